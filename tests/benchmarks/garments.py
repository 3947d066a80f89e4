"""Garments that nothing here was tuned on: skirts, trousers, a dress, a jacket, a cape; each fitted on a body.

    python tests/benchmarks/garments.py --body BODY.obj --out garments --set collision.avatar=auto

Each is cut and sewn as GarmentCode's box meshes are: flat panels before and behind a body of 1.72 m, their seams'
vertices merged, texture coordinates in metres, panels side by side. Loose ones are meant to slide down, and the fit to
say so. Prints how each ended; what --out names gets the meshes and the results, for the pictures.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

import warp_cloth
from warp_cloth.base.connected import connected_components
from warp_cloth.base.mesh import Points
from warp_cloth.shapes.triangulate import triangulate

APART = 0.2  # [m] of front and back from the body's middle
PANEL_GAP = 0.03  # [m] between panels in texture space
SAMPLES = 200  # of a curve
Place = Callable[[Points], Points]
Side = tuple[str, str]  # panel and its edge


def line(*points: tuple[float, float]) -> Points:
    return np.array(points, dtype=float)


def curve(*handles: tuple[float, float]) -> Points:
    """A cubic curve of four handles, or a quadratic one of three."""
    t = np.linspace(0.0, 1.0, SAMPLES)[:, None]
    weights = {
        3: ((1 - t) ** 2, 2 * t * (1 - t), t**2),
        4: ((1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3),
    }
    return np.asarray(sum(w * np.array(h) for w, h in zip(weights[len(handles)], handles, strict=True)))


def arc(radius: float, start: float, end: float) -> Points:
    """Round the origin; angles in degrees."""
    angle = np.radians(np.linspace(start, end, SAMPLES))
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def flat(z: float, y: float = 0.0) -> Place:
    return lambda p: np.column_stack([p[:, 0], p[:, 1] + y, np.full(len(p), z)])


def mirrored(edges: Mapping[str, Points]) -> dict[str, Points]:
    """The same panel of the other half: still counter-clockwise."""
    return {name: edges[name][::-1] * (-1.0, 1.0) for name in reversed(edges)}


class Pattern:
    """Panels with named edges, counter-clockwise, and which of them are sewn together."""

    def __init__(self, edge: float) -> None:
        self.edge = edge
        self.panels: dict[str, tuple[Mapping[str, Points], Place]] = {}
        self.seams: list[tuple[Side, Side, bool]] = []

    def sew(self, one: Side, other: Side, *, turned: bool) -> None:
        """``turned``: the edges run opposite ways."""
        self.seams.append((one, other, turned))

    def pair(self, edges: Mapping[str, Points], y: float, *sewn: str, name: str = "") -> None:
        """The same panel before and behind."""
        for side, z in (("front", APART), ("back", -APART)):
            self.panels[name + side] = (edges, flat(z, y))
        for edge in sewn:
            self.sew((f"{name}front", edge), (f"{name}back", edge), turned=False)

    def write(self, path: Path) -> int:
        """Writes the sewn box mesh; how many vertices it has."""
        steps = {
            (name, edge): max(1, round(float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum()) / self.edge))
            for name, (edges, _) in self.panels.items()
            for edge, way in edges.items()
        }
        for one, other, _ in self.seams * len(self.panels):  # what is sewn has as many steps, however long the chain
            steps[one] = steps[other] = max(steps[one], steps[other])
        places, textures, triangles, rows, along, first, right = [], [], [], [], {}, 0, 0.0
        for name, (edges, place) in self.panels.items():
            outline = [_spaced(way, steps[name, edge])[:-1] for edge, way in edges.items()]
            points, inside = triangulate(np.vstack(outline), self.edge)
            ends = np.cumsum([0, *map(len, outline)])
            for edge, start in zip(edges, ends, strict=False):
                along[name, edge] = first + (start + np.arange(steps[name, edge] + 1)) % ends[-1]
            places.append(place(points))
            textures.append(points - points.min(axis=0) + (right, 0.0))
            right += float(np.ptp(points[:, 0])) + PANEL_GAP
            triangles.append(inside + first)
            rows += [name] * len(inside)
            first += len(points)
        pairs = [(along[one], along[other][::-1] if turned else along[other]) for one, other, turned in self.seams]
        a, b = (
            (np.concatenate([np.zeros(0, dtype=int), *ends]) for ends in zip(*pairs, strict=True))
            if pairs
            else ([], [])
        )
        _, vertex = np.unique(connected_components(first, np.asarray(a, int), np.asarray(b, int)), return_inverse=True)
        where, weight = np.concatenate(places), np.bincount(vertex)
        sewn = np.column_stack([np.bincount(vertex, where[:, axis]) / weight for axis in range(3)])
        lines = [f"v {x:.9f} {y:.9f} {z:.9f}" for x, y, z in sewn]
        lines += [f"vt {u:.9f} {v:.9f}" for u, v in np.concatenate(textures)]
        for name, before, corners in zip(rows, ["", *rows], np.concatenate(triangles), strict=False):
            lines += [f"g {name}"] * (name != before)
            lines.append("f " + " ".join(f"{vertex[corner] + 1}/{corner + 1}" for corner in corners))
        path.write_text("\n".join(lines) + "\n")
        return len(sewn)


def _spaced(way: Points, steps: int) -> Points:
    run = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    at = np.linspace(0.0, run[-1], steps + 1)
    return np.column_stack([np.interp(at, run, way[:, 0]), np.interp(at, run, way[:, 1])])


def skirt(edge: float, waist: float, hip: float, hem: float) -> Pattern:
    made, (w, h, m) = Pattern(edge), (waist / 4, hip / 4, hem / 4)
    side = curve((m, 0), (h, 0.2), (h, 0.4), (w, 0.6))
    made.pair({"hem": line((-m, 0), (m, 0)), "right": side, "waist": line((w, 0.6), (-w, 0.6)),
               "left": side[::-1] * (-1, 1)}, 0.49, "right", "left")  # fmt: skip
    return made


def tube(edge: float, top: float, hem: float, height: float, level: float) -> Pattern:
    made, (w, m) = Pattern(edge), (top / 4, hem / 4)
    made.pair({"hem": line((-m, 0), (m, 0)), "right": line((m, 0), (w, height)), "top": line((w, height), (-w, height)),
               "left": line((-w, height), (-m, 0))}, level - height, "right", "left")  # fmt: skip
    return made


def trousers(edge: float, waist: float, hip: float, hem: float) -> Pattern:
    made, (w, h, m), inseam, crotch = Pattern(edge), (waist / 4, hip / 4, hem / 4), 0.68, 0.05
    left = {
        "hem": line((0.09 - m, 0), (0.09 + m, 0)),
        "out": curve((0.09 + m, 0), (h, inseam), (h, 0.78), (w, 0.98)),
        "waist": line((w, 0.98), (0, 0.98)),
        "rise": curve((0, 0.98), (0, inseam + 0.08), (0, inseam), (-crotch, inseam)),
        "in": line((-crotch, inseam), (0.09 - m, 0)),
    }
    made.pair(left, 0.09, "out", "in", name="left_")
    made.pair(mirrored(left), 0.09, "out", "in", name="right_")
    for side in ("front", "back"):
        made.sew((f"left_{side}", "rise"), (f"right_{side}", "rise"), turned=True)
    return made


def upper(edge: float, chest: float, hem: float, length: float, *, front_open: bool) -> Pattern:
    """A dress or waistcoat: four panels that meet in the middle, before and behind; open, they only touch before."""
    made, (c, m), top = Pattern(edge), (chest / 4, hem / 4), length - 0.22
    for side, z, drop in (("front", APART, 0.10), ("back", -APART, 0.03)):
        left = {
            "hem": line((0, 0), (m, 0)),
            "side": line((m, 0), (c, top)),
            "arm": curve((c, top), (0.14, top), (0.15, length - 0.1), (0.17, length - 0.04)),
            "shoulder": line((0.17, length - 0.04), (0.09, length)),
            "neck": curve((0.09, length), (0.09, length - drop), (0, length - drop)),
            "middle": line((0, length - drop), (0, 0)),
        }
        made.panels[f"left_{side}"] = (left, flat(z, 1.43 - length))
        made.panels[f"right_{side}"] = (mirrored(left), flat(z, 1.43 - length))
        if side == "back" or not front_open:
            made.sew((f"left_{side}", "middle"), (f"right_{side}", "middle"), turned=True)
    for half in ("left", "right"):
        for seam in ("side", "shoulder"):
            made.sew((f"{half}_front", seam), (f"{half}_back", seam), turned=False)
    return made


def cape(edge: float) -> Pattern:
    """Nearly a ring, open in front, level with the shoulders."""
    made, (inner, outer), (start, end) = Pattern(edge), (0.07, 0.67), (-82.0, 262.0)
    rim, hem = arc(inner, end, start), arc(outer, start, end)
    edges = {"neck": rim, "left": np.array([rim[-1], hem[0]]), "hem": hem, "right": np.array([hem[-1], rim[0]])}
    made.panels["cape"] = (edges, lambda p: np.column_stack([p[:, 0], np.full(len(p), 1.45), -p[:, 1] - 0.01]))
    return made


GARMENTS: dict[str, Callable[[float], Pattern]] = {
    "skirt": lambda edge: skirt(edge, 0.86, 1.04, 0.96),
    "skirt far too wide": lambda edge: skirt(edge, 1.3, 1.4, 1.5),
    "trousers": lambda edge: trousers(edge, 0.90, 1.08, 0.50),
    "flared trousers": lambda edge: trousers(edge, 0.90, 1.08, 0.64),
    "dress": lambda edge: upper(edge, 1.0, 1.3, 0.95, front_open=False),
    "open waistcoat": lambda edge: upper(edge, 1.06, 1.08, 0.62, front_open=True),
    "tube": lambda edge: tube(edge, 0.84, 0.84, 0.35, 1.32),
    "strapless dress": lambda edge: tube(edge, 0.88, 1.3, 0.75, 1.30),
    "cape": cape,
}


def main() -> None:
    parse = argparse.ArgumentParser()
    parse.add_argument("--body", type=Path, required=True, help="1.72 m tall, in A-pose, as GarmentCode's mean_all.obj")
    parse.add_argument("--out", type=Path, default=Path("garments"))
    parse.add_argument("--device", default="cpu")
    parse.add_argument("--edge-mm", type=float, default=20.0)
    parse.add_argument("--only", nargs="+", choices=list(GARMENTS), default=list(GARMENTS))
    parse.add_argument("--set", dest="changes", action="append", default=[], metavar="KEY=VALUE")
    given = parse.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    for name in given.only:
        path = given.out / f"{name.replace(' ', '_')}.obj"
        vertices = GARMENTS[name](1e-3 * given.edge_mm).write(path)
        scene = {
            "name": path.stem,
            "garment": {"mesh": str(path.absolute()), "rest": "uv", "fabric": "cotton"},
            "avatar": {"mesh": str(given.body.absolute())},
        }
        worn = warp_cloth.fit(scene, device=given.device, overrides=given.changes)
        worn.save(given.out / path.stem)
        print(f"@ {name}: {vertices:,} vertices. {worn.message}", flush=True)


if __name__ == "__main__":
    main()

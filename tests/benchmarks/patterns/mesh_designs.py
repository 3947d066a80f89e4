"""Meshes GarmentCode specifications and holds each against closed forms, and against the box mesh next to it.

    python tests/benchmarks/patterns/mesh_designs.py --designs designs

FOLDER holds ``specs/NAME_specification.json`` and ``NAME.obj``, GarmentCode's own mesh of the same design. A row has:
panels; vertices; largest errors of a panel's area and of a seam's length [%]; stitches that run as in the box mesh;
stitches found right without what the file states; topology (components, boundary loops, Euler number), and the box
mesh's where it differs; smallest angle, triangles under 25 degrees, and those of them not in a corner under 30 degrees;
CPU milliseconds of one core for reading, meshing and sewing, and those with an edge length that gives 7,000 vertices.
``unpinched``: topologies that are equal once vertices are parted at which two rims of a mesh touch.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from designs.geometry import components
from measured import Figures, script_parser
from scipy.spatial import cKDTree

from warp_cloth.base.mesh import Mesh
from warp_cloth.pattern import load_pattern
from warp_cloth.pattern.garmentcode import read_specification
from warp_cloth.pattern.mesher import angles_of
from warp_cloth.pattern.sewing import seams_of
from warp_cloth.pattern.specification import Pattern

SMALL, SHARP, NEAR = 25.0, 30.0, 0.06  # [degrees, degrees, m]
FULL = 7000  # vertices
SAME_PLACE = 2e-4  # [m] between a corner and the box mesh's vertex; OBJ files round to 0.1 um


def topology(triangles: np.ndarray) -> tuple[int, int, int]:
    """Components, loops of the boundary, V - E + F."""
    triangles = np.asarray(triangles, dtype=np.int64)
    sides = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    edges, count = np.unique(sides, axis=0, return_counts=True)
    used, rim = np.unique(triangles), edges[count == 1]
    part, loops = (components(int(triangles.max()) + 1, pairs) for pairs in (edges, rim))
    return len(np.unique(part[used])), len(np.unique(loops[np.unique(rim)])), len(used) - len(edges) + len(triangles)


def unpinched(triangles: np.ndarray) -> np.ndarray:
    """The triangles with every vertex parted at which several fans of triangles meet in nothing but that vertex."""
    corners = np.arange(triangles.size).reshape(triangles.shape)
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    at = np.column_stack([corners.ravel(), np.roll(corners, -1, axis=1).ravel()])
    at[start > end] = at[start > end][:, ::-1]
    order = np.lexsort((np.maximum(start, end), np.minimum(start, end)))
    key = np.column_stack([np.minimum(start, end), np.maximum(start, end)])[order]
    same = np.flatnonzero((key[1:] == key[:-1]).all(axis=1))
    pairs = np.concatenate([np.column_stack([at[order[same], k], at[order[same + 1], k]]) for k in (0, 1)])
    return components(triangles.size, pairs)[corners]


def panel_errors(pattern: Pattern, mesh: Mesh) -> tuple[float, float, int, int, float]:
    """Worst relative error of area and length, triangles under SMALL, those away from sharp corners, smallest angle."""
    worst_area = worst_length = 0.0
    small = open_small = 0
    least = 180.0
    for index, panel in enumerate(pattern.panels):
        corners = mesh.texcoords[mesh.panels == index]
        flat = corners.reshape(-1, 2)
        a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        area = 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()
        worst_area = max(worst_area, abs(area / abs(panel.area) - 1))
        points, ids = np.unique(np.round(flat, 9), axis=0, return_inverse=True)
        triangles = ids.reshape(-1, 3)
        shift, rim = outline_of(points, triangles, panel)
        for edge in panel.edges:
            worst_length = max(worst_length, abs(length_along(rim, edge, shift) / edge.curve.length - 1))
        angles = angles_of(points, triangles).min(axis=1)
        least = min(least, float(angles.min()))
        tips = sharp_corners(panel) + shift
        bad = points[triangles[angles < SMALL]].mean(axis=1)
        small += len(bad)
        if len(bad):
            away = np.ones(len(bad), bool) if not len(tips) else cKDTree(tips).query(bad)[0] > NEAR
            open_small += int(away.sum())
    return worst_area, worst_length, small, open_small, least


def outline_of(points: np.ndarray, triangles: np.ndarray, panel: object) -> tuple[np.ndarray, np.ndarray]:
    """By how much a panel was moved in texture space, and its outline's vertices in order."""
    follow = {}
    sides = {(int(t[i]), int(t[(i + 1) % 3])) for t in triangles for i in range(3)}
    for a, b in sides:
        if (b, a) not in sides:
            follow[a] = b
    loop = [min(follow)]
    while follow[loop[-1]] != loop[0]:
        loop.append(follow[loop[-1]])
    rim = points[loop]
    starts = np.array([edge.curve.start for edge in panel.edges])  # type: ignore[attr-defined]
    # the corner whose place among the outline's vertices lets all others be found
    for candidate in rim:
        shift = candidate - starts[0]
        if cKDTree(rim).query(starts + shift)[0].max() < 1e-8:
            return shift, rim
    raise SystemExit(f"{panel.name}: its corners are not in the mesh")  # type: ignore[attr-defined]


def length_along(rim: np.ndarray, edge: object, shift: np.ndarray) -> float:
    """Length of the outline between an edge's ends, the way round that is nearer to its curve."""
    curve = edge.curve  # type: ignore[attr-defined]
    i, j = cKDTree(rim).query(np.array([curve.start, curve.end]) + shift)[1]
    steps = np.hypot(*(np.roll(rim, -1, axis=0) - rim).T)
    total = np.concatenate([[0.0], np.cumsum(steps)])
    ways = [(total[j] - total[i]) % total[-1], (total[i] - total[j]) % total[-1]]
    return float(min(ways, key=lambda way: abs(way - curve.length)))


def sharp_corners(panel: object) -> np.ndarray:
    """Corners whose angle inside the cloth is under SHARP [m], shape [n, 2]."""
    edges, found = panel.edges, []  # type: ignore[attr-defined]
    for edge, before in zip(edges, [edges[-1], *edges[:-1]], strict=True):
        ahead = edge.curve.at(np.array([min(1.0, 0.015 / edge.curve.length)]))[0] - edge.curve.start
        behind = before.curve.at(np.array([max(0.0, 1 - 0.015 / before.curve.length)]))[0] - edge.curve.start
        turn = np.sign(panel.area) * np.degrees(np.arctan2(ahead[0] * behind[1] - ahead[1] * behind[0], ahead @ behind))  # type: ignore[attr-defined]
        if -5.0 < turn < SHARP:
            found.append(edge.curve.start)
    return np.reshape(found, (-1, 2))


def as_in_box(pattern: Pattern, order: list[str], box: Path) -> tuple[int, int]:
    """Stitches whose direction is that of the box mesh, and those that could be looked up in it."""
    corner = {}
    uv, faces = read_with_uv(box)
    used = np.unique(faces[:, :, 1])
    part = components(len(uv), np.concatenate([faces[:, [0, 1], 1], faces[:, [1, 2], 1]]))
    islands = [used[part[used] == first] for first in dict.fromkeys(part[used].tolist())]
    vertex_of = np.zeros(len(uv), dtype=np.int64)
    vertex_of[faces[:, :, 1].ravel()] = faces[:, :, 0].ravel()
    by_name = {panel.name: index for index, panel in enumerate(pattern.panels)}
    for name, island in zip(order, islands, strict=True):
        panel = pattern.panels[by_name[name]]
        fine = np.concatenate([edge.curve.at(np.linspace(0, 1, 2001)) for edge in panel.edges])
        tree = cKDTree(uv[island])
        starts = np.array([edge.curve.start for edge in panel.edges])
        middle = 0.5 * (uv[island].min(axis=0) + uv[island].max(axis=0) - fine.min(axis=0) - fine.max(axis=0))
        _, near = tree.query(starts + middle)
        shift = np.median(uv[island][near] - starts, axis=0)
        distance, near = tree.query(starts + shift)
        for place, (gap, at) in enumerate(zip(distance, near, strict=True)):
            if gap < SAME_PLACE:
                corner[by_name[name], place] = int(vertex_of[island[at]])
    right = known = 0
    for seam in seams_of(pattern):
        ends = []
        for piece in seam.pieces:
            count = len(pattern.panels[piece.side.panel].edges)
            ends += [corner.get((piece.side.panel, (piece.side.edge + step) % count)) for step in (0, 1)]
        a, b, c, d = ends
        if None in ends or (a, b) == (b, a):
            continue
        known += 1
        right += (a, b) == ((d, c) if seam.reverse else (c, d))
    return right, known


def read_with_uv(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Texture coordinates, and (vertex, texture coordinate) of every corner of an OBJ file's triangles."""
    uv, faces = [], []
    for line in path.read_text().splitlines():
        kind, *rest = line.split() or [""]
        if kind == "vt":
            uv.append([float(x) for x in rest[:2]])
        elif kind == "f":
            faces.append([[int(number) - 1 for number in corner.split("/")[:2]] for corner in rest])
    return np.array(uv), np.array(faces)


def blind(pattern: Pattern) -> int:
    """Stitches that run alike with and without the sides that the file states."""
    stated = {seam.stitch: seam.reverse for seam in seams_of(pattern)}
    unstated = tuple(replace(stitch, right_to_wrong=None) for stitch in pattern.stitches)
    return sum(seam.reverse == stated[seam.stitch] for seam in seams_of(replace(pattern, stitches=unstated)))


def timed(path: Path, edge: float, times: int) -> tuple[float, Mesh]:
    """The least CPU milliseconds that loading takes, and the garment."""
    spent = []
    for _ in range(times):
        start = time.process_time()
        mesh = load_pattern(path, edge=edge)
        spent.append(1e3 * (time.process_time() - start))
    return min(spent), mesh


def at_full_count(path: Path, edge: float, count: int) -> float:
    """CPU milliseconds of a garment that has ``count`` vertices at an edge length, meshed with FULL of them."""
    for _ in range(3):
        edge *= (count / FULL) ** 0.5
        spent, mesh = timed(path, edge, 2)
        count = mesh.vertex_count
        if abs(count / FULL - 1.0) < 0.02:
            break
    return spent * FULL / count


def main() -> None:
    parser = script_parser(__doc__)
    parser.add_argument("--designs", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--only", nargs="*", default=[], metavar="NAME")
    parser.add_argument("--edge-mm", type=float, default=15.0)
    args = parser.parse_args()
    print("name panels vertices area% length% in_box blind topology least <25 open ms ms/7000")
    rows, times = [], []
    for path in sorted((args.designs / "specs").glob("*_specification.json")):
        name = path.name.removesuffix("_specification.json")
        if args.only and name not in args.only:
            continue
        spent, mesh = timed(path, args.edge_mm * 1e-3, 4)
        pattern = read_specification(str(path), path.read_bytes())
        area, length, small, open_small, least = panel_errors(pattern, mesh)
        order = json.loads(path.read_text())["pattern"]["panel_order"]
        own, other = topology(mesh.triangles), args.designs / f"{name}.obj"
        right, known, box, alike = 0, 0, None, False
        if other.exists():  # the generator's own mesher refuses some of its designs
            right, known = as_in_box(pattern, order, other)
            faces = read_with_uv(other)[1][:, :, 0]
            box, alike = topology(faces), topology(unpinched(mesh.triangles)) == topology(unpinched(faces))
        seams = len(pattern.stitches)
        found = blind(pattern)
        each = at_full_count(path, args.edge_mm * 1e-3, mesh.vertex_count)
        differs = "" if own == box else f"!={box}".replace(" ", "")
        print(
            f"{name} {len(pattern.panels)} {mesh.vertex_count} {100 * area:.4f} {100 * length:.4f}",
            f"{right}/{known}/{seams} {found}/{seams} {str(own).replace(' ', '')}{differs}",
            f"{least:.1f} {small} {open_small} {spent:.0f} {each:.0f}",
            flush=True,
        )
        rows.append((area, length, right, known, seams, found, own == box, alike, least, small, open_small))
        times.append((spent, each, mesh.vertex_count))
    table, (milliseconds, full, vertices) = np.array(rows, dtype=float), np.array(times).T
    with Figures(__file__, args, cores=1) as figures:
        figures.add("designs", len(table), "designs")
        figures.add("area_error", 100 * table[:, 0].max(), "%")
        figures.add("seam_length_error", 100 * table[:, 1].max(), "%")
        figures.add("stitches", int(table[:, 4].sum()), "stitches")
        figures.add("stitches_looked_up", int(table[:, 3].sum()), "stitches")
        figures.add("stitches_as_in_box", int(table[:, 2].sum()), "stitches")
        figures.add("stitches_right_unstated", int(table[:, 5].sum()), "stitches")
        figures.add("topology_as_box", int(table[:, 6].sum()), "designs")
        figures.add("topology_as_box_unpinched", int(table[:, 7].sum()), "designs")
        figures.add("least_angle_over_25", int((table[:, 8] >= 25).sum()), "designs")
        figures.add("under_25_degrees", int(table[:, 9].sum()), "triangles")
        figures.add("under_25_degrees_open", int(table[:, 10].sum()), "triangles")
        figures.add("rate", 1e3 * len(table) / milliseconds.sum(), "designs/s")
        figures.add("meshing_7000", float(np.median(full)), "ms")
        figures.add("meshing_7000_most", float(full.max()), "ms")
        figures.add("meshing_up_to_7000_most", float(milliseconds[vertices <= FULL].max(initial=0.0)), "ms")


if __name__ == "__main__":
    main()

"""Spoils worn designs in seven ways, and asks the program and the judge about each: none may be called worn.

    python tests/benchmarks/designs/spoil.py --designs designs --data ../shared/data --good designs_out --out spoiled

``--good`` is a folder that fit_designs.py wrote: what both call good there is spoiled. Two sizes are fitted again (a
garment a fifth too small, one two fifths too large); the other shapes are spoiled as they are worn, and are judged
without relaxing, so that the program cannot mend them. Writes spoiled.csv and every shape (NAME.npz) into ``--out``.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from pathlib import Path

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

sys.path.insert(0, str(Path(__file__).parents[1]))

from designs.fit_designs import designs_of, run_batch, shapes_of
from designs.geometry import Floats, Ints, Mesh, cross, crossings, read_obj
from designs.judge import Wearer, judge
from designs.limbs import boundary_loops, opening_class, ways_out
from designs.measures import edge_strains, panel_corners, panel_lengths
from measured import Figures, script_parser

import warp_cloth

SIZES = {"too_small": 0.8, "too_large": 1.4}  # of the garment as drafted
COUNTS = {
    "arm_outside": 9,
    "seam_open": 9,
    "beside": 9,
    "swapped": 9,
    "crossing": 8,
    "too_small": 8,
    "too_large": 8,
}
MOST_VERTICES = 6000  # of a garment that is fitted again
CLEAR = 0.08  # [m] between an arm and the sleeve that was taken off it
LAYERS, APART = 0.05, 0.15  # [m] cloth that lies so near to other cloth, so far away along the cloth
THROUGH = 0.006  # [m] that cloth is pushed beyond the cloth that it passes through
BUMP = 0.03  # [m] radius of what is pushed
OPEN = (0.7, 1.5, 3.0)  # strains of a seam that is held open
OFF = 0.004  # [m] from the skin, where cloth is moved out of the body
SEAM = 0.12  # [m] around the middle of a seam that is held open


@dataclass(frozen=True, eq=False)
class Worn:
    """A worn design: what it was fitted from, and its shape."""

    job: dict[str, str]
    points: Floats  # [m] [V, 3]
    wearer: Wearer
    at_rest: bool = True

    @cached_property
    def garment(self) -> Mesh:
        return read_obj(Path(self.job["garment.mesh"]))

    @cached_property
    def arms(self) -> list[tuple[int, Ints]]:
        """The openings that one arm passes through: 1 for the right, 2 for the left, and the loop."""
        if self.wearer.skeleton is None:
            return []
        ways = ways_out(self.wearer.skeleton, self.points[self.garment.triangles])
        classes = [(opening_class(self.points[loop], ways), loop) for loop in boundary_loops(self.garment)]
        return [(limbs.index(1), loop) for limbs, loop in classes if sum(limbs) == 1 and max(limbs[1:3]) == 1]

    def distances(self, sources: Ints) -> Floats:
        """Distances along the cloth from the nearest of some vertices [m] [V]."""
        edges, size = self.garment.edges[0], len(self.points)
        graph = coo_matrix((np.maximum(panel_lengths(self.garment), 1e-6), edges.T), shape=(size, size))
        return np.asarray(dijkstra(graph, directed=False, indices=sources, min_only=True))


def pushed_out(points: Floats, wearer: Wearer) -> Floats:
    """The shape with what is inside the body moved to its skin, as a fit leaves it."""
    body, found = wearer.body, points.copy()
    faces = cross(body.corners[:, 1] - body.corners[:, 0], body.corners[:, 2] - body.corners[:, 0])
    normals = np.zeros_like(body.mesh.points)
    for corner in body.mesh.triangles.T:
        np.add.at(normals, corner, faces)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    near = cKDTree(body.mesh.points)
    for _ in range(3):
        deep = np.flatnonzero(body.inside(found))
        skin = near.query(found[deep])[1]
        found[deep] = body.mesh.points[skin] + OFF * normals[skin]
    return found


Spoiler = Callable[[Worn, int], Floats | None]  # of a worn design, and which of its kind it is; None: not this one


def _fading(distances: Floats, reach: float) -> Floats:
    """1 at 0, falling smoothly to 0 at ``reach``."""
    share = np.clip(1.0 - distances / reach, 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)


def arm_outside(worn: Worn, number: int) -> Floats | None:
    """A sleeve that lies before or behind its arm: all of it, or the part near its end."""
    if not worn.arms:
        return None
    _, loop = worn.arms[number % len(worn.arms)]
    along = worn.distances(loop)
    others = [other for other in boundary_loops(worn.garment) if set(other.tolist()) != set(loop.tolist())]
    length = min(float(along[other].min()) for other in others)
    radius = float(np.linalg.norm(worn.points[loop] - worn.points[loop].mean(axis=0), axis=1).max())
    way = np.array([0.0, 0.0, -1.0 if number % 3 == 2 else 1.0]) * (radius + CLEAR)
    moved = worn.points + _fading(along, (1.0, 0.5, 0.8)[number % 3] * length)[:, None] * way
    return pushed_out(moved, worn.wearer) if number % 2 else moved


def seam_open(worn: Worn, number: int) -> Floats | None:
    """Cloth on one side of a seam drawn away from it, until an edge is so much longer than on its panel."""
    vertex, _ = panel_corners(worn.garment)
    sewn = np.flatnonzero(np.bincount(vertex, minlength=len(worn.points)) > 1)
    if not len(sewn):
        return None
    start = sewn[(number * len(sewn)) // 9 % len(sewn)]
    near = np.linalg.norm(worn.points - worn.points[start], axis=1)
    run = sewn[near[sewn] < SEAM]
    along = worn.points[run] - worn.points[run].mean(axis=0)
    seam = np.linalg.svd(along, full_matrices=False)[2][0] if len(run) > 2 else np.array([0.0, 1.0, 0.0])
    around = np.flatnonzero(near < SEAM)
    flat = worn.points[around] - worn.points[start]
    out = np.linalg.svd(flat, full_matrices=False)[2][2]
    across = np.cross(seam, out)
    side = (worn.points - worn.points[start]) @ across > 1e-4
    side[sewn] = False
    weight = np.where(side, _fading(np.maximum(near - 0.03, 0.0), SEAM), 0.0)
    for step in np.geomspace(0.01, 0.1, 20):
        found = worn.points + step * weight[:, None] * across
        if edge_strains(worn.garment, found).max() > OPEN[number % len(OPEN)]:
            return np.asarray(found)
    return None


def beside(worn: Worn, number: int) -> Floats | None:
    """Dropped beside the body: at its height or on the floor, aside, before or behind, and across a corner."""
    body = worn.wearer.body
    low, high = worn.points.min(axis=0), worn.points.max(axis=0)
    x, z = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (0.7, 0.7))[number % 5]
    size = np.maximum(high, body.high) - np.minimum(low, body.low)
    step = (0.55, 0.75, 1.05)[number % 3] * size * (x, 0.0, z)
    drop = body.low[1] - low[1] if number % 2 else 0.0
    return worn.points + step + (0.0, drop, 0.0)


def swapped(worn: Worn, number: int) -> Floats | None:
    """Every arm in the other sleeve: the shape mirrored, or turned back to front."""
    if len({arm for arm, _ in worn.arms}) < 2:
        return None
    middle = 0.5 * (worn.wearer.body.low + worn.wearer.body.high)
    off = worn.points - middle
    return pushed_out(middle + off * ((-1.0, 1.0, 1.0) if number % 3 else (-1.0, 1.0, -1.0)), worn.wearer)


def crossing(worn: Worn, number: int) -> Floats | None:
    """A bump of cloth pushed through other cloth that lies near."""
    points, garment = worn.points, worn.garment
    near = cKDTree(points).query_pairs(LAYERS, output_type="ndarray")
    gap = np.linalg.norm(points[near[:, 0]] - points[near[:, 1]], axis=1)
    for pair in np.argsort(gap, kind="stable")[number * 7 :: 997]:
        for here, there in (near[pair], near[pair][::-1]):
            along = worn.distances(np.array([here]))
            if along[there] < APART:
                continue
            way = points[there] - points[here]
            way *= 1.0 + THROUGH / max(float(np.linalg.norm(way)), 1e-6)
            found = points + _fading(along, BUMP)[:, None] * way
            moved = along < BUMP
            if not worn.wearer.body.inside(found[moved]).any() and len(crossings(garment, found)[0]):
                return np.asarray(found)
    return None


SPOILERS: dict[str, Spoiler] = {
    "arm_outside": arm_outside,
    "seam_open": seam_open,
    "beside": beside,
    "swapped": swapped,
    "crossing": crossing,
}


def resized(job: dict[str, str], kind: str, folder: Path) -> dict[str, str]:
    """The job of a garment of another size, about the middle of its top, so that it starts where it is worn."""
    garment = Path(job["garment.mesh"])
    mesh, scale = read_obj(garment), SIZES[kind]
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    fixed = np.array([0.5 * (low[0] + high[0]), high[1], 0.5 * (low[2] + high[2])])
    lines = []
    for line in garment.read_text(encoding="utf-8").splitlines():
        word, *rest = line.split() or [""]
        if word == "v":
            place = fixed + scale * (np.array(rest[:3], dtype=np.float64) - fixed)
            line = "v " + " ".join(f"{value:.6f}" for value in place)
        elif word == "vt":
            line = "vt " + " ".join(f"{scale * float(value):.6f}" for value in rest[:2])
        lines.append(line)
    name = f"{job['name']}.{kind}"
    path = folder / f"{name}.obj"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return {**job, "name": name, "garment.mesh": str(path.resolve())}


def spoiled_shapes(kind: str, good: list[Worn]) -> Iterator[Worn]:
    """Spoiled designs of a kind; each from another design, taken in an order of the kind's own."""
    first = len(good) * list(COUNTS).index(kind) // len(COUNTS)
    number = 0
    for worn in good[first:] + good[:first]:
        points = SPOILERS[kind](worn, number)
        if points is not None:
            number += 1
            yield replace(worn, job={**worn.job, "name": f"{worn.job['name']}.{kind}"}, points=points)


def refitted(kind: str, good: list[Worn], given: argparse.Namespace) -> Iterator[Worn]:
    """The same designs fitted in another size."""
    folder = given.out / kind
    folder.mkdir(parents=True, exist_ok=True)
    small = [worn for worn in good if len(worn.points) <= MOST_VERTICES]
    chosen = small[:: max(1, len(small) // COUNTS[kind])][: COUNTS[kind]]
    jobs = [resized(worn.job, kind, folder) for worn in chosen]
    run_batch(jobs, [], argparse.Namespace(**{**vars(given), "out": folder, "shard": 1, "sheet": 0}))
    shapes, ended = shapes_of(folder / "batch"), rows_of(folder / "batch" / "results.csv")
    for worn, job in zip(chosen, jobs, strict=True):
        name = job["name"]
        yield Worn(job, shapes[name], worn.wearer, ended[name]["status"] == "at_rest")


def rows_of(path: Path) -> dict[str, dict[str, str]]:
    """A table's rows, by their name."""
    with path.open() as file:
        return {row["name"]: row for row in csv.DictReader(file)}


def words_of(worn: Worn) -> tuple[str, str]:
    """The program's word and the judge's on a shape."""
    scene = {
        "garment": {"mesh": worn.job["garment.mesh"], "fabric": worn.job["garment.fabric"]},
        "avatar": {"mesh": worn.job["avatar.mesh"]},
    }
    found = warp_cloth.judge(scene, worn.points, device="cpu")
    codes = [problem.code.value for problem in found.problems if not problem.code.is_note]
    codes += [] if worn.at_rest else ["not_at_rest"]
    return " ".join(codes) or "worn", str(judge(worn.garment, worn.points, worn.wearer, at_rest=worn.at_rest))


def worn_designs(given: argparse.Namespace) -> tuple[list[Worn], dict[str, dict[str, str]]]:
    """The designs of ``--good`` that have a shape, and what is said of them there."""
    rows = rows_of(given.good / "judged.csv")
    shapes, wearers, found = shapes_of(given.good / "batch"), {}, []
    for job in designs_of(given.designs, given.data, []):
        if job["name"] in shapes:
            body = job["avatar.mesh"]
            wearers[body] = wearers.get(body) or Wearer.of(read_obj(Path(body)))
            found.append(Worn(job, shapes[job["name"]], wearers[body], rows[job["name"]]["status"] == "at_rest"))
    return found, rows


def main() -> None:
    parse = script_parser(__doc__)
    parse.add_argument("--designs", type=Path, required=True, help="folder of index.csv")
    parse.add_argument("--data", type=Path, required=True, help="folder of garmentcode/ and bodies/")
    parse.add_argument("--good", type=Path, required=True, help="what fit_designs.py wrote: judged.csv and batch/")
    parse.add_argument("--out", type=Path, default=Path("spoiled_out"))
    parse.add_argument("--kinds", nargs="+", default=list(COUNTS), choices=list(COUNTS))
    parse.add_argument("--unspoiled", action="store_true", help="ask about all of --good, too")
    parse.add_argument("--device")
    parse.add_argument("--workers", type=int)
    given = parse.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    designs, rows = worn_designs(given)
    good = [each for each in designs if rows[each.job["name"]]["worn"] == "true"]
    good = [each for each in good if rows[each.job["name"]]["judge"] == "good"]
    table: list[tuple[str, ...]] = []

    def ask(kind: str, worn: Worn) -> None:
        table.append((worn.job["name"], kind, *words_of(worn)))
        np.savez_compressed(given.out / f"{worn.job['name']}.npz", points=worn.points)
        print("  ".join(table[-1]), flush=True)

    for worn in designs if given.unspoiled else ():
        ask("unspoiled", worn)
    for kind in given.kinds:
        made = refitted(kind, good, given) if kind in SIZES else spoiled_shapes(kind, good)
        for worn in islice(made, COUNTS[kind]):
            ask(kind, worn)
    with (given.out / "spoiled.csv").open("w", newline="") as file:
        csv.writer(file).writerows([("name", "kind", "program", "judge"), *table])
    with Figures(__file__, given, device=given.device or "cpu") as figures:
        for kind in dict.fromkeys(row[1] for row in table):
            own = [row for row in table if row[1] == kind]
            figures.add("shapes", str(len(own)), kind)
            figures.add("called_worn", str(sum(row[2] == "worn" for row in own)), kind)
            figures.add("judged_good", str(sum(row[3] == "good" for row in own)), kind)
            figures.add("disagree", str(sum((row[2] == "worn") != (row[3] == "good") for row in own)), kind)


if __name__ == "__main__":
    main()

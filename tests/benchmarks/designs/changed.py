"""Designs whose files are changed without changing the garment: is the same garment worn?

    python tests/benchmarks/designs/changed.py starts --designs designs --data ../shared/data --out out --every 16
    python tests/benchmarks/designs/changed.py noise --designs designs --data ../shared/data --out out --every 8

``starts``: the garment's file is moved, turned, scaled, mirrored, or has z up; its body stays. ``noise``: every vertex
of garment and body is moved by 0.1 mm in a direction of its own, once for each seed. Each change is fitted with nothing
set but mesh, fabric and body. Writes changed.csv into --out: what each ends as, and how far its cloth lies from the
unchanged one's [mm, mean over its vertices].
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from designs.fit_designs import designs_of, pairs_of, run_batch, shapes_of
from designs.geometry import Floats
from measured import Figures, script_parser

NOISE = 1.0e-4  # [m]
COLUMNS = ("name", "change", "status", "worn", "problems", "distance_mm")
SAME = "unchanged"

Change = Callable[[Floats], Floats]  # of points [V, 3]


def turned(points: Floats, degrees: float) -> Floats:
    """About the vertical line through their middle."""
    angle, middle = np.deg2rad(degrees), points.mean(axis=0)
    c, s = np.cos(angle), np.sin(angle)
    return (points - middle) @ np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]]) + middle


STARTS: dict[str, Change] = {
    "moved_aside": lambda points: points + np.array([0.3, 0.0, 0.0]),
    "moved_back": lambda points: points - np.array([0.0, 0.0, 0.3]),
    "turned_90": lambda points: turned(points, 90.0),
    "turned_180": lambda points: turned(points, 180.0),
    "scaled_100": lambda points: 100.0 * points,
    "scaled_inch": lambda points: 0.0254 * points,
    "mirrored": lambda points: points * np.array([-1.0, 1.0, 1.0]),
    "z_up": lambda points: points[:, [0, 2, 1]] * np.array([1.0, -1.0, 1.0]),
}


def shaken(seed: int) -> Change:
    """Moves each point by ``NOISE`` in a random direction."""

    def change(points: Floats) -> Floats:
        steps = np.random.default_rng(seed).normal(size=points.shape)
        return points + NOISE * steps / np.linalg.norm(steps, axis=1, keepdims=True)

    return change


def write_changed(path: Path, change: Change, into: Path) -> str:
    """Writes an OBJ whose vertices are changed, all else as it is; returns its path."""
    lines = path.read_text(encoding="utf-8").splitlines()
    rows = [number for number, line in enumerate(lines) if line.startswith("v ")]
    points = change(np.array([lines[row].split()[1:4] for row in rows], dtype=np.float64))
    for row, point in zip(rows, points, strict=True):
        lines[row] = "v {:.9g} {:.9g} {:.9g}".format(*point)
    into.parent.mkdir(parents=True, exist_ok=True)
    into.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return str(into.resolve())


def changed_jobs(jobs: list[dict[str, str]], given: argparse.Namespace) -> list[dict[str, str]]:
    """Each job unchanged, and once for every change; names end with that of the change."""
    files, found = given.out / "files", []
    seeds = [f"seed_{seed}" for seed in range(given.seeds)]
    for job in jobs:
        garment, body = Path(job["garment.mesh"]), Path(job["avatar.mesh"])
        found.append({**job, "name": f"{job['name']}.{SAME}"})
        for name in STARTS if given.what == "starts" else seeds:
            change = STARTS.get(name) or shaken(int(name.removeprefix("seed_")))
            row = {**job, "name": f"{job['name']}.{name}"}
            row["garment.mesh"] = write_changed(garment, change, files / name / garment.name)
            if given.what == "noise":
                row["avatar.mesh"] = write_changed(body, change, files / name / body.name)
            found.append(row)
    return found


def rows_of(jobs: list[dict[str, str]], folder: Path) -> list[dict[str, str]]:
    """What each job ended as, beside its unchanged one."""
    with (folder / "results.csv").open() as file:
        results = {row["name"]: row for row in csv.DictReader(file)}
    shapes, rows = shapes_of(folder), []
    for job in jobs:
        name, change = job["name"].rsplit(".", 1)
        told = results[job["name"]]
        shape, wanted = shapes.get(job["name"]), shapes.get(f"{name}.{SAME}")
        row = {"name": name, "change": change, "distance_mm": ""}
        row |= {column: told[column] for column in ("status", "worn", "problems")}
        if shape is not None and wanted is not None:
            wanted = STARTS[change](wanted) if change == "mirrored" else wanted
            row["distance_mm"] = f"{1e3 * np.linalg.norm(shape - wanted, axis=1).mean():.1f}"
        rows.append(row)
    return rows


def main() -> None:
    parse = script_parser(__doc__)
    parse.add_argument("what", choices=("starts", "noise"))
    parse.add_argument("--designs", type=Path, required=True, help="folder of index.csv")
    parse.add_argument("--data", type=Path, required=True, help="folder of garmentcode/ and bodies/")
    parse.add_argument("--out", type=Path, default=Path("changed_out"))
    parse.add_argument("--bodies", type=Path, nargs="+", default=[], metavar="OBJ", help="instead of the own ones")
    parse.add_argument("--only", nargs="+", default=[], metavar="NAME")
    parse.add_argument("--every", type=int, default=1, help="every so many-th design")
    parse.add_argument("--seeds", type=int, default=20)
    parse.add_argument("--device")
    parse.add_argument("--workers", type=int)
    parse.add_argument("--shard", type=int, help="items a shard")
    parse.add_argument("--sheet", type=int, help="pictures on batch/contact_sheet.html, the worst items first")
    given = parse.parse_args()
    jobs = designs_of(given.designs, given.data, given.only)[:: given.every]
    if given.bodies:
        jobs = pairs_of(jobs, given.bodies, 1)
    jobs = changed_jobs(jobs, given)
    run_batch(jobs, [], given)
    rows = rows_of(jobs, given.out / "batch")
    with (given.out / "changed.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    for row in rows:
        print("  ".join(row[column] for column in COLUMNS))
    unchanged = {row["name"]: row["worn"] for row in rows if row["change"] == SAME}
    changed = [row for row in rows if row["change"] != SAME]
    with Figures(__file__, given, device=given.device or "cpu") as figures:
        figures.add(f"{given.what}.changed", str(len(changed)), "fits")
        same = Counter(row["worn"] == unchanged[row["name"]] for row in changed)
        figures.add(f"{given.what}.same_verdict", str(same[True]), "fits")
        figures.add(f"{given.what}.worn", str(sum(row["worn"] == "true" for row in changed)), "fits")


if __name__ == "__main__":
    main()

"""Fits the random designs as one batch, judges every result from outside, and compares the judge with ``worn``.

    python tests/benchmarks/designs/fit_designs.py --designs designs --data ../shared/data --out out --device cpu

Each item states its mesh, its fabric (cotton, jersey, silk, denim by turns) and its body, and nothing else but what
--set names. With --bodies every --every-th design is fitted on each of these bodies instead of its own. Writes
judged.csv into --out, and prints the table and a summary. A batch that is in --out already goes on where it was.
"""

from __future__ import annotations

import argparse
import csv
import subprocess
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from designs.geometry import Floats, read_obj
from designs.judge import Wearer, judge
from measured import Figures, script_parser

FABRICS = ("cotton", "jersey", "silk", "denim")
BODIES = ("garmentcode", "bodies")  # folders of --data that hold the bodies of index.csv
COLUMNS = ("name", "status", "worn", "problems", "judge", "iterations")


def designs_of(folder: Path, data: Path, only: list[str]) -> list[dict[str, str]]:
    """Rows of a job file, paths absolute; fabrics go by the place in index.csv, whatever --only leaves out."""
    with (folder / "index.csv").open() as file:
        rows = list(csv.DictReader(file))
    found = []
    for place, row in enumerate(rows):
        bodies = [path for part in BODIES if (path := data / part / f"{row['body']}.obj").exists()]
        job = {
            "name": row["name"],
            "garment.mesh": str((folder / row["garment"]).resolve()),
            "garment.fabric": FABRICS[place % len(FABRICS)],
            "avatar.mesh": str(bodies[0].resolve()),
        }
        if not only or row["name"] in only:
            found.append(job)
    return found


def pairs_of(jobs: list[dict[str, str]], bodies: list[Path], every: int) -> list[dict[str, str]]:
    """Every so many-th of these jobs on each body."""
    return [
        {**job, "name": f"{job['name']}.{body.stem}", "avatar.mesh": str(body.resolve())}
        for body in bodies
        for job in jobs[::every]
    ]


def run_batch(jobs: list[dict[str, str]], changes: list[str], given: argparse.Namespace) -> None:
    """Writes scene and job file, and runs ``warp-cloth batch`` over them."""
    given.out.mkdir(parents=True, exist_ok=True)
    first, scene = jobs[0], given.out / "scene.toml"
    scene.write_text(
        f'[garment]\nmesh = "{first["garment.mesh"]}"\nfabric = "{first["garment.fabric"]}"\n'
        f'[avatar]\nmesh = "{first["avatar.mesh"]}"\n'
    )
    pairs = dict(change.split("=", 1) for change in changes)
    with (given.out / "jobs.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, ["name", "scene", *list(first)[1:], *pairs])
        writer.writeheader()
        writer.writerows({**job, "scene": str(scene.absolute()), **pairs} for job in jobs)
    words = [
        sys.executable,
        "-m",
        "warp_cloth",
        "batch",
        str(given.out / "jobs.csv"),
        "--out",
        str(given.out / "batch"),
    ]
    words += ["--device", given.device] if given.device else []
    words += ["--workers", str(given.workers)] if given.workers else []
    words += ["--shard", str(given.shard)] if given.shard else []
    words += ["--sheet", str(given.sheet)] if given.sheet else []
    subprocess.run(words, check=False)  # its exit status tells whether all are worn; the table says more


def shapes_of(folder: Path) -> dict[str, Floats]:
    """The worn points [m] of each item of a batch, at the vertices of its garment's file."""
    found = {}
    for path in sorted((folder / "shards").glob("*.npz")):
        with np.load(path) as packed:
            starts, points, maps = packed["point_start"], packed["points"], packed["map_start"]
            for g, item in enumerate(packed["item"]):
                own = np.asarray(points[starts[g] : starts[g + 1]], dtype=np.float64)
                became = packed["vertex_map"][maps[g] : maps[g + 1]]
                found[str(item)] = own[became] if len(became) else own
    return found


def judged(job: dict[str, str], at_rest: bool, shape: Floats) -> dict[str, str]:
    """The judge's word and figures for one item."""
    found = judge(read_obj(Path(job["garment.mesh"])), shape, wearer_of(job["avatar.mesh"]), at_rest=at_rest)
    return {"judge": str(found)} | {name: f"{value:.4g}" for name, value in found.figures.items()}


@cache
def wearer_of(body: str) -> Wearer:
    """The body of a file; each process reads one once."""
    return Wearer.of(read_obj(Path(body)))


def judged_rows(jobs: list[dict[str, str]], folder: Path) -> list[dict[str, str]]:
    """A row per item: what the batch says, and what the judge says, on all cores."""
    with (folder / "results.csv").open() as file:
        results = {row["name"]: row for row in csv.DictReader(file)}
    shapes, rows = shapes_of(folder), []
    with ProcessPoolExecutor() as pool:
        for job in jobs:
            row = results[job["name"]]
            told = {column: row.get(column, "") for column in COLUMNS}
            shape = shapes.get(job["name"])
            rows.append((told, None if shape is None else pool.submit(judged, job, row["status"] == "at_rest", shape)))
        return [told | (word.result() if word else {}) for told, word in rows]


def main() -> None:
    parse = script_parser(__doc__)
    parse.add_argument("--designs", type=Path, required=True, help="folder of index.csv")
    parse.add_argument("--data", type=Path, required=True, help="folder of garmentcode/ and bodies/")
    parse.add_argument("--out", type=Path, default=Path("designs_out"))
    parse.add_argument("--bodies", type=Path, nargs="+", default=[], metavar="OBJ")
    parse.add_argument("--every", type=int, default=4, help="with --bodies")
    parse.add_argument("--only", nargs="+", default=[], metavar="NAME")
    parse.add_argument("--device")
    parse.add_argument("--workers", type=int)
    parse.add_argument("--shard", type=int, help="items a shard: small ones leave results where a run is cut off")
    parse.add_argument("--sheet", type=int, help="pictures on batch/contact_sheet.html, the worst items first")
    parse.add_argument("--set", dest="changes", action="append", default=[], metavar="KEY=VALUE")
    given = parse.parse_args()
    jobs = designs_of(given.designs, given.data, given.only)
    if given.bodies:
        jobs = pairs_of(jobs, given.bodies, given.every)
    run_batch(jobs, given.changes, given)
    rows = judged_rows(jobs, given.out / "batch")
    names = list(dict.fromkeys([*COLUMNS, *(name for row in rows for name in row)]))
    with (given.out / "judged.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerows(rows)
    for row in rows:
        print("  ".join(str(row[column]) for column in COLUMNS))
    with Figures(__file__, given, device=given.device or "cpu") as figures:
        group = "pairs" if given.bodies else "designs"
        figures.add("designs", str(len(rows)), group)
        figures.add("at_rest", str(sum(row["status"] == "at_rest" for row in rows)), group)
        verdicts = Counter((row["worn"] == "true", row["judge"] == "good") for row in rows)
        for (worn, good), count in sorted(verdicts.items()):
            name = f"{'worn' if worn else 'not_worn'}.judged_{'good' if good else 'bad'}"
            figures.add(name, str(count), group)


if __name__ == "__main__":
    main()

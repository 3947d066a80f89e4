"""How many garments a second does a batch fit, and are they the same to the bit however they are fitted?

    python tests/benchmarks/batch_rate.py --device cuda:0 --alone 8 --turned --killed
    python tests/benchmarks/batch_rate.py --device cuda:0 --alone 8 --turned --killed --start dressed
    python tests/benchmarks/batch_rate.py --device cpu --items 48 --coarsest 4 --workers 1 2

T-shirts of eleven meshes (2,400 to 14,100 vertices, 7,500 in the mean) in all nine fabrics on four bodies, by the
command as a user calls it, once for each number of workers (0: the default); before it a batch of a single small
garment, which shows the time of starting. Options add some fits by ``warp_cloth.fit`` in this process, one after
another; all items in the opposite order and in other shards; all after a kill -9 halfway.
"""

from __future__ import annotations

import csv
import math
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pyarrow.parquet
from measured import Figures, script_parser

from warp_cloth.cli.terminal import NOT_WORN

FABRICS = ("cotton", "denim", "faille", "felt", "jersey", "linen", "polyester", "silk", "wool")
GARMENTS = (("L", 20), ("S", 17), ("M", 14), ("L", 14), ("M", 12), ("L", 12), ("M", 10), ("L", 10), ("S", 9), ("M", 9),
            ("M", 8))  # size and edge [mm]  # fmt: skip
LOADERS = 14  # processes that load a shard
MEASURES = ("stature", "chest", "waist", "hip")
BODIES = ((1.70, 0.92, 0.80, 0.96), (1.76, 0.98, 0.86, 1.00), (1.84, 1.06, 0.94, 1.06), (1.66, 1.04, 0.96, 1.08))
# in turn for items that are otherwise alike
FRICTIONS = (0.5, 0.4, 0.3, 0.6, 0.2, 0.45, 0.35, 0.55, 0.25, 0.65, 0.15,
             0.33, 0.47, 0.28, 0.52, 0.22, 0.57, 0.38, 0.62, 0.18, 0.43)  # fmt: skip

Row = dict[str, Any]


@dataclass(frozen=True)
class Run:
    """A batch that has ended; seconds since its command was called."""

    seconds: float
    shards: list[tuple[float, int]]  # when each was written, and its items, in time's order
    rows: dict[str, Row]  # of the results table, by name

    def add_to(self, figures: Figures, label: str) -> None:
        """Adds its figures, and prints more."""
        count, (first, early) = len(self.rows), self.shards[0]
        figures.add(f"{label}.seconds", self.seconds, "s")
        figures.add(f"{label}.rate", count / self.seconds, "items/s")
        if len(self.shards) > 1:
            figures.add(f"{label}.first_shard", first, "s")
            figures.add(f"{label}.rate_after_first_shard", (count - early) / (self.seconds - first), "items/s")
        vertices, iterations = ([row[name] or 0 for row in self.rows.values()] for name in ("vertices", "iterations"))
        work = sum(v * i for v, i in zip(vertices, iterations, strict=True))
        statuses = Counter(row["status"] for row in self.rows.values())
        figures.add(f"{label}.at_rest", 100.0 * statuses["at_rest"] / count, "%")
        figures.add(f"{label}.worn", 100.0 * sum(bool(row["worn"]) for row in self.rows.values()) / count, "%")
        figures.add(f"{label}.iterations", sum(iterations) / count, "iterations, mean")
        print(f"  {sum(vertices) / count:.0f} vertices (mean), {1e-9 * work / self.seconds:.2f} G vertex-iterations/s")


def jobs(count: int, coarsest: int, start: str = "placed") -> list[Row]:
    """So many items, as many on each body, of so many of the meshes; of all up to 8,316 no two alike."""
    garments = GARMENTS[:coarsest]
    each, kinds = -(-count // len(BODIES)), math.lcm(len(garments), len(FABRICS))
    rows = []
    for number in range(count):
        body, place = divmod(number, each)
        size, edge = garments[place % len(garments)]
        row = {"name": f"item-{number:05d}", "scene": "tshirt", "garment.shape.size": size}
        row |= {"garment.shape.edge_mm": edge, "garment.fabric": FABRICS[place % len(FABRICS)]}
        row |= {f"avatar.shape.{name}": value for name, value in zip(MEASURES, BODIES[body], strict=True)}
        row |= {} if start == "placed" else {"solver.start": start}
        rows.append({**row, "avatar.friction": FRICTIONS[place // kinds % len(FRICTIONS)]})
    return rows


def loaded(rows: Sequence[Row]) -> tuple[list[Any], Any]:
    """The scenes of items that are begun to be loaded, and the cache that has them; before there is a device."""
    from warp_cloth.batch.loading import LoadCache

    load_cache = LoadCache(LOADERS, fork=True)  # before this process has threads and a device
    from warp_cloth.scene import load_scene

    scenes = [
        load_scene(row["scene"], [f"{key}={value}" for key, value in row.items() if key not in ("name", "scene")])
        for row in rows
    ]
    load_cache.begin(scenes, patches=True)
    return scenes, load_cache


def write_jobs(path: Path, rows: Sequence[Row]) -> Path:
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, list(rows[0]))
        table.writeheader()
        table.writerows(rows)
    return path


def command(jobs_file: Path, out: Path, device: str, *more: str) -> list[str]:
    words = [sys.executable, "-m", "warp_cloth", "batch", str(jobs_file), "--out", str(out), "--device", device]
    return [*words, "--no-ease", *more]  # what is timed is fitting


def run(jobs_file: Path, out: Path, device: str, *more: str) -> Run:
    """Runs a batch by its command."""
    began = time.time()
    ended = subprocess.run(command(jobs_file, out, device, *more), check=False, stdout=subprocess.DEVNULL)
    if ended.returncode not in (0, NOT_WORN):
        raise RuntimeError(f"the batch ended with status {ended.returncode}")
    seconds = time.time() - began
    written = [(path.stat().st_mtime - began, pyarrow.parquet.read_metadata(path).num_rows)
               for path in (out / "shards").glob("*.parquet")]  # fmt: skip
    rows = pyarrow.parquet.read_table(out / "results.parquet").to_pylist()
    named = {row["name"]: row for row in rows}
    if len(named) < len(rows):
        raise RuntimeError(f"{out} has an item's results twice")
    return Run(seconds, sorted(written), named)


def run_killed(jobs_file: Path, out: Path, device: str, after: float) -> Run:
    """The same, ended by kill -9 after so many seconds, with all its processes, and resumed."""
    with subprocess.Popen(command(jobs_file, out, device), stdout=subprocess.DEVNULL, start_new_session=True) as batch:
        time.sleep(after)
        os.killpg(batch.pid, signal.SIGKILL)
    print(f"killed after {after:.1f} s, {len(list((out / 'shards').glob('*.parquet')))} shards written", flush=True)
    return run(jobs_file, out, device)


def compare(label: str, found: dict[str, Row], wanted: dict[str, Row]) -> bool:
    """Prints how many results are as they should be, apart from the file that holds them."""
    alike = sum({**row, "file": ""} == {**wanted[name], "file": ""} for name, row in found.items())
    print(f"{label}: {alike} of {len(found)} the same, {len(wanted)} wanted", flush=True)
    return alike == len(found)


def fit_alone(rows: Sequence[Row], device: str) -> tuple[float, dict[str, Row]]:
    """Mean seconds of ``warp_cloth.fit`` after a first one that does not count, and the rows of a results table."""
    import warp_cloth
    from warp_cloth.batch.rows import row_of

    found, began = {}, 0.0
    for number, row in enumerate([rows[0], *rows]):
        if number == 1:
            began = time.perf_counter()
        changes = [f"{key}={value}" for key, value in row.items() if key not in ("name", "scene")]
        fit = warp_cloth.fit(row["scene"], overrides=changes, device=device)
        found[row["name"]] = row_of(row["name"], fit, "", ease=False)
    return (time.perf_counter() - began) / len(rows), found


@contextmanager
def folder(path: Path | None) -> Iterator[Path]:
    """A folder that stays, or a temporary one."""
    if path is not None:
        path.mkdir(parents=True, exist_ok=True)
        yield path
    else:
        with TemporaryDirectory() as place:
            yield Path(place)


def main() -> int:
    parser = script_parser(__doc__, device="cuda:0")
    parser.add_argument("--items", type=int, default=1024)
    parser.add_argument("--coarsest", type=int, default=len(GARMENTS), metavar="N", help="so many of the meshes only")
    parser.add_argument("--start", choices=["placed", "dressed"], default="placed", help="solver.start of all")
    parser.add_argument("--workers", type=int, nargs="+", default=[0])
    parser.add_argument("--alone", type=int, default=0, metavar="N", help="so many items by warp_cloth.fit")
    parser.add_argument("--turned", action="store_true", help="in the opposite order and in other shards")
    parser.add_argument("--killed", action="store_true", help="by kill -9 halfway, then resumed")
    parser.add_argument("--out", type=Path, help="a new folder for the results")
    options = parser.parse_args()
    rows, device, same = jobs(options.items, options.coarsest, options.start), options.device, True
    with folder(options.out) as place, Figures(__file__, options, device=device) as figures:
        one = {"name": "one", "scene": "hanging", "garment.shape.vertices_per_side": 5}
        started = run(write_jobs(place / "one.csv", [one]), place / "one", device)
        figures.add("one_square.seconds", started.seconds, "s")
        file = write_jobs(place / "jobs.csv", rows)
        runs = []
        for workers in options.workers:
            more = ("--workers", str(workers)) if workers else ()
            runs.append(run(file, place / f"workers-{workers}", device, *more))
            label = f"{options.start}.{options.items}" + (f".{workers}_workers" if workers else "")
            runs[-1].add_to(figures, label)
        first = runs[0]
        for workers, other in zip(options.workers[1:], runs[1:], strict=True):
            print(f"{workers} workers over {options.workers[0]}: {first.seconds / other.seconds:.2f} times as fast")
            same &= compare(f"{workers} workers", other.rows, first.rows)
        if options.turned:
            turned = write_jobs(place / "turned.csv", rows[::-1])
            size = str(-(-options.items // 7))
            same &= compare("turned", run(turned, place / "turned", device, "--shard", size).rows, first.rows)
        if options.killed:
            after = (first.shards[0][0] + first.shards[-1][0]) / 2
            same &= compare("killed", run_killed(file, place / "killed", device, after).rows, first.rows)
        if options.alone:
            some = rows[:: max(len(rows) // options.alone, 1)][: options.alone]
            each, alone = fit_alone(some, device)
            figures.add("alone.seconds_each", each, "s")
            figures.add("alone.times_as_long", each * options.items / first.seconds, "times the batch")
            same &= compare("alone", alone, first.rows)
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())

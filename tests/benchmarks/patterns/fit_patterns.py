"""Fits GarmentCode designs from their specifications and from GarmentCode's own meshes, and compares the results.

    python tests/benchmarks/patterns/fit_patterns.py --designs designs --data ../shared/data --out out --only g11_000
    python tests/benchmarks/patterns/fit_patterns.py --designs designs --data ../shared/data --out out --part 1/4
    python tests/benchmarks/patterns/fit_patterns.py --results out/part_*

The first two run ``warp-cloth batch``, the second over every fourth design only, into OUT/part_1; both go on where they
were. Nothing is set but the garment, cotton, and the body that index.csv names. With --controls each design is fitted
twice more, which tells how much of a difference is noise: its mesh started 0.1 mm higher, and its specification with
edges of 14 mm. --results compares what is in the tables of batches, whole or cut off, and needs nothing else.

A row for each design: worn, vertices and iterations of both; median strain of both [%]; girths of the garment as worn
at chest, waist and hip, where it is closed, pattern minus mesh [mm]. Figures of strain and girths are of designs that
are worn from both.
"""

from __future__ import annotations

import argparse
import csv
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from statistics import median
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from measured import Figures, script_parser

STRAIN, GIRTH = 0.3, 3.0  # [percentage points, mm] by which the two may differ
LEVELS = ("chest", "waist", "hip")
BODIES = ("garmentcode", "bodies")  # folders of --data that hold the bodies of index.csv
# What a design is fitted from, and the scene keys that differ from "pattern" and "mesh".
KINDS: dict[str, dict[str, str]] = {"pattern": {}, "mesh": {}}
CONTROLS = {"mesh_moved": {"garment.translate": "[0.0, 1e-4, 0.0]"}, "pattern_14": {"garment.edge_mm": "14"}}
PAIRS = {"": ("pattern", "mesh"), "moved.": ("mesh_moved", "mesh"), "edge_14.": ("pattern_14", "pattern")}

Results = Mapping[tuple[str, str], Mapping[str, Any]]  # by design and kind


def jobs_of(args: argparse.Namespace) -> list[dict[str, str]]:
    """Rows of the job file: the designs of this part, each from every kind; paths absolute."""
    with (args.designs / "index.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if not args.only or row["name"] in args.only]
    part, parts = map(int, args.part.split("/"))
    jobs = []
    for row in rows[part - 1 :: parts]:
        name = row["name"]
        body = next(path for each in BODIES if (path := args.data / each / f"{row['body']}.obj").exists())
        files = {
            "pattern": args.designs / "specs" / f"{name}_specification.json",
            "mesh": args.designs / row["garment"],
        }
        for kind, keys in (KINDS | (CONTROLS if args.controls else {})).items():
            key = kind.partition("_")[0]
            job = {"name": f"{name}.{kind}", f"garment.{key}": str(files[key].resolve()), **keys}
            jobs.append(job | {"avatar.mesh": str(body.resolve())})
    return jobs


def run_batch(jobs: list[dict[str, str]], args: argparse.Namespace) -> Path:
    """Writes scene and job file, and runs ``warp-cloth batch`` over them; its folder."""
    out = args.out if args.part == "1/1" else args.out / f"part_{args.part.partition('/')[0]}"
    out.mkdir(parents=True, exist_ok=True)
    scene = out / "scene.toml"
    scene.write_text('[garment]\nfabric = "cotton"\n[avatar]\n')
    columns = list(dict.fromkeys(["name", "scene", *(key for job in jobs for key in job)]))
    with (out / "jobs.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows({**job, "scene": str(scene.absolute())} for job in jobs)
    words = [sys.executable, "-m", "warp_cloth", "batch", str(out / "jobs.csv"), "--out", str(out / "batch")]
    words += ["--keep", args.keep]
    for option in ("device", "workers", "shard"):
        value = getattr(args, option)
        words += [f"--{option}", str(value)] if value is not None else []
    subprocess.run(words, check=False)  # its exit status tells whether all are worn; the table says more
    return out


def read_results(places: list[Path]) -> Results:
    """The rows of batches, of their results.parquet or, where a run was cut off, of the shards that are done."""
    import pyarrow.parquet

    found: dict[tuple[str, str], Mapping[str, Any]] = {}
    for place in places:
        whole = [place] if place.is_file() else sorted(place.rglob("results.parquet"))
        for path in whole or sorted(place.rglob("shards/*.parquet")):
            for row in pyarrow.parquet.ParquetFile(path).read().to_pylist():
                design, _, kind = row["name"].rpartition(".")
                found[design, kind] = row
    return found


def girth_differences(one: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, float]:
    """Girths as worn at the levels where both are closed round the body, one minus other [mm]."""
    pairs = {level: (one[f"girth_{level}_cm"], other[f"girth_{level}_cm"]) for level in LEVELS}
    return {level: 10 * (a - b) for level, (a, b) in pairs.items() if a is not None and b is not None}


def strain_of(row: Mapping[str, Any]) -> float:
    """Median strain [%]; NaN without a result."""
    return float("nan") if row["strain_p50"] is None else 100 * float(row["strain_p50"])


def print_table(results: Results) -> None:
    """A line for each design."""
    print("name worn vertices iterations strain% girths_mm")
    for name in dict.fromkeys(design for design, _ in results):
        rows = [results.get((name, kind)) for kind in KINDS]
        if None in rows:
            print(f"{name} not done from {' and '.join(k for k, row in zip(KINDS, rows, strict=True) if row is None)}")
            continue
        one, other = (row for row in rows if row is not None)
        columns = [f"{one[key]}/{other[key]}" for key in ("worn", "vertices", "iterations")]
        girths = [f"{level} {value:+.1f}" for level, value in girth_differences(one, other).items()]
        print(name, *columns, f"{strain_of(one):.2f}/{strain_of(other):.2f}", *girths)
        for kind, row in zip(KINDS, (one, other), strict=True):
            if not row["worn"]:
                print(f"    from {kind}: {' '.join(row['problems'] or [])} {row['message']}")


def add_figures(figures: Figures, results: Results) -> None:
    """How many are worn from each, and how far strain and girths of those worn from both are apart."""
    for kind in (*KINDS, *CONTROLS):
        rows = [row for (_, each), row in results.items() if each == kind]
        if rows:
            figures.add(f"{kind}.done", len(rows), "designs")
            figures.add(f"{kind}.worn", sum(bool(row["worn"]) for row in rows), "designs")
    for prefix, (kind, reference) in PAIRS.items():
        both = [
            (row, results[design, reference])
            for (design, each), row in results.items()
            if each == kind and row["worn"] and results.get((design, reference), {"worn": False})["worn"]
        ]
        if not both:
            continue
        figures.add(f"{prefix}both.worn", len(both), "designs")
        strains = [strain_of(one) - strain_of(other) for one, other in both]
        spread(figures, f"{prefix}strain", strains, STRAIN, "designs", "percentage points")
        girths = [girth_differences(one, other) for one, other in both]
        spread(figures, f"{prefix}girths", [v for each in girths for v in each.values()], GIRTH, "girths", "mm")
        for level in LEVELS:
            found = [each[level] for each in girths if level in each]
            spread(figures, f"{prefix}{level}", found, GIRTH, "girths", "mm")


def spread(figures: Figures, name: str, differences: list[float], limit: float, what: str, unit: str) -> None:
    """How many differences, the share within a limit, their median, and the median and largest of their sizes."""
    if differences:
        sizes = [abs(each) for each in differences]
        figures.add(name, len(sizes), what)
        figures.add(f"{name}_within", 100 * sum(each <= limit for each in sizes) / len(sizes), f"% within {limit:g}")
        figures.add(f"{name}_shift", median(differences), f"{unit}, median")
        figures.add(f"{name}_median", median(sizes), unit)
        figures.add(f"{name}_apart", max(sizes), unit)


def main() -> None:
    parser = script_parser(__doc__)
    parser.add_argument("--designs", type=Path, metavar="FOLDER")
    parser.add_argument("--data", type=Path, metavar="FOLDER")
    parser.add_argument("--out", type=Path, metavar="FOLDER")
    parser.add_argument("--only", nargs="*", default=[], metavar="NAME")
    parser.add_argument("--part", default="1/1", metavar="K/N")
    parser.add_argument("--controls", action="store_true")
    parser.add_argument("--keep", default="none", help="as for warp-cloth batch")
    parser.add_argument("--device")
    parser.add_argument("--workers", type=int)
    parser.add_argument("--shard", type=int)
    parser.add_argument("--results", nargs="+", type=Path, default=[], metavar="PATH", help="folders or Parquet files")
    args = parser.parse_args()
    if not args.results and None in (args.designs, args.data, args.out):
        parser.error("give --designs, --data and --out, or --results")
    if args.results and args.write and args.device is None:
        parser.error("--write says which hardware it was: give --device, here")
    results = read_results(args.results or [run_batch(jobs_of(args), args)])
    print_table(results)
    with Figures(__file__, args, device=args.device or "cpu") as figures:
        add_figures(figures, results)


if __name__ == "__main__":
    main()

"""Fits GarmentCode designs from their specifications and from GarmentCode's own meshes, and compares the results.

    python tests/benchmarks/patterns/fit_patterns.py --designs designs --data ../shared/data --out out --only g11_000

Nothing is set but the garment, cotton, and the body that index.csv names. A row for each design: worn, vertices and
iterations of both; median strain of both [%]; girths of the garment at chest,
waist and hip, where it is closed, pattern minus mesh [mm].
With --against-edge 14 the other one is the specification again, meshed with edges of 14 mm: how far two meshes of one
design are apart.
Results that are in --out already are not computed again; --at-once fits share a device.
"""

from __future__ import annotations

import argparse
import csv
import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from measured import Figures, add_write_option

STRAIN, GIRTH = 0.3, 3.0  # [percentage points, mm] by which the two may differ
BODIES = ("garmentcode", "bodies")  # folders of --data that hold the bodies of index.csv


def fitted(kind: str, file: Path, body: Path, out: Path, device: str, edge_mm: float | None = None) -> dict[str, Any]:
    """The report of a fit; ``edge_mm``: of a pattern's mesh, None by default."""
    if not (out / "report.json").exists():
        out.parent.mkdir(parents=True, exist_ok=True)
        scene = out.with_suffix(".toml")
        garment = f'[garment]\n{kind} = "{file.resolve()}"\nfabric = "cotton"\n'
        garment += f"edge_mm = {edge_mm:g}\n" if edge_mm is not None else ""
        scene.write_text(f'{garment}[avatar]\nmesh = "{body.resolve()}"\n')
        words = [
            sys.executable,
            "-m",
            "warp_cloth",
            "fit",
            str(scene),
            "--out",
            str(out),
            "--device",
            device,
            "--maps",
            "gap",
        ]
        done = subprocess.run(words, check=False, capture_output=True, text=True)
        if not (out / "report.json").exists():
            print(f"{out.name}: {done.stderr[-500:].strip()}", file=sys.stderr, flush=True)
            return {"worn": False, "vertices": 0, "iterations": 0, "strain": {"p50": float("nan")}}
    return dict(json.loads((out / "report.json").read_text()))


def both(row: dict[str, str], args: argparse.Namespace) -> list[dict[str, Any]]:
    """The reports of a design from its specification and from its mesh."""
    name = row["name"]
    body = next(path for part in BODIES if (path := args.data / part / f"{row['body']}.obj").exists())
    pattern = args.designs / "specs" / f"{name}_specification.json"
    one = fitted("pattern", pattern, body, args.out / f"{name}_pattern", args.device)
    edge = args.against_edge
    if edge is not None:
        return [one, fitted("pattern", pattern, body, args.out / f"{name}_pattern_{edge:g}", args.device, edge)]
    return [one, fitted("mesh", args.designs / f"{name}.obj", body, args.out / f"{name}_mesh", args.device)]


def girths(report: dict[str, Any]) -> dict[str, float]:
    """Girths of the garment [mm] at the levels where it is closed round the body."""
    return {row["level"]: row["garment_girth"] for row in report.get("girths_mm", []) if row["closed"]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--designs", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--data", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--only", nargs="*", default=[], metavar="NAME")
    parser.add_argument("--against-edge", type=float, metavar="MM")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--at-once", type=int, default=1, metavar="N")
    add_write_option(parser)
    args = parser.parse_args()
    with (args.designs / "index.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if not args.only or row["name"] in args.only]
    pool = ThreadPoolExecutor(args.at_once)
    results = pool.map(lambda row: both(row, args), rows)
    strains, apart, worn = [], [], [0, 0]
    print("name worn vertices iterations strain% girths_mm")
    for row, reports in zip(rows, results, strict=True):
        name = row["name"]
        one, other = reports
        own, box = girths(one), girths(other)
        differences = {level: own[level] - box[level] for level in own if level in box}
        strain = [100 * report["strain"]["p50"] for report in reports]
        print(
            f"{name} {one['worn']}/{other['worn']} {one['vertices']}/{other['vertices']}",
            f"{one['iterations']}/{other['iterations']} {strain[0]:.2f}/{strain[1]:.2f}",
            " ".join(f"{level} {value:+.1f}" for level, value in differences.items()),
            flush=True,
        )
        worn = [count + bool(report["worn"]) for count, report in zip(worn, reports, strict=True)]
        if one["worn"] and other["worn"]:
            strains.append(abs(strain[0] - strain[1]))
            apart += [abs(value) for value in differences.values()]
    with Figures(__file__, args, device=args.device) as figures:
        figures.add("pattern.worn", worn[0], "designs")
        figures.add("mesh.worn", worn[1], "designs")
        figures.add("both.worn", len(strains), "designs")
        figures.add("strain_within", sum(each <= STRAIN for each in strains), "designs")
        figures.add("strain_apart", max(strains, default=0.0), "percentage points")
        figures.add("girths", len(apart), "girths")
        figures.add("girths_within", sum(each <= GIRTH for each in apart), "girths")
        figures.add("girths_apart", max(apart, default=0.0), "mm")


if __name__ == "__main__":
    main()

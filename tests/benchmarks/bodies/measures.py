"""Measures read off bodies, and those that the bodies' maker states.

    python tests/benchmarks/bodies/measures.py FOLDER [--table]

FOLDER holds NAME.obj and measures.csv with a column ``name`` and any of

- ``height``: stature [m],
- ``waist_circumference``: anny's own, a line through marked vertices about the navel: wavy, so longer than a tape,
- ``hull_chest``, ``hull_waist``, ``hull_hip``: level girths [m] that whoever posed the bodies found with their joints,
- ``hull_chest_y``, ``hull_waist_y``, ``hull_hip_y``: the heights of those above the floor [m].

Prints for each column the number of bodies, the median, and the largest difference; for heights the difference between
the girth there and the stated one, which tells the tape from the choice of its level.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from warp_cloth.anatomy.figure import Figure
from warp_cloth.anatomy.levels import trunk_level
from warp_cloth.anatomy.measures import DEFINITIONS, measures_of
from warp_cloth.anatomy.skeleton import skeleton_of
from warp_cloth.loading import load_mesh

STATED = {"height": "stature", "waist_circumference": "waist", **{f"hull_{n}": n for n in ("chest", "waist", "hip")}}
MM = 1e3


def differences(figure: Figure, stated: dict[str, str]) -> Iterator[tuple[str, float]]:
    """Measured less stated [mm], by column."""
    values = {each.name: each.value for each in measures_of(figure.body, figure.skeleton)}
    for column, name in STATED.items():
        value = values[name]
        if stated.get(column) and value is not None:
            yield column, MM * (value - float(stated[column]))
        if stated.get(f"{column}_y"):
            level = trunk_level(figure.trunk, figure.floor + float(stated[f"{column}_y"]), figure.middle)
            if level is not None:
                yield f"{column}_y", MM * (level.girth - float(stated[column]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--table", action="store_true", help="every body's measures in centimetres")
    options = parser.parse_args()
    with open(options.folder / "measures.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    found: dict[str, list[tuple[float, str]]] = {}
    if options.table:
        print(f"{'':<26}", *(f"{name[:8]:>8}" for name in DEFINITIONS))
    for row in rows:
        body = load_mesh(options.folder / f"{row['name']}.obj", role="avatar", key="avatar")
        skeleton = skeleton_of(body)
        if skeleton is None:
            print(f"{row['name']}: no limbs")
            continue
        figure = Figure.of(body, skeleton)
        if options.table:
            values = [each.value for each in measures_of(body, skeleton)]
            print(f"{row['name']:<26}", *(f"{'-' if v is None else f'{100 * v:.1f}':>8}" for v in values))
        for column, difference in differences(figure, row):
            found.setdefault(column, []).append((difference, row["name"]))
    for column, each in found.items():
        off = np.array([difference for difference, _ in each])
        worst = each[int(np.argmax(np.abs(off)))]
        print(f"{column}.bodies {len(off)} bodies")
        print(f"{column}.median {np.median(np.abs(off)):.1f} mm")
        print(f"{column}.within_5mm {int((np.abs(off) <= 5.0).sum())} bodies")
        print(f"{column}.largest {worst[0]:.1f} mm ({worst[1]})")


if __name__ == "__main__":
    main()

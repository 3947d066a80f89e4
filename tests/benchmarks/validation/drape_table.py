"""Computes warp_cloth/drape/drapes.csv: what discs of known bending length drape like.

python tests/benchmarks/validation/drape_table.py --device cuda --discs 12 --lengths 24 --workers 8   (what is shipped)
python tests/benchmarks/validation/drape_table.py --shear 3 --discs 2 --lengths 10 --out sheared.csv
"""

from __future__ import annotations

import argparse
import csv
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from warp_cloth.base.warp_setup import start_warp
from warp_cloth.drape.simulated import SUPPORT_RADIUS, Trial, random_start, simulate, with_bending_lengths
from warp_cloth.material.fabric import Fabric

RATIOS = (4.0 / 3.0, 5.0 / 3.0, 2.0)  # discs of 24, 30 and 36 cm on a support of 18 cm
ANISOTROPIES = (1.0, 1.25, 1.6)  # bending length along the warp over that along the weft
SHORTEST, LONGEST = 0.05, 0.6  # bending length over the support's radius
TOGETHER = 3  # lengths that are draped in one batch
MESHES = 3  # of the discs of one fabric
CLOTH = Fabric(weight=0.16, stretch_warp=80e3, stretch_weft=80e3, shear=900.0)  # a usual woven's
COLUMNS = ("ratio", "length", "anisotropy", "disc", "coefficient", "elongation", "folds", "depth", "reach")


def drape_rows(cloth: Fabric, discs: int, device: str, rings: int | None, task: tuple[float, list[float]]) -> list[str]:
    """Rows of the table for one ratio and some bending lengths."""
    start_warp(False)
    ratio, lengths = task
    names, trials = [], []
    for length in lengths:
        for anisotropy in ANISOTROPIES:
            mean = length * SUPPORT_RADIUS
            fabric = with_bending_lengths(cloth, mean * anisotropy**0.5, mean / anisotropy**0.5)
            for number in range(discs):
                names.append(f"{ratio:.4f},{length:.5f},{anisotropy},{number}")
                trials.append(Trial(fabric, random_start(number), number % MESHES))
    rows = []
    for name, each in zip(names, simulate(trials, SUPPORT_RADIUS, ratio, device=device, rings=rings), strict=True):
        shape = each.outline
        depth = float(np.mean(shape.depths)) if shape.depths else 0.0
        figures = (shape.coefficient(ratio), shape.elongation, shape.folds, depth, shape.reach)
        rows.append(",".join([name, *(f"{figure:.5g}" for figure in figures)]))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--discs", type=int, default=3)
    parser.add_argument("--lengths", type=int, default=10)
    parser.add_argument("--rings", type=int, help="of every disc; else as the bending length asks")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--shear", type=float, default=1.0, help="times the usual one: what shear does to a drape")
    parser.add_argument("--out", type=Path, default=Path("warp_cloth/drape/drapes.csv"))
    chosen = parser.parse_args()
    cloth = replace(CLOTH, shear=(CLOTH.shear or 0.0) * chosen.shear)
    lengths = np.geomspace(SHORTEST, LONGEST, chosen.lengths).tolist()
    groups = [lengths[first : first + TOGETHER] for first in range(0, len(lengths), TOGETHER)]
    tasks = [(ratio, group) for ratio in ((5.0 / 3.0,) if chosen.shear != 1.0 else RATIOS) for group in groups]
    work = partial(drape_rows, cloth, chosen.discs, chosen.device, chosen.rings)
    with ProcessPoolExecutor(chosen.workers, mp_context=get_context("spawn")) as pool:
        rows = [row for found in pool.map(work, tasks) for row in found]
    with chosen.out.open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerow(COLUMNS)
        file.writelines(f"{row}\n" for row in rows)


if __name__ == "__main__":
    main()

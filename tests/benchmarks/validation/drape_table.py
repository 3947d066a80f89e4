"""Computes warp_cloth/drape/drapes.csv: what discs of known bending length drape like.

python tests/benchmarks/validation/drape_table.py --rings 20   (what is shipped; 4 min on one core)
python tests/benchmarks/validation/drape_table.py --device cuda --discs 12 --lengths 24 --rings 60
"""

from __future__ import annotations

import argparse
import csv
from dataclasses import replace
from pathlib import Path

import numpy as np

from warp_cloth.base.warp_setup import start_warp
from warp_cloth.drape.simulated import SUPPORT_RADIUS, random_start, simulate, with_bending_lengths
from warp_cloth.material.fabric import Fabric

RATIOS = (4.0 / 3.0, 5.0 / 3.0, 2.0)  # discs of 24, 30 and 36 cm on a support of 18 cm
ANISOTROPIES = (1.0, 1.25, 1.6)  # bending length along the warp over that along the weft
SHORTEST, LONGEST = 0.05, 0.6  # bending length over the support's radius
CLOTH = Fabric(weight=0.16, stretch_warp=80e3, stretch_weft=80e3, shear=900.0)  # a usual woven's


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--discs", type=int, default=2)
    parser.add_argument("--lengths", type=int, default=10)
    parser.add_argument("--rings", type=int, help="of every disc; else as the bending length asks")
    parser.add_argument("--shear", type=float, default=1.0, help="times the usual one: what shear does to a drape")
    parser.add_argument("--out", type=Path, default=Path("warp_cloth/drape/drapes.csv"))
    chosen = parser.parse_args()
    start_warp(False)
    cloth = replace(CLOTH, shear=(CLOTH.shear or 0.0) * chosen.shear)
    with chosen.out.open("w", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["ratio", "length", "anisotropy", "disc", "coefficient", "elongation", "folds", "depth"])
        for ratio in (5.0 / 3.0,) if chosen.shear != 1.0 else RATIOS:
            for length in np.geomspace(SHORTEST, LONGEST, chosen.lengths):
                for anisotropy in ANISOTROPIES:
                    mean = length * SUPPORT_RADIUS
                    fabric = with_bending_lengths(cloth, mean * anisotropy**0.5, mean / anisotropy**0.5)
                    starts = [random_start(seed) for seed in range(chosen.discs)]
                    drapes = simulate(fabric, SUPPORT_RADIUS, ratio, starts, device=chosen.device, rings=chosen.rings)
                    for number, each in enumerate(drapes):
                        shape = each.outline
                        depth = float(np.mean(shape.depths)) if shape.depths else 0.0
                        figures = (shape.coefficient(ratio), shape.elongation, shape.folds, depth)
                        rows.writerow(
                            [f"{ratio:.4f}", f"{length:.5f}", anisotropy, number, *(f"{x:.5g}" for x in figures)]
                        )
                    file.flush()


if __name__ == "__main__":
    main()

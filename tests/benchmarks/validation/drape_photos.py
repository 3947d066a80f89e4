"""Fabrics from rendered photographs of known drapes: how often coefficient and bending come back.

python tests/benchmarks/validation/drape_photos.py --fabrics 10 --photos 3            (reading only)
python tests/benchmarks/validation/drape_photos.py --fabrics 10 --photos 3 --refine   (with real fits)
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))
from drape_photos import photograph, random_view

from warp_cloth.base.errors import InputError
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.drape.made import fabric_of_readings, rigidities
from warp_cloth.drape.reading import Setting, read_drape
from warp_cloth.drape.simulated import Trial, random_start, simulate, with_bending_lengths
from warp_cloth.material.fabric import fabric_named
from warp_cloth.material.laboratory import GRAVITY, KES_BENDING


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--fabrics", type=int, default=10)
    parser.add_argument("--photos", type=int, default=3)
    parser.add_argument("--rings", type=int, default=32, help="of the discs that are photographed")
    parser.add_argument("--refine", action="store_true")
    parser.add_argument("--keep", type=Path)
    chosen = parser.parse_args()
    start_warp(False)
    folder = chosen.keep or Path(tempfile.mkdtemp())
    folder.mkdir(exist_ok=True)
    setting, rng, found = Setting(), np.random.default_rng(7), []
    for number in range(chosen.fabrics):
        # not an entry of the table: lengths, weight, stretch and shear of its own (20 % off its class), another mesh,
        # finer than the fit's
        lengths = setting.support * np.exp(
            rng.uniform(np.log(0.11), np.log(0.42)) + np.array([0.5, -0.5]) * rng.normal(0, 0.15)
        )
        base = fabric_named(str(rng.choice(["cotton", "wool", "jersey", "silk", "polyester", "linen"])))
        weight, off = base.weight * float(np.exp(rng.normal(0, 0.2))), np.exp(rng.normal(0, 0.2, 2))
        base = replace(base, weight=weight)
        shear = (base.shear or 0.0) * float(off[1])
        cloth = replace(base, stretch_warp=base.stretch_warp * off[0], stretch_weft=base.stretch_weft * off[0])
        cloth = replace(cloth, shear=min(shear, 0.24 * min(cloth.stretch_warp, cloth.stretch_weft)))
        true = with_bending_lengths(cloth, *lengths)
        truth = weight * GRAVITY * lengths**3 / KES_BENDING
        trial = Trial(true, random_start(100 + number), 100 + number)
        (drape,) = simulate([trial], setting.support, setting.ratio, rings=chosen.rings)
        for copy in range(chosen.photos):
            view = random_view(1000 * number + copy)
            path = photograph(
                drape.points, drape.mesh.triangles, view, setting.support, setting.disc, folder / f"{number}_{copy}.jpg"
            )
            begun = time.perf_counter()
            try:
                reading = read_drape(path, setting)
            except InputError as error:
                print(f"{number}_{copy} {view.side:5d} px  {error}", flush=True)
                found.append((np.inf, np.inf, 1.0, np.inf, np.inf, 1.0))
                continue
            made = fabric_of_readings([reading], base, setting, refine=chosen.refine)
            warp, weft = rigidities(made.fabric, made.estimate, setting.support)
            off = reading.coefficient - drape.outline.coefficient(setting.ratio)
            mean = np.sqrt(warp * weft / truth.prod()) - 1.0
            sigma, one = made.rigidity_errors
            found.append((off, mean, sigma, warp / truth[0] - 1.0, weft / truth[1] - 1.0, one))
            print(
                f"{number}_{copy} {view.side:5d} px tilt {view.tilt:4.1f}  DC {reading.coefficient:5.1f} ({off:+5.2f})"
                f"  folds {reading.outline.folds} ({drape.outline.folds})  B {100 * mean:+5.0f} % (+-{100 * sigma:.0f})"
                f"  warp/weft {warp / weft:.2f} ({truth[0] / truth[1]:.2f})  {time.perf_counter() - begun:.1f} s",
                flush=True,
            )
    table = np.array(found)
    read = np.isfinite(table[:, 0])
    print(f"photographs {len(table)}, read {read.sum()}, refined {chosen.refine}")
    print(f"coefficient within 1 point: {(np.abs(table[:, 0]) < 1.0).sum()}")
    print(f"mean bending within 15 %: {(np.abs(table[:, 1]) < 0.15).sum()}")
    apart = np.abs(table[:, 3:5]).max(axis=1)
    print(f"both of warp and weft within 15 %: {(apart < 0.15).sum()}")
    print(
        f"mean within two stated standard deviations: {(np.abs(np.log1p(table[read, 1])) < 2 * table[read, 2]).sum()}"
    )
    off = np.abs(np.log1p(table[read, 3:5])).max(axis=1)
    print(f"both within two stated standard deviations: {(off < 2 * table[read, 5]).sum()}")


if __name__ == "__main__":
    main()

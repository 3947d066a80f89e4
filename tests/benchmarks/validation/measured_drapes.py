"""Simulated drapes and measured ones: folds, rim radii and drop over the drape coefficient, and draping again.

python tests/benchmarks/validation/measured_drapes.py --simulate drapes.csv --device cuda --workers 4   (324 discs)
python tests/benchmarks/validation/measured_drapes.py --compare drapes.csv --measured ../shared/data/drape.csv --write

The first drapes twelve discs of every shipped fabric and size, each on a mesh of its own: four from slight waves, four
from high ones, four laid down from one side. The second compares them with the table of measured drapes, and draws
them.
"""

from __future__ import annotations

import csv
import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from measured import Figures, script_parser

from warp_cloth.base.warp_setup import start_warp
from warp_cloth.drape.outline import ANGLES
from warp_cloth.drape.simulated import SimulatedDrape, Trial, random_start, simulate
from warp_cloth.material.fabric import fabric_named

FABRICS = ("jersey", "silk", "faille", "wool", "polyester", "cotton", "linen", "denim", "felt")
RATIOS = (4.0 / 3.0, 5.0 / 3.0, 2.0)  # discs of 24, 30 and 36 cm on a support of 18 cm
SUPPORT = 0.09  # radius [m]
STARTS = 12
HIGH_WAVES = 8.0  # times the slight ones
LEANS = 0.03  # [m] at the rim, of a disc that is laid down from one side
COLUMNS = ("fabric", "ratio", "start", "coefficient", "folds", "rim_min", "rim_max", "drop")
COMPARED = {"folds": "folds", "rim_min": "rim_radius_min_m", "rim_max": "rim_radius_max_m", "drop": "drop_m"}
REPEATED = ("wool", "cotton", "denim", "felt")  # four coefficients at which draping again is compared
INSIDE = 2.0  # standard deviations of the measured fabrics about their line


def start_of(number: int) -> np.ndarray:
    """Height of the rim over the angle [m], shape [ANGLES]."""
    wave = random_start(number)
    if number % 3 == 1:
        return HIGH_WAVES * wave
    if number % 3 == 2:
        turn = 2.0 * np.pi * np.arange(ANGLES) / ANGLES
        return np.asarray(wave + LEANS * np.cos(turn - number))
    return wave


def rows_of(device: str, rings: int | None, task: tuple[str, float]) -> list[list[str]]:
    start_warp(False)
    name, ratio = task
    fabric = fabric_named(name)
    trials = [Trial(fabric, start_of(number), number) for number in range(STARTS)]
    drapes = simulate(trials, SUPPORT, ratio, device=device, rings=rings)
    return [[name, f"{ratio:.4f}", str(n), *(f"{x:.5g}" for x in shape_of(d, ratio))] for n, d in enumerate(drapes)]


def shape_of(drape: SimulatedDrape, ratio: float) -> tuple[float, ...]:
    """Coefficient [%], folds, smallest and largest radius of the rim [m], drop of its lowest point [m]."""
    outline = drape.outline
    radius = SUPPORT * outline.radius
    return (
        outline.coefficient(ratio),
        float(outline.folds),
        float(radius.min()),
        float(radius.max()),
        float(-drape.points[:, 1].min()),
    )


def simulated(path: Path, device: str, rings: int | None, workers: int) -> None:
    tasks = [(name, ratio) for name in FABRICS for ratio in RATIOS]
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        found = [row for rows in pool.map(partial(rows_of, device, rings), tasks) for row in rows]
    with path.open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([COLUMNS, *found])


def read(path: Path) -> list[dict[str, Any]]:
    def value(text: str) -> Any:
        try:
            return float(text)
        except ValueError:
            return text or float("nan")

    with path.open(newline="") as file:
        return [{key: value(text) for key, text in row.items()} for row in csv.DictReader(file)]


def compared(ours: list[dict[str, Any]], theirs: list[dict[str, Any]], figures: Figures, picture: Path) -> None:
    """Ours, the mean of each fabric and size, against lines through the measured fabrics."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    drawn, axes = plt.subplots(1, 5, figsize=(24, 4.6))
    measured = {key: np.array([row[key] for row in theirs], dtype=float) for key in theirs[0]}
    over = measured["drape_coefficient_percent"]
    for panel, (own, other) in zip(axes, COMPARED.items(), strict=False):
        known = np.isfinite(measured[other])
        line = np.polyfit(over[known], measured[other][known], 2)
        spread = float(np.std(measured[other][known] - np.polyval(line, over[known]), ddof=3))
        if own == "folds":  # of one disc: it has a whole number of them
            spread = float(np.hypot(spread, np.nanmean(measured["folds_sd"])))
        grid = np.linspace(over[known].min(), over[known].max(), 50)
        panel.plot(over, measured[other], "k.", label="measured, 30 cm")
        panel.fill_between(grid, *(np.polyval(line, grid) + side * INSIDE * spread for side in (-1, 1)), alpha=0.2)
        inside = total = 0
        for ratio in RATIOS:
            points = [_mean(ours, name, ratio, own) for name in FABRICS]
            size = f"{200 * ratio * SUPPORT:.0f} cm"
            panel.plot(*np.transpose(points), "o", label=f"ours, {size}")
            if abs(ratio - 5.0 / 3.0) < 0.01:
                for coefficient, value in points:
                    if grid[0] <= coefficient <= grid[-1]:
                        total += 1
                        inside += int(abs(value - np.polyval(line, coefficient)) <= INSIDE * spread)
        figures.add(f"{own}.inside", f"{inside} of {total}", "fabrics, 30 cm")
        panel.set(xlabel="drape coefficient [%]", title=own)
        panel.legend(fontsize=7)
    again, panel = _again(ours), axes[4]
    panel.plot(over, measured["sd_all"], "k.", label="measured, all captures")
    panel.plot(over, measured["sd_same_sample_again"], "kx", label="measured, one sample again")
    panel.plot([again[name][0] for name in FABRICS], [again[name][1] for name in FABRICS], "o", label="ours, 12 starts")
    panel.set(xlabel="drape coefficient [%]", title="standard deviation of draping again [points]")
    panel.legend(fontsize=7)
    for name in REPEATED:
        mean, spread = again[name]
        near = np.argsort(np.abs(over - mean))[:5]
        figures.add(f"again.{name}.coefficient", mean, "%")
        figures.add(f"again.{name}.spread", spread, "points")
        low, high = (float(side(measured["sd_all"][near])) for side in (np.min, np.max))
        figures.add(f"again.{name}.measured", f"{low:.1f} to {high:.1f}", "points, five nearest fabrics")
    drawn.tight_layout()
    drawn.savefig(picture, dpi=80)


def _mean(rows: list[dict[str, Any]], name: str, ratio: float, key: str) -> tuple[float, float]:
    own = [row for row in rows if row["fabric"] == name and abs(row["ratio"] - ratio) < 0.01]
    return float(np.mean([row["coefficient"] for row in own])), float(np.mean([row[key] for row in own]))


def _again(rows: list[dict[str, Any]]) -> dict[str, tuple[float, float]]:
    """Mean and spread of each fabric's coefficient, discs of 30 cm [%]."""
    found = {}
    for name in FABRICS:
        own = [row["coefficient"] for row in rows if row["fabric"] == name and abs(row["ratio"] - 5.0 / 3.0) < 0.01]
        found[name] = (float(np.mean(own)), float(np.std(own, ddof=1)))
    return found


def main() -> None:
    parser = script_parser(__doc__, device="cpu")
    parser.add_argument("--simulate", type=Path, metavar="CSV")
    parser.add_argument("--compare", type=Path, metavar="CSV")
    parser.add_argument("--measured", type=Path, default=Path("../shared/data/drape.csv"))
    parser.add_argument("--picture", type=Path, default=Path("measured_drapes.png"))
    parser.add_argument("--rings", type=int)
    parser.add_argument("--workers", type=int, default=1)
    chosen = parser.parse_args()
    if chosen.simulate:
        simulated(chosen.simulate, chosen.device, chosen.rings, chosen.workers)
    if chosen.compare:
        with Figures(__file__, chosen) as figures:
            compared(read(chosen.compare), read(chosen.measured), figures, chosen.picture)


if __name__ == "__main__":
    main()

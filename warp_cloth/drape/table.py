"""The table of simulated drapes: bending lengths from a drape coefficient and an outline's elongation."""

from __future__ import annotations

import csv
import functools
from dataclasses import dataclass
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.errors import InputError

Floats = NDArray[np.float64]

USUAL_ANISOTROPY = 0.2  # standard deviation of ln(bending length along warp / weft) of woven cloth
KNOWN_CLASS = 0.03  # of ln(bending length): what a stretch two times off the base's and a shear a quarter off do
UNKNOWN_CLASS = 0.07  # the same where they may be four times off
MOST_ERROR = 0.5  # of ln(bending length): what is known of cloth without a drape
DEEPER = 0.07  # times 1 - coefficient: the part by which tips of the 25 measured fabrics reach farther than the table's
FULLNESS_ERROR = 0.03  # how far these fabrics lie from one line
BEYOND = 5.0  # [points] outside the table, where the drape says that a cloth is limp or stiff, no more
LEAST_SPREAD, LEAST_UNEVEN = 0.3, 0.003  # of one disc's coefficient [points] and elongation: other meshes do that
AGAIN = 15.0  # [points] times c (1 - c): rms spread of ten measured fabrics of 48 captures, one sample draped again


@dataclass(frozen=True, eq=False)
class Drapes:
    """What discs of one ratio of disc to support drape like, over ln(bending length / support radius)."""

    ratio: float
    length: Floats  # ln, shape [N]
    coefficient: Floats  # [%], rising, shape [N]
    spread: Floats  # of one disc's coefficient [points], shape [N]
    elongation: Floats  # per ln(anisotropy), shape [N]
    elongation_spread: Floats  # of one disc, shape [N]
    reach: Floats  # of the farthest tip [support radii], shape [N]
    reach_spread: float  # of one disc

    def slope(self, length: float) -> float:
        """Points of the coefficient per unit of ln(bending length)."""
        step = 0.12
        low, high = (float(np.interp(length + d, self.length, self.coefficient)) for d in (-step, step))
        return max((high - low) / (2.0 * step), 5.0)

    def reach_of(self, fullness: float) -> tuple[float, float]:
        """How far the tips of a drape reach, and its standard deviation [support radii].

        ``fullness`` is the mean squared radius over the square of the reach, which needs no scale.
        """
        covered = 0.01 * self.coefficient
        reach = self.reach * (1.0 + DEEPER * (1.0 - covered))
        full = (1.0 + covered * (self.ratio**2 - 1.0)) / reach**2
        limpest = int(np.argmin(full))  # limper cloth, which hangs straight down, fills its circle again
        risen = np.maximum.accumulate(full[limpest:])
        off = np.array([-FULLNESS_ERROR, 0.0, FULLNESS_ERROR])
        low, found, high = np.interp(fullness + off, risen, reach[limpest:])
        return float(found), float(np.hypot(max(high - found, found - low), self.reach_spread))

    def spread_at(self, length: float) -> float:
        """Standard deviation of one disc's coefficient [points]."""
        return float(np.interp(length, self.length, self.spread))

    def gain_at(self, length: float) -> float:
        """Elongation per ln(anisotropy)."""
        return float(np.interp(length, self.length, self.elongation))

    def elongation_spread_at(self, length: float) -> float:
        """Standard deviation of one disc's elongation."""
        return float(np.interp(length, self.length, self.elongation_spread))

    def uneven(self, length: float, elongation: float, spread: float) -> tuple[float, float]:
        """Anisotropy of cloth that stands out so, read with a standard deviation ``spread``, and its own."""
        gain = self.gain_at(length)
        # what is usual counts as one more observation: a weak picture then says little, not nonsense
        precision = (gain / spread) ** 2 + 1.0 / USUAL_ANISOTROPY**2
        return gain * elongation / spread**2 / precision, precision**-0.5


@dataclass(frozen=True)
class BendingEstimate:
    """Bending lengths over the support's radius, as ln of their geometric mean and of warp over weft."""

    length: float
    length_error: float  # one standard deviation
    anisotropy: float
    anisotropy_error: float

    def bending_lengths(self, support: float) -> tuple[float, float]:
        """Along warp and weft, for a support of this radius [m]."""
        length, uneven = support * float(np.exp(self.length)), float(np.exp(0.5 * self.anisotropy))
        return length * uneven, length / uneven


def drapes_of_ratio(ratio: float) -> Drapes:
    """The table between its ratios of disc to support.

    Raises:
        InputError: it has no such ratio.
    """
    table = _tables()
    ratios = np.array(sorted(table))
    if not ratios[0] - 0.02 <= ratio <= ratios[-1] + 0.02:
        problem = f"must be {ratios[0]:.2f} to {ratios[-1]:.2f} times the support's diameter, not {ratio:.2f}"
        raise InputError("--disc-mm", problem, "discs usually have 240, 300 or 360 mm, on a support of 180 mm")
    ratio = float(np.clip(ratio, ratios[0], ratios[-1]))
    upper = int(np.clip(np.searchsorted(ratios, ratio), 1, len(ratios) - 1))
    low, high = table[float(ratios[upper - 1])], table[float(ratios[upper])]
    part = (ratio - ratios[upper - 1]) / (ratios[upper] - ratios[upper - 1])

    def mixed(a: Floats, b: Floats) -> Floats:
        return np.asarray((1.0 - part) * a + part * b)

    return Drapes(
        ratio,
        low.length,
        mixed(low.coefficient, high.coefficient),
        mixed(low.spread, high.spread),
        mixed(low.elongation, high.elongation),
        mixed(low.elongation_spread, high.elongation_spread),
        mixed(low.reach, high.reach),
        max(low.reach_spread, high.reach_spread),
    )


def estimate(
    drapes: Drapes, coefficients: Floats, errors: Floats, elongations: Floats | None, place: str, *, rest_error: float
) -> BendingEstimate:
    """Bending from one or several drapes of a fabric; ``elongations`` None: warp and weft are not told apart.

    ``rest_error`` [ln of the bending length] is what the unknown shear and stretch may do.

    Raises:
        InputError: no cloth of the table drapes so; placed at ``place``.
    """
    mean = float(np.mean(coefficients))
    low, high = float(drapes.coefficient[0]), float(drapes.coefficient[-1])
    if not low - BEYOND <= mean <= min(high + BEYOND, 100.5):
        problem = f"a drape coefficient of {mean:.1f} % is beyond the table's {low:.0f} to {high:.0f} %"
        raise InputError(place, problem, "use a smaller disc for limp cloth, a larger one for stiff cloth")
    length = float(np.interp(mean, drapes.coefficient, drapes.length))
    count = len(coefficients)
    single = variance_of_one(drapes.spread_at(length), coefficients, errors)
    length_error = float(np.hypot(np.sqrt(single / count) / drapes.slope(length), rest_error))
    length_error = min(length_error, MOST_ERROR)
    anisotropy, anisotropy_error = 0.0, USUAL_ANISOTROPY
    if elongations is not None:
        spread = drapes.elongation_spread_at(length) / count**0.5
        anisotropy, anisotropy_error = drapes.uneven(length, float(np.mean(elongations)), spread)
    return BendingEstimate(length, length_error, anisotropy, anisotropy_error)


def variance_of_one(spread: float, coefficients: Floats, errors: Floats) -> float:
    """Variance of one drape's coefficient [points^2], of a fabric whose discs spread so.

    Of the disc and its reading; or what several drapes themselves show, where it is more.
    """
    single = spread**2 + float(np.mean(errors**2))
    return max(single, float(np.var(coefficients, ddof=1))) if len(coefficients) > 1 else single


def spread_again(coefficient: float) -> float:
    """Standard deviation of a real fabric's drape coefficient [%] when it is draped again [points].

    Friction in cloth keeps it as it was laid; simulated discs without friction spread by a third of it or less.
    """
    covered = float(np.clip(0.01 * coefficient, 0.0, 1.0))
    return AGAIN * covered * (1.0 - covered)


@functools.cache
def _tables() -> dict[float, Drapes]:
    text = (files("warp_cloth.drape") / "drapes.csv").read_text(encoding="utf-8")
    rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(text.splitlines())]
    ratios = sorted({row["ratio"] for row in rows})
    return {ratio: _drapes([row for row in rows if row["ratio"] == ratio]) for ratio in ratios}


def _drapes(rows: list[dict[str, float]]) -> Drapes:
    lengths = np.array(sorted({row["length"] for row in rows}))
    levels, spreads, gains, off, reaches, reach_off = [], [], [], [], [], []
    for length in lengths:
        here = [row for row in rows if row["length"] == length]
        coefficients = np.array([row["coefficient"] for row in here])
        uneven = np.log([row["anisotropy"] for row in here])
        stretched = np.array([row["elongation"] for row in here])
        usual = uneven < 0.3  # up to 1.35: what most fabrics are
        levels.append(float(coefficients[usual].mean()))
        spreads.append(_within(coefficients, uneven))
        reach = np.array([row["reach"] for row in here])[usual]
        reaches.append(float(reach.mean()))
        reach_off.append(reach - reaches[-1])
        gains.append(max(float(uneven @ stretched / (uneven @ uneven)), 0.0))
        off.append(_within(stretched, uneven))
    rising = _monotone(np.array(levels))
    return Drapes(
        rows[0]["ratio"],
        np.log(lengths),
        rising,
        _smooth(np.maximum(spreads, LEAST_SPREAD)),
        _smooth(np.array(gains)),
        _smooth(np.maximum(off, LEAST_UNEVEN)),
        _smooth(np.array(reaches)),
        float(np.concatenate(reach_off).std()),
    )


def _within(values: Floats, kind: Floats) -> float:
    """Standard deviation of values within their kinds."""
    kinds = np.unique(kind)
    squares = sum(float(((values[kind == each] - values[kind == each].mean()) ** 2).sum()) for each in kinds)
    return float(np.sqrt(squares / (len(values) - len(kinds))))


def _monotone(values: Floats) -> Floats:
    """The rising sequence closest to the values (pool adjacent violators), strictly rising."""
    blocks: list[list[float]] = []
    for value in values:
        blocks.append([float(value), 1.0])
        while len(blocks) > 1 and blocks[-2][0] >= blocks[-1][0]:
            (a, n), (b, m) = blocks[-2], blocks.pop()
            blocks[-1] = [(a * n + b * m) / (n + m), n + m]
    flat = np.concatenate([np.full(int(count), value) for value, count in blocks])
    return flat + 1e-6 * np.arange(len(flat))


def _smooth(values: Floats) -> Floats:
    padded = np.pad(values, 1, mode="edge")
    return np.asarray(0.25 * padded[:-2] + 0.5 * padded[1:-1] + 0.25 * padded[2:])

"""Bending found by simulation: drapes in the photographs' folds, until they cover and stand out as measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warp_cloth.drape.outline import Floats, Outline
from warp_cloth.drape.reading import Setting
from warp_cloth.drape.simulated import SimulatedDrape, Trial, simulate, with_bending_lengths
from warp_cloth.drape.table import MOST_ERROR, BendingEstimate, Drapes, estimate, variance_of_one
from warp_cloth.material.fabric import Fabric

ROUNDS = 3  # of simulation and correction
FIRST, LATER = 2, 5  # fewest discs in the first round, and in a later one; each has a mesh of its own
NEAR = 0.05  # of ln(bending length); discs simulated nearer than this to what they tell all count
LONGEST_STEP = 0.3  # of ln(bending length) in one round
SIMULATED = 4  # photographs at most in whose folds discs start
KNOWN_SPREAD = 6.0  # discs that the table's spread counts for, added to those that are simulated


@dataclass(frozen=True, eq=False)
class Measured:
    """What was measured of the drapes of one fabric, N of them."""

    coefficients: Floats  # [%], shape [N]
    errors: Floats  # one standard deviation of each [points], shape [N]
    elongations: Floats | None  # along the warp, shape [N]; None: not seen
    starts: Mapping[int, Floats | Outline]  # by the drape's number: what simulated discs start from
    place: str  # where it was measured, for errors

    def estimate(self, drapes: Drapes, rest_error: float) -> BendingEstimate:
        """The table's."""
        return estimate(drapes, self.coefficients, self.errors, self.elongations, self.place, rest_error=rest_error)


@dataclass(frozen=True, eq=False)
class _Round:
    """Discs that were simulated with one estimate of the bending."""

    tried: BendingEstimate
    coefficients: Floats  # [%], shape [M]
    elongations: Floats  # shape [M]


def starts_of(outlines: Sequence[Outline], ratio: float) -> dict[int, Floats | Outline]:
    """Outlines to start from by their numbers: of many, some from the lowest coefficient to the highest."""
    order = np.argsort([outline.coefficient(ratio) for outline in outlines])
    chosen = np.linspace(0.0, len(order) - 1.0, min(SIMULATED, len(order))).round().astype(int)
    return {int(number): outlines[number] for number in sorted(order[chosen])}


def refined(
    found: BendingEstimate,
    measured: Measured,
    drapes: Drapes,
    base: Fabric,
    setting: Setting,
    *,
    device: str,
    rest_error: float,
    progress: Callable[[str], None],
) -> tuple[BendingEstimate, dict[int, SimulatedDrape]]:
    """The estimate after simulations with the base's stretch and shear, and the last drapes by their starts' numbers.

    The table has one stretch and one shear for all cloth: silk, stiff in both, covers 3 points more than it says, and
    jersey 4 less. Each disc tells a bending length of its own, by what it misses; their mean counts. On one mesh
    alone what the mesh favours would be taken for the cloth's.
    """
    numbers, rounds, used, trial = list(measured.starts), list[_Round](), 0, found
    shown: dict[int, SimulatedDrape] = {}
    for index in range(ROUNDS):
        count = max(LATER if index else FIRST, len(numbers))
        progress(f"simulating {count} drapes, round {index + 1}")
        fabric = fabric_of(base, trial, setting)
        kinds = [numbers[disc % len(numbers)] for disc in range(count)]
        trials = [Trial(fabric, measured.starts[kind], used + disc) for disc, kind in enumerate(kinds)]
        simulated = simulate(trials, setting.support, setting.ratio, device=device)
        used += count
        shown = dict(zip(kinds, simulated, strict=True))
        outlines = [drape.outline for drape in simulated]
        coefficients = np.array([outline.coefficient(setting.ratio) for outline in outlines])
        rounds.append(_Round(trial, coefficients, np.array([outline.elongation for outline in outlines])))
        found = _told(rounds, measured, drapes, rest_error)
        step, turn = found.length - trial.length, found.anisotropy - trial.anisotropy
        if index and max(abs(step), 0.5 * abs(turn)) < NEAR:
            break
        # no farther from what was simulated than a step, also in the end
        near = trial.length + float(np.clip(step, -LONGEST_STEP, LONGEST_STEP))
        error = float(np.hypot(found.length_error, found.length - near))
        trial = found = replace(found, length=near, length_error=min(error, MOST_ERROR))
    return found, shown


def fabric_of(base: Fabric, found: BendingEstimate, setting: Setting) -> Fabric:
    """The base with the bending lengths found."""
    return with_bending_lengths(base, *found.bending_lengths(setting.support))


def _told(rounds: Sequence[_Round], measured: Measured, drapes: Drapes, rest_error: float) -> BendingEstimate:
    """What the last round tells, with all that were simulated near it."""
    goal, count = float(measured.coefficients.mean()), len(measured.coefficients)

    def lengths(each: _Round) -> Floats:
        return each.tried.length + (goal - each.coefficients) / drapes.slope(each.tried.length)

    last = float(lengths(rounds[-1]).mean())
    near = [each for each in rounds if abs(each.tried.length - last) < NEAR] or [rounds[-1]]
    length = float(np.concatenate([lengths(each) for each in near]).mean())
    discs = sum(len(each.coefficients) for each in near)
    # of the measured drapes about the fabric's mean, and of the mean of those simulated
    spread = _pooled(drapes.spread_at(length), [each.coefficients for each in near])
    single = variance_of_one(spread, measured.coefficients, measured.errors)
    error = float(np.hypot(np.sqrt(single / count + spread**2 / discs) / drapes.slope(length), rest_error))
    if measured.elongations is None:
        return BendingEstimate(length, error, rounds[0].tried.anisotropy, rounds[0].tried.anisotropy_error)
    gain = drapes.gain_at(length)
    missed = [measured.elongations.mean() - each.elongations + gain * each.tried.anisotropy for each in near]
    uneven = _pooled(drapes.elongation_spread_at(length), [each.elongations for each in near])
    spread = uneven * (1.0 / count + 1.0 / discs) ** 0.5
    anisotropy, anisotropy_error = drapes.uneven(length, float(np.concatenate(missed).mean()), spread)
    return BendingEstimate(length, error, anisotropy, anisotropy_error)


def _pooled(known: float, groups: Sequence[Floats]) -> float:
    """Standard deviation within groups, with the table's as if so many more discs had shown it."""
    squares = sum(float(((group - group.mean()) ** 2).sum()) for group in groups)
    freedom = sum(len(group) - 1 for group in groups)
    return float(np.sqrt((KNOWN_SPREAD * known**2 + squares) / (KNOWN_SPREAD + freedom)))

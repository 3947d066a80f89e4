"""A fabric made from drapes: the table's estimate, refined by simulating what the photographs show."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warp_cloth.drape.outline import ANGLES, Outline
from warp_cloth.drape.reading import DrapeReading, Setting
from warp_cloth.drape.simulated import (
    SimulatedDrape,
    Trial,
    random_start,
    simulate,
    start_of_outline,
    with_bending_lengths,
)
from warp_cloth.drape.table import KNOWN_CLASS, BendingEstimate, Drapes, drapes_of_ratio, estimate
from warp_cloth.material.fabric import Fabric
from warp_cloth.material.laboratory import GRAVITY, KES_BENDING

ROUNDS = 2  # of simulation and correction
CLOSE = 0.5  # [points]; nearer needs no further round
FEWEST_SIMULATED = 2  # in a round; on one mesh alone the coefficient is 0.7 points off, the elongation 0.01
LONGEST_STEP = 0.3  # of ln(bending length) in one round
SIMULATED = 4  # drapes at most in a round
FABRIC_SPREAD = 20.0  # [points]; measured fabrics draped again stay within
FOLDS_APART = 2.0  # a number of folds farther than this from the simulated one is told


@dataclass(frozen=True, eq=False)
class MadeFabric:
    """A fabric and how well it is known."""

    fabric: Fabric
    estimate: BendingEstimate
    coefficient: float  # measured, mean [%]
    coefficient_error: float  # one standard deviation of one drape [points]
    simulated: tuple[SimulatedDrape, ...]  # of the fabric, in the order of the photographs
    notes: tuple[str, ...]

    @property
    def rigidity_errors(self) -> tuple[float, float]:
        """Relative standard deviations of the mean bending rigidity B, and of that along warp or weft."""
        one = np.hypot(self.estimate.length_error, 0.5 * self.estimate.anisotropy_error)
        return 3.0 * self.estimate.length_error, 3.0 * float(one)


@dataclass(frozen=True, eq=False)
class _Measured:
    """What was measured of the drapes of one fabric, N of them."""

    coefficients: np.ndarray  # [%], shape [N]
    errors: np.ndarray  # one standard deviation of each [points], shape [N]
    elongations: np.ndarray | None  # along the warp, shape [N]; None: not seen
    starts: Sequence[np.ndarray]  # outlines with the folds that simulations begin with
    place: str  # where it was measured, for errors

    def estimate(self, drapes: Drapes, rest_error: float) -> BendingEstimate:
        """The table's."""
        return estimate(drapes, self.coefficients, self.errors, self.elongations, self.place, rest_error=rest_error)

    @property
    def goal(self) -> float:
        """Mean drape coefficient of those that are simulated [%]."""
        seen = self.coefficients[: len(self.starts)] if len(self.coefficients) > 1 else self.coefficients
        return float(seen.mean())


def fabric_of_readings(
    readings: Sequence[DrapeReading],
    base: Fabric,
    setting: Setting,
    *,
    device: str = "cpu",
    refine: bool = True,
    rest_error: float = KNOWN_CLASS,
    progress: Callable[[str], None] = lambda _: None,
) -> MadeFabric:
    """The fabric that drapes as photographed; what a drape does not tell is the base's.

    Raises:
        InputError: no cloth drapes so.
    """
    drapes, outlines = drapes_of_ratio(setting.ratio), [reading.outline for reading in readings]
    measured = _Measured(
        np.array([reading.coefficient for reading in readings]),
        np.array([reading.error for reading in readings]),
        np.array([outline.elongation for outline in outlines]),
        [start_of_outline(outline) for outline in outlines][:SIMULATED],
        str(readings[0].photograph.path),
    )
    found = measured.estimate(drapes, rest_error)
    simulated: list[SimulatedDrape] = []
    if refine:
        found, simulated = _refined(found, measured, drapes, base, setting, device, progress)
    notes = _doubts(drapes, measured.coefficients, simulated, outlines)
    return _made(measured, found, base, setting, simulated, notes)


def fabric_of_numbers(
    coefficient: float,
    folds: int | None,
    base: Fabric,
    setting: Setting,
    *,
    device: str = "cpu",
    rest_error: float = KNOWN_CLASS,
    progress: Callable[[str], None] = lambda _: None,
) -> MadeFabric:
    """The fabric with this drape coefficient [%], the same along warp and weft; the number of folds is compared.

    Raises:
        InputError: no cloth drapes so.
    """
    drapes = drapes_of_ratio(setting.ratio)
    turn = 2.0 * np.pi * np.arange(ANGLES) / ANGLES
    starts = [random_start(seed) for seed in range(2)]
    if folds is not None:
        starts = [4e-3 * np.cos(folds * turn + phase) for phase in (0.0, 0.5)]
    measured = _Measured(np.array([coefficient]), np.array([0.0]), None, starts, "--drape-coefficient")
    found = measured.estimate(drapes, rest_error)
    found, simulated = _refined(found, measured, drapes, base, setting, device, progress)
    notes = _doubts(drapes, measured.coefficients, [], [])
    shown = float(np.mean([drape.outline.folds for drape in simulated]))
    if folds is not None and abs(shown - folds) > FOLDS_APART:
        told = f"{folds} folds were counted, {shown:.0f} were simulated: check the sizes of disc and support"
        notes = (*notes, told)
    return _made(measured, found, base, setting, simulated, notes)


def _made(
    measured: _Measured,
    found: BendingEstimate,
    base: Fabric,
    setting: Setting,
    simulated: Sequence[SimulatedDrape],
    notes: tuple[str, ...],
) -> MadeFabric:
    error = float(np.sqrt(np.mean(measured.errors**2)))
    fabric, coefficient = _fabric(base, found, setting), float(measured.coefficients.mean())
    return MadeFabric(fabric, found, coefficient, error, tuple(simulated), notes)


def _refined(
    found: BendingEstimate,
    measured: _Measured,
    drapes: Drapes,
    base: Fabric,
    setting: Setting,
    device: str,
    progress: Callable[[str], None],
) -> tuple[BendingEstimate, list[SimulatedDrape]]:
    """Simulates the drapes in their own folds, and corrects the bending lengths by what they miss.

    Each is simulated on meshes of its own, or what one mesh favours would be taken for the cloth's.
    """
    starts, elongations = measured.starts, measured.elongations
    copies = -(-FEWEST_SIMULATED // len(starts))
    best: tuple[float, BendingEstimate, list[SimulatedDrape]] | None = None
    trial = found
    for number in range(ROUNDS + 1):
        progress(f"simulating {copies * len(starts)} drapes, round {number + 1}")
        fabric = _fabric(base, trial, setting)
        trials = [Trial(fabric, start, seed) for seed, start in enumerate([*starts] * copies)]
        simulated = simulate(trials, setting.support, setting.ratio, device=device)
        missed = measured.goal - float(np.mean([each.outline.coefficient(setting.ratio) for each in simulated]))
        if elongations is not None:
            shown = float(np.mean([each.outline.elongation for each in simulated]))
            off = float(elongations[: len(starts)].mean()) - shown
            trial = drapes.turned_by(trial, off, len(starts))
        if best is None or abs(missed) < best[0]:
            best = (abs(missed), trial, simulated[: len(starts)])
        if abs(missed) < CLOSE or number == ROUNDS:
            break
        step = float(np.clip(missed / drapes.slope(trial.length), -LONGEST_STEP, LONGEST_STEP))
        trial = replace(trial, length=trial.length + step)
    return (best[1], best[2]) if best is not None else (found, [])


def _fabric(base: Fabric, found: BendingEstimate, setting: Setting) -> Fabric:
    length = setting.support * float(np.exp(found.length))
    uneven = float(np.exp(0.5 * found.anisotropy))
    return with_bending_lengths(base, length * uneven, length / uneven)


def rigidities(fabric: Fabric, found: BendingEstimate, support: float) -> tuple[float, float]:
    """Bending rigidities B along warp and weft [gf cm2/cm]."""
    length, uneven = support * float(np.exp(found.length)), float(np.exp(0.5 * found.anisotropy))
    unit = fabric.weight * GRAVITY / KES_BENDING
    return unit * (length * uneven) ** 3, unit * (length / uneven) ** 3


def _doubts(
    drapes: Drapes, coefficients: np.ndarray, simulated: Sequence[SimulatedDrape], outlines: Sequence[Outline]
) -> tuple[str, ...]:
    notes = []
    if len(coefficients) > 1 and float(np.ptp(coefficients)) > FABRIC_SPREAD:
        notes.append(f"the drapes are {np.ptp(coefficients):.0f} points apart: is it one fabric?")
    coefficient = float(np.mean(coefficients))
    low, high = float(drapes.coefficient[0]), float(drapes.coefficient[-1])
    if coefficient < low + 4.0:
        notes.append("so limp a cloth drapes alike whatever its bending: use a smaller disc to tell it")
    if coefficient > high - 3.0:
        notes.append("so stiff a cloth hardly drapes: use a larger disc to tell its bending")
    for number, (each, outline) in enumerate(zip(simulated, outlines, strict=False), start=1):
        if abs(each.outline.folds - outline.folds) > FOLDS_APART:
            notes.append(f"drape {number} shows {outline.folds} folds, simulated {each.outline.folds}")
    return tuple(notes)


def apart(measured: Outline, simulated: Outline) -> float:
    """How far two outlines are apart, rms over the angle, in support radii."""
    return float(np.sqrt(np.mean((measured.radius - simulated.radius) ** 2)))

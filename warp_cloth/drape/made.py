"""A fabric made from drapes: the table's estimate, then that of drapes simulated as photographed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warp_cloth.drape.outline import ANGLES, Outline
from warp_cloth.drape.reading import DrapeReading, Setting
from warp_cloth.drape.refine import Measured, fabric_of, refined, starts_of
from warp_cloth.drape.simulated import SimulatedDrape, random_start
from warp_cloth.drape.table import (
    KNOWN_CLASS,
    UNKNOWN_CLASS,
    BendingEstimate,
    Drapes,
    drapes_of_ratio,
    spread_again,
)
from warp_cloth.material.fabric import Fabric
from warp_cloth.material.laboratory import GRAVITY, KES_BENDING

STARTING_WAVE = 4e-3  # [m], at the rim, of a disc that is to fall into a counted number of folds
FABRIC_SPREAD = 20.0  # [points]; measured fabrics draped again stay within
FOLDS_APART = 2.0  # a number of folds farther than this from the simulated one is reported


@dataclass(frozen=True, eq=False)
class MadeFabric:
    """A fabric and how well it is known."""

    fabric: Fabric
    estimate: BendingEstimate
    coefficient: float  # measured, mean [%]
    again: float  # standard deviation of a real fabric's coefficient when it is draped again [points]
    again_error: float  # what that makes of the mean bending rigidity, relative; one standard deviation
    simulated: Mapping[int, SimulatedDrape]  # of the fabric, by the photographs' numbers
    notes: tuple[str, ...]

    @property
    def rigidity_errors(self) -> tuple[float, float]:
        """Relative standard deviations of the mean bending rigidity B, and of that along warp or weft."""
        one = np.hypot(self.estimate.length_error, 0.5 * self.estimate.anisotropy_error)
        return 3.0 * self.estimate.length_error, 3.0 * float(one)


@dataclass(frozen=True)
class _Simulation:
    """How drapes are simulated."""

    device: str
    rest_error: float  # [ln of the bending length]
    progress: Callable[[str], None]


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

    ``refine`` False takes the table's estimate, whose cloth has one stretch and one shear, whatever the base's.
    ``rest_error`` [ln of the bending length] is what the base's stretch and shear may be off.

    Raises:
        InputError: no cloth drapes so.
    """
    outlines = [reading.outline for reading in readings]
    measured = Measured(
        np.array([reading.coefficient for reading in readings]),
        np.array([reading.error for reading in readings]),
        np.array([outline.elongation for outline in outlines]),
        starts_of(outlines, setting.ratio),
        str(readings[0].photograph.path),
    )
    simulation = _Simulation(device, rest_error, progress) if refine else None
    return _made(measured, base, setting, simulation, outlines)


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
    turn = 2.0 * np.pi * np.arange(ANGLES) / ANGLES
    starts = [random_start(seed) for seed in range(2)]
    if folds is not None:
        starts = [STARTING_WAVE * np.cos(folds * turn + phase) for phase in (0.0, 0.5)]
    measured = Measured(np.array([coefficient]), np.array([0.0]), None, dict(enumerate(starts)), "--drape-coefficient")
    made = _made(measured, base, setting, _Simulation(device, rest_error, progress))
    shown = float(np.mean([drape.outline.folds for drape in made.simulated.values()]))
    if folds is None or abs(shown - folds) <= FOLDS_APART:
        return made
    told = f"{folds} folds were counted, {shown:.0f} were simulated: check the sizes of disc and support"
    return replace(made, notes=(*made.notes, told))


def _made(
    measured: Measured,
    base: Fabric,
    setting: Setting,
    simulation: _Simulation | None,
    outlines: Sequence[Outline] = (),
) -> MadeFabric:
    """``simulation`` None: by the table alone; ``outlines`` of the photographs, to compare with."""
    drapes = drapes_of_ratio(setting.ratio)
    found, simulated = measured.estimate(drapes, UNKNOWN_CLASS), dict[int, SimulatedDrape]()
    if simulation is not None:
        found, simulated = refined(found, measured, drapes, base, setting, **vars(simulation))
    fabric, coefficient = fabric_of(base, found, setting), float(measured.coefficients.mean())
    again = spread_again(coefficient)
    again_error = 3.0 * again / len(measured.coefficients) ** 0.5 / drapes.slope(found.length)
    notes = _doubts(drapes, measured.coefficients, simulated, outlines)
    return MadeFabric(fabric, found, coefficient, again, again_error, simulated, notes)


def rigidities(fabric: Fabric, found: BendingEstimate, support: float) -> tuple[float, float]:
    """Bending rigidities B along warp and weft [gf cm2/cm]."""
    warp, weft = found.bending_lengths(support)
    unit = fabric.weight * GRAVITY / KES_BENDING
    return unit * warp**3, unit * weft**3


def _doubts(
    drapes: Drapes, coefficients: np.ndarray, simulated: Mapping[int, SimulatedDrape], outlines: Sequence[Outline]
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
    for number, each in simulated.items():
        if outlines and abs(each.outline.folds - outlines[number].folds) > FOLDS_APART:
            notes.append(f"drape {number + 1} shows {outlines[number].folds} folds, simulated {each.outline.folds}")
    return tuple(notes)


def apart(measured: Outline, simulated: Outline) -> float:
    """How far two outlines are apart, rms over the angle, in support radii."""
    return float(np.sqrt(np.mean((measured.radius - simulated.radius) ** 2)))

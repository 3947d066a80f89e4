"""Conversion of textile laboratory figures (KES-F, FAST, ISO 9073-7) to a Fabric in SI."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from warp_cloth.base.errors import InputError

GRAVITY = 9.80665  # standard gravity [m/s2]
KES_FORCE = 490.3325  # [N/m], 500 gf/cm: the force per width at which KES-F reads the elongation EMT
KES_BENDING = 9.80665e-5  # [N m], 1 gf cm2/cm: the unit of KES-F's bending rigidity B
KES_HYSTERESIS = 9.80665e-3  # [N], 1 gf cm/cm: the unit of 2HB, the width of KES-F's bending loop
KES_SHEAR = 0.980665 / math.radians(1.0)  # [N/m per radian], 1 gf/(cm degree): the unit of KES-F's shear stiffness G
KES_SHEAR_HYSTERESIS = 0.980665  # [N/m], 1 gf/cm: the unit of 2HG, the width of KES-F's shear loop at half a degree
FAST_FORCE = 5 * 0.980665  # [N/m], 5 gf/cm: FAST reads the extension at this and at four times this
FAST_SHEAR = 123.0  # [N/m per radian] over EB5 [%], the bias extension at 5 gf/cm (SiroFAST manual)

# The cosine law's moment per width is bending * curvature^2 / 2, the measured line's B * curvature. They meet at one
# curvature only: where the cloth's own weight folds it. That goes with its bending length c = (B / weight)^(1/3), so
# that cloths of one c fold alike, whatever they are. At this curvature times c the cantilever test (ISO 9073-7), whose
# reading is c, reads the same on both.
MATCHED_FOLD = 0.8327
# The yarns' shear force per width is shear * angle^2. KES-F reads G as the slope between 0.5 and 2.5 degrees, and
# the slope of a square between two angles is its factor times their sum.
MATCHED_SHEAR_ANGLE = math.radians(0.5 + 2.5)

EDGES = "edges"  # a shear that is no figure: what the mesh's edges happen to resist

Point = tuple[float, float]


@dataclass(frozen=True)
class Figure:
    """One laboratory figure: which values of a Fabric it states, how, and within which bounds."""

    states: tuple[str, ...]
    unit: str
    bounds: tuple[float, float]
    convert: Callable[[float], float]


def stretch_of_emt(percent: float) -> float:
    """K [N/m] of F/w = K e^2 from the elongation at 500 gf/cm [%]."""
    return KES_FORCE / (percent * 1e-2) ** 2


def bending_length(rigidity: float, weight: float) -> float:
    """Bending length c [m] of a cloth from its rigidity B [N m] and its weight [kg/m2] (ISO 9073-7)."""
    return (rigidity / (weight * GRAVITY)) ** (1.0 / 3.0)


def bending_of_rigidity(rigidity: float, weight: float) -> float:
    """The cosine law's constant [N m2] from a bending rigidity B [N m]: it meets the line at MATCHED_FOLD / c."""
    return 2.0 * rigidity * bending_length(rigidity, weight) / MATCHED_FOLD


def rigidity_of_bending(bending: float, weight: float) -> float:
    """The bending rigidity B [N m] that the cosine law's constant [N m2] stands for."""
    return (0.5 * MATCHED_FOLD * bending) ** 0.75 * (weight * GRAVITY) ** 0.25


def shear_of_stiffness(stiffness: float) -> float:
    """The yarns' shear constant [N/m] from a shear stiffness G [N/m per radian]."""
    return stiffness / MATCHED_SHEAR_ANGLE


def friction_of_hysteresis(width: float) -> float:
    """Moment per width that friction resists [N], from the width 2HB of the loop [gf cm/cm]: half of it each way."""
    return 0.5 * width * KES_HYSTERESIS


def shear_friction_of_hysteresis(width: float) -> float:
    """Force per width that friction resists as yarns are sheared [N/m], from 2HG [gf/cm]: half of it each way."""
    return 0.5 * width * KES_SHEAR_HYSTERESIS


_HYSTERESIS = ("gf cm/cm", (0.0, 1e3), friction_of_hysteresis)
_EMT = ((0.05, 300.0), stretch_of_emt)
_MM = ((0.0, 50.0), lambda value: value * 1e-3)

FIGURES: Mapping[str, Figure] = MappingProxyType(
    {
        "weight_gsm": Figure(("weight",), "g/m2", (1.0, 1e5), lambda value: value * 1e-3),
        "emt_percent": Figure(("stretch_warp", "stretch_weft"), "% at 500 gf/cm", *_EMT),
        "emt_warp_percent": Figure(("stretch_warp",), "% at 500 gf/cm", *_EMT),
        "emt_weft_percent": Figure(("stretch_weft",), "% at 500 gf/cm", *_EMT),
        "shear_G": Figure(
            ("shear",), "gf/(cm degree)", (1e-4, 1e4), lambda value: shear_of_stiffness(value * KES_SHEAR)
        ),
        "bias_extension_percent": Figure(
            ("shear",), "% at 5 gf/cm", (0.01, 300.0), lambda value: shear_of_stiffness(FAST_SHEAR / value)
        ),
        "bending_hysteresis_2HB": Figure(("bending_friction_warp", "bending_friction_weft"), *_HYSTERESIS),
        "bending_hysteresis_2HB_warp": Figure(("bending_friction_warp",), *_HYSTERESIS),
        "bending_hysteresis_2HB_weft": Figure(("bending_friction_weft",), *_HYSTERESIS),
        "shear_hysteresis_2HG": Figure(("shear_friction",), "gf/cm", (0.0, 1e3), shear_friction_of_hysteresis),
        "thickness_mm": Figure(("thickness",), "mm", *_MM),
    }
)
TABLES: Mapping[str, str] = MappingProxyType({"tension_warp": "stretch_warp", "tension_weft": "stretch_weft"})
RIGIDITIES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "bending_B": ("bending_warp", "bending_weft"),
        "bending_B_warp": ("bending_warp",),
        "bending_B_weft": ("bending_weft",),
    }
)
LENGTHS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "bending_length_mm": ("bending_warp", "bending_weft"),
        "bending_length_warp_mm": ("bending_warp",),
        "bending_length_weft_mm": ("bending_weft",),
    }
)
FORMABILITIES: Mapping[str, str] = MappingProxyType(
    {"formability_warp": "stretch_warp", "formability_weft": "stretch_weft"}
)
SHORTHAND: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {"stretch": ("stretch_warp", "stretch_weft"), "bending": ("bending_warp", "bending_weft")}
)
KEYS = (*FIGURES, *RIGIDITIES, *TABLES, *LENGTHS, *FORMABILITIES, *SHORTHAND)


def stated_by(key: str) -> tuple[str, ...]:
    """The values of a Fabric that a key of its table states."""
    if key in FIGURES:
        return FIGURES[key].states
    if key in TABLES:
        return (TABLES[key],)
    if key in FORMABILITIES:
        return (FORMABILITIES[key],)
    return {**SHORTHAND, **RIGIDITIES, **LENGTHS}.get(key, (key,))


def si_values(table: Mapping[str, Any], weight: float) -> dict[str, Any]:
    """A fabric's table with every laboratory figure and shorthand replaced by the SI values that it states.

    ``weight`` [kg/m2], which bending figures need, counts where the table states none. A shear of "edges" is None.

    Raises:
        InputError: placed at the key that is wrong.
    """
    values: dict[str, Any] = {}
    stated: dict[str, str] = {}

    def state(key: str, name: str, value: Any) -> None:
        if name in stated:
            raise InputError(key, f"states the same value as {stated[name]}", "give one of them")
        stated[name], values[name] = key, value

    bent = {key: value for key, value in table.items() if key in RIGIDITIES or key in LENGTHS}
    for key, value in table.items():
        result = value
        if key in bent or key in FORMABILITIES:
            continue
        if key in FIGURES:
            result = FIGURES[key].convert(_number(key, value, FIGURES[key].bounds, FIGURES[key].unit))
        elif key in TABLES:
            result = stretch_of_table(key, value)
        elif key == "shear" and value == EDGES:
            result = None
        for name in stated_by(key):
            state(key, name, result)
    heavy = values.get("weight", weight)
    if not isinstance(heavy, int | float) or not heavy > 0.0:
        heavy = weight  # it will be refused; what bends it matters no more
    for key, value in bent.items():
        for name in stated_by(key):
            state(key, name, bending_of_rigidity(_rigidity(key, value, heavy), heavy))
    for key in (each for each in FORMABILITIES if each in table):
        state(key, FORMABILITIES[key], _stretch_of_formability(key, table[key], values, heavy))
    return values


def _stretch_of_formability(key: str, value: Any, values: Mapping[str, Any], weight: float) -> float:
    """K [N/m] from FAST's formability F [mm2] = (E20 - E5) B / 14.7, E in % at 20 and 5 gf/cm, B in uN m.

    At four times the force a quadratic law stretches twice as far: E20 - E5 = E5, and K = FAST_FORCE / E5^2.
    """
    formability = _number(key, value, (1e-4, 1e3), "mm2")
    bending = values.get(FORMABILITIES[key].replace("stretch", "bending"))
    if not isinstance(bending, float) or not bending > 0.0:
        direction = FORMABILITIES[key].rpartition("_")[2]
        remedy = f"give bending_length_{direction}_mm or bending_B_{direction}"
        raise InputError(key, "needs the bending of the same direction, too", remedy)
    extension = 14.7 * formability / (1e6 * rigidity_of_bending(bending, weight))  # [%]
    return FAST_FORCE / (1e-2 * extension) ** 2


def _rigidity(key: str, value: Any, weight: float) -> float:
    """B [N m] that a rigidity or a bending length states."""
    if key in RIGIDITIES:
        return _number(key, value, (0.0, 1e3), "gf cm2/cm") * KES_BENDING
    return weight * GRAVITY * (_number(key, value, (0.1, 1e3), "mm") * 1e-3) ** 3  # ISO 9073-7


def stretch_of_table(key: str, table: Any) -> float:
    """K [N/m] that fits measured pairs of elongation [%] and force per width [N/m] best, by least squares in force."""
    pairs = _pairs(key, table)
    squares = [((percent * 1e-2) ** 2, force) for percent, force in pairs]
    return sum(square * force for square, force in squares) / sum(square**2 for square, _ in squares)


def _pairs(key: str, table: Any) -> list[Point]:
    problem = "must be a list of [elongation in %, force in N/m] pairs, all positive"
    rows: Sequence[Any] = table if isinstance(table, list | tuple) else ()
    pairs: list[Point] = []
    for row in rows:
        if not isinstance(row, list | tuple) or len(row) != 2:
            raise InputError(key, problem)
        numbers = [_number(key, value, (1e-3, 1e6), "% and N/m") for value in row]
        pairs.append((numbers[0], numbers[1]))
    if not pairs:
        raise InputError(key, problem, "for instance [[1, 20], [3, 180], [5, 490]]")
    return pairs


def _number(key: str, value: Any, bounds: tuple[float, float], unit: str) -> float:
    low, high = bounds
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not low <= value <= high:
        shown = f'"{value}"' if isinstance(value, str) else repr(value)[:60]
        raise InputError(key, f"must be a number from {low:g} to {high:g} [{unit}], not {shown}")
    return float(value)

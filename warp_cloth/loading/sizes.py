"""The length unit of a mesh: as the scene states, as its file declares, or guessed from its size."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.units import LENGTH_UNITS, METRES_PER, LengthUnit
from warp_cloth.loading.raw import Floats, Role, counted

# Largest extent [m] of garments and bodies: from a hat and a baby to a gown and a giant; and with a bridal train, which
# is guessed only where no unit gives a usual size (400 is a child's shirt in millimetres).
USUAL: dict[Role, tuple[float, float]] = {"garment": (0.2, 3.5), "avatar": (0.3, 3.5)}
PLAUSIBLE: dict[Role, tuple[float, float]] = {"garment": (0.2, 6.0), "avatar": (0.3, 3.5)}
# Of what is worn on a hand, the head or the neck; guessed only where no unit gives a larger garment.
SMALL: dict[Role, tuple[float, float]] = {"garment": (0.08, 0.2), "avatar": PLAUSIBLE["avatar"]}
# Largest extent [m] accepted where the unit is stated: dolls and curtains are possible, houses are not.
POSSIBLE: dict[Role, tuple[float, float]] = {"garment": (0.01, 20.0), "avatar": (0.05, 20.0)}
# The first of these that gives a usual size is guessed; inches only where panels show them, or no other unit fits.
GUESSED: tuple[LengthUnit, ...] = ("m", "cm", "mm")
SAME_LENGTH = 0.01  # within which panels and mesh have the same lengths: those of a worn T-shirt differ by 0.15 %
LAST: tuple[LengthUnit, ...] = ("in",)  # of garments: 6 to 8 are a glove or a hat, no gown of 7 m
MAYBE_INCHES: dict[Role, tuple[float, float]] = {"garment": (20.0, 40.0), "avatar": (40.0, 80.0)}  # small in cm

# Vertices so many times farther from the middle than all but this fraction belong to no garment or body.
STRAY, FEW = 20.0, 0.01

FARTHEST = 1000.0  # [m] from the origin; there float32, as files store points, has steps of 0.06 mm

GUESS_NOTE = "units not stated"  # start of every note about a guess
# Largest extent of the garment over the avatar's, from a glove to a train. Wide where both units are stated.
RATIO, WIDE_RATIO = (0.05, 1.6), (0.01, 20.0)
SAME_UNIT_RATIO = (0.02, 5.0)  # both guessed alike: an error concerns both
STATED_RATIO, PERSON = (0.05, 5.0), (1.4, 2.1)  # of a garment of stated unit, on an avatar as tall as people are [m]
ACROSS = 2.0  # of its second largest extent, if more than STATED_RATIO: gathered skirts are made of strips that long
GAP, WIDE_GAP = 0.25, 2.0  # between the two bounding boxes, over the avatar's extent


@dataclass(frozen=True)
class UnitChoice:
    """Unit of a mesh, its length in metres, and a note if it was guessed or overrides the file."""

    name: str
    metres: float
    notes: tuple[str, ...] = ()


def choose_unit(
    points: Floats,
    *,
    file: str,
    role: Role,
    key: str,
    stated: LengthUnit | None,
    declared: float | None,
    scale: float = 1.0,
    texture_scale: Callable[[], float | None] = lambda: None,
) -> UnitChoice:
    """Unit of the vertices in use, ``points`` [file unit], shape [V, 3], whose lengths are then times ``scale``.

    ``texture_scale``: units of texture space per unit of length, if the file shows it. Where no unit gives a possible
    size, texture coordinates in a unit that does are taken for panels: files are scaled where they are not.

    Raises:
        InputError: no unit gives the mesh a possible size.
    """
    with np.errstate(over="ignore"):
        extent = float(np.ptp(points, axis=0).max()) * scale
    if extent == 0.0:
        raise InputError(file, "all vertices are at one point", "export the mesh again")
    scaled = f" times {key}.scale" if scale != 1.0 else ""
    if stated is not None or declared is not None:
        metres = METRES_PER[stated] if stated is not None else float(declared or 0.0)
        name = stated if stated is not None else _unit_name(metres)
        if not _fits(extent * metres, POSSIBLE[role]):
            _refuse_strays(points, file)
        source = f'{key}.units = "{stated}"' if stated is not None else f"its declared unit ({name})"
        _refuse_impossible(extent, metres, name, file=file, role=role, key=key, source=source + scaled)
        overruled = stated is not None and declared is not None and not np.isclose(metres, declared)
        note = f'units = "{name}" overrides the file, which declares {_unit_name(declared or 0.0)}'
        return UnitChoice(name, metres, (note,) if overruled else ())
    fitting = [
        unit for sizes in (USUAL, PLAUSIBLE) for unit in GUESSED if _fits(extent * METRES_PER[unit], sizes[role])
    ]
    if not fitting:
        _refuse_strays(points, file)
        if role == "garment" and scale == 1.0 and (shown := _unit_of_panels(extent, texture_scale(), role)) is not None:
            return shown
        fitting = [unit for unit in GUESSED if _fits(extent * METRES_PER[unit], SMALL[role])]
        if role == "garment" and not fitting:
            fitting = [unit for unit in LAST if is_usual_size(role, extent * METRES_PER[unit])]
    if not fitting:
        low, high = SMALL[role][0], PLAUSIBLE[role][1]
        wanted = f"{_a(role)} of {low:g} to {high:g} m"
        problem = f"units not stated, and with an extent{scaled} of {extent:.4g} no unit gives {wanted}"
        remedy = _possible_units(extent, role, key) or _rescaling(extent, role, key)
        raise InputError(file, problem, remedy)
    unit = fitting[0]
    if _fits(extent, MAYBE_INCHES[role]) and role == "garment" and scale == 1.0 and _is_in_inches(texture_scale()):
        note = f"{GUESS_NOTE}: inches assumed, as the panels in texture space have the lengths that the mesh has then"
        return UnitChoice("in", METRES_PER["in"], (note,))
    note = f"{GUESS_NOTE}: {_PLURALS[unit]} assumed, as the largest extent{scaled} is {extent:.4g}"
    if _fits(extent, MAYBE_INCHES[role]):
        note += f' (if it is in inches, set {key}.units = "in")'
    return UnitChoice(unit, METRES_PER[unit], (note,))


def _unit_of_panels(extent: float, texture_scale: float | None, role: Role) -> UnitChoice | None:
    """The unit of a mesh of this extent [file unit] whose texture coordinates are panels; None: they are not."""
    if texture_scale is None:
        return None
    for unit in GUESSED:
        metres = METRES_PER[unit] * texture_scale
        if _fits(extent * metres, USUAL[role]):
            note = f"{GUESS_NOTE}: taken times {metres:.4g}, as its panels in texture space are in {_PLURALS[unit]}"
            return UnitChoice(_unit_name(metres), metres, (note,))
    return None


def _is_in_inches(texture_scale: float | None) -> bool:
    """Whether panels in texture space, in a metric unit, are as long as a mesh in inches."""
    lengths = [METRES_PER[unit] * (texture_scale or 0.0) for unit in GUESSED]  # of the mesh's unit [m]
    return bool(np.isclose(lengths, METRES_PER["in"], rtol=SAME_LENGTH, atol=0.0).any())


_PLURALS: dict[str, str] = {"m": "metres", "cm": "centimetres", "mm": "millimetres", "in": "inches"}


def _a(role: Role) -> str:
    return "an avatar" if role == "avatar" else "a garment"


def _unit_name(metres: float) -> str:
    return next((unit for unit in LENGTH_UNITS if np.isclose(METRES_PER[unit], metres, rtol=1e-4)), f"{metres:g} m")


def _fits(value: float, bounds: tuple[float, float]) -> bool:
    return bounds[0] <= value <= bounds[1]


def is_usual_size(role: Role, extent: float) -> bool:
    """Whether a mesh is usually so large [m], from the smallest to the largest that are."""
    return _fits(extent, (SMALL[role][0], PLAUSIBLE[role][1]))


def _likely_unit(extent: float, role: Role, *, other_than: str = "") -> LengthUnit | None:
    """The first unit, metres first, in which an extent is plausible."""
    fitting = (unit for unit in LENGTH_UNITS if unit != other_than)
    return next((unit for unit in fitting if _fits(extent * METRES_PER[unit], PLAUSIBLE[role])), None)


def _possible_units(extent: float, role: Role, key: str) -> str:
    """The units that make an unusual extent possible, as a remedy; empty without any."""
    units = [unit for unit in LENGTH_UNITS if _fits(extent * METRES_PER[unit], POSSIBLE[role])]
    values = " or ".join(f'"{unit}" ({_length(extent * METRES_PER[unit])})' for unit in units)
    return f"if that size is intended, set {key}.units = {values}" if units else ""


def _rescaling(extent: float, role: Role, key: str) -> str:
    """Remedy for an extent that no unit makes possible: scaling to metres by a power of ten."""
    low, high = PLAUSIBLE[role]
    extent = min(max(extent, 1e-300), 1e300)  # beyond these the factor itself would overflow
    factor = 10.0 ** round(math.log10(math.sqrt(low * high) / extent))
    return f'scale the mesh by {factor:g}, to {_length(extent * factor)}, and set {key}.units = "m"'


def _length(metres: float) -> str:
    if metres >= 1.0 or metres == 0.0:
        return f"{metres:.3g} m"
    return f"{100 * metres:.3g} cm" if metres >= 0.01 else f"{1000 * metres:.3g} mm"


def _refuse_strays(points: Floats, file: str) -> None:
    """Refuses a mesh whose extent is due to a few stray vertices."""
    with np.errstate(over="ignore"):
        away = np.abs(points - np.median(points, axis=0)).max(axis=1)
        strays = away / STRAY > np.quantile(away, 1.0 - FEW)
    if strays.any():
        x, y, z = points[np.argmax(away)]
        problem = f"{counted(int(strays.sum()), 'vertex')} far from all others, the farthest at ({x:g}, {y:g}, {z:g})"
        raise InputError(file, problem, "remove them in the modelling tool")


def _refuse_impossible(
    extent: float, metres: float, name: str, *, file: str, role: Role, key: str, source: str
) -> None:
    if _fits(extent * metres, POSSIBLE[role]):
        return
    problem = f"is {_length(extent * metres)} across with {source}: not a possible {role}"
    likely = _likely_unit(extent, role, other_than=name)
    if likely is None:
        raise InputError(file, problem, _rescaling(extent, role, key))
    raise InputError(file, problem, f'its numbers look like {_PLURALS[likely]}: set {key}.units = "{likely}"')


def refuse_far(points: Floats, file: str) -> None:
    """Refuses a mesh so far from the origin that float32 results would lose more than 0.1 mm; ``points`` [m]."""
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    away = float(np.abs(middle).max())
    if away > FARTHEST:
        x, y, z = middle
        problem = f"lies {away / 1000:,.3g} km from the origin, at ({x:g}, {y:g}, {z:g}) m"
        raise InputError(file, problem, "move garment and avatar to the origin: float32 is too coarse there")


def was_guessed(mesh: Mesh) -> bool:
    """Whether the mesh's unit was guessed from its size."""
    return any(note.startswith(GUESS_NOTE) for note in mesh.notes)


def check_sizes(garments: Sequence[tuple[str, Mesh]], avatar: Mesh | None) -> None:
    """Refuses garments whose size or place does not fit the avatar; with closer bounds where a unit was guessed.

    Args:
        garments: scene key ("garment", "garment[1]") and mesh of each.
        avatar: None: nothing is checked.

    Raises:
        InputError: a garment does not fit, with the unit that would.
    """
    if avatar is None:
        return
    for key, garment in garments:
        if is_of_fitting_size(garment, avatar):
            continue
        ratio, gap = _fit_of(garment, avatar, 1.0, 1.0)
        extent_g, extent_a = _extent(garment), _extent(avatar)
        if not _fits(ratio, _bounds(garment, avatar)[0]):
            problem = f"is {_length(extent_g)} across, which does not fit an avatar of {_length(extent_a)}"
        else:
            problem = f"is {_length(gap * extent_a)} away from the avatar, which is {_length(extent_a)} across"
        problem += f" (garment in {_origin(garment)}, avatar in {_origin(avatar)})"
        raise InputError(f'{key} "{garment.name}"', problem, _remedy(key, garment, avatar))


def is_of_fitting_size(garment: Mesh, avatar: Mesh) -> bool:
    """Whether a garment's size and place fit the avatar; with closer bounds where a unit was guessed."""
    ratio_bounds, gap_bound = _bounds(garment, avatar)
    ratio, gap = _fit_of(garment, avatar, 1.0, 1.0)
    return _fits(ratio, ratio_bounds) and gap <= gap_bound


def lies_apart(key: str, garment: Mesh, avatar: Mesh) -> bool:
    """Whether a garment of a fitting size lies too far from the avatar, and so it would in any unit."""
    ratio_bounds, gap_bound = _bounds(garment, avatar)
    ratio, gap = _fit_of(garment, avatar, 1.0, 1.0)
    return _fits(ratio, ratio_bounds) and gap > gap_bound and not fitting_reading(key, garment, avatar)


def _bounds(garment: Mesh, avatar: Mesh) -> tuple[tuple[float, float], float]:
    """Bounds of the garment's extent and of its distance, relative to the avatar's extent."""
    guess_g, guess_a = was_guessed(garment), was_guessed(avatar)
    if guess_g and guess_a and garment.unit == avatar.unit:
        return SAME_UNIT_RATIO, WIDE_GAP
    if guess_a and not guess_g and _fits(_extent(avatar), PERSON):
        strip = _extent(garment, second=True) <= ACROSS * _extent(avatar)
        most = WIDE_RATIO[1] if strip else STATED_RATIO[1]  # a gown is wider than two people are tall
        return (STATED_RATIO[0], most), GAP
    return (RATIO, GAP) if guess_g or guess_a else (WIDE_RATIO, WIDE_GAP)


def _origin(mesh: Mesh) -> str:
    return f"{mesh.unit}, {'guessed' if was_guessed(mesh) else 'stated'}"


def _extent(mesh: Mesh, *, second: bool = False) -> float:
    """The largest extent, or the second largest one [m]."""
    low, high = mesh.bounds()
    return float(np.sort(high - low)[-2 if second else -1])


def _fit_of(garment: Mesh, avatar: Mesh, scale_g: float, scale_a: float, *, stand: str = "") -> tuple[float, float]:
    """Extent of the garment and gap between the bounding boxes, if scaled, relative to the avatar's extent.

    ``stand``, "garment" or "avatar", is rotated from z up to y up first.
    """
    (low_g, high_g), (low_a, high_a) = (
        _stood_up(*mesh.bounds()) if role == stand else mesh.bounds()
        for role, mesh in (("garment", garment), ("avatar", avatar))
    )
    extent = float((high_a - low_a).max()) * scale_a
    gap = float(max((low_g * scale_g - high_a * scale_a).max(), (low_a * scale_a - high_g * scale_g).max(), 0.0))
    return float((high_g - low_g).max()) * scale_g / extent, gap / extent


def _stood_up(low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """A bounding box rotated from z up to y up."""
    return np.array([low[0], low[2], -high[1]]), np.array([high[0], high[2], -low[1]])


def fitting_reading(key: str, garment: Mesh, avatar: Mesh) -> dict[str, str]:
    """Scene keys of units and up axes in which garment and avatar fit, guessed ones first; {} without any.

    One unit is changed, and where need be one of the two, of a format without an up axis, stands up.
    """
    options: list[tuple[bool, str, LengthUnit, float, float]] = []
    for unit in LENGTH_UNITS:
        if unit != garment.unit:
            scale = METRES_PER[unit] / METRES_PER.get(garment.unit, 1.0)  # type: ignore[call-overload]
            options.append((was_guessed(garment), key, unit, scale, 1.0))
        if unit != avatar.unit:
            scale = METRES_PER[unit] / METRES_PER.get(avatar.unit, 1.0)  # type: ignore[call-overload]
            options.append((was_guessed(avatar), "avatar", unit, 1.0, scale))
    options.sort(key=lambda option: not option[0])
    lying = _may_lie(key, garment, avatar)
    for stand, standing in (("", ""), *lying):
        for _, name, unit, scale_g, scale_a in options:
            ratio, gap = _fit_of(garment, avatar, scale_g, scale_a, stand=stand)
            sane = is_usual_size("garment", _extent(garment) * scale_g)
            sane = sane and _fits(_extent(avatar) * scale_a, PLAUSIBLE["avatar"])
            if sane and _fits(ratio, RATIO) and gap <= (0.0 if stand else GAP):
                return {f"{name}.units": unit, **({f"{standing}.up": "z"} if stand else {})}
    return {}


def _may_lie(key: str, garment: Mesh, avatar: Mesh) -> list[tuple[str, str]]:
    """Role and key of what may have z up: only formats without an up axis have guessed units."""
    meshes = ("garment", key, garment), ("avatar", "avatar", avatar)
    return [(role, name) for role, name, mesh in meshes if was_guessed(mesh)]


def _remedy(key: str, garment: Mesh, avatar: Mesh) -> str:
    """The unit and the up axis that make garment and avatar fit."""
    reading = fitting_reading(key, garment, avatar)
    if reading:
        (name, unit), *standing = reading.items()
        also = "".join(f', and z up: set {place} = "z"' for place, _ in standing)
        return f'likely {_PLURALS[unit]}: set {name} = "{unit}"{also}'
    for role, name in _may_lie(key, garment, avatar):
        if _fit_of(garment, avatar, 1.0, 1.0, stand=role)[1] == 0.0:
            return f'if its file is z up, set {name}.up = "z"; or place the garment round the avatar: {key}.translate'
    pairs = ((key, garment), ("avatar", avatar))
    meant = " and ".join(f'{name}.units = "{mesh.unit}"' for name, mesh in pairs if was_guessed(mesh))
    sizes = f"if these sizes are meant, set {meant}; or " if meant else ""
    return f"{sizes}place the garment round the avatar: {key}.translate"

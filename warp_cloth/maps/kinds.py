"""The kinds of fit map: name, unit, and how each is coloured."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.arguments import strings
from warp_cloth.base.errors import InputError

SHOWN_PERCENTILE = 98.0  # upper end of the colours; the few vertices beyond would hide all others
NICE_STEPS = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)  # ends of a colour range, times a power of ten


@dataclass(frozen=True)
class MapKind:
    """A kind of map, which has a value per vertex."""

    name: str  # of the primvar
    unit: str
    label: str  # in pictures
    signed: bool  # coloured symmetrically about zero; otherwise from zero up
    about: str
    needs_avatar: bool = False
    needs_warp: bool = False  # requires the direction of the warp in the garment
    least_range: float = 1e-3  # of the colours, at least


_KINDS = (
    MapKind("strain", "1", "largest strain", False, "largest principal strain of the cloth"),
    MapKind("strain_warp", "1", "strain along the warp", True, "strain along the warp", needs_warp=True),
    MapKind("strain_weft", "1", "strain along the weft", True, "strain along the weft", needs_warp=True),
    MapKind("strain_bias", "1", "strain along the bias", True, "larger strain of both biases", needs_warp=True),
    MapKind(
        "shear", "degree", "shear angle", True, "change of the angle between warp and weft", needs_warp=True,
        least_range=1.0,
    ),
    MapKind(
        "pressure", "kPa", "pressure on the body", False, "contact force on the avatar over area", needs_avatar=True,
        least_range=0.01,
    ),
    MapKind(
        "gap", "mm", "distance to the skin", False, "exact distance to the avatar's surface, negative inside",
        needs_avatar=True, least_range=5.0,
    ),
)  # fmt: skip

MAPS: Mapping[str, MapKind] = MappingProxyType({kind.name: kind for kind in _KINDS})
EASE_HINT = 'ease is the difference of girths, which every report has; the distance to the skin is "gap": '
GROUPS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "strain": ("strain", "strain_warp", "strain_weft", "strain_bias", "shear"),
        "all": tuple(MAPS),
    }
)


def chosen_maps(text: str | Sequence[str], *, place: str = "maps") -> tuple[str, ...]:
    """Names of maps from "strain,pressure,gap"; "strain" stands for all strains and the shear angle, "all" for all."""
    requested = [name.strip() for part in strings(text, place) for name in part.split(",")]
    names: dict[str, None] = {}
    for name in filter(None, requested):
        if name not in MAPS and name not in GROUPS:
            close = [] if name == "ease" else difflib.get_close_matches(name, [*MAPS, *GROUPS], n=1)
            hint = f'did you mean "{close[0]}"? ' if close else EASE_HINT if name == "ease" else ""
            raise InputError(place, f'there is no map "{name}"', f"{hint}choose from {', '.join([*MAPS, 'all'])}")
        names.update(dict.fromkeys(GROUPS.get(name, (name,))))
    return tuple(names)


def chosen_colour(text: str, *, place: str) -> str:
    """The map that colours a stage; empty for none."""
    if not isinstance(text, str):
        raise InputError(
            place, f"must be the name of a map, not {type(text).__name__}", "pass one name, or an empty string"
        )
    if text.strip() == "all" or len([name for name in text.split(",") if name.strip()]) > 1:
        raise InputError(place, f'"{text}" names several maps', "choose one")
    return next(iter(chosen_maps(text, place=place)), "")


def difference_of(kind: MapKind) -> MapKind:
    """The map of a difference between two fits."""
    label = f"difference in {kind.label}"
    return replace(kind, name=f"{kind.name}_difference", label=label, signed=True, about=label)


def kind_named(name: str) -> MapKind | None:
    """The map of this name, or the difference of maps of this name; None if the field is no map."""
    base = MAPS.get(name.removesuffix("_difference"))
    return base if base is None or base.name == name else difference_of(base)


def shown_range(kind: MapKind, values: Sequence[NDArray[np.floating]]) -> tuple[float, float]:
    """Range of a map's colours, with round ends; one range for all arrays."""
    joined = np.concatenate([np.ravel(array) for array in values]) if len(values) else np.zeros(1)
    top = float(np.percentile(np.abs(joined) if kind.signed else joined, SHOWN_PERCENTILE)) if len(joined) else 0.0
    end = rounded_up(max(top, kind.least_range))
    return (-end, end) if kind.signed else (0.0, end)


def rounded_up(value: float) -> float:
    """The next round number, one of NICE_STEPS times a power of ten."""
    power = 10.0 ** math.floor(math.log10(value))
    step = next(step for step in NICE_STEPS if step * power >= value * (1.0 - 1e-9))
    return float(f"{step * power:.6g}")

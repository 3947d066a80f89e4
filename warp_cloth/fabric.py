"""Fabrics: what a cloth is made of, in SI, and the ones that ship."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from warp_cloth.errors import InputError
from warp_cloth.toml_file import read_toml

KES_FORCE = 490.3325  # [N/m], 500 gf/cm: the force per width at which KES-F reads the elongation EMT
KES_BENDING = 9.80665e-5  # [N m], 1 gf cm2/cm: the unit of KES-F's bending rigidity B
# The cosine law's moment per width is bending * curvature^2 / 2, the measured line's B * curvature. They meet
# at one curvature only: KES-F reads B between 0.5 and 1.5 1/cm, so the middle is taken.
MATCHED_CURVATURE = 100.0  # [1/m]

BOUNDS: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        "weight": (1e-3, 100.0),  # [kg/m2], from gossamer to sheet lead
        "stretch": (1e-3, 1e9),  # [N/m], far beyond any cloth on both sides, within what float32 holds
        "compression": (0.0, 1.0),  # a cloth resists being shortened at most as much as being stretched
        "bending": (0.0, 1.0),  # [N m2], 0: none; 1: a plank
        "thickness": (0.0, 0.05),  # [m]
        "friction": (0.0, 10.0),
    }
)


@dataclass(frozen=True)
class Fabric:
    """A fabric in SI, the same in every direction and for every mesh: edges and hinges take a share of it.

    Every value has a default, the generic fabric's, so that a fabric can be stated by what is known of it.
    """

    name: str = "default"
    weight: float = 0.2  # [kg/m2], a shirt's or a T-shirt's
    stretch: float = 20_000.0  # K [N/m], force per width K e^2 at strain e; KES-F would read EMT 15.7 %
    compression: float = 0.1  # c, share of the force when pushed together: cloth buckles before it shortens
    bending: float = (
        1e-7  # [N m2], a hinge has C = bending * axis / height^2; KES-F would read B 0.05 gf cm2/cm
    )
    thickness: float = 0.5e-3  # [m]
    friction: float = 0.3  # of cloth on cloth
    source: str = "generic: between a knit and a shirting, measured on nothing"

    def __post_init__(self) -> None:
        for key, (low, high) in BOUNDS.items():
            value = getattr(self, key)
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not number or not low <= value <= high or not math.isfinite(value):
                raise InputError(key, f"must be a number from {low:g} to {high:g}, not {_shown(value)}")
            object.__setattr__(self, key, float(value))
        for key in ("name", "source"):
            if not isinstance(getattr(self, key), str):
                raise InputError(key, f"must be text, not {_shown(getattr(self, key))}")


def measured_fabric(
    name: str,
    *,
    weight_gsm: float,
    emt_percent: float,
    bending_b: float,
    thickness_mm: float,
    friction: float = Fabric.friction,
    compression: float = Fabric.compression,
    source: str,
) -> Fabric:
    """A fabric from what a textile laboratory states.

    ``weight_gsm`` [g/m2]; ``emt_percent`` KES-F elongation at 500 gf/cm [%], which gives K = 490.3 / EMT^2;
    ``bending_b`` KES-F bending rigidity B [gf cm2/cm], which gives bending = 2 B / curvature at 1 1/cm.
    """
    return Fabric(
        name=name,
        weight=weight_gsm * 1e-3,
        stretch=KES_FORCE / (emt_percent * 1e-2) ** 2,
        compression=compression,
        bending=2.0 * bending_b * KES_BENDING / MATCHED_CURVATURE,
        thickness=thickness_mm * 1e-3,
        friction=friction,
        source=source,
    )


TYPICAL = "typical KES-F figures, mean of both directions, of no one sample"

_SHIPPED = (
    Fabric(),
    measured_fabric(
        "jersey",
        weight_gsm=160,
        emt_percent=22,
        bending_b=0.02,
        thickness_mm=0.7,
        friction=0.35,
        source=TYPICAL,
    ),
    measured_fabric(
        "cotton", weight_gsm=120, emt_percent=5, bending_b=0.06, thickness_mm=0.35, source=TYPICAL
    ),
    measured_fabric(
        "denim",
        weight_gsm=400,
        emt_percent=5,  # 4.7 to 5.7 %, doi 10.1155/2016/4614168, table 5
        bending_b=0.8,
        thickness_mm=0.9,  # 0.8 to 1.2 mm, the same
        friction=0.4,
        source=f"EMT and thickness: J. Textiles 2016, 4614168, table 5 (soft denims, B only 0.14 to 0.23); "
        f"weight and B as of 12 oz denim: {TYPICAL}",
    ),
    measured_fabric(
        "silk", weight_gsm=60, emt_percent=4, bending_b=0.02, thickness_mm=0.2, friction=0.2, source=TYPICAL
    ),
    measured_fabric("wool", weight_gsm=200, emt_percent=6, bending_b=0.09, thickness_mm=0.5, source=TYPICAL),
    measured_fabric(
        "linen", weight_gsm=180, emt_percent=4, bending_b=0.15, thickness_mm=0.45, source=TYPICAL
    ),
    measured_fabric(
        "polyester",
        weight_gsm=70,
        emt_percent=3,
        bending_b=0.03,
        thickness_mm=0.12,
        friction=0.2,
        source=TYPICAL,
    ),
    measured_fabric(
        "felt", weight_gsm=350, emt_percent=10, bending_b=1.0, thickness_mm=2.0, friction=0.5, source=TYPICAL
    ),
)


def shipped_fabrics() -> dict[str, Fabric]:
    """Every fabric that comes with the package, by name."""
    return {fabric.name: fabric for fabric in _SHIPPED}


def fabric_named(name: str) -> Fabric:
    """A shipped fabric."""
    fabrics = shipped_fabrics()
    if name not in fabrics:
        close = difflib.get_close_matches(name.lower(), fabrics, n=1, cutoff=0.6)
        hint = f'did you mean "{close[0]}"? ' if close else ""
        raise InputError(
            "",
            f"unknown fabric {_shown(name)}",
            f"{hint}there are {', '.join(fabrics)}, or name a .toml file",
        )
    return fabrics[name]


def load_fabric(path: Path) -> Fabric:
    """A fabric file: TOML with the keys of Fabric in SI, over those of its ``base`` (a name, or a file)."""
    return _load(path, ())


def resolve_fabric(value: Any, directory: Path = Path()) -> Fabric:
    """The fabric that a scene states: a shipped name, a .toml file, a table of overrides, or a Fabric.

    A table stands over its ``base``, or over the shipped fabric that it has the ``name`` of, or else over the
    generic one. The place of an error is the key of the table that is wrong, "" for the whole, or a file.
    """
    if isinstance(value, Fabric):
        return value
    if isinstance(value, str):
        return _named_or_file(value, directory, ())
    if isinstance(value, Mapping):
        return _from_table(value, directory)
    raise InputError(
        "", f"must be a name, a .toml file or a table, not {_shown(value)}", 'for instance "cotton"'
    )


def _named_or_file(value: str, directory: Path, way: tuple[Path, ...]) -> Fabric:
    return _load(directory / value, way) if value.lower().endswith(".toml") else fabric_named(value)


def _load(path: Path, way: tuple[Path, ...]) -> Fabric:
    """A fabric file; ``way`` are the files that lead here by ``base``."""
    values = read_toml(path, "fabric file")
    if path.resolve() in way:
        raise InputError(f"{path}: base", "comes back to this file", "end the chain with a shipped fabric")
    try:
        base = values.pop("base", "default")
        if not isinstance(base, str):
            raise InputError("base", f"must be a name or a .toml file, not {_shown(base)}")
        fabric = _named_or_file(base, path.parent, (*way, path.resolve()))
        return _over(fabric, {"name": path.stem, "source": f"{path.name}, over {fabric.name}", **values})
    except InputError as error:
        nested = error.place in values or error.place in ("", "base")
        place = f"{path}: {error.place or 'base'}" if nested else error.place
        raise InputError(place, error.problem, error.remedy) from None


def _from_table(table: Mapping[str, Any], directory: Path) -> Fabric:
    values = dict(table)
    named = "base" not in values and "name" in values and not set(BOUNDS) <= set(values)
    key = "name" if named else "base"
    base = values.pop(key, "default")
    if not isinstance(base, str):
        raise InputError(key, f"must be a name or a .toml file, not {_shown(base)}")
    try:
        fabric = _named_or_file(base, directory, ())
    except InputError as error:
        raise InputError(error.place or key, error.problem, error.remedy) from None
    own = ", ".join(name for name in values if name in BOUNDS)
    source = f"{fabric.source}; the scene's own: {own}" if own else fabric.source
    return _over(fabric, {"source": source, **values})


def _over(base: Fabric, values: Mapping[str, Any]) -> Fabric:
    """A fabric with some values replaced."""
    keys = [field.name for field in fields(Fabric)]
    for key in values:
        if key not in keys:
            close = difflib.get_close_matches(str(key), keys, n=1, cutoff=0.6)
            hint = f"did you mean {close[0]}? " if close else ""
            raise InputError(str(key), "unknown key", f"{hint}allowed here: base, {', '.join(keys)}")
    return replace(base, **values)


def _shown(value: Any) -> str:
    """A value as a TOML file would write it, cut short."""
    if isinstance(value, bool):
        return "true" if value else "false"
    text = f'"{value}"' if isinstance(value, str) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."

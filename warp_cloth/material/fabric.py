"""Fabrics: what a cloth is made of, in SI, and the ones that ship."""

from __future__ import annotations

import difflib
import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType
from typing import Any

from warp_cloth.base.errors import InputError
from warp_cloth.base.toml_file import read_toml
from warp_cloth.material import laboratory
from warp_cloth.material.laboratory import si_values

BOUNDS: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        "weight": (1e-3, 100.0),  # [kg/m2], from gossamer to sheet lead
        "stretch_warp": (1e-3, 1e9),  # [N/m], far beyond any cloth on both sides, within what float32 holds
        "stretch_weft": (1e-3, 1e9),
        "shear": (0.0, 1e9),  # [N/m]
        "compression": (0.0, 1.0),  # a cloth resists being shortened at most as much as being stretched
        "bending_warp": (0.0, 1.0),  # [N m2], 0: none; 1: a plank
        "bending_weft": (0.0, 1.0),
        "thickness": (0.0, 0.05),  # [m]
        "friction": (0.0, 10.0),
        "bending_friction_warp": (0.0, 10.0),  # [N]
        "bending_friction_weft": (0.0, 10.0),
        "shear_friction": (0.0, 1e3),  # [N/m]
    }
)

# 0 unless a fabric states them
HYSTERESIS = ("bending_friction_warp", "bending_friction_weft", "shear_friction")

# From stockings to sails, in the same units. A value beyond is more likely in the wrong unit than meant.
CLOTHS: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        "weight": (5e-3, 5.0),
        "stretch_warp": (50.0, 1e7),
        "stretch_weft": (50.0, 1e7),
        "bending_warp": (1e-10, 1e-4),
        "bending_weft": (1e-10, 1e-4),
        "thickness": (2e-5, 0.02),
        "bending_friction_warp": (1e-6, 0.05),
        "bending_friction_weft": (1e-6, 0.05),
        "shear_friction": (1e-3, 50.0),
    }
)

UNITS: Mapping[str, str] = MappingProxyType(
    {
        "weight": "kg/m2; weight_gsm takes g/m2",
        "stretch_warp": "N/m",
        "stretch_weft": "N/m",
        "shear": "N/m",
        "bending_warp": "N m2",
        "bending_weft": "N m2",
        "thickness": "m; thickness_mm takes mm",
        "bending_friction_warp": "N (moment per width); bending_hysteresis_2HB_warp takes gf cm/cm",
        "bending_friction_weft": "N (moment per width); bending_hysteresis_2HB_weft takes gf cm/cm",
        "shear_friction": "N/m (force per width); shear_hysteresis_2HG takes gf/cm",
    }
)

# Bias yarns are strained, too, where cloth is pulled along warp or weft. Above this fraction of the smaller stretch
# they would bear all of it, and nothing would be left for warp and weft.
LARGEST_SHEAR_FRACTION = 0.25


@dataclass(frozen=True)
class Fabric:
    """A fabric in SI, for every mesh: edges, yarns and hinges take a fraction of it.

    Every value has a default, the generic fabric's, so that a fabric can be stated by what is known of it.
    """

    name: str = "default"
    weight: float = 0.2  # [kg/m2], a shirt's or a T-shirt's
    stretch_warp: float = 20_000.0  # K [N/m], force per width K e^2 at strain e; KES-F would read EMT 15.7 %
    stretch_weft: float = 20_000.0
    shear: float | None = None  # [N/m], shear force per width shear * angle^2; None: what the mesh's edges resist
    compression: float = 0.1  # c, fraction of the force when compressed: cloth buckles before it shortens
    bending_warp: float = 1e-7  # [N m2], moment per width bending * curvature^2 / 2 where the warp is bent
    bending_weft: float = 1e-7  # with this weight as KES-F B 0.035 gf cm2/cm: a bending length of 12 mm
    thickness: float = 0.5e-3  # [m]
    friction: float = 0.3  # of cloth on cloth
    bending_friction_warp: float = 0.0  # [N], moment per width of friction where the warp is bent: half of 2HB
    bending_friction_weft: float = 0.0
    shear_friction: float = 0.0  # [N/m], force per width of friction where yarns are sheared: half of 2HG
    source: str = "generic: between a knit and a shirting, measured on nothing"

    def __post_init__(self) -> None:
        for key, (low, high) in BOUNDS.items():
            value = getattr(self, key)
            if key == "shear" and value is None:
                continue
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not number or not low <= value <= high or not math.isfinite(value):
                other = f', or "{laboratory.EDGES}"' if key == "shear" else ""
                problem = f"must be a number from {low:g} to {high:g}{other}, not {_shown(value)}"
                raise InputError(key, problem, f"it is in {UNITS[key]}" if number and key in UNITS else "")
            object.__setattr__(self, key, float(value))
        for key in ("name", "source"):
            if not isinstance(getattr(self, key), str):
                raise InputError(key, f"must be a string, not {_shown(getattr(self, key))}")
        most = LARGEST_SHEAR_FRACTION * min(self.stretch_warp, self.stretch_weft)
        if self.shear is not None and self.shear > most:
            problem = f"{self.shear:.4g} N/m is more than {LARGEST_SHEAR_FRACTION:g} times the smaller stretch"
            raise InputError("shear", problem, f"use at most {most:.4g} N/m, or remove it")

    @property
    def woven(self) -> bool:
        """Whether the fabric has yarns of its own, with a shear of its own, rather than the mesh's edges."""
        return self.shear is not None

    @property
    def stretch(self) -> float:
        """K [N/m] of warp and weft together, their geometric mean."""
        return math.sqrt(self.stretch_warp * self.stretch_weft)

    @property
    def bending(self) -> float:
        """[N m2] of warp and weft together, their geometric mean."""
        return math.sqrt(self.bending_warp * self.bending_weft)

    def rubs(self, directed: bool) -> bool:
        """Whether it has friction in bending on a garment that has directions or not."""
        friction = self.bending_friction_warp, self.bending_friction_weft
        stiff = self.bending_warp, self.bending_weft
        enough = any if directed else all
        return enough(friction) and enough(stiff) and min(stiff) > 0.0

    @property
    def has_band(self) -> bool:
        """Whether cloth with directions rests in a band of shapes, kept by friction in bending or shear."""
        return self.rubs(directed=True) or (self.woven and self.shear_friction > 0.0)

    @property
    def even_shear(self) -> float:
        """Shear [N/m] of cloth whose four yarns are alike, with the smaller stretch of this.

        Then warp, weft and both biases have one stretch K_b, with which ``material.yarn_stretches`` is solved.
        """
        c, stretch = self.compression, min(self.stretch_warp, self.stretch_weft)
        t = 1.0 / (1.0 + 2.0 * math.sqrt(c))  # what pulled cloth contracts by, of what it is pulled by
        return (1.0 + c) / 8.0 * stretch / (1.0 + 0.25 * (1.0 - t) ** 3 + c * t**3)


def unlikely_values(fabric: Fabric) -> tuple[str, ...]:
    """A note on values that no cloth has; 0 is taken as meant."""
    unusual = []
    for key, (low, high) in CLOTHS.items():
        value = getattr(fabric, key)
        if value and not low <= value <= high:
            unusual.append(f"{key} {value:.2g} {UNITS[key].split(';')[0]} (usual: {low:g} to {high:g})")
    return (
        (f'the fabric "{fabric.name}" is unlike any cloth: {", ".join(unusual)}; check its units',) if unusual else ()
    )


def shipped_fabrics() -> dict[str, Fabric]:
    """Every fabric that comes with the package, by name."""
    return {"default": generic_fabric(), **{name: load_fabric(path) for name, path in _shipped_files().items()}}


def generic_fabric() -> Fabric:
    """The fabric where none is stated: ``Fabric``'s values, woven alike in every direction."""
    return replace(Fabric(), shear=Fabric().even_shear)


def fabric_named(name: str) -> Fabric:
    """A shipped fabric."""
    found = _shipped(name)
    if found is not None:
        return found
    names = ["default", *_shipped_files()]
    close = difflib.get_close_matches(name.lower(), names, n=1, cutoff=0.6)
    hint = f'did you mean "{close[0]}"? ' if close else ""
    raise InputError("", f"unknown fabric {_shown(name)}", f"{hint}use one of {', '.join(names)}, or a .toml file")


@functools.cache  # a batch names the same few a thousand times
def _shipped(name: str) -> Fabric | None:
    if name == "default":
        return generic_fabric()
    path = _shipped_files().get(name)
    return None if path is None else load_fabric(path)


def _shipped_files() -> dict[str, Path]:
    folder = Path(str(files("warp_cloth"))) / "fabrics"
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def load_fabric(path: Path) -> Fabric:
    """A fabric file: TOML of laboratory figures, or of Fabric's keys in SI, over its ``base`` (a name, or a file)."""
    return _load(path, ())


def resolve_fabric(value: Any, directory: Path = Path()) -> Fabric:
    """The fabric that a scene states: a shipped name, a .toml file, a table of overrides, or a Fabric.

    A table overrides values of its ``base``, or else of the shipped fabric of its ``name``, or else of the generic one.
    The place of an error is the key of the table that is wrong, "" for the whole, or a file.
    """
    if isinstance(value, Fabric):
        return value
    if isinstance(value, str):
        return _named_or_file(value, directory, ())
    if isinstance(value, Mapping):
        return _from_table(value, directory)
    raise InputError("", f"must be a name, a .toml file or a table, not {_shown(value)}", 'for instance "cotton"')


def _named_or_file(value: str, directory: Path, chain: tuple[Path, ...]) -> Fabric:
    return _load(directory / value, chain) if value.lower().endswith(".toml") else fabric_named(value)


def _base(value: str, directory: Path, chain: tuple[Path, ...]) -> Fabric:
    """What a fabric is stated over; of the generic one, whose shear goes with its stretch, the shear is left open."""
    return Fabric() if value == "default" else _named_or_file(value, directory, chain)


def _load(path: Path, chain: tuple[Path, ...]) -> Fabric:
    """A fabric file; ``chain`` are the files that refer to it by ``base``."""
    values = read_toml(path, "fabric file")
    if path.resolve() in chain:
        raise InputError(f"{path}: base", "refers back to this file", "end the chain with a shipped fabric")
    try:
        base = values.pop("base", "default")
        if not isinstance(base, str):
            raise InputError("base", f"must be a name or a .toml file, not {_shown(base)}")
        fabric = _base(base, path.parent, (*chain, path.resolve()))
        return _over(fabric, {"name": path.stem, "source": f"{path.name}, over {fabric.name}", **values})
    except InputError as error:
        nested = error.place in values or error.place in ("", "base")
        place = f"{path}: {error.place or 'base'}" if nested else error.place
        raise InputError(place, error.problem, error.remedy) from None


def _from_table(table: Mapping[str, Any], directory: Path) -> Fabric:
    values = dict(table)
    named = "base" not in values and "name" in values and not _complete(values)
    key = "name" if named else "base"
    base = values.pop(key, "default")
    if not isinstance(base, str):
        raise InputError(key, f"must be a name or a .toml file, not {_shown(base)}")
    try:
        fabric = _base(base, directory, ())
    except InputError as error:
        raise InputError(error.place or key, error.problem, error.remedy) from None
    own = ", ".join(name for name in values if name not in ("name", "source"))
    source = f"{fabric.source}; the scene's own: {own}" if own else fabric.source
    return _over(fabric, {"source": source, **values})


def _complete(values: Mapping[str, Any]) -> bool:
    """Whether the values leave nothing to a base."""
    return set(BOUNDS) - set(HYSTERESIS) <= set(values)


def _over(base: Fabric, values: Mapping[str, Any]) -> Fabric:
    """A fabric with some values replaced, each stated in SI or as a laboratory does."""
    own = [field.name for field in fields(Fabric)]
    keys = [*own, *laboratory.KEYS]
    for key in values:
        if key not in keys:
            close = difflib.get_close_matches(str(key), keys, n=1, cutoff=0.6)
            hint = f"did you mean {close[0]}? " if close else ""
            raise InputError(str(key), "unknown key", f"{hint}allowed here: base, {', '.join(keys)}")
    try:
        stated = si_values(values, base.weight)
        sheared = "shear" in stated
        if "stretch" in values:  # one for every direction: the base's shear does not go with it
            stated.setdefault("shear", None)
        fabric = replace(base, **stated)
        open_shear = base == Fabric() or "stretch_warp" in stated or "stretch_weft" in stated
        if fabric.shear is None and not sheared and open_shear:
            # yarns reproduce a stretch on every mesh, edges do not; edges pull only if requested
            fabric = replace(fabric, shear=fabric.even_shear)
        return fabric
    except InputError as error:
        stating = (key for key in values if error.place in laboratory.stated_by(key))
        place = error.place if error.place in values else next(stating, error.place)
        raise InputError(place, error.problem, error.remedy) from None


def _shown(value: Any) -> str:
    """A value as a TOML file would write it, cut short."""
    if isinstance(value, bool):
        return "true" if value else "false"
    text = f'"{value}"' if isinstance(value, str) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."

"""Fabrics: what a cloth is made of, in SI, and the ones that ship."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from warp_cloth.errors import InputError

KES_FORCE = 490.3325  # [N/m], 500 gf/cm: the force per width at which KES reads the elongation EMT
KES_BENDING = 9.80665e-5  # [N m] in 1 gf cm2/cm
MATCHED_CURVATURE = 100.0  # [1/m]
# The cosine law's moment per width, bending * curvature^2 / 2, is not linear, so it meets the measured straight line
# B * curvature at one curvature only. KES reads B between 0.5 and 1.5 1/cm: the middle, 1 1/cm, is taken.

BOUNDS: dict[str, tuple[float, float]] = {
    "weight": (1e-3, 100.0),  # from gossamer to sheet lead [kg/m2]
    "stretch": (1e-3, 1e9),  # [N/m]
    "compression": (0.0, 1.0),
    "bending": (0.0, 1.0),  # [N m2]
    "thickness": (0.0, 0.05),  # [m]
    "friction": (0.0, 10.0),
}


@dataclass(frozen=True)
class Fabric:
    """A fabric in SI, the same in every direction. Mesh-independent: edges and hinges take their share of it.

    Every value has a default, the generic fabric's, so that a fabric can be stated by what is known of it.
    """

    name: str = "default"
    weight: float = 0.2  # [kg/m2], a shirt's
    stretch: float = 20_000.0  # K [N/m], force per width K e^2 at strain e; as KES EMT 15.7 %
    compression: float = 0.1  # c, share of the force when pushed together: cloth buckles rather than shortens
    bending: float = 1e-7  # [N m2], a hinge's C = bending * axis / height^2; as KES B 0.05 gf cm2/cm
    thickness: float = 0.5e-3  # [m]
    friction: float = 0.3  # of cloth on cloth
    source: str = "generic: between a knit and a shirting"

    def __post_init__(self) -> None:
        for key, (low, high) in BOUNDS.items():
            value = getattr(self, key)
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not number or not math.isfinite(value) or not low <= value <= high:
                given = "true" if value is True else "false" if value is False else repr(value).replace("'", '"')
                raise InputError(key, f"must be a number from {low:g} to {high:g}, not {given}")
            object.__setattr__(self, key, float(value))
        for key in ("name", "source"):
            if not isinstance(getattr(self, key), str):
                raise InputError(key, "must be text")


def fabric_named(name: str) -> Fabric:
    raise NotImplementedError


def resolve_fabric(value: Any, directory: Path = Path()) -> Fabric:
    return Fabric()

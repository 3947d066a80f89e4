"""Length units and up axes of files and scenes; inside, everything is in metres, y up."""

from __future__ import annotations

from typing import Literal, get_args

LengthUnit = Literal["m", "cm", "mm", "in"]
LENGTH_UNITS: tuple[LengthUnit, ...] = get_args(LengthUnit)
METRES_PER: dict[LengthUnit, float] = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}

UpAxis = Literal["y", "z"]  # of tools
BodyUp = Literal["y", "z", "x", "-x", "-y", "-z"]  # where a body's head is, which may lie in any way

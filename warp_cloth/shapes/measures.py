"""Body measures of the mannequin, the levels where they are taken, and the standard bodies of the sizes."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from warp_cloth.base.errors import InputError

# What each measure may be [m; degrees]: generous for grown-ups, tight enough to catch centimetres or inches.
LIMITS: dict[str, tuple[float, float]] = {
    "stature": (1.2, 2.3),
    "chest": (0.60, 1.60),
    "waist": (0.45, 1.60),
    "hip": (0.60, 1.70),
    "arm_angle": (40.0, 85.0),  # lower, the arms would touch the chest where its girth is taken
}

# Levels as fractions of stature. Joints and chin: Drillis & Contini, Body Segment Parameters (1966), as tabulated
# in Winter, Biomechanics and Motor Control of Human Movement, fig. 4.1. ISO 8559-1 takes the chest girth at the
# nipples, the waist between ribs and hip bone, the hip at the fullest of the seat; the fractions follow the
# eight-head canon of figure drawing (nipples 6/8, navel 5/8, crotch 4/8), the chest a little lower, as measured.
CHEST_LEVEL = 0.720
WAIST_LEVEL = 0.625
HIP_LEVEL = 0.510


@dataclass(frozen=True)
class MannequinMeasures:
    """Measures of a mannequin; lengths and girths in metres, the default a size M of SIZE_BODIES."""

    stature: float = 1.76
    chest: float = 0.98
    waist: float = 0.86
    hip: float = 1.00
    arm_angle: float = 45.0  # degrees between arm and vertical; 45 is the usual A-pose

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            low, high = LIMITS[field.name]
            unit = "degrees" if field.name == "arm_angle" else "m"
            if not (isinstance(value, (int, float)) and math.isfinite(value) and low <= value <= high):
                raise InputError(
                    f"mannequin {field.name}",
                    f"{value!r} {unit} is not plausible",
                    f"allowed: {low} to {high} {unit}",
                )
        girths = (self.chest, self.waist, self.hip)
        if min(girths) < 0.25 * self.stature or max(girths) > 1.6 * min(girths):
            raise InputError(
                "mannequin",
                f"girths {self.chest}, {self.waist}, {self.hip} m do not make a body of {self.stature} m",
                "chest, waist and hip must be within 1.6 times each other and above a quarter of the stature",
            )

    @property
    def chest_height(self) -> float:
        """Height of the chest girth above the floor [m]."""
        return CHEST_LEVEL * self.stature

    @property
    def waist_height(self) -> float:
        """Height of the waist girth above the floor [m]."""
        return WAIST_LEVEL * self.stature

    @property
    def hip_height(self) -> float:
        """Height of the hip girth above the floor [m]."""
        return HIP_LEVEL * self.stature


# Middles of the letter codes of EN 13402-3 for men: chest 86-94, 94-102, 102-110 cm; waist 74-82, 82-90, 90-98
# cm. Statures and hips are our choice to go with them.
SIZE_BODIES: dict[str, MannequinMeasures] = {
    "S": MannequinMeasures(stature=1.70, chest=0.90, waist=0.78, hip=0.94),
    "M": MannequinMeasures(stature=1.76, chest=0.98, waist=0.86, hip=1.00),
    "L": MannequinMeasures(stature=1.82, chest=1.06, waist=0.94, hip=1.06),
}

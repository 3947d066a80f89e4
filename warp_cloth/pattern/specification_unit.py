"""The length unit of a specification that states none: centimetres, unless only another makes a garment of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warp_cloth.pattern.curve import Floats

CENTIMETRE = 0.01
OTHERS = {"millimetres": 1e-3, "metres": 1.0}  # inches make a garment of what is one in centimetres, too
TYPICAL = (0.025, 2.5)  # [m] extent of a garment's panels in the median of their area; of 96 random designs 0.08 to 1.7


def unit_by_size(corners: Sequence[Floats]) -> tuple[float, str]:
    """Metres in a unit of the corners of all panels, shape [N, 2] each; and a note on why."""
    typical = _typical(np.array([np.ptp(each, axis=0) for each in corners]).reshape(-1, 2))
    if not _is_panel(CENTIMETRE * typical):
        for name, metres in OTHERS.items():
            if _is_panel(metres * typical):
                why = f"as its panels are then some {metres * typical:.2f} m long"
                return metres, f"units_in_meter not stated: {name} assumed, {why}"
    return CENTIMETRE, "units_in_meter not stated: centimetres assumed, as GarmentCode's"


def _is_panel(extent: float) -> bool:
    return TYPICAL[0] <= extent <= TYPICAL[1]


def _typical(sizes: Floats) -> float:
    """The extent of the panel at the median of area, by the rectangles round them, shape [P, 2]."""
    if not len(sizes):
        return 0.0
    extents = sizes.max(axis=1)
    order = np.argsort(extents, kind="stable")
    area = np.cumsum(sizes.prod(axis=1)[order])
    return float(extents[order[np.searchsorted(area, 0.5 * area[-1])]])

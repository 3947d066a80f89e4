"""Constants of hinges, from the user's cache on disk where the same panels have been fitted in the same bending."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.stored_value import SMALLEST, stored
from warp_cloth.material.bending import hinge_constants
from warp_cloth.material.constants import Sheet
from warp_cloth.material.fabric import Fabric
from warp_cloth.material.hysteresis import rubbing_constants

Floats = NDArray[np.float64]

PACKAGES = ("material", "base")  # whose code these constants depend on


def constants_of_hinges(sheet: Sheet, fabric: Fabric, length: Floats) -> tuple[Floats, Floats | None]:
    """C of every hinge [N m], shape [H], and its friction as ``RestShape.hinge_slider`` has it; None: it has none.

    Args:
        sheet: the garment.
        fabric: of which bending, its friction and weight count.
        length: of every edge at rest [m], shape [E].
    """
    if len(sheet.topology.hinges) < SMALLEST:
        return _made(sheet, fabric, length)
    bending = fabric.bending_warp, fabric.bending_weft, fabric.bending_friction_warp, fabric.bending_friction_weft
    shape = sheet.triangles, sheet.flat, sheet.areas, sheet.directed, length
    return stored("hinges", PACKAGES, partial(_made, sheet, fabric, length), *bending, fabric.weight, *shape)


def _made(sheet: Sheet, fabric: Fabric, length: Floats) -> tuple[Floats, Floats | None]:
    if fabric.rubs(sheet.directed) and len(sheet.topology.hinges):
        return rubbing_constants(sheet, fabric, length)
    return hinge_constants(sheet, fabric, length), None

"""A fabric in the linear constants of the surface-deformable physics schema, and back.

The paper's laws are quadratic (force per width K e^2), the schema's linear (S e): both agree at one strain, one shear
angle and one curvature, those of worn cloth.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from warp_cloth.material.fabric import LARGEST_SHEAR_FRACTION, Fabric

STRAIN = 0.05  # where K e^2 = S e
ANGLE = math.radians(5.0)  # where shear angle^2 = G angle
CURVATURE = 1.0 / 0.03  # [1/m], where bending curvature^2 / 2 = D curvature
POISSON = 0.3  # the schema's own, where the fabric says nothing
THICKNESS = 1e-3  # [m], the schema's own


def linear_constants(fabric: Fabric) -> dict[str, float]:
    """Attributes of PhysicsSurfaceDeformableMaterialAPI and the density, SI; warp and weft as their mean."""
    stretch = fabric.stretch * STRAIN
    shear = stretch / (2.0 * (1.0 + POISSON)) if fabric.shear is None else fabric.shear * ANGLE
    thickness = fabric.thickness or THICKNESS
    return {
        "density": fabric.weight / thickness,
        "youngsModulus": stretch * (1.0 - POISSON**2) / thickness,
        "poissonsRatio": POISSON,
        "surfaceStretchStiffness": stretch,
        "surfaceShearStiffness": shear,
        "surfaceBendStiffness": 0.5 * fabric.bending * CURVATURE,
    }


def fabric_table(constants: Mapping[str, float], thickness: float | None, weight: float | None) -> dict[str, Any]:
    """A scene's fabric table from such attributes (SI); what they do not state is left to the default fabric.

    ``thickness`` [m] and ``weight`` [kg/m2] are the mesh's own, where it has them.
    """
    table: dict[str, Any] = {}
    if thickness is not None:
        table["thickness"] = thickness
    assumed = thickness if thickness else THICKNESS
    density = constants.get("density", 0.0)
    if weight is not None:
        table["weight"] = weight
    elif density > 0.0:
        table["weight"] = density * assumed
    young, poisson = constants.get("youngsModulus", 0.0), constants.get("poissonsRatio", POISSON)
    plane = young * assumed / (1.0 - poisson**2)
    stretch = constants.get("surfaceStretchStiffness", plane)
    shear = constants.get("surfaceShearStiffness", young * assumed / (2.0 * (1.0 + poisson)))
    bend = constants.get("surfaceBendStiffness", plane * assumed**2 / 12.0)
    if stretch > 0.0:
        table["stretch_warp"] = table["stretch_weft"] = stretch / STRAIN
    if stretch > 0.0 and shear > 0.0:
        # cloth that resists shear as a sheet of its Poisson ratio does has no shear of its own
        sheet = stretch / (2.0 * (1.0 + poisson))
        if not math.isclose(shear, sheet, rel_tol=0.05):
            table["shear"] = min(shear / ANGLE, LARGEST_SHEAR_FRACTION * stretch / STRAIN)
    if bend > 0.0:
        table["bending_warp"] = table["bending_weft"] = 2.0 * bend / CURVATURE
    return table

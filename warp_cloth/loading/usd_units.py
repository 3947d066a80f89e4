"""What a whole stage says of its numbers, or fails to: unit, mass, up axis, references that lead nowhere."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from warp_cloth.errors import InputError
from warp_cloth.loading.raw import Floats

if TYPE_CHECKING:
    from pxr import Usd, UsdGeom

FLATTEST = 1e-9  # determinant of a transform over its largest size cubed, below which it has lost a direction


def metres_per_unit(stage: Usd.Stage, file: str) -> float | None:
    """The stage's unit; None where it states none.

    Raises:
        InputError: it is no unit, or the up axis is none.
    """
    from pxr import UsdGeom

    axis = str(UsdGeom.GetStageUpAxis(stage))
    if axis not in (UsdGeom.Tokens.y, UsdGeom.Tokens.z):
        raise InputError(file, f"upAxis is {axis}", "make it Y or Z")
    if not UsdGeom.StageHasAuthoredMetersPerUnit(stage):
        return None
    scale = float(UsdGeom.GetStageMetersPerUnit(stage))
    if not (np.isfinite(scale) and scale > 0):
        raise InputError(file, f"metersPerUnit is {scale:g}", "give the stage a positive one")
    return scale


def kilograms_per_unit(stage: Usd.Stage, file: str) -> float:
    """The stage's unit of mass.

    Raises:
        InputError: it is no unit.
    """
    from pxr import UsdPhysics

    scale = float(UsdPhysics.GetStageKilogramsPerUnit(stage))
    if not (np.isfinite(scale) and scale > 0):
        raise InputError(file, f"kilogramsPerUnit is {scale:g}", "give the stage a positive one")
    return scale


def to_stage(mesh: UsdGeom.Mesh, time: Usd.TimeCode, place: str) -> Floats:
    """Matrix from a mesh to its stage, rows first, shape [4, 4].

    Raises:
        InputError: it is not finite, or leaves no volume.
    """
    from pxr import UsdGeom

    matrix = np.array(UsdGeom.XformCache(time).GetLocalToWorldTransform(mesh.GetPrim()), dtype=np.float64)
    if not np.isfinite(matrix).all():
        raise InputError(place, "its transform, or one above it, is not finite", "give it numbers")
    size = float(np.abs(matrix[:3, :3]).max())
    if abs(float(np.linalg.det(matrix[:3, :3] / (size or 1.0)))) <= FLATTEST:
        raise InputError(place, "its transform, or one above it, flattens it: a scale is 0", "give it another scale")
    return matrix


def lost_references(stage: Usd.Stage) -> str:
    """The first file that the stage refers to and that cannot be opened, as a clause; empty: none."""
    for error in stage.GetCompositionErrors():
        found = re.search(r"Could not open asset @([^@]*)@ for (\w+) introduced by @[^@]*@<([^>]*)>", str(error))
        if found:
            file, kind, prim = found.groups()
            return f"the {kind} at {prim} to {file} cannot be opened"
    return ""

"""What a whole stage says of its numbers, or fails to: unit, mass, up axis, references that lead nowhere."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.loading.raw import Floats

if TYPE_CHECKING:
    from pxr import Sdf, Usd, UsdGeom

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


def standing_time(prim: Usd.Prim) -> Usd.TimeCode:
    """When a prim stands as it is read: its default, or the first sample where its points or its place have none."""
    from pxr import Usd, UsdGeom

    points = UsdGeom.Mesh(prim).GetPointsAttr() if prim.IsA(UsdGeom.Mesh) else None
    if points and points.Get() is None and points.GetNumTimeSamples():
        return Usd.TimeCode(points.GetTimeSamples()[0])
    while prim and not prim.IsPseudoRoot():
        moves = UsdGeom.Xformable(prim).GetOrderedXformOps() if prim.IsA(UsdGeom.Xformable) else ()
        if any(move.GetNumTimeSamples() and move.GetAttr().Get() is None for move in moves):
            return Usd.TimeCode.EarliestTime()
        prim = prim.GetParent()
    return Usd.TimeCode.Default()


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


def meshes_of(stage: Usd.Stage) -> list[Usd.Prim]:
    """The meshes of a stage, instances too, but not what a point instancer scatters."""
    from pxr import Usd, UsdGeom

    scattered = [path for _, path in _prototypes(stage)]
    return [
        prim
        for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
        if prim.IsA(UsdGeom.Mesh) and not any(prim.GetPath().HasPrefix(path) for path in scattered)
    ]


def _prototypes(stage: Usd.Stage) -> list[tuple[Usd.Prim, Sdf.Path]]:
    """Every point instancer of a stage with each prim that it scatters."""
    from pxr import Usd, UsdGeom

    every = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
    instancers = [prim for prim in every if prim.IsA(UsdGeom.PointInstancer)]
    return [
        (prim, path)
        for prim in instancers
        for path in UsdGeom.PointInstancer(prim).GetPrototypesRel().GetForwardedTargets()
    ]


def why_missing(stage: Usd.Stage) -> tuple[str, str]:
    """What may keep a mesh from being found in a stage, as a clause, and what to do; both empty: nothing."""
    from pxr import Usd

    lost = lost_references(stage)
    if lost:
        return lost, "mend the path"
    for prim, path in _prototypes(stage):
        clause = f"the point instancer {prim.GetPath()} scatters {path}, and such are not read"
        return clause, "write its instances out as meshes of their own"
    for prim in Usd.PrimRange(stage.GetPseudoRoot()):
        sets = prim.GetVariantSets()
        for name in sets.GetNames():
            if not sets.GetVariantSelection(name):
                known = ", ".join(sets.GetVariantSet(name).GetVariantNames())
                return f"the variant set {name} of {prim.GetPath()} has no selection", f"select one of {known}"
    return "", ""


def lost_references(stage: Usd.Stage) -> str:
    """The first file that the stage refers to and that cannot be opened, as a clause; empty: none."""
    for error in stage.GetCompositionErrors():
        found = re.search(r"Could not open asset @([^@]*)@ for (\w+) introduced by @[^@]*@<([^>]*)>", str(error))
        if found:
            file, kind, prim = found.groups()
            return f"the {kind} at {prim} to {file} cannot be opened"
    return ""

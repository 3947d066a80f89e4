"""Units, up axis, transforms and broken references of a USD stage."""

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
    """Metres per unit of the stage; None if it states none.

    Raises:
        InputError: the unit or the up axis is invalid.
    """
    from pxr import UsdGeom

    axis = str(UsdGeom.GetStageUpAxis(stage))
    if axis not in (UsdGeom.Tokens.y, UsdGeom.Tokens.z):
        raise InputError(file, f"upAxis is {axis}", "set it to Y or Z")
    if not UsdGeom.StageHasAuthoredMetersPerUnit(stage):
        return None
    scale = float(UsdGeom.GetStageMetersPerUnit(stage))
    if not (np.isfinite(scale) and scale > 0):
        raise InputError(file, f"metersPerUnit is {scale:g}", "set a positive value")
    return scale


def kilograms_per_unit(stage: Usd.Stage, file: str) -> float:
    """Kilograms per unit of mass of the stage.

    Raises:
        InputError: the unit is invalid.
    """
    from pxr import UsdPhysics

    scale = float(UsdPhysics.GetStageKilogramsPerUnit(stage))
    if not (np.isfinite(scale) and scale > 0):
        raise InputError(file, f"kilogramsPerUnit is {scale:g}", "set a positive value")
    return scale


def standing_time(prim: Usd.Prim) -> Usd.TimeCode:
    """The time at which a prim is read: the default, or the first sample if points or transform have no default."""
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
        raise InputError(place, "its transform, or one above it, is not finite", "correct the transform")
    size = float(np.abs(matrix[:3, :3]).max())
    if abs(float(np.linalg.det(matrix[:3, :3] / (size or 1.0)))) <= FLATTEST:
        raise InputError(place, "its transform, or one above it, has a scale of 0", "correct the scale")
    return matrix


def meshes_of(stage: Usd.Stage) -> list[Usd.Prim]:
    """The meshes of a stage, including instances, without prototypes of point instancers."""
    from pxr import Usd, UsdGeom

    scattered = [path for _, path in _prototypes(stage)]
    return [
        prim
        for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
        if prim.IsA(UsdGeom.Mesh) and not any(prim.GetPath().HasPrefix(path) for path in scattered)
    ]


def _prototypes(stage: Usd.Stage) -> list[tuple[Usd.Prim, Sdf.Path]]:
    """Every point instancer of a stage with each of its prototypes."""
    from pxr import Usd, UsdGeom

    every = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
    instancers = [prim for prim in every if prim.IsA(UsdGeom.PointInstancer)]
    return [
        (prim, path)
        for prim in instancers
        for path in UsdGeom.PointInstancer(prim).GetPrototypesRel().GetForwardedTargets()
    ]


def why_missing(stage: Usd.Stage) -> tuple[str, str]:
    """A likely reason why a stage has no such mesh, and a remedy; both empty if none is found."""
    from pxr import Usd

    lost = lost_references(stage)
    if lost:
        return lost, "correct the path"
    for prim, path in _prototypes(stage):
        clause = f"the point instancer {prim.GetPath()} scatters {path}, which is not supported"
        return clause, "export its instances as meshes"
    for prim in Usd.PrimRange(stage.GetPseudoRoot()):
        sets = prim.GetVariantSets()
        for name in sets.GetNames():
            if not sets.GetVariantSelection(name):
                known = ", ".join(sets.GetVariantSet(name).GetVariantNames())
                return f"the variant set {name} of {prim.GetPath()} has no selection", f"select one of {known}"
    return "", ""


def lost_references(stage: Usd.Stage) -> str:
    """The first broken reference of the stage, as a clause; empty without any."""
    for error in stage.GetCompositionErrors():
        found = re.search(r"Could not open asset @([^@]*)@ for (\w+) introduced by @[^@]*@<([^>]*)>", str(error))
        if found:
            file, kind, prim = found.groups()
            return f"the {kind} at {prim} to {file} cannot be opened"
    return ""

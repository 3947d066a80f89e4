"""The avatar as a USD reference to the user's own file: transformed, but not copied."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pxr import Gf, Kind, Sdf, Usd, UsdGeom

from warp_cloth.base.mesh import Points
from warp_cloth.base.units import METRES_PER, LengthUnit
from warp_cloth.base.warp_setup import quiet_usd
from warp_cloth.loading.usd_units import standing_time


@dataclass(frozen=True)
class AvatarAsset:
    """The source of an avatar: a USD file, its meshes there, and meshes that the reference must not include."""

    file: Path
    meshes: tuple[str, ...]
    garments: tuple[str, ...] = ()  # meshes of the same file that are garments
    units: LengthUnit | None = None  # where the scene overrides those of the file


def relative_asset(file: Path, folder: Path) -> str:
    """The path by which a layer in a folder refers to the file."""
    path = Path(os.path.relpath(file.resolve(), folder.resolve())).as_posix()
    return path if path.startswith(".") else f"./{path}"  # without a dot USD would look it up in its search paths


def author_reference(part: Usd.Prim, asset: AvatarAsset, path_of_stage: Path) -> bool:
    """Adds a reference to the avatar under its part; False, with nothing added, if the avatar has no prim of its own.

    A package (usdz) includes the referenced file, and needs its absolute path; a stage refers to it by a relative path.
    """
    with quiet_usd():
        source = Usd.Stage.Open(str(asset.file))
    target = own_prim(source, asset.meshes, asset.garments)
    if target is None:
        return False
    matrix = to_metres(source, source.GetPrimAtPath(target).GetParent(), asset.units)
    path = part.GetPath().AppendChild(f"{part.GetName()}_avatar")
    holder = UsdGeom.Xform.Define(part.GetStage(), path)
    holder.AddTransformOp().Set(Gf.Matrix4d(matrix.tolist()))
    inner = part.GetStage().DefinePrim(path.AppendChild(Sdf.Path(target).name))
    packed = path_of_stage.suffix == ".usdz"
    named = str(asset.file.resolve()) if packed else relative_asset(asset.file, path_of_stage.parent)
    with quiet_usd():  # a stage in memory has no folder to find the file from
        inner.GetReferences().AddReference(named, target)
    if any(Usd.ModelAPI(prim).GetKind() for prim in Usd.PrimRange(source.GetPrimAtPath(target))):
        Usd.ModelAPI(part).SetKind(Kind.Tokens.group)  # a component would hide the models inside
    return True


def own_prim(stage: Usd.Stage, meshes: Sequence[str], garments: Sequence[str]) -> str | None:
    """The prim with all of the avatar's meshes and no others; an Xform rather than a mesh, to include its materials."""
    common = Sdf.Path(meshes[0])
    for path in meshes[1:]:
        common = common.GetCommonPrefix(Sdf.Path(path))
    while not stage.GetPrimAtPath(common).IsPseudoRoot():
        parent = common.GetParentPath()
        inside = [p for p in Usd.PrimRange(stage.GetPrimAtPath(parent)) if p.IsA(UsdGeom.Gprim)]
        if parent == Sdf.Path.absoluteRootPath or {str(p.GetPath()) for p in inside} - set(meshes):
            break
        common = parent
    if common == Sdf.Path.absoluteRootPath or any(Sdf.Path(path).HasPrefix(common) for path in garments):
        return None
    prim = stage.GetPrimAtPath(common)
    return None if prim.IsInstanceProxy() else str(common)


def to_metres(stage: Usd.Stage, prim: Usd.Prim, units: LengthUnit | None) -> Points:
    """Matrix (for row vectors) from a prim's own space to metres with y up, as in the loader; shape [4, 4]."""
    world = np.array(UsdGeom.XformCache(standing_time(prim)).GetLocalToWorldTransform(prim), dtype=np.float64)
    authored = UsdGeom.StageHasAuthoredMetersPerUnit(stage)
    metres = METRES_PER[units] if units else UsdGeom.GetStageMetersPerUnit(stage) if authored else 1.0
    y_up = np.eye(4)
    if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z:  # (x, y, z) becomes (x, z, -y)
        y_up[:3, :3] = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
    return np.asarray(world @ y_up @ np.diag([metres] * 3 + [1.0]))

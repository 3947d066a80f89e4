"""The worn shape as a USD layer over the user's own stage, whose files are not changed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from pxr import Sdf, Usd, UsdGeom, Vt

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Points, vertex_normals
from warp_cloth.base.units import LengthUnit
from warp_cloth.base.warp_setup import quiet_usd
from warp_cloth.export.fields import Ranges, author_colours, author_fields
from warp_cloth.export.files import whole_file
from warp_cloth.export.reference import relative_asset, to_metres
from warp_cloth.export.surface import require_sound
from warp_cloth.model.result import WornGarment

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True)
class StagedGarment:
    """A worn garment, and the prims of the user's stage that it was loaded from."""

    worn: WornGarment
    file: Path
    prims: tuple[str, ...]  # of its meshes, in the order of the joined mesh
    units: LengthUnit | None = None  # where the scene overrides those of the stage


def write_override(
    path: Path,
    garments: Sequence[StagedGarment],
    *,
    ranges: Ranges = MappingProxyType({}),
    colour: str = "",
) -> None:
    """Writes a layer whose one sublayer is the user's stage: points, normals, extent and maps of the garments.

    They are in the stage's own units, up axis and prim transforms; everything else, references and variants included,
    composes as before. The layer turns off instancing for an instance that contains a garment.
    """
    file = garments[0].file
    require_sound([garment.worn for garment in garments], None)
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.subLayerPaths.append(str(file.resolve()))  # absolute, to compose it here; the written path is relative
    with quiet_usd():
        stage = Usd.Stage.Open(layer)
        _copy_metadata(Usd.Stage.Open(str(file)), stage)
        for garment in garments:
            for prim in garment.prims:
                _open_instances(stage, prim)
            _author_garment(stage, garment, ranges, colour)
        _extend_times([0 if each.worn.frames is None else len(each.worn.frames) for each in garments], stage)
    # in a layer that no stage composes, as that would resolve the relative path
    written = Sdf.Layer.CreateAnonymous(".usda")
    written.TransferContent(layer)
    written.subLayerPaths[0] = relative_asset(file, path.parent)
    with whole_file(path) as target:
        if not written.Export(str(target)):
            raise OSError("USD could not write it")


def _copy_metadata(base: Usd.Stage, stage: Usd.Stage) -> None:
    """Copies units, axis and times, which a stage reads from its root layer only."""
    root = base.GetRootLayer()
    for key in root.pseudoRoot.ListInfoKeys():
        if key not in ("subLayers", "subLayerOffsets"):
            stage.GetRootLayer().pseudoRoot.SetInfo(key, root.pseudoRoot.GetInfo(key))


def _extend_times(frame_counts: Sequence[int], stage: Usd.Stage) -> None:
    """Extends the stage's time range to the frames; without a range only the first would play."""
    if max(frame_counts):
        first, last = stage.GetStartTimeCode(), stage.GetEndTimeCode()
        stage.SetStartTimeCode(first)
        stage.SetEndTimeCode(max(last, first + max(frame_counts) - 1))


def _open_instances(stage: Usd.Stage, path: str) -> None:
    """Turns off instancing above a prim in this layer, because the inside of an instance cannot be overridden."""
    prim = stage.GetPrimAtPath(path)
    while prim and prim.IsInstanceProxy():
        instance = prim
        while instance.IsInstanceProxy():
            instance = instance.GetParent()
        instance.SetInstanceable(False)
        prim = stage.GetPrimAtPath(path)


def _author_garment(stage: Usd.Stage, garment: StagedGarment, ranges: Ranges, colour: str) -> None:
    meshes = [UsdGeom.Mesh(stage.GetPrimAtPath(path)) for path in garment.prims]
    for path, mesh in zip(garment.prims, meshes, strict=True):
        if not mesh:
            raise InputError(garment.file, f"the prim {path} no longer exists", "fit the stage again")
    known = garment.worn.mesh
    vertex = np.arange(known.vertex_count) if known.vertex_map is None else known.vertex_map
    ends = np.cumsum([len(_default_points(mesh)) for mesh in meshes])
    if ends[-1] != len(vertex):
        raise InputError(garment.file, f"{', '.join(garment.prims)} changed after the fit", "fit the stage again")
    trim = np.full(len(vertex), -1) if known.trim_map is None else known.trim_map
    parts = zip(garment.prims, np.split(vertex, ends[:-1]), np.split(trim, ends[:-1]), strict=True)
    for path, part, trims in parts:
        _author_mesh(stage, path, garment, part, trims, ranges, colour)


def _author_mesh(
    stage: Usd.Stage,
    path: str,
    garment: StagedGarment,
    vertex: NDArray[np.int64],
    trim: NDArray[np.int64],
    ranges: Ranges,
    colour: str,
) -> None:
    """Authors one mesh of a garment.

    ``vertex`` is the worn vertex of each vertex of the mesh, and ``trim`` that of the trims, -1: none.
    """
    prim, worn = stage.GetPrimAtPath(path), garment.worn
    surface = UsdGeom.Mesh(stage.OverridePrim(path))
    old = _default_points(UsdGeom.Mesh(prim))
    from_world = np.linalg.inv(to_metres(stage, prim, garment.units))

    def local(points: Points | NDArray[np.float32]) -> NDArray[np.float32]:
        moved = old.copy()
        carried = None if worn.trims is None else worn.trims.at(points)
        for shape, number in ((points, vertex), (carried, trim)):
            if shape is not None:
                there = np.asarray(shape, dtype=np.float64) @ from_world[:3, :3] + from_world[3, :3]
                moved[number >= 0] = there[number[number >= 0]]
        return np.ascontiguousarray(moved, dtype=np.float32)

    triangles = _file_triangles(surface)
    if UsdGeom.PrimvarsAPI(surface).GetPrimvar("normals"):
        surface.GetPrim().GetAttribute("primvars:normals").Block()

    def author(points: NDArray[np.float32], time: Usd.TimeCode) -> None:
        surface.CreatePointsAttr().Set(Vt.Vec3fArray.FromNumpy(points), time)
        normal = vertex_normals(points, triangles)
        if surface.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
            normal = -normal
        surface.CreateNormalsAttr().Set(Vt.Vec3fArray.FromNumpy(normal), time)
        box = np.stack([points.min(axis=0), points.max(axis=0)])
        surface.CreateExtentAttr().Set(Vt.Vec3fArray.FromNumpy(box), time)

    author(local(worn.points), Usd.TimeCode.Default())
    for index, frame in enumerate(() if worn.frames is None else worn.frames):
        author(local(frame), Usd.TimeCode(stage.GetStartTimeCode() + index))
    surface.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    if surface.GetSubdivisionSchemeAttr().Get() != UsdGeom.Tokens.none:
        # the control cage was fitted; a subdivided surface would intersect the body
        surface.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    fields = {name: _at_file_vertices(values, vertex) for name, values in worn.fields.items()}
    author_fields(surface, fields, ranges)
    if colour in fields:
        author_colours(surface, fields[colour], colour, ranges[colour])


def _default_points(mesh: UsdGeom.Mesh) -> Points:
    """The mesh's points as the loader reads them (default value, or first sample), in its own space."""
    value = mesh.GetPointsAttr().Get()
    if value is None:
        value = mesh.GetPointsAttr().Get(Usd.TimeCode.EarliestTime())
    return np.array(value, dtype=np.float64).reshape(-1, 3)


def _file_triangles(mesh: UsdGeom.Mesh) -> NDArray[np.int32]:
    """The mesh's polygons as triangle fans, for its normals."""
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get(), dtype=np.int64)
    corners = np.array(mesh.GetFaceVertexIndicesAttr().Get(), dtype=np.int64)
    starts = np.cumsum(counts) - counts
    fan_size = np.maximum(counts - 2, 0)
    fans = np.repeat(np.arange(len(counts)), fan_size)
    step = np.arange(len(fans)) - np.repeat(np.cumsum(fan_size) - fan_size, fan_size)
    first = starts[fans]
    return np.stack([corners[first], corners[first + step + 1], corners[first + step + 2]], axis=1).astype(np.int32)


def _at_file_vertices(values: NDArray[np.float32], vertex: NDArray[np.int64]) -> NDArray[np.float32]:
    """Values at the vertices of the file's mesh; 0 at those that no face uses."""
    found = np.zeros(len(vertex), dtype=np.float32)
    found[vertex >= 0] = values[vertex[vertex >= 0]]
    return found

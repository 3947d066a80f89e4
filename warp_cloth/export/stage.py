"""The worn garments as a USD stage for modelling and rendering tools."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pxr import Gf, Kind, Sdf, Tf, Usd, UsdGeom, UsdPhysics, UsdShade, UsdUtils, Vt

from warp_cloth.base import mesh_formats
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh, Points, vertex_normals
from warp_cloth.base.trims import TRIMS
from warp_cloth.base.version import package_version
from warp_cloth.base.warp_setup import usd_sentence
from warp_cloth.export.fields import Ranges, author_colours, author_fields, contiguous, unique_identifier
from warp_cloth.export.files import whole_file
from warp_cloth.export.flat_panels import author_flat_panels
from warp_cloth.export.physics import author_collider, author_physics
from warp_cloth.export.reference import AvatarAsset, author_reference
from warp_cloth.export.surface import (
    AVATAR_COLOUR,
    Colour,
    cloth_colour,
    linear,
    material_name,
    require_sound,
    trim_colour,
)
from warp_cloth.model.result import WornGarment

FRAMES_PER_SECOND = 24.0
FIRST_FRAME = 1  # where Blender, Maya and most film tools start counting
CLOTH_ROUGHNESS = 0.85
AVATAR_ROUGHNESS = 0.55
MATERIALS = "materials"


@dataclass(frozen=True, eq=False)
class StageAvatar:
    """An avatar as a stage is to have it: referenced where it came from a USD file and does not move, else copied."""

    mesh: Mesh
    asset: AvatarAsset | None = None  # the USD file that it came from
    frames: NDArray[np.float32] | None = None  # [m], shape [N, V, 3]; None: it does not move


def write_stage(
    path: Path,
    *,
    garments: Sequence[WornGarment],
    avatar: Mesh | StageAvatar | None,
    name: str,
    ranges: Ranges = MappingProxyType({}),
    colour: str = "",
    flat: Collection[int] = (),
) -> None:
    """Writes garments and avatar as one stage in metres: /NAME/GARMENT/GARMENT_mesh, /NAME/materials.

    A garment's trims, such as buttons, are /NAME/GARMENT/GARMENT_trims.

    The garments numbered in ``flat`` also get their panels, as cut: /NAME/GARMENT/GARMENT_panels.

    Points, normals and extent have time samples only where garments have frames. ``ranges`` are those of the colours
    of maps; the map named ``colour`` also becomes displayColor. Nothing is written if a value is not finite
    (ValueError).
    """
    body = StageAvatar(avatar) if isinstance(avatar, Mesh) else avatar
    if path.suffix not in mesh_formats.USD:
        raise InputError(path, f"is not a USD file name ({', '.join(mesh_formats.USD)})", "use the suffix .usdc")
    require_sound(garments, None if body is None else body.mesh)
    frame_count = common_frame_count(garments)
    stage = Usd.Stage.CreateInMemory()
    root = author_root(stage, name, frame_count)
    assembled = len(garments) + (body is not None) > 1
    Usd.ModelAPI(root).SetKind(Kind.Tokens.assembly if assembled else Kind.Tokens.component)
    taken, looks = {MATERIALS}, set[str]()
    for index, garment in enumerate(garments):
        part = author_part(root, garment.name, unique_identifier(garment.name, "garment", taken), assembled)
        painted = colour in garment.fields
        look = unique_identifier(material_name(garment), "garment", looks)
        material = author_material(root, look, cloth_colour(index), CLOTH_ROUGHNESS, painted=painted)
        surface = author_mesh(part, garment.mesh, garment.points, garment.frames)
        author_fields(surface, garment.fields, ranges)
        if painted:
            author_colours(surface, garment.fields[colour], colour, ranges[colour])
        author_panels(surface, garment.mesh, material)
        bind(surface.GetPrim(), material)
        cut = author_flat_panels(part, garment, ranges) if index in flat else None
        if cut is not None:
            author_panels(cut, garment.mesh, material)
            bind(cut.GetPrim(), material)
        author_physics(surface, garment, material)
        if garment.trims is not None:
            look = unique_identifier(f"{material_name(garment)}_trims", "trims", looks)
            hard = author_material(root, look, trim_colour(index), CLOTH_ROUGHNESS)
            trims, frames = garment.trims, garment.frames
            shapes = None if frames is None else np.stack([trims.at(frame) for frame in frames]).astype(np.float32)
            carried = author_mesh(part, trims.mesh, trims.at(garment.points), shapes, suffix=TRIMS)
            bind(carried.GetPrim(), hard)
    if body is not None:
        mesh, asset = body.mesh, body.asset
        part = author_part(root, mesh.name, unique_identifier(mesh.name, "avatar", taken), assembled)
        if asset is None or body.frames is not None or not author_reference(part, asset, path):
            look = unique_identifier(mesh.name, "avatar", looks)
            material = author_material(root, look, AVATAR_COLOUR, AVATAR_ROUGHNESS)
            surface = author_mesh(part, mesh, mesh.points, body.frames)
            bind(surface.GetPrim(), material)
            author_collider(surface)
    save(stage, path)


def common_frame_count(garments: Sequence[WornGarment]) -> int:
    """Number of frames of the garments; ValueError if they differ, because a frame needs a sample of each."""
    counts = {0 if garment.frames is None else len(garment.frames) for garment in garments}
    if len(counts) > 1:
        raise ValueError(f"garments differ in their number of frames: {sorted(counts)}")
    return counts.pop() if counts else 0


def author_root(stage: Usd.Stage, name: str, frame_count: int) -> Usd.Prim:
    """Authors the stage's metadata, and returns its default prim."""
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, UsdGeom.LinearUnits.meters)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(FRAMES_PER_SECOND)
    stage.SetFramesPerSecond(FRAMES_PER_SECOND)
    if frame_count:
        stage.SetStartTimeCode(FIRST_FRAME)
        stage.SetEndTimeCode(FIRST_FRAME + frame_count - 1)
    stage.GetRootLayer().customLayerData = {"generator": "warp_cloth", "version": package_version()}
    root = UsdGeom.Xform.Define(stage, Sdf.Path.absoluteRootPath.AppendChild(unique_identifier(name, "fit", set())))
    root.GetPrim().SetDisplayName(name)
    stage.SetDefaultPrim(root.GetPrim())
    UsdGeom.Scope.Define(stage, root.GetPath().AppendChild(MATERIALS))
    return root.GetPrim()


def author_part(root: Usd.Prim, name: str, identifier: str, assembled: bool) -> Usd.Prim:
    """The Xform of one garment or of the avatar; a component where the root is an assembly."""
    part = UsdGeom.Xform.Define(root.GetStage(), root.GetPath().AppendChild(identifier)).GetPrim()
    part.SetDisplayName(name)
    if assembled:
        Usd.ModelAPI(part).SetKind(Kind.Tokens.component)
    return part


def author_material(
    root: Usd.Prim, name: str, colour: Colour, roughness: float, *, painted: bool = False
) -> UsdShade.Material:
    """A preview surface of this name in one sRGB colour or, if ``painted``, in the mesh's displayColor."""
    path = root.GetPath().AppendChild(MATERIALS).AppendChild(name)
    material = UsdShade.Material.Define(root.GetStage(), path)
    shader = UsdShade.Shader.Define(root.GetStage(), path.AppendChild("surface"))
    shader.CreateIdAttr("UsdPreviewSurface")
    diffuse = shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
    diffuse.Set(Gf.Vec3f(*linear(colour).tolist()))
    if painted:
        reader = UsdShade.Shader.Define(root.GetStage(), path.AppendChild("colour"))
        reader.CreateIdAttr("UsdPrimvarReader_float3")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("displayColor")
        reader.CreateInput("fallback", Sdf.ValueTypeNames.Float3).Set(Gf.Vec3f(*linear(colour).tolist()))
        diffuse.ConnectToSource(reader.CreateOutput("result", Sdf.ValueTypeNames.Float3))
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(roughness)
    shader.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(0.0)
    output = shader.CreateOutput("surface", Sdf.ValueTypeNames.Token)
    material.CreateSurfaceOutput().ConnectToSource(output)
    return material


def bind(prim: Usd.Prim, material: UsdShade.Material) -> None:
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material)


def author_mesh(
    part: Usd.Prim, mesh: Mesh, points: Points, frames: NDArray[np.float32] | None, *, suffix: str = "mesh"
) -> UsdGeom.Mesh:
    """The mesh: faces and st once; points, normals and extent as default values and at every frame."""
    path = part.GetPath().AppendChild(f"{part.GetName()}_{suffix}")
    surface = UsdGeom.Mesh.Define(part.GetStage(), path)
    surface.CreateFaceVertexCountsAttr(Vt.IntArray(mesh.triangle_count, 3))
    surface.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(contiguous(mesh.triangles.ravel(), np.int32)))
    surface.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    surface.CreateDoubleSidedAttr(True)
    surface.CreatePointsAttr()
    surface.CreateNormalsAttr()
    surface.CreateExtentAttr()
    surface.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    author_shape(surface, mesh, points, Usd.TimeCode.Default())
    for index, frame in enumerate(() if frames is None else frames):
        author_shape(surface, mesh, frame, Usd.TimeCode(FIRST_FRAME + index))
    if mesh.texcoords is not None:
        st = UsdGeom.PrimvarsAPI(surface).CreatePrimvar(
            "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
        )
        st.Set(Vt.Vec2fArray.FromNumpy(contiguous(mesh.texcoords.reshape(-1, 2), np.float32)))
    return surface


def author_shape(surface: UsdGeom.Mesh, mesh: Mesh, points: ArrayLike, time: Usd.TimeCode) -> None:
    """Points [m], vertex normals and extent at one time."""
    written = contiguous(points, np.float32)
    box = np.stack([written.min(axis=0), written.max(axis=0)])  # of the float32 points: it holds each
    surface.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(written), time)
    surface.GetNormalsAttr().Set(Vt.Vec3fArray.FromNumpy(vertex_normals(written, mesh.triangles)), time)
    surface.GetExtentAttr().Set(Vt.Vec3fArray.FromNumpy(box), time)


def author_panels(surface: UsdGeom.Mesh, mesh: Mesh, material: UsdShade.Material) -> None:
    """Panels as face subsets that partition the garment."""
    if mesh.panels is None:
        return
    taken: set[str] = set()
    for panel in np.unique(mesh.panels).tolist():
        name = mesh.panel_names[panel] if 0 <= panel < len(mesh.panel_names) else f"panel_{panel}"
        faces = contiguous(np.flatnonzero(mesh.panels == panel), np.int32)
        subset = UsdShade.MaterialBindingAPI(surface).CreateMaterialBindSubset(
            unique_identifier(name, "panel", taken), Vt.IntArray.FromNumpy(faces), UsdGeom.Tokens.face
        )
        bind(subset.GetPrim(), material)
    UsdShade.MaterialBindingAPI(surface).SetMaterialBindSubsetsFamilyType(UsdGeom.Tokens.partition)


def save(stage: Usd.Stage, path: Path) -> None:
    """Writes the stage, complete or not at all, in the format of the file's suffix."""
    with whole_file(path) as place:
        layer_place = place.with_suffix(".usdc") if path.suffix == ".usdz" else place
        try:
            written = stage.GetRootLayer().Export(str(layer_place))
            if written and path.suffix == ".usdz":
                written = UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(layer_place)), str(place))
        except Tf.ErrorException as error:
            raise OSError(f"USD: {usd_sentence(str(error))}") from error
        if not written:
            raise OSError("USD could not write it")

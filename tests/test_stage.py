"""The stage holds the arrays, by the rules that modelling and rendering tools need."""

from __future__ import annotations

from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from pxr import Kind, Usd, UsdGeom, UsdShade, UsdValidation
from worn import FRAME_COUNT, box_avatar, worn

from warp_cloth.base.errors import InputError
from warp_cloth.export.stage import FIRST_FRAME, write_stage
from warp_cloth.export.surface import cloth_colour, linear
from warp_cloth.material.fabric import fabric_named
from warp_cloth.model.result import WornGarment

# Sums of at most eight float32 cross products, normalised in float64 and rounded once.
NORMAL_TOLERANCE = 2e-7


def written(path: Path, *garments: WornGarment, avatar: bool = True, name: str = "fit") -> Usd.Stage:
    write_stage(path, garments=garments, avatar=box_avatar() if avatar else None, name=name)
    return Usd.Stage.Open(str(path))


def surface(stage: Usd.Stage, part: str = "shirt") -> UsdGeom.Mesh:
    return UsdGeom.Mesh(stage.GetPrimAtPath(f"/fit/{part}/{part}_mesh"))


@pytest.mark.parametrize("suffix", [".usdc", ".usda", ".usdz"])
def test_validators_find_nothing(tmp_path: Path, suffix: str) -> None:
    stage = written(tmp_path / f"fit{suffix}", worn(frame_count=FRAME_COUNT), worn("coat", frame_count=FRAME_COUNT))
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    findings = UsdValidation.ValidationContext(validators).Validate(stage)
    assert [finding.GetMessage() for finding in findings] == []


def test_stage_is_in_metres_with_y_up_under_one_prim(tmp_path: Path) -> None:
    stage = written(tmp_path / "fit.usdc", worn())
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.y
    assert [prim.GetName() for prim in stage.GetPseudoRoot().GetChildren()] == ["fit"]
    assert stage.GetDefaultPrim().IsA(UsdGeom.Xform)
    assert stage.GetTimeCodesPerSecond() == stage.GetFramesPerSecond() == 24.0
    about = stage.GetRootLayer().customLayerData
    assert about == {"generator": "warp_cloth", "version": version("warp-cloth")}


def test_assembly_has_components_and_one_garment_is_a_component(tmp_path: Path) -> None:
    both = written(tmp_path / "both.usdc", worn())
    kinds = {str(prim.GetPath()): Usd.ModelAPI(prim).GetKind() for prim in both.Traverse()}
    assert {path: kind for path, kind in kinds.items() if kind} == {
        "/fit": Kind.Tokens.assembly,
        "/fit/shirt": Kind.Tokens.component,
        "/fit/body": Kind.Tokens.component,
    }
    alone = written(tmp_path / "alone.usdc", worn(), avatar=False)
    kinds = {str(prim.GetPath()): Usd.ModelAPI(prim).GetKind() for prim in alone.Traverse()}
    assert {path: kind for path, kind in kinds.items() if kind} == {"/fit": Kind.Tokens.component}


def test_arrays_read_back_equal(tmp_path: Path) -> None:
    garment = worn()
    stage = written(tmp_path / "fit.usdc", garment)
    mesh = surface(stage)
    assert np.array_equal(mesh.GetPointsAttr().Get(), garment.points.astype(np.float32))
    assert np.array_equal(mesh.GetFaceVertexIndicesAttr().Get(), garment.mesh.triangles.ravel())
    assert np.array_equal(mesh.GetFaceVertexCountsAttr().Get(), np.full(garment.mesh.triangle_count, 3))
    assert mesh.GetSubdivisionSchemeAttr().Get() == UsdGeom.Tokens.none
    assert mesh.GetDoubleSidedAttr().Get() is True
    st = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st")
    assert np.array_equal(st.Get(), garment.mesh.texcoords.reshape(-1, 2).astype(np.float32))
    assert (st.GetTypeName(), st.GetInterpolation()) == ("texCoord2f[]", UsdGeom.Tokens.faceVarying)
    strain = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("strain")
    assert np.array_equal(strain.Get(), garment.fields["strain"])
    assert (strain.GetTypeName(), strain.GetInterpolation()) == ("float[]", UsdGeom.Tokens.vertex)


def test_avatar_is_written_as_given(tmp_path: Path) -> None:
    stage, body = written(tmp_path / "fit.usdc", worn()), box_avatar()
    mesh = surface(stage, "body")
    assert np.array_equal(mesh.GetPointsAttr().Get(), body.points.astype(np.float32))
    assert np.array_equal(mesh.GetFaceVertexIndicesAttr().Get(), body.triangles.ravel())


def test_normals_are_the_area_weighted_means(tmp_path: Path) -> None:
    garment = worn()
    stage = written(tmp_path / "fit.usdc", garment)
    mesh = surface(stage)
    points = garment.points.astype(np.float32).astype(np.float64)
    expected = np.zeros_like(points)
    for triangle in garment.mesh.triangles:
        a, b, c = points[triangle]
        for vertex in triangle:
            expected[vertex] += np.cross(b - a, c - a)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert mesh.GetNormalsAttr().GetTypeName() == "normal3f[]"
    assert mesh.GetNormalsInterpolation() == UsdGeom.Tokens.vertex
    assert np.abs(np.array(mesh.GetNormalsAttr().Get()) - expected).max() <= NORMAL_TOLERANCE


def test_normals_are_unit_even_where_no_area_meets(tmp_path: Path) -> None:
    garment = worn()
    loose = replace(garment.mesh, triangles=garment.mesh.triangles[8:])  # leaves the first corner without faces
    points = garment.points.copy()
    points[garment.mesh.triangles[-1]] = points[0]  # a triangle without area
    part = replace(garment, mesh=replace(loose, texcoords=None, panels=None), points=points)
    stage = written(tmp_path / "fit.usdc", part)
    normals = np.array(surface(stage).GetNormalsAttr().Get())
    assert np.abs(np.linalg.norm(normals, axis=1) - 1.0).max() <= NORMAL_TOLERANCE


def test_without_frames_nothing_is_sampled(tmp_path: Path) -> None:
    stage = written(tmp_path / "fit.usdc", worn())
    sampled = [a.GetPath() for p in stage.Traverse() for a in p.GetAttributes() if a.GetNumTimeSamples()]
    assert sampled == []
    assert not stage.HasAuthoredTimeCodeRange()


def test_frames_are_sampled_at_every_whole_frame(tmp_path: Path) -> None:
    garment = worn(frame_count=FRAME_COUNT)
    assert garment.frames is not None
    stage = written(tmp_path / "fit.usdc", garment)
    times = [float(FIRST_FRAME + frame) for frame in range(FRAME_COUNT)]
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (times[0], times[-1])
    mesh = surface(stage)
    shape = (mesh.GetPointsAttr(), mesh.GetNormalsAttr(), mesh.GetExtentAttr())
    sampled = [a.GetName() for p in stage.Traverse() for a in p.GetAttributes() if a.GetNumTimeSamples()]
    assert sorted(sampled) == sorted(attribute.GetName() for attribute in shape)
    for attribute in shape:
        assert attribute.GetTimeSamples() == times
    for time, frame in zip(times, garment.frames, strict=True):
        assert np.array_equal(mesh.GetPointsAttr().Get(time), frame)
        assert np.array_equal(mesh.GetExtentAttr().Get(time), [frame.min(axis=0), frame.max(axis=0)])
    assert np.array_equal(mesh.GetPointsAttr().Get(), garment.points.astype(np.float32))  # the default: worn


def test_extent_holds_the_points(tmp_path: Path) -> None:
    stage = written(tmp_path / "fit.usdc", worn())
    mesh = surface(stage)
    points = np.array(mesh.GetPointsAttr().Get())
    assert np.array_equal(mesh.GetExtentAttr().Get(), [points.min(axis=0), points.max(axis=0)])


def test_panels_share_out_all_faces(tmp_path: Path) -> None:
    garment = worn()
    stage = written(tmp_path / "fit.usdc", garment)
    mesh = surface(stage)
    subsets = UsdShade.MaterialBindingAPI(mesh).GetMaterialBindSubsets()
    assert [subset.GetPrim().GetName() for subset in subsets] == ["front", "back", "panel_2"]
    faces = np.concatenate([subset.GetIndicesAttr().Get() for subset in subsets])
    assert np.array_equal(np.sort(faces), np.arange(garment.mesh.triangle_count))
    family = UsdGeom.Subset.GetFamilyType(mesh, UsdShade.Tokens.materialBind)
    assert family == UsdGeom.Tokens.partition


def test_materials_are_named_by_garment_and_fabric(tmp_path: Path) -> None:
    stage = written(tmp_path / "fit.usda", replace(worn("my shirt"), fabric=fabric_named("jersey")), worn("coat"))
    materials = stage.GetPrimAtPath("/fit/materials").GetChildren()
    assert [prim.GetName() for prim in materials] == ["my_shirt_jersey", "coat", "body"]


def test_every_surface_and_panel_has_a_preview_material(tmp_path: Path) -> None:
    stage = written(tmp_path / "fit.usdc", worn(), worn("coat"))
    bound = {}
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Mesh) or prim.IsA(UsdGeom.Subset):
            material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
            shader, *_ = material.ComputeSurfaceSource()
            assert UsdShade.Shader(shader).GetIdAttr().Get() == "UsdPreviewSurface"
            assert str(material.GetPath()).startswith("/fit/")
            bound[prim.GetName()] = np.array(UsdShade.Shader(shader).GetInput("diffuseColor").Get())
    assert np.array_equal(bound["shirt_mesh"], linear(cloth_colour(0)).astype(np.float32))
    assert np.array_equal(bound["coat_mesh"], linear(cloth_colour(1)).astype(np.float32))
    assert not np.array_equal(bound["body_mesh"], bound["shirt_mesh"])


def test_any_name_becomes_a_legal_prim_and_stays_readable(tmp_path: Path) -> None:
    names = ["summer shirt", "summer shirt", "Größe 1", "日本", "", "3/4 sleeve", "materials", "body"]
    path = tmp_path / "fit.usdc"
    stage = written(path, *[worn(name) for name in names], name="my fit, 1st")
    parts = [prim for prim in stage.GetDefaultPrim().GetChildren() if prim.IsA(UsdGeom.Xform)]
    assert stage.GetDefaultPrim().GetName() == "my_fit__1st"
    assert stage.GetDefaultPrim().GetDisplayName() == "my fit, 1st"
    assert [part.GetName() for part in parts] == [
        "summer_shirt",
        "summer_shirt_2",
        "Groe_1",
        "garment",
        "garment_2",
        "_3_4_sleeve",
        "materials_2",
        "body",
        "body_2",
    ]
    assert [part.GetDisplayName() for part in parts] == [*names, "body"]


def test_field_names_do_not_take_the_surface_own(tmp_path: Path) -> None:
    garment = worn()
    ones = np.ones(garment.mesh.vertex_count, dtype=np.float32)
    fields = {"st": ones, "normals": ones, "gap [mm]": ones}
    stage = written(tmp_path / "fit.usdc", replace(garment, fields=fields))
    primvars = UsdGeom.PrimvarsAPI(surface(stage)).GetPrimvarsWithAuthoredValues()
    assert {p.GetPrimvarName() for p in primvars} == {"st", "st_2", "normals_2", "gap__mm_"}


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e300])
@pytest.mark.parametrize("where", ["points", "frames", "fields"])
def test_what_is_not_finite_is_refused_and_leaves_no_file(tmp_path: Path, where: str, value: float) -> None:
    garment = worn("bad shirt", frame_count=FRAME_COUNT)
    bad = {"points": garment.points.copy(), "frames": garment.frames.astype(np.float64)}
    if where == "fields":
        bad["fields"] = {"gap": np.full(garment.mesh.vertex_count, value)}
    else:
        bad[where][..., 3, 1] = value
    with pytest.raises(ValueError, match="bad shirt"):
        write_stage(tmp_path / "fit.usdc", garments=[replace(garment, **bad)], avatar=None, name="fit")
    assert list(tmp_path.iterdir()) == []


def test_avatar_that_is_not_finite_is_refused(tmp_path: Path) -> None:
    body = box_avatar()
    body.points[0, 0] = np.nan
    with pytest.raises(ValueError, match="body"):
        write_stage(tmp_path / "fit.usdc", garments=[worn()], avatar=body, name="fit")


def test_arrays_that_do_not_match_the_mesh_are_refused(tmp_path: Path) -> None:
    garment = worn(frame_count=FRAME_COUNT)
    with pytest.raises(ValueError, match="per vertex"):
        written(tmp_path / "fit.usdc", replace(garment, points=garment.points[1:]))
    with pytest.raises(ValueError, match="frames"):
        written(tmp_path / "fit.usdc", garment, worn("coat"))


def test_a_failed_write_keeps_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "fit.usdc"
    path.mkdir()  # a folder cannot be replaced by a file
    with pytest.raises(InputError, match=r"fit\.usdc"):
        write_stage(path, garments=[worn()], avatar=None, name="fit")
    assert list(tmp_path.iterdir()) == [path]
    with pytest.raises(InputError, match="not a USD file name"):
        write_stage(tmp_path / "fit.obj", garments=[worn()], avatar=None, name="fit")


def test_stage_can_be_written_again(tmp_path: Path) -> None:
    first = worn()
    written(tmp_path / "fit.usdc", first)
    moved = replace(first, points=first.points + 1.0)
    write_stage(tmp_path / "fit.usdc", garments=[moved], avatar=None, name="fit")
    stage = Usd.Stage.Open(str(tmp_path / "fit.usdc"))
    stage.Reload()
    assert np.array_equal(surface(stage).GetPointsAttr().Get(), moved.points.astype(np.float32))
    assert [entry.name for entry in tmp_path.iterdir()] == ["fit.usdc"]

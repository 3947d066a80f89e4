"""A user's stage is the scene: read by its physics, left as it is, and worn through a layer over it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdUtils, UsdValidation, Vt
from stages import COUNT, RADIUS, add_mesh, write_users_stage

from warp_cloth.base.errors import InputError
from warp_cloth.export.save import write_meshes
from warp_cloth.fitting.fit import Fit, fit
from warp_cloth.material.fabric import Fabric
from warp_cloth.material.linearised import CURVATURE, STRAIN, fabric_table, linear_constants
from warp_cloth.scene import load_scene

# held all round, so that it has one rest shape: loose folds fall one way or another by the last bit of a number
HELD = "garment.pin.loop=0"
FAST = ("solver.iterations=300", "collision.pixel_mm=4")
FLOAT32 = 2e-7  # of a metre, what a stage's points hold
UNITS = 2e-5  # [m]; float32 points in another unit, carried through 300 iterations


def fitted(path: Path, **options: str) -> Fit:
    return fit(path, device="cpu", overrides=(*FAST, HELD), **options)


def world_points(stage: Usd.Stage, path: str) -> np.ndarray:
    """Points in metres, y up."""
    prim = stage.GetPrimAtPath(path)
    matrix = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(prim))
    points = np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get(), dtype=np.float64) @ matrix[:3, :3] + matrix[3, :3]
    points *= UsdGeom.GetStageMetersPerUnit(stage)
    return points[:, [0, 2, 1]] * (1, 1, -1) if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z else points


@pytest.fixture(scope="module")
def metres(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Fit]:
    path = write_users_stage(tmp_path_factory.mktemp("metres"))
    return path, fitted(path, maps="strain,pressure,gap")


def test_the_scene_comes_from_the_physics_schema(metres: tuple[Path, Fit]) -> None:
    scene = load_scene(metres[0])
    (garment,) = scene.garments
    assert (garment.name, garment.prim, garment.rest) == ("cloth", "/World/wardrobe/cloth", "physics")
    assert garment.fabric.thickness == pytest.approx(0.0006)
    assert garment.fabric.weight == pytest.approx(300.0 * 0.0006)
    assert garment.fabric.stretch_warp == pytest.approx(800.0 / STRAIN)
    assert garment.fabric.bending_weft == pytest.approx(2 * 4e-6 / CURVATURE)
    assert scene.avatar.prim == "/World/ball/skin"


def test_the_rest_shape_is_the_stages(metres: tuple[Path, Fit]) -> None:
    garment = metres[1].garments[0]
    edges = garment.rest.topology.edges
    drawn = np.linalg.norm(garment.mesh.points[edges[:, 0]] - garment.mesh.points[edges[:, 1]], axis=1)
    assert np.allclose(garment.rest.edge_length / drawn, 0.98, atol=1e-5)


def test_centimetres_with_z_up_give_the_same_garment(metres: tuple[Path, Fit], tmp_path: Path) -> None:
    other = fitted(write_users_stage(tmp_path, metres=0.01, z_up=True))
    assert other.scene.garments[0].fabric.weight == pytest.approx(0.18)
    assert other.scene.garments[0].fabric.bending_warp == pytest.approx(2 * 4e-6 / CURVATURE)
    assert np.abs(other.garments[0].points - metres[1].garments[0].points).max() < UNITS


def test_the_layer_lasts_as_long_as_its_frames(metres: tuple[Path, Fit], tmp_path: Path) -> None:
    """The user's stage has no times of its own."""
    worn = metres[1]
    frames = np.stack([worn.garments[0].points.astype(np.float32)] * 3)
    write_meshes(replace(worn, garments=(replace(worn.garments[0], frames=frames),)), tmp_path)
    over = Usd.Stage.Open(str(tmp_path / "user_over.usda"))
    samples = UsdGeom.Mesh(over.GetPrimAtPath("/World/wardrobe/cloth")).GetPointsAttr().GetTimeSamples()
    assert [over.GetStartTimeCode(), over.GetEndTimeCode()] == [samples[0], samples[-1]]
    assert over.GetRootLayer().HasStartTimeCode()


def test_the_users_files_stay_as_they_are_and_the_layer_wears_the_garment(metres: tuple[Path, Fit]) -> None:
    path, worn = metres
    files = sorted(path.parent.glob("*.usda"))
    before = [file.read_bytes() for file in files]
    out = path.parent / "out"
    names = [written.name for written in write_meshes(worn, out, colour="strain")]
    assert [file.read_bytes() for file in files] == before
    assert "user_over.usda" in names
    over = Usd.Stage.Open(str(out / "user_over.usda"))
    assert np.abs(world_points(over, "/World/wardrobe/cloth") - worn.garments[0].points).max() < FLOAT32
    mesh = UsdGeom.Mesh(over.GetPrimAtPath("/World/wardrobe/cloth"))
    assert mesh.GetNormalsInterpolation() == UsdGeom.Tokens.vertex
    assert not UsdGeom.PrimvarsAPI(mesh).GetPrimvar("normals").HasValue()
    strain = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("strain")
    assert np.array_equal(strain.Get(), worn.garments[0].fields["strain"])
    box = np.array(mesh.GetExtentAttr().Get())
    assert np.allclose(box, UsdGeom.PointBased.ComputeExtent(mesh.GetPointsAttr().Get()), atol=1e-6)
    # what the user made is still there
    assert over.GetPrimAtPath("/World/ball").GetVariantSets().GetVariantSelection("look") == "white"
    over.GetPrimAtPath("/World/ball").GetVariantSets().SetSelection("look", "grey")
    skin = UsdGeom.Mesh(over.GetPrimAtPath("/World/ball/skin"))
    assert skin.GetDisplayColorAttr().Get()[0][0] == pytest.approx(0.5)
    assert over.GetDefaultPrim().GetPath() == "/World"
    assert over.GetRootLayer().subLayerPaths[:] == ["../user.usda"]


def test_a_garment_of_several_meshes_is_sewn_and_worn_as_one(tmp_path: Path) -> None:
    """A cloth cut into two meshes of one group, whose cut has vertices at the same places."""
    path = write_users_stage(tmp_path, physics=False)
    stage = Usd.Stage.Open(str(path))
    whole = UsdGeom.Mesh(stage.GetPrimAtPath("/World/wardrobe/cloth"))
    points = np.array(whole.GetPointsAttr().Get())
    triangles = np.array(whole.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
    left = points[triangles].mean(axis=1)[:, 0] < 0.0
    for name, half in (("left", triangles[left]), ("right", triangles[~left])):
        used, own = np.unique(half, return_inverse=True)
        add_mesh(stage, f"/World/wardrobe/coat/{name}", Vt.Vec3fArray.FromNumpy(points[used]), own.reshape(-1, 3))
    stage.RemovePrim("/World/wardrobe/cloth")
    stage.Save()
    prims = ("garment.prim=/World/wardrobe/coat", "avatar.prim=/World/ball", "solver.iterations=30")
    worn = fit(path, device="cpu", overrides=prims)
    (garment,) = worn.garments
    assert garment.mesh.vertex_count == len(points)
    assert not any("pieces" in note for note in garment.mesh.notes)
    write_meshes(worn, tmp_path / "out")
    over = Usd.Stage.Open(str(tmp_path / "out" / "user_over.usda"))
    found = np.concatenate([world_points(over, f"/World/wardrobe/coat/{name}") for name in ("left", "right")])
    assert garment.mesh.vertex_map is not None
    assert np.abs(found - garment.points[garment.mesh.vertex_map]).max() < FLOAT32
    with pytest.raises(InputError, match=r'"/World" contains the avatar, too; name the prim of the garment alone'):
        load_scene(path, ("garment.prim=/World", "avatar.prim=/World/ball"))


def test_layer_over_a_stage_in_centimetres_is_in_centimetres(tmp_path: Path) -> None:
    worn = fitted(write_users_stage(tmp_path, metres=0.01, z_up=True))
    write_meshes(worn, tmp_path / "out")
    over = Usd.Stage.Open(str(tmp_path / "out" / "user_over.usda"))
    assert UsdGeom.GetStageMetersPerUnit(over) == 0.01
    assert UsdGeom.GetStageUpAxis(over) == UsdGeom.Tokens.z
    assert np.abs(world_points(over, "/World/wardrobe/cloth") - worn.garments[0].points).max() < 4 * FLOAT32


def test_the_new_stage_refers_to_the_avatar_and_is_valid(metres: tuple[Path, Fit]) -> None:
    path, worn = metres
    out = path.parent / "new"
    write_meshes(worn, out, formats=("usda", "usdz"))
    text = (out / "user.usda").read_text()
    assert "@../user.usda@</World/ball>" in text
    for file in (out / "user.usda", out / "user.usdz"):
        stage = Usd.Stage.Open(str(file))
        (skin,) = (prim for prim in stage.Traverse() if prim.GetName() == "skin")
        assert np.abs(world_points(stage, str(skin.GetPath())) - worn.avatar.points).max() < 2 * FLOAT32
        validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
        found = UsdValidation.ValidationContext(validators).Validate(stage)
        assert [finding.GetMessage() for finding in found] == []


def test_a_written_stage_is_a_scene_again_with_its_physics_intact(metres: tuple[Path, Fit], tmp_path: Path) -> None:
    worn = fit("sphere", device="cpu", overrides=("garment.shape.vertices_per_side=11", *FAST))
    (stage, *_) = write_meshes(worn, tmp_path)
    again = load_scene(stage)
    assert again.garments[0].fabric == worn.garments[0].fabric
    assert again.garments[0].rest == "physics"
    second = fit(again, device="cpu")
    first_rest, second_rest = worn.garments[0].rest, second.garments[0].rest
    assert np.allclose(second_rest.edge_length, first_rest.edge_length, rtol=1e-5)
    assert np.allclose(second_rest.vertex_weight, first_rest.vertex_weight, rtol=1e-5)
    assert first_rest.sheet.directed
    assert second_rest.sheet.directed
    turned = second_rest.sheet.flat - second_rest.sheet.flat.mean(axis=1, keepdims=True)
    assert np.allclose(turned, first_rest.sheet.flat - first_rest.sheet.flat.mean(axis=1, keepdims=True), atol=1e-6)


def test_a_garment_in_an_instance_is_worn_too(tmp_path: Path) -> None:
    write_users_stage(tmp_path, name="inner.usda", physics=False)
    stage = Usd.Stage.CreateNew(str(tmp_path / "outer.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    for name in ("a", "b"):
        prim = UsdGeom.Xform.Define(stage, f"/{name}").GetPrim()
        prim.GetReferences().AddReference("./inner.usda")
        prim.SetInstanceable(True)
    UsdGeom.Xformable(stage.GetPrimAtPath("/b")).AddTranslateOp().Set((0.0, 0.0, -4.0))
    stage.Save()
    prims = ("garment.prim=/a/wardrobe/cloth", "avatar.prim=/a/ball")
    worn = fit(tmp_path / "outer.usda", device="cpu", overrides=(*FAST, *prims))
    write_meshes(worn, tmp_path / "out")
    over = Usd.Stage.Open(str(tmp_path / "out" / "outer_over.usda"))
    assert np.abs(world_points(over, "/a/wardrobe/cloth") - worn.garments[0].points).max() < FLOAT32
    assert over.GetPrimAtPath("/b").IsInstance()
    assert not over.GetPrimAtPath("/a").IsInstance()


def test_a_stage_without_physics_must_be_told_its_prims(tmp_path: Path) -> None:
    path = write_users_stage(tmp_path, physics=False)
    with pytest.raises(InputError, match="no mesh of the stage is a surface deformable") as refused:
        load_scene(path)
    assert "override garment.prim=PATH and override avatar.prim=PATH" in refused.value.remedy
    scene = load_scene(path, ("garment.prim=/World/wardrobe/cloth", "avatar.prim=/World/ball"))
    assert scene.garments[0].rest == "auto"


def test_the_users_stage_is_not_written_over(metres: tuple[Path, Fit]) -> None:
    path, worn = metres
    with pytest.raises(InputError, match="would be overwritten"):
        write_meshes(worn, path.parent, formats=("usda",))


def test_rest_triangles_that_fit_no_mesh_are_refused(tmp_path: Path) -> None:
    path = write_users_stage(tmp_path)
    stage = Usd.Stage.Open(str(path))
    prim = stage.GetPrimAtPath("/World/wardrobe/cloth")
    from pxr import Sdf, Vt

    prim.CreateAttribute("physics:restTriVertexIndices", Sdf.ValueTypeNames.Int3Array).Set(Vt.Vec3iArray(2))
    stage.Save()
    with pytest.raises(InputError, match="restTriVertexIndices do not match the mesh"):
        fitted(path)


def test_linear_constants_go_there_and_back() -> None:
    fabric = Fabric(stretch_warp=9000.0, stretch_weft=9000.0, shear=200.0, bending_warp=3e-7, bending_weft=3e-7)
    table = fabric_table(linear_constants(fabric), fabric.thickness, None)
    for name, value in table.items():
        assert value == pytest.approx(getattr(fabric, name), rel=1e-6)
    even = Fabric()
    assert "shear" not in fabric_table(linear_constants(even), even.thickness, None)


def test_a_cloth_over_a_ball_lies_on_it(metres: tuple[Path, Fit]) -> None:
    points = metres[1].garments[0].points
    assert len(points) == COUNT**2
    assert np.linalg.norm(points - (0.0, RADIUS + 0.3, 0.0), axis=1).min() > RADIUS


def test_a_package_holds_everything(metres: tuple[Path, Fit]) -> None:
    path, worn = metres
    out = path.parent / "package"
    write_meshes(worn, out, formats=("usdz",))
    layers, assets, unresolved = UsdUtils.ComputeAllDependencies(str(out / "user.usdz"))
    assert unresolved == []
    assert all(str(out / "user.usdz") in layer.identifier for layer in layers)
    assert assets == []


def test_a_subdivided_mesh_is_fitted_as_its_cage_and_shown_so(tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    path = write_users_stage(tmp_path)
    stage = Usd.Stage.Open(str(path))
    UsdGeom.Mesh(stage.GetPrimAtPath("/World/wardrobe/cloth")).GetSubdivisionSchemeAttr().Set("catmullClark")
    stage.Save()
    worn = fit(path, device="cpu", overrides=("solver.iterations=0", "collision.pixel_mm=4"))
    assert any("subdivision (catmullClark) is not applied" in note for note in worn.garments[0].mesh.notes)
    capfd.readouterr()
    write_meshes(worn, tmp_path / "out")
    assert "Warning" not in capfd.readouterr().err
    over = Usd.Stage.Open(str(tmp_path / "out" / "user_over.usda"))
    cloth = UsdGeom.Mesh(over.GetPrimAtPath("/World/wardrobe/cloth"))
    assert cloth.GetSubdivisionSchemeAttr().Get() == "none"

"""USD files: unit, up axis, place, texture, holes, instances and time samples are honoured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, Vt
from small_grid import FLOAT32_AT_ONE_METRE, POINTS, TRIANGLES, load, write_usd

from warp_cloth.base.errors import InputError


def test_usd_unit_up_axis_and_transform_are_honoured(tmp_path: Path) -> None:
    path = tmp_path / "stage.usda"
    moved = np.eye(4)
    moved[3, :3] = [0, 0, 100]  # USD multiplies rows: 100 cm along z, which is up
    write_usd(path, moved, metres=0.01, up=UsdGeom.Tokens.z, points=POINTS * 100)
    mesh = load(path)
    expected = np.stack([POINTS[:, 0], POINTS[:, 2] + 1, -POINTS[:, 1]], axis=1)
    np.testing.assert_allclose(mesh.points, expected, atol=10 * FLOAT32_AT_ONE_METRE)
    assert mesh.unit == "cm"
    assert any("overrides" in note for note in load(path, units="in").notes)


def test_usd_texture_subsets_holes_and_orientation(tmp_path: Path) -> None:
    path = tmp_path / "rich.usda"
    write_usd(path)
    stage = Usd.Stage.Open(str(path))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/root/shirt"))
    mesh.CreateOrientationAttr(UsdGeom.Tokens.leftHanded)
    mesh.CreateHoleIndicesAttr([17])
    kind = Sdf.ValueTypeNames.TexCoord2fArray
    primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", kind, UsdGeom.Tokens.faceVarying)
    primvar.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(POINTS[:, :2], dtype=np.float32)))
    primvar.SetIndices(Vt.IntArray.FromNumpy(TRIANGLES.reshape(-1).astype(np.int32)))
    UsdGeom.Subset.CreateGeomSubset(mesh, "front", UsdGeom.Tokens.face, [0, 1, 2])
    stage.Save()
    loaded = load(path)
    np.testing.assert_array_equal(loaded.triangles, TRIANGLES[:17, ::-1])
    assert loaded.panel_names == ("front", "unassigned")
    assert loaded.panels.tolist() == [0, 0, 0] + [1] * 14
    assert loaded.texcoords is not None
    np.testing.assert_allclose(loaded.texcoords, loaded.points[loaded.triangles][:, :, :2], atol=FLOAT32_AT_ONE_METRE)
    assert any("holes" in note for note in loaded.notes)


def test_usd_with_several_meshes_asks_for_a_prim(tmp_path: Path) -> None:
    path = tmp_path / "several.usda"
    write_usd(path)
    stage = Usd.Stage.Open(str(path))
    Sdf.CopySpec(stage.GetRootLayer(), "/root/shirt", stage.GetRootLayer(), "/root/scarf")
    stage.Save()
    with pytest.raises(InputError, match=r"2 meshes: /root/shirt, /root/scarf; set garment.prim"):
        load(path)
    assert load(path, prim="/root/scarf").vertex_count == 16
    with pytest.raises(InputError, match=r"no prim /root/hat; garment.prim may be /root/shirt, /root/scarf"):
        load(path, prim="/root/hat")
    with pytest.raises(InputError, match="no prim"):
        load(path, prim="not a path")
    assert load(path, role="avatar").triangle_count == 2 * len(TRIANGLES)


def test_usd_instances_and_time_samples_are_read(tmp_path: Path) -> None:
    path = tmp_path / "worn.usda"
    write_usd(path)
    stage = Usd.Stage.Open(str(path))
    attribute = stage.GetPrimAtPath("/root/shirt").GetAttribute("points")
    points = attribute.Get()
    attribute.Clear()
    attribute.Set(points, 3.0)
    stage.SetDefaultPrim(stage.GetPrimAtPath("/root"))
    stage.Save()
    user = Usd.Stage.CreateNew(str(tmp_path / "user.usda"))
    UsdGeom.SetStageMetersPerUnit(user, 1.0)
    instance = user.DefinePrim("/here")
    instance.GetReferences().AddReference("./worn.usda")
    instance.SetInstanceable(True)
    user.Save()
    mesh = load(tmp_path / "user.usda", prim="/here")
    np.testing.assert_allclose(mesh.points, POINTS, atol=FLOAT32_AT_ONE_METRE)


def test_usd_place_and_texture_that_only_have_time_samples_are_those_of_the_first(tmp_path: Path) -> None:
    path = tmp_path / "moves.usda"
    write_usd(path)
    stage = Usd.Stage.Open(str(path))
    move = UsdGeom.Xform(stage.GetPrimAtPath("/root")).AddTranslateOp()
    for time, height in ((5.0, 2.0), (9.0, 3.0)):
        move.Set(Gf.Vec3d(0.0, height, 0.0), time)
    kind = Sdf.ValueTypeNames.TexCoord2fArray
    primvar = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/root/shirt")).CreatePrimvar("st", kind, UsdGeom.Tokens.vertex)
    primvar.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(POINTS[:, :2], dtype=np.float32)), 5.0)
    stage.Save()
    mesh = load(path)
    np.testing.assert_allclose(mesh.points, POINTS + np.array([0.0, 2.0, 0.0]), atol=FLOAT32_AT_ONE_METRE)
    assert mesh.texcoords is not None


@pytest.mark.parametrize(("name", "kind"), [("UVMap", Sdf.ValueTypeNames.Float2Array), ("uv", "texCoord3f[]")])
def test_usd_texture_is_told_by_its_name_where_its_type_does_not(tmp_path: Path, name: str, kind: object) -> None:
    path = tmp_path / "pairs.usda"
    write_usd(path)
    stage = Usd.Stage.Open(str(path))
    kind = Sdf.ValueTypeNames.Find(kind) if isinstance(kind, str) else kind
    primvar = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/root/shirt")).CreatePrimvar(name, kind, UsdGeom.Tokens.vertex)
    width = 3 if "3" in str(kind) else 2
    primvar.Set(POINTS[:, :width].tolist() if width == 2 else [Gf.Vec3f(*point) for point in POINTS])
    stage.Save()
    loaded = load(path)
    assert loaded.texcoords is not None
    np.testing.assert_allclose(loaded.texcoords, loaded.points[loaded.triangles][:, :, :2], atol=FLOAT32_AT_ONE_METRE)


def test_usd_skinning_that_is_not_applied_is_told(tmp_path: Path) -> None:
    path = tmp_path / "rigged.usda"
    write_usd(path)
    stage = Usd.Stage.Open(str(path))
    prim = stage.GetPrimAtPath("/root/shirt")
    prim.CreateAttribute("primvars:skel:jointIndices", Sdf.ValueTypeNames.IntArray).Set([0] * len(POINTS))
    stage.Save()
    assert any("not applied" in note for note in load(path).notes)


def test_usd_warnings_stay_silent(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "dangling.usda"
    write_usd(path)
    path.write_text(path.read_text() + '\ndef "gone" (references = @./nothing.usda@) {}\n')
    load(path)
    assert capfd.readouterr().err == ""

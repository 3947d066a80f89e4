"""Stages that cannot be meant are told in a line, before anything is written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, Vt
from stages import write_users_stage

from warp_cloth.base.errors import InputError
from warp_cloth.export.save import write_meshes
from warp_cloth.fitting.fit import fit
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.loading import load_mesh
from warp_cloth.scene import load_scene

CLOTH, BALL = "/World/wardrobe/cloth", "/World/ball"
NAN = float("nan")


def scaled(*factors: float) -> Callable[[Usd.Stage], object]:
    return lambda stage: stage.GetPrimAtPath("/World/wardrobe").GetAttribute("xformOp:scale").Set(Gf.Vec3f(*factors))


def said(prim: str, name: str, value: object) -> Callable[[Usd.Stage], object]:
    return lambda stage: stage.GetPrimAtPath(prim).GetAttribute(name).Set(value)


def shortened(stage: Usd.Stage) -> None:
    attribute = stage.GetPrimAtPath(CLOTH).GetAttribute("physics:restShapePoints")
    attribute.Set(Vt.Vec3fArray(list(attribute.Get())[:9]))


def not_finite(stage: Usd.Stage) -> None:
    attribute = stage.GetPrimAtPath(CLOTH).GetAttribute("physics:restShapePoints")
    points = np.array(attribute.Get())
    points[3, 1] = NAN
    attribute.Set(Vt.Vec3fArray.FromNumpy(points))


def past_the_end(stage: Usd.Stage) -> None:
    attribute = UsdGeom.Mesh(stage.GetPrimAtPath(CLOTH)).GetFaceVertexIndicesAttr()
    corners = np.array(attribute.Get())
    corners[7] = 99999
    attribute.Set(Vt.IntArray.FromNumpy(corners))


def lost(stage: Usd.Stage) -> None:
    references = stage.GetPrimAtPath(BALL).GetReferences()
    references.ClearReferences()
    references.AddReference("./nowhere.usda")


def spoilt(folder: Path, spoil: Callable[[Usd.Stage], object], physics: bool = True) -> Path:
    path = write_users_stage(folder, physics=physics)
    stage = Usd.Stage.Open(str(path))
    spoil(stage)
    stage.Save()
    return path


def write_mesh(stage: Usd.Stage, path: str) -> None:
    """A square of two triangles, 1 m wide."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    mesh.CreateFaceVertexCountsAttr([3, 3])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 0, 2, 3])


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (scaled(2.0, 0.0, 2.0), "has a scale of 0"),
        (scaled(NAN, 2.0, 2.0), "is not finite"),
        (lambda stage: UsdGeom.SetStageMetersPerUnit(stage, 0.0), "metersPerUnit is 0"),
        (lambda stage: stage.SetMetadata("kilogramsPerUnit", 0.0), "kilogramsPerUnit is 0"),
        (lambda stage: stage.SetMetadata("upAxis", "X"), "upAxis is X"),
        (said("/World/linen", "physics:density", -3.0), "physics:density is -3"),
        (said("/World/linen", "physics:surfaceStretchStiffness", NAN), "surfaceStretchStiffness is nan"),
        (said("/World/linen", "physics:surfaceStretchStiffness", 1e30), "must be a number from"),
        (said(CLOTH, "physics:thicknesses", [-0.1]), "thicknesses are not all 0 or more"),
        (shortened, "not one per vertex"),
        (not_finite, "restShapePoints are not finite"),
        (past_the_end, "refers to vertex 99999"),
        (lost, "there is no avatar: the reference at /World/ball to .*nowhere.usda cannot be opened"),
    ],
)
def test_what_cannot_be_meant_is_refused(
    tmp_path: Path, spoil: Callable[[Usd.Stage], object], words: str, capfd: pytest.CaptureFixture
) -> None:
    path = spoilt(tmp_path, spoil)
    capfd.readouterr()
    with pytest.raises(InputError, match=words) as refused:
        load_outfit(load_scene(path))
    assert "\n" not in str(refused.value)
    assert capfd.readouterr().err == ""


def test_a_prim_without_a_mesh_is_told_of_its_lost_file(tmp_path: Path) -> None:
    path = spoilt(tmp_path, lost, physics=False)
    with pytest.raises(InputError, match=r"no mesh at /World/ball .the reference .*nowhere.usda cannot be opened"):
        load_outfit(load_scene(path, (f"garment.prim={CLOTH}", f"avatar.prim={BALL}")))


def test_what_a_point_instancer_scatters_is_refused_and_told(tmp_path: Path) -> None:
    path = tmp_path / "scattered.usda"
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    instancer = UsdGeom.PointInstancer.Define(stage, "/bodies")
    write_mesh(stage, "/bodies/body/mesh")
    instancer.CreatePrototypesRel().AddTarget("/bodies/body")
    instancer.CreateProtoIndicesAttr([0])
    instancer.CreatePositionsAttr([(2.0, 0.0, 0.0)])
    stage.Save()
    with pytest.raises(InputError, match=r"no mesh: the point instancer /bodies scatters /bodies/body"):
        load_mesh(path, role="avatar", key="avatar")
    write_mesh(stage, "/floor")
    stage.Save()
    assert load_mesh(path, role="avatar", key="avatar").vertex_count == 4


def test_a_variant_set_without_a_selection_is_told(tmp_path: Path) -> None:
    path = tmp_path / "sizes.usda"
    stage = Usd.Stage.CreateNew(str(path))
    sizes = stage.DefinePrim("/shirt").GetVariantSets().AddVariantSet("size")
    for size in ("S", "M"):
        sizes.AddVariant(size)
        sizes.SetVariantSelection(size)
        with sizes.GetVariantEditContext():
            write_mesh(stage, "/shirt/cloth")
    sizes.ClearVariantSelection()
    stage.Save()
    with pytest.raises(InputError, match=r"the variant set size of /shirt has no selection; select one of M, S"):
        load_mesh(path, role="garment", key="garment")


def test_what_a_stage_has_lost_elsewhere_is_noted(tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    def lamp(stage: Usd.Stage) -> None:
        stage.DefinePrim("/World/lamp").GetReferences().AddReference("./lamp.usda")

    path = spoilt(tmp_path, lamp)
    capfd.readouterr()
    worn = fit(path, device="cpu", overrides=("solver.iterations=0", "collision.pixel_mm=8"))
    write_meshes(worn, tmp_path / "out")
    assert any("lamp.usda cannot be opened" in note for note in worn.garments[0].mesh.notes)
    assert "lamp" not in capfd.readouterr().err


def test_a_mirrored_garment_is_worn(tmp_path: Path) -> None:
    path = spoilt(tmp_path, scaled(-2.0, 2.0, 2.0))
    worn = fit(path, device="cpu", overrides=("solver.iterations=0", "collision.pixel_mm=8"))
    (_, *rest) = write_meshes(worn, tmp_path / "out")
    over = Usd.Stage.Open(str(rest[-1]))
    prim = over.GetPrimAtPath(CLOTH)
    matrix = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(prim))
    points = np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get()) @ matrix[:3, :3] + matrix[3, :3]
    assert np.allclose(points, worn.garments[0].points, atol=1e-6)

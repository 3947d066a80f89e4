"""Files in other units, axes and places tell of the same mesh by the same bits, where their numbers allow it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from meshfiles import sheet, write_obj
from pxr import Gf, Sdf, Usd, UsdGeom, Vt
from stages import add_mesh, local

from warp_cloth.base.mesh import Mesh
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.loading import load_mesh
from warp_cloth.loading.decimals import float32_doubt, half_step, shortest_decimals
from warp_cloth.material.fabric import fabric_named

DECIMALS = 6  # as exporters write metres; float32 near 2 m holds them, a step being 0.2 um
WRITTEN = np.round(np.random.default_rng(7).uniform(-2.0, 2.0, (500, 3)), DECIMALS)


def wavy() -> tuple[np.ndarray, np.ndarray]:
    """A sheet of six decimals that lies in no plane [m]."""
    points, faces = sheet(12)
    points = points + 0.03 * np.sin(9.0 * points[:, [1, 2, 0]]) + (0.1, 0.7, -0.2)
    return np.round(points, DECIMALS), faces


@pytest.mark.parametrize("metres", [1.0, 0.01, 0.001, 0.0254, 0.3048])
def test_six_decimals_of_a_metre_come_back_from_float32_in_any_unit(metres: float) -> None:
    stored = (WRITTEN / metres).astype(np.float32).astype(np.float64)
    assert np.array_equal(shortest_decimals(stored * metres, float32_doubt(stored) * metres), WRITTEN)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_nothing_moves_by_more_than_it_is_in_doubt(size: float) -> None:
    stored = (size * np.random.default_rng(1).uniform(-1.0, 1.0, 3000)).astype(np.float32)
    found = shortest_decimals(stored.astype(np.float64), float32_doubt(stored.astype(np.float64)))
    assert np.array_equal(found.astype(np.float32), stored)


def test_what_float32_cannot_hold_was_not_stored_as_such() -> None:
    assert float32_doubt(np.array([0.1]))[0] == 0.0
    assert float32_doubt(np.array([0.125]))[0] == half_step(np.array([0.125]))[0] > 0.0
    assert np.isnan(shortest_decimals(np.array([np.nan]), float32_doubt(np.array([np.nan])))).all()


def stage_mesh(path: Path, *, metres: float, z_up: bool, turn: Gf.Matrix4d | None = None) -> Mesh:
    """The wavy sheet through a stage of that unit and axis, under a parent that turns it."""
    points, faces = wavy()
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, metres)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z if z_up else UsdGeom.Tokens.y)
    parent = UsdGeom.Xform.Define(stage, "/parent")
    stored = points[:, [0, 2, 1]] * (1.0, -1.0, 1.0) / metres if z_up else points / metres
    if turn is not None:
        parent.AddTransformOp().Set(turn)
        inverse = np.array(turn.GetInverse())
        stored = stored @ inverse[:3, :3] + inverse[3, :3]
    add_mesh(stage, "/parent/sheet", local(stored, 1.0, False), faces)
    stage.Save()
    return load_mesh(path, role="garment", key="garment")


@pytest.mark.parametrize(("metres", "z_up"), [(1.0, False), (0.01, True), (0.001, True), (0.0254, False)])
@pytest.mark.parametrize("turned", [False, True])
def test_stages_of_any_unit_axis_and_parent_hold_the_same_mesh(
    metres: float, z_up: bool, turned: bool, tmp_path: Path
) -> None:
    turn = Gf.Matrix4d(Gf.Rotation((1, 2, 3), 41.0), Gf.Vec3d(0.4, -0.3, 0.2) / metres) if turned else None
    mesh = stage_mesh(tmp_path / "stage.usdc", metres=metres, z_up=z_up, turn=turn)
    assert np.array_equal(mesh.points, wavy()[0])


def test_text_in_other_units_holds_the_same_mesh(tmp_path: Path) -> None:
    points, faces = wavy()
    for unit, metres in (("m", 1.0), ("cm", 0.01), ("mm", 0.001)):
        write_obj(tmp_path / f"{unit}.obj", np.round(points / metres, 6), faces)
        mesh = load_mesh(tmp_path / f"{unit}.obj", role="garment", key="garment", units=unit)
        assert np.array_equal(mesh.points, points)


SEWN = 3e-7  # [m]; a float32 step of 1.5 m in metres and in centimetres, and the shortest decimals within them


def sewn_stage(path: Path, mesh: Mesh, *, metres: float, z_up: bool) -> Mesh:
    """A garment with panels, written as a stage of that unit and axis and read again."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, metres)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z if z_up else UsdGeom.Tokens.y)
    surface = add_mesh(stage, "/shirt", local(mesh.points, metres, z_up), mesh.triangles)
    st = UsdGeom.PrimvarsAPI(surface).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
    )
    st.Set(Vt.Vec2fArray.FromNumpy(mesh.texcoords.reshape(-1, 2).astype(np.float32)))
    stage.Save()
    return load_mesh(path, role="garment", key="garment", rest="uv")


def test_a_sewn_shirt_of_nine_digits_is_the_same_cloth_in_any_unit(shared_data: Path, tmp_path: Path) -> None:
    shirt = load_mesh(shared_data / "garmentcode" / "tshirt.obj", role="garment", key="garment", rest="uv")
    metres = sewn_stage(tmp_path / "m.usdc", shirt, metres=1.0, z_up=False)
    centimetres = sewn_stage(tmp_path / "cm.usdc", shirt, metres=0.01, z_up=True)
    assert np.abs(metres.points - centimetres.points).max() < SEWN
    assert np.abs(metres.points - shirt.points).max() < SEWN
    assert np.array_equal(metres.triangles, centimetres.triangles)
    first, second = (build_rest_shape(mesh, fabric_named("jersey"), rest="uv") for mesh in (metres, centimetres))
    for name in ("edge_length", "edge_pull", "edge_push", "hinge_stiffness", "vertex_weight"):
        assert np.array_equal(getattr(first, name), getattr(second, name))
    for name in ("triangles", "corners", "slope", "packed"):
        assert np.array_equal(getattr(first.yarns, name), getattr(second.yarns, name))

"""Masses and rest angles of cloth on a stage: written, and read as the physics schema means them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cloths import grid
from meshfiles import write_obj
from pxr import Sdf, Usd, Vt
from stages import COUNT, SIDE, cloth_points, write_users_stage

from warp_cloth.base.errors import InputError
from warp_cloth.base.topology import build_topology
from warp_cloth.export.save import write_meshes
from warp_cloth.fitting.fit import Fit, fit
from warp_cloth.garment.folds import fold_angles
from warp_cloth.garment.rest import RestShape
from warp_cloth.scene import load_scene

CLOTH = "/World/wardrobe/cloth"
AS_IT_IS = ("solver.iterations=0", "collision.pixel_mm=8")
FLOAT32 = 1e-6  # [rad]; what degrees in float32 hold of an angle
AREA = (0.98 * SIDE) ** 2  # [m2], of the rest shape of the users' stage


def rest_of(path: Path) -> RestShape:
    return fit(path, device="cpu", overrides=AS_IT_IS).garments[0].rest


def stage_with(folder: Path, values: dict[str, tuple[Sdf.ValueTypeName, object]], **options: object) -> Path:
    """The users' stage with more said of its cloth."""
    path = write_users_stage(folder, **options)
    stage = Usd.Stage.Open(str(path))
    for name, (kind, value) in values.items():
        stage.GetPrimAtPath(CLOTH).CreateAttribute(f"physics:{name}", kind, False).Set(value)
    stage.Save()
    return path


def with_masses(folder: Path, masses: list[float], **options: object) -> Path:
    return stage_with(folder, {"masses": (Sdf.ValueTypeNames.FloatArray, Vt.FloatArray(masses))}, **options)


@pytest.mark.parametrize("metres", [1.0, 0.01])
def test_masses_come_before_the_density(tmp_path: Path, metres: float) -> None:
    scene = load_scene(with_masses(tmp_path, [0.05 / COUNT**2] * COUNT**2, metres=metres, z_up=metres < 1.0))
    assert scene.garments[0].fabric.weight == pytest.approx(0.05 / AREA, rel=1e-5)


def test_uneven_masses_are_spread_evenly_and_told(tmp_path: Path) -> None:
    masses = np.linspace(1.0, 3.0, COUNT**2)
    path = with_masses(tmp_path, (0.05 * masses / masses.sum()).tolist())
    worn = fit(path, device="cpu", overrides=AS_IT_IS)
    assert worn.scene.garments[0].fabric.weight == pytest.approx(0.05 / AREA, rel=1e-5)
    assert any("their sum is distributed evenly" in note for note in worn.garments[0].mesh.notes)
    assert np.ptp(worn.garments[0].rest.vertex_weight) == 0.0


@pytest.mark.parametrize("masses", [[1.0, 2.0], [-1.0] * COUNT**2, [float("nan")] * COUNT**2])
def test_masses_that_fit_no_mesh_are_refused(tmp_path: Path, masses: list[float]) -> None:
    with pytest.raises(InputError, match="not one positive number per vertex"):
        load_scene(with_masses(tmp_path, masses))


def pleats(folder: Path) -> Fit:
    """A square of four pleats, folded at rest as it is modelled."""
    flat = grid(9, 0.4)
    wave = 1.0 + 0.02 * np.cos(40.0 * flat.points[:, 0])
    points = np.stack([flat.points[:, 0] - 0.2, wave, flat.points[:, 1] - 0.2], axis=1)
    write_obj(folder / "pleats.obj", points, flat.triangles)
    text = (
        '[garment]\nmesh = "pleats.obj"\nrest_angles = "mesh"\nfabric = "wool"\n[avatar]\nshape = {kind = "sphere"}\n'
    )
    (folder / "scene.toml").write_text(text)
    return fit(folder / "scene.toml", device="cpu", overrides=("solver.iterations=5", "collision.pixel_mm=8"))


def test_a_written_stage_has_the_rest_angles_and_is_the_same_cloth_again(tmp_path: Path) -> None:
    worn = pleats(tmp_path)
    (path, *_) = write_meshes(worn, tmp_path / "out")
    first, again = worn.garments[0].rest, load_scene(path)
    assert again.garments[0].rest_angles == "physics"
    assert again.garments[0].fabric == worn.garments[0].fabric
    second = rest_of(path)
    assert np.abs(first.hinge_angle).max() > 0.5
    assert np.allclose(second.hinge_angle, first.hinge_angle, atol=FLOAT32)
    assert np.allclose(second.hinge_stiffness, first.hinge_stiffness, rtol=1e-5)
    # and a stage made of that one says the same once more
    (third, *_) = write_meshes(fit(load_scene(path, AS_IT_IS), device="cpu"), tmp_path / "next")
    assert np.allclose(rest_of(third).hinge_angle, first.hinge_angle, atol=FLOAT32)


def bent() -> np.ndarray:
    """The users' cloth, bent up along its middle row, in the stage's own place and scale [m]."""
    points = cloth_points()
    points[:, 1] += np.maximum(points[:, 0], 0.0)
    return (points - (0.0, 0.1, 0.0)) / 2.0


def bent_angles() -> np.ndarray:
    mesh = grid(COUNT, SIDE)
    return fold_angles(bent(), build_topology(mesh.triangles, mesh.vertex_count))


@pytest.mark.parametrize(("metres", "z_up"), [(1.0, False), (0.01, True)])
def test_a_folded_rest_shape_is_folded_at_rest_where_the_stage_says_so(
    tmp_path: Path, metres: float, z_up: bool
) -> None:
    from stages import local

    shape = Sdf.ValueTypeNames.Point3fArray, local(bent(), metres, z_up)
    path = stage_with(tmp_path, {"restShapePoints": shape}, metres=metres, z_up=z_up)
    assert rest_of(path).hinge_angle is None
    stage = Usd.Stage.Open(str(path))
    attribute = stage.GetPrimAtPath(CLOTH).CreateAttribute("physics:restBendAnglesDefault", Sdf.ValueTypeNames.Token)
    attribute.Set("restShape")
    stage.Save()
    assert np.allclose(rest_of(path).hinge_angle, bent_angles(), atol=1e-4)  # float32 corners 2 cm apart
    assert np.abs(bent_angles()).max() == pytest.approx(np.pi / 4)


def test_stated_angles_come_before_the_rest_shapes(tmp_path: Path) -> None:
    topology = build_topology(grid(COUNT, SIDE).triangles, COUNT**2)
    pair = topology.hinge_triangles[7].tolist()
    path = stage_with(
        tmp_path,
        {
            "restAdjTriPairs": (Sdf.ValueTypeNames.Int2Array, Vt.Vec2iArray([tuple(pair[::-1])])),
            "restBendAngles": (Sdf.ValueTypeNames.FloatArray, Vt.FloatArray([-30.0])),
        },
    )
    expected = np.zeros(len(topology.hinges))
    expected[7] = -np.pi / 6
    assert np.allclose(rest_of(path).hinge_angle, expected, atol=FLOAT32)


@pytest.mark.parametrize(
    ("pairs", "angles"), [([(0, 1)], [1.0, 2.0]), ([(0, 9999)], [1.0]), ([(0, 1)], [float("nan")])]
)
def test_angles_that_fit_no_mesh_are_refused(tmp_path: Path, pairs: list, angles: list) -> None:
    values = {
        "restAdjTriPairs": (Sdf.ValueTypeNames.Int2Array, Vt.Vec2iArray(pairs)),
        "restBendAngles": (Sdf.ValueTypeNames.FloatArray, Vt.FloatArray(angles)),
    }
    with pytest.raises(InputError, match="one angle for each pair of faces"):
        rest_of(stage_with(tmp_path, values))


def test_an_unknown_default_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='restBendAnglesDefault is "rest"'):
        rest_of(stage_with(tmp_path, {"restBendAnglesDefault": (Sdf.ValueTypeNames.Token, "rest")}))


def test_angles_that_no_stage_states_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='rest_angles = "physics" needs'):
        fit(write_users_stage(tmp_path), device="cpu", overrides=(*AS_IT_IS, "garment.rest_angles=physics"))

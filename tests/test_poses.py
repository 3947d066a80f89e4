"""An avatar with poses: they are read or refused, and the garment follows it to the last one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from meshfiles import ball, write_obj, write_usd
from pxr import Usd, UsdGeom, Vt
from refusals import refusal

import warp_cloth
from warp_cloth.fitting.fit import Fit
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.model.result import Status
from warp_cloth.view.live import LiveFit

WAY = np.array([0.06, 0.02, -0.02])  # [m] that the ball goes: more than any garment could jump
SLIPPED = 0.015  # [m] that the cloth's middle may lag behind: what hangs free is dragged
OFFSET = 3.0  # [mm]
TOLERANCE = 0.5  # [mm] under the exact surface


def scene(mesh: str = "ball.obj", **avatar: Any) -> dict[str, Any]:
    """A square that lies on a ball."""
    shape = {"kind": "square", "side": 0.6, "vertices_per_side": 13, "height": 1.51}
    body = {"mesh": mesh, "units": "m", **avatar}
    return {"garment": {"shape": shape}, "avatar": body, "collision": {"pixel_mm": 8.0}}


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    points, faces = ball()
    write_obj(tmp_path / "ball.obj", points, faces)
    write_obj(tmp_path / "there.obj", points + WAY, faces)
    return tmp_path


def fit(**avatar: Any) -> Fit:
    return warp_cloth.fit(scene(**avatar), device="cpu")


@pytest.mark.parametrize("kind", ["depth", "mesh"])
def test_cloth_goes_with_its_avatar(kind: str) -> None:
    still = fit()
    values = scene(poses=["there.obj"])
    moved = warp_cloth.fit({**values, "collision": {"avatar": kind, "pixel_mm": 8.0}}, device="cpu")
    assert moved.status is Status.AT_REST
    known = moved.report["contact"].get("error_mm")  # where three views see little
    assert moved.report["penetration_mm"]["max"] < (known["max"] - OFFSET if known else TOLERANCE)
    np.testing.assert_allclose(moved.avatar.points, ball()[0] + WAY, atol=1e-6)
    went = moved.garments[0].points.mean(axis=0) - still.garments[0].points.mean(axis=0)
    assert np.abs(went - WAY).max() < SLIPPED
    carried = moved.report["contact"]["carried"]
    assert carried["poses"] == 2
    assert carried["steps"] == np.ceil(np.linalg.norm(WAY) / 0.01)


def test_a_live_change_does_not_take_the_garment_through_the_poses_again() -> None:
    live = LiveFit(scene(poses=["there.obj"]), {"collision.pixel_mm": "8"}, "cpu")
    assert live.problem.pose_run is not None
    worn = live.points.copy()
    live.change({"garment.fabric": "denim"})
    assert live.problem.pose_run is None
    assert np.array_equal(live.problem.model.points(), worn)
    drawn = live.problem.contact.built
    live.change({"collision.offset_mm": "2"})
    assert live.problem.contact.built is drawn
    for _ in range(20):
        live.advance()
    assert live.values("gap")[0][0].min() > -TOLERANCE
    live.reset()
    assert live.problem.pose_run is not None


def test_an_avatar_that_stays_is_not_carried() -> None:
    assert (
        warp_cloth.fit(scene(), device="cpu", overrides=["solver.iterations=20"]).report["contact"]["carried"] is None
    )


def test_poses_are_visited_in_order() -> None:
    points, faces = ball()
    write_obj(Path("up.obj"), points + np.array([0.0, 0.1, 0.0]), faces)
    outfit = load_outfit(warp_cloth.load_scene(scene(poses=["up.obj", "there.obj"])))
    assert len(outfit.poses) == 3
    np.testing.assert_allclose(outfit.starting_avatar.points, outfit.poses[0])
    np.testing.assert_allclose(outfit.poses[1] - outfit.poses[0], [[0.0, 0.1, 0.0]] * len(points), atol=1e-9)
    np.testing.assert_allclose(outfit.avatar.points, outfit.poses[2])


def test_pose_of_a_mesh_that_loading_welds_keeps_its_vertices() -> None:
    """Every face with corners of its own: welded in the first pose, and the same vertices are taken from the next."""
    points, faces = ball()
    apart, own = points[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)
    write_obj(Path("apart.obj"), apart, own)
    write_obj(Path("apart_there.obj"), apart + WAY, own)
    outfit = load_outfit(warp_cloth.load_scene(scene("apart.obj", poses="apart_there.obj")))
    assert len(outfit.poses[0]) < len(apart)
    np.testing.assert_allclose(outfit.poses[1] - outfit.poses[0], [WAY] * len(outfit.poses[0]), atol=1e-9)


def test_time_samples_of_a_usd_mesh_are_its_poses() -> None:
    points, faces = ball()
    write_usd(Path("ball.usda"), points, faces)
    stage = Usd.Stage.Open("ball.usda")
    attribute = UsdGeom.Mesh(stage.GetPrimAtPath("/sheet")).GetPointsAttr()
    for time, share in ((1.0, 0.0), (5.0, 0.5), (9.0, 1.0)):
        attribute.Set(Vt.Vec3fArray.FromNumpy((points + share * WAY).astype(np.float32)), time)
    stage.Save()
    values = scene("ball.usda", poses="samples")
    del values["avatar"]["units"]
    outfit = load_outfit(warp_cloth.load_scene(values))
    shift = [pose[0] - points[0] for pose in outfit.poses]
    np.testing.assert_allclose(shift, [0.0 * WAY, 0.0 * WAY, 0.5 * WAY, WAY], atol=1e-6)


def refused(values: dict[str, Any], *words: str) -> None:
    message = str(refusal(lambda: load_outfit(warp_cloth.load_scene(values))))
    assert all(word in message for word in words)


def test_poses_that_are_of_another_mesh_are_refused() -> None:
    points, faces = ball()
    write_obj(Path("other.obj"), points[1:], faces[(faces > 0).all(axis=1)] - 1)
    refused(scene(poses=["other.obj"]), "other.obj", "vertices, but avatar.mesh has", "same mesh")
    write_obj(Path("turned.obj"), points, np.roll(faces, 1, axis=0))
    refused(scene(poses=["turned.obj"]), "turned.obj", "faces differ from those of avatar.mesh")
    write_obj(Path("small.obj"), 0.01 * points, faces)
    refused(scene(poses=["small.obj"]), "small.obj", "edges are 0.01 times as long", "same unit")
    refused(scene(poses=["nowhere.obj"]), "nowhere.obj", "no such file")
    refused(scene(poses=[3]), "avatar.poses", "not a path")
    broken = points.copy()
    broken[7] = np.nan
    write_obj(Path("broken.obj"), broken, faces)
    refused(scene(poses=["broken.obj"]), "broken.obj", "not finite")


def test_samples_are_asked_of_usd_files_that_have_them() -> None:
    refused(scene(poses="samples"), '"samples" is for USD files')
    write_usd(Path("ball.usda"), *ball())
    refused(scene("ball.usda", poses="samples"), "no time samples")


def test_a_generated_avatar_has_no_poses() -> None:
    refused({**scene(), "avatar": {"shape": {"kind": "sphere"}, "poses": ["ball.obj"]}}, "avatar.poses", "remove them")

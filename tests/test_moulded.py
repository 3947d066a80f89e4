"""A garment modelled on a body shows by its own shape which side is its front."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from meshfiles import obj_text

from warp_cloth.base.mesh import Mesh, Points, vertex_normals
from warp_cloth.garment.moulded import faces_ahead, within
from warp_cloth.garment.outfit import Outfit, load_outfit
from warp_cloth.garment.skin import Skin
from warp_cloth.loading import load_mesh
from warp_cloth.scene import load_scene

OFFSET = 0.008  # [m]
LOW, HIGH, BROAD = 0.5, 0.7, 0.14  # of the body's height: from the crotch to under the arms
HALF_TURN = np.array([-1.0, 1.0, -1.0])


@pytest.fixture(scope="module")
def body(shared_data: Path) -> Mesh:
    return load_mesh(shared_data / "anny/female_avg_A_pose.obj", role="avatar", key="avatar")


def top_on(body: Mesh) -> tuple[Points, np.ndarray]:
    """A tube off the skin of the trunk, without a neckline."""
    height = np.ptp(body.points[:, 1])
    points = body.points + OFFSET * vertex_normals(body.points, body.triangles)
    level = (body.points[:, 1] - body.points[:, 1].min()) / height
    kept = (level > LOW) & (level < HIGH) & (np.abs(body.points[:, 0]) < BROAD * height)
    used, faces = np.unique(body.triangles[kept[body.triangles].all(axis=1)], return_inverse=True)
    return points[used], faces.reshape(-1, 3)


def outfit_of(body: Mesh, shared_data: Path, path: Path, points: Points, faces: np.ndarray) -> Outfit:
    path.write_text(obj_text(points, faces))
    return load_outfit(load_scene(path, on=shared_data / "anny/female_avg_A_pose.obj"))


def test_what_lies_on_the_skin_faces_ahead_and_turned_it_does_not(body: Mesh) -> None:
    points, _ = top_on(body)
    turned = points * HALF_TURN
    skin = Skin(body)
    assert within(points, skin) < 0.02
    assert faces_ahead(points, [turned], skin) == 1
    assert faces_ahead(turned, [points], skin) == -1
    wide = points + np.array([0.0, 3.0, 0.0])  # off the skin either way
    assert faces_ahead(wide, [wide * HALF_TURN], skin) == 0


@pytest.mark.parametrize("is_turned", [False, True])
def test_one_that_was_turned_by_half_is_turned_back(
    body: Mesh, shared_data: Path, tmp_path: Path, is_turned: bool
) -> None:
    points, faces = top_on(body)
    placed = points * HALF_TURN if is_turned else points
    outfit = outfit_of(body, shared_data, tmp_path / "top.obj", placed, faces)
    assert [choice.key for choice in outfit.readings] == ["garment.rotate"] * is_turned
    assert not any("back to front" in note for note in outfit.meshes[0].notes)
    np.testing.assert_allclose(outfit.meshes[0].points, points, atol=1e-5)

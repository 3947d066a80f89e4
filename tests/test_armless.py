"""A shirt on a mannequin without arms is worn, sleeves empty; with arms that are there, but not known, it is not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from meshfiles import write_obj
from numpy.typing import NDArray

from warp_cloth.anatomy.skeleton import LEFT_ARM, RIGHT_ARM, TRUNK, Skeleton, skeleton_of
from warp_cloth.base.mesh import Mesh, vertex_normals
from warp_cloth.fitting.judge import judged_shape
from warp_cloth.garment.outfit import MeshCache, load_outfit
from warp_cloth.loading import load_mesh
from warp_cloth.scene import load_scene
from warp_cloth.shapes import mannequin

OFF = 0.006  # [m] of the shirt from the skin
ELBOW, HEM = 0.62, -0.05  # of an arm's curve, where sleeves end; [m] above the middle of the trunk
WAIST = -0.08  # the same, where the body ends


@pytest.fixture(scope="module")
def body() -> Mesh:
    return mannequin(edge=0.015)


def codes(body: Mesh, skeleton: Skeleton, lacks: list[int], folder: Path, sleeve: NDArray[np.float64]) -> set[str]:
    """Problems of a shirt of a body's skin on what is left of it without some limbs, its left sleeve moved."""
    up = (body.points - skeleton.middle) @ skeleton.up
    arm = np.isin(skeleton.limb, (RIGHT_ARM, LEFT_ARM))
    mine = ((skeleton.limb == TRUNK) & (up > HEM)) | (arm & (skeleton.station < ELBOW))
    kept, corners = np.unique(body.triangles[mine[body.triangles].all(axis=1)], return_inverse=True)
    points = body.points[kept] + OFF * vertex_normals(body.points, body.triangles)[kept]
    points[skeleton.limb[kept] == LEFT_ARM] += sleeve
    write_obj(folder / "shirt.obj", points, corners.reshape(-1, 3))
    there = ~np.isin(skeleton.limb, lacks) & (up > WAIST)
    write_obj(folder / "body.obj", body.points, body.triangles[there[body.triangles].all(axis=1)])
    # a bust is understood unless its arms reach below it
    found = skeleton_of(load_mesh(folder / "body.obj", role="avatar", key="avatar", units="m"))
    assert (found is None) == (not lacks)
    garment = {"mesh": str(folder / "shirt.obj"), "units": "m", "rest": "mesh"}
    scene = load_scene({"garment": garment, "avatar": {"mesh": str(folder / "body.obj"), "units": "m"}})
    outfit = load_outfit(scene, MeshCache())
    judged = judged_shape(scene, outfit, outfit.garments[0].points, "cpu")
    return {problem.code.value for problem in judged.problems}


def test_sleeves_hang_empty_where_there_are_no_arms(body: Mesh, skeleton: Skeleton, tmp_path: Path) -> None:
    assert codes(body, skeleton, [RIGHT_ARM, LEFT_ARM], tmp_path, np.zeros(3)) == set()


def test_a_sleeve_before_an_arm_is_empty_where_limbs_are_not_known(
    body: Mesh, skeleton: Skeleton, tmp_path: Path
) -> None:
    assert "empty_opening" in codes(body, skeleton, [], tmp_path, 0.2 * skeleton.forward)

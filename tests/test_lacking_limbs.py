"""Amputees, torsos and dress forms are understood and measured by what is there; a vase is no torso."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from meshfiles import write_obj

from warp_cloth.anatomy.person import understand
from warp_cloth.anatomy.skeleton import (
    HEAD,
    LEFT_ARM,
    LEFT_LEG,
    LIMBS,
    RIGHT_ARM,
    RIGHT_LEG,
    TRUNK,
    Skeleton,
    skeleton_of,
)
from warp_cloth.base.mesh import Mesh, vertex_normals
from warp_cloth.fitting.judge import judged_shape
from warp_cloth.garment.outfit import MeshCache, load_outfit
from warp_cloth.scene import load_scene
from warp_cloth.shapes import mannequin

TRUNK_LEVELS = ("chest", "waist", "hip")
NEAR = 0.015  # [m] by which a girth may differ: a body is cut open, and its lid is flat
OFF, HIGH = 0.006, 0.3  # [m] of trousers from the skin, and above their place as they start
WAIST, ANKLE = -0.03, 0.9  # [m] above the middle of the trunk; of a leg's curve
LEGS, ARMS = [RIGHT_LEG, LEFT_LEG], [RIGHT_ARM, LEFT_ARM]


@pytest.fixture(scope="module")
def body() -> Mesh:
    return mannequin(edge=0.015)


def without(body: Mesh, skeleton: Skeleton, limbs: Sequence[int], beyond: float) -> Mesh:
    """A body without what lies beyond this part of some limbs' curves."""
    kept = ~(np.isin(skeleton.limb, limbs) & (skeleton.station > beyond))[body.triangles].any(axis=1)
    used, corners = np.unique(body.triangles[kept], return_inverse=True)
    return Mesh("form", body.points[used], corners.reshape(-1, 3).astype(np.int32))


@pytest.mark.parametrize(
    ("limbs", "beyond"),
    [([LEFT_ARM], 0.5), ([RIGHT_LEG], 0.6), ([RIGHT_ARM, LEFT_LEG], 0.5), (ARMS, 0.0), (LEGS, 0.55),
     ([HEAD, *ARMS, *LEGS], 0.0), ([RIGHT_ARM, *LEGS], 0.5)],
)  # fmt: skip
def test_lacking_limbs_are_told_and_the_trunk_is_measured(
    body: Mesh, skeleton: Skeleton, limbs: list[int], beyond: float
) -> None:
    whole = {each.name: each.value for each in understand(body).measures}
    form = without(body, skeleton, limbs, beyond)
    found = understand(form)
    assert found.skeleton is not None
    assert found.stance is not None
    assert sorted(found.skeleton.lacks) == sorted(limbs)
    assert all(LIMBS[limb] in found.stance.in_words() for limb in limbs)
    values = {each.name: each.value for each in found.measures}
    for name in TRUNK_LEVELS:
        assert values[name] == pytest.approx(whole[name], abs=NEAR), name
    assert (values["stature"] is None) == (HEAD in limbs or set(LEGS) <= set(limbs))
    assert skeleton_of(form, is_whole=True) is None


def test_trousers_that_reach_below_a_form_without_shanks_are_worn(
    body: Mesh, skeleton: Skeleton, tmp_path: Path
) -> None:
    """They had slid down to its feet, it was said, since its height was taken for a whole body's."""
    form = without(body, skeleton, LEGS, 0.55)
    write_obj(tmp_path / "body.obj", form.points, form.triangles)
    up = (body.points - skeleton.middle) @ skeleton.up
    leg = np.isin(skeleton.limb, LEGS) & (skeleton.station < ANKLE)
    mine = ((skeleton.limb == TRUNK) & (up < WAIST)) | leg
    kept, corners = np.unique(body.triangles[mine[body.triangles].all(axis=1)], return_inverse=True)
    points = body.points[kept] + OFF * vertex_normals(body.points, body.triangles)[kept]
    write_obj(tmp_path / "trousers.obj", points + HIGH * skeleton.up, corners.reshape(-1, 3))
    garment = {"mesh": str(tmp_path / "trousers.obj"), "units": "m", "rest": "mesh"}
    scene = load_scene({"garment": garment, "avatar": {"mesh": str(tmp_path / "body.obj"), "units": "m"}})
    found = judged_shape(scene, load_outfit(scene, MeshCache()), points, "cpu")
    assert [problem.code.value for problem in found.problems] == []


def test_a_torso_is_dressed_where_its_legs_would_stand(body: Mesh, skeleton: Skeleton, tmp_path: Path) -> None:
    """Its lowest point was taken for its feet, and the T-shirt was brought up over its head."""
    form = without(body, skeleton, [HEAD, *ARMS, *LEGS], 0.0)
    write_obj(tmp_path / "body.obj", form.points, form.triangles)
    avatar = {"mesh": str(tmp_path / "body.obj"), "units": "m"}
    outfit = load_outfit(load_scene({"garment": {"shape": {"kind": "tshirt"}}, "avatar": avatar}), MeshCache())
    assert "garment.translate" not in [choice.key for choice in outfit.readings]
    assert outfit.wearing[0] is not None
    assert not outfit.wearing[0].misplaced_at_start


def test_vase_with_neck_is_no_torso() -> None:
    """It is as deep as it is wide."""
    profile = ((0.0, 0.12), (0.3, 0.18), (0.5, 0.2), (0.6, 0.08), (0.7, 0.07))  # heights and radii [m]
    angle = np.arange(32) * (2.0 * np.pi / 32)
    points = np.array([(r * np.cos(a), y, r * np.sin(a)) for y, r in profile for a in angle])
    here, there = np.arange(32), np.roll(np.arange(32), -1)
    ring = np.vstack([np.stack([here, there + 32, there], axis=1), np.stack([here, here + 32, there + 32], axis=1)])
    sides = np.vstack([ring + 32 * n for n in range(len(profile) - 1)]).astype(np.int32)
    assert skeleton_of(Mesh("vase", points, sides)) is None

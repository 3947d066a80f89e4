"""Skin yields where arms that hang close pass through the trunk, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from warp_cloth.anatomy.skeleton import LEFT_ARM, RIGHT_ARM, Skeleton
from warp_cloth.anatomy.yielding import REACH, ROOM, _pairs, yielded
from warp_cloth.base.mesh import Mesh
from warp_cloth.garment.outfit import MeshCache, load_outfit
from warp_cloth.scene import load_scene


@pytest.fixture(scope="module")
def pressed(body: Mesh, skeleton: Skeleton) -> tuple[Mesh, Skeleton]:
    """The body with its right arm turned into its trunk, about the shoulder."""
    arm = skeleton.limb == RIGHT_ARM
    root = skeleton.curves[RIGHT_ARM][skeleton.joints[RIGHT_ARM]]
    for degrees in np.arange(0.0, 60.0, 0.5):
        turned = body.points.copy()
        turned[arm] = root + (turned[arm] - root) @ turn(-degrees * side_of(skeleton)).T
        found = replace(body, points=turned), replace(skeleton, skin=turned)
        if yielded(*found) is not None:
            return found
    raise AssertionError("the arm never pressed")


def side_of(skeleton: Skeleton) -> float:
    """The sign of x on the right arm's side."""
    return float(np.sign(skeleton.curves[RIGHT_ARM][-1, 0]))


def turn(degrees: float) -> NDArray[np.float64]:
    """A turn about z."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def test_nothing_yields_where_limbs_are_apart(body: Mesh, skeleton: Skeleton) -> None:
    assert yielded(body, skeleton) is None


def test_both_sides_give_way_to_each_other(pressed: tuple[Mesh, Skeleton]) -> None:
    body, skeleton = pressed
    points = yielded(body, skeleton)
    assert points is not None
    moved = np.linalg.norm(points - body.points, axis=1)
    assert 0.5 * ROOM < moved.max() < REACH
    assert not moved[skeleton.limb == LEFT_ARM].any()
    assert moved[skeleton.limb == RIGHT_ARM].any()
    assert moved[(skeleton.limb != RIGHT_ARM) & (body.points[:, 0] * side_of(skeleton) > 0.0)].any()
    again = yielded(replace(body, points=points), replace(skeleton, skin=points))
    assert again is None or np.linalg.norm(again - points, axis=1).max() < 0.3 * ROOM


def test_a_body_inside_out_yields_alike(pressed: tuple[Mesh, Skeleton]) -> None:
    body, skeleton = pressed
    inside_out = replace(body, triangles=np.ascontiguousarray(body.triangles[:, ::-1]))
    np.testing.assert_allclose(yielded(inside_out, skeleton), yielded(body, skeleton), atol=1e-6)


def test_limbs_found_on_a_wrap_do_not_yield(pressed: tuple[Mesh, Skeleton]) -> None:
    """Such a body may be in pieces, which would come apart."""
    body, skeleton = pressed
    assert yielded(body, replace(skeleton, is_of_wrap=True)) is None


def test_arms_that_press_on_each_other_are_parted_once(skeleton: Skeleton) -> None:
    """As two pairs they moved by twice what was missing."""
    seen = [
        frozenset((a, b))
        for one, other in _pairs(skeleton)
        for a in np.unique(skeleton.limb[one]).tolist()
        for b in np.unique(skeleton.limb[other]).tolist()
    ]
    assert frozenset((RIGHT_ARM, LEFT_ARM)) in seen
    assert len(seen) == len({*seen})


def test_a_body_that_does_not_yield_is_cached_once() -> None:
    """Batches forget all meshes beyond some number of cached vertices; each body counted twice."""
    cache = MeshCache()
    outfit = load_outfit(load_scene("tshirt"), cache)
    meshes = [made for made in cache.portable_entries().values() if isinstance(made, Mesh)]
    assert outfit.avatar in meshes
    assert len({id(mesh) for mesh in meshes}) == len(meshes)

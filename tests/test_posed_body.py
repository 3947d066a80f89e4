"""A body that is thin along its curves: what lies within a limb stays within it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from bodies import sure_skeleton

from warp_cloth.anatomy.outermost import outermost_distances
from warp_cloth.anatomy.skeleton import HEAD
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.dressing.posing import PosedBody
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.scene import load_scene

MOUTH = 0.04  # [m], half its width
THIN = 0.03  # [m]


def ball(radius: float, centre: Points | None = None) -> tuple[Points, np.ndarray]:
    sphere = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    return np.asarray(sphere.vertices) + (0.0 if centre is None else centre), np.asarray(sphere.faces, np.int32)


def test_the_outermost_of_several_surfaces_is_met() -> None:
    inner, triangles = ball(0.1)
    outer, _ = ball(0.3)
    both = np.concatenate([inner, outer])
    surface = np.concatenate([triangles, triangles + len(inner)])
    out = np.eye(3)
    found = outermost_distances(both, surface, np.zeros((3, 3)), out)
    np.testing.assert_allclose(found, 0.3, atol=3e-3)
    np.testing.assert_allclose(outermost_distances(both, surface, np.full((3, 3), 0.05), out), 0.25, atol=2e-2)
    assert outermost_distances(both, surface, 2.0 * out, out).max() == 0.0  # all of it lies behind
    assert outermost_distances(both, surface[:0], np.zeros((3, 3)), out).max() == 0.0


@pytest.fixture(scope="module")
def body() -> Mesh:
    """The shipped body with a hollow within its head, as a mouth has."""
    avatar = load_outfit(load_scene("tshirt", ("garment.shape.edge_mm=40",))).avatar
    assert avatar is not None
    head = sure_skeleton(avatar).curves[HEAD]
    mouth, triangles = ball(MOUTH, head[-1] + 0.5 * (head[len(head) // 2] - head[-1]))
    return replace(
        avatar,
        points=np.concatenate([avatar.points, mouth]),
        triangles=np.concatenate([avatar.triangles, triangles[:, ::-1] + avatar.vertex_count]),
        texcoords=None,
        panels=None,
        panel_names=(),
    )


def test_a_mouth_stays_within_a_thin_head(body: Mesh) -> None:
    """Drawn onto one surface with the skin it kept cloth that lay there, as the skin grew."""
    skeleton = sure_skeleton(body)
    posed = PosedBody(body, skeleton)
    is_mouth = np.arange(body.vertex_count) >= body.vertex_count - len(ball(MOUTH)[0])
    for thickness in (THIN, 2.0 * THIN):
        points = posed.points(posed.home, thickness)
        off = np.linalg.norm(points - posed.points(posed.home, 0.0), axis=1)
        near = np.linalg.norm(body.points - body.points[is_mouth].mean(axis=0), axis=1) < 3.0 * MOUTH
        assert off.max() < thickness + 1e-9
        assert off[is_mouth].max() < 0.75 * thickness
        assert np.median(off[near & ~is_mouth]) > 0.95 * thickness
    np.testing.assert_allclose(posed.points(posed.home, np.inf), body.points, atol=1e-9)

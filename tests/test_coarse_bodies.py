"""Bodies of a few hundred triangles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from warp_cloth.anatomy.person import understand
from warp_cloth.anatomy.skeleton import skeleton_of
from warp_cloth.base.division import divided
from warp_cloth.base.mesh import Indices, Mesh, Points
from warp_cloth.loading import load_mesh
from warp_cloth.shapes import sphere

CELL = 0.08  # [m]


def clustered(body: Mesh, cell: float) -> tuple[Points, Indices]:
    """A body whose vertices in one cell of a grid are one."""
    _, number = np.unique((body.points / cell + 0.25).round(), axis=0, return_inverse=True)
    number = number.ravel()
    points = np.stack([np.bincount(number, body.points[:, axis]) for axis in range(3)], axis=1)
    corners = number[body.triangles]
    corners = corners[(corners != np.roll(corners, 1, axis=1)).all(axis=1)]
    _, first = np.unique(np.sort(corners, axis=1), axis=0, return_index=True)
    return points / np.bincount(number)[:, None], corners[first].astype(np.int32)


def test_a_body_of_a_few_hundred_triangles_has_limbs(shared_data: Path) -> None:
    body = load_mesh(shared_data / "anny/female_avg_A_pose.obj", role="avatar", key="avatar")
    coarse = Mesh("coarse", *clustered(body, CELL))
    assert coarse.triangle_count < 800
    fine, found = (understand(each) for each in (body, coarse))
    assert found.skeleton is not None, found.reason
    assert not found.skeleton.is_of_wrap
    assert len(found.skeleton.limb) == coarse.vertex_count
    measured, wanted = ({each.name: each.value for each in person.measures} for person in (found, fine))
    for name in ("stature", "waist", "hip"):
        assert measured[name] == pytest.approx(wanted[name], rel=0.07)


def test_divided_triangles_lie_where_their_own_did() -> None:
    ball = sphere(radius=0.4, edge=0.1)
    points, triangles = divided(ball.points, ball.triangles)
    assert len(triangles) == 4 * ball.triangle_count
    assert np.array_equal(points[: ball.vertex_count], ball.points)
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    p, q, r = np.moveaxis(ball.points[ball.triangles], 1, 0)
    finer, whole = np.cross(b - a, c - a), np.cross(q - p, r - p)
    assert np.allclose(finer.reshape(4, -1, 3).sum(axis=0), whole)
    assert skeleton_of(ball) is None

"""Bodies whose own surface does not show their limbs: rough, shattered, or in closed pieces that touch."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from warp_cloth.anatomy.person import Person, understand
from warp_cloth.anatomy.skeleton import HEAD, LEFT_LEG, RIGHT_ARM, Skeleton, skeleton_or_reason
from warp_cloth.anatomy.wrapping import CELLS, _samples, wrapped
from warp_cloth.base.lids import cones, with_tips
from warp_cloth.base.mesh import Indices, Mesh, Points
from warp_cloth.loading import load_mesh
from warp_cloth.shapes import mannequin, sphere

NOISE = 0.005  # [m], of each coordinate: a poor scanner's
NEAR = 0.04  # [m]


@cache
def sound() -> Person:
    return understand(mannequin(edge=0.011))


def shattered() -> Mesh:
    """Each face by itself, a little smaller than it was: no two share a vertex, or nearly one."""
    body = sound().body
    corners = body.points[body.triangles]
    corners = corners + 0.03 * (corners.mean(axis=1, keepdims=True) - corners)
    return Mesh("shards", corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3))


def closed(mesh: Mesh, number: int) -> Mesh:
    """A piece of a mesh with lids over its rims; ``number`` for its name."""
    lids, rims = cones(mesh.triangles.astype(np.int64), mesh.vertex_count)
    triangles = np.vstack([mesh.triangles, lids.astype(np.int32)])
    used, corners = np.unique(triangles, return_inverse=True)
    points = with_tips(mesh.points, rims)[used]
    return Mesh(f"piece {number}", points, corners.reshape(-1, 3).astype(np.int32))


def in_pieces() -> Mesh:
    """The mannequin as a dummy is modelled: head, arms and legs are closed bodies that touch the trunk."""
    skeleton, body = sound().skeleton, sound().body
    assert skeleton is not None
    limb = skeleton.limb[body.triangles].max(axis=1)
    pieces = [closed(Mesh("", body.points, body.triangles[limb == n]), n) for n in np.unique(limb).tolist()]
    starts = np.cumsum([0, *(piece.vertex_count for piece in pieces)])
    triangles = [piece.triangles + start for piece, start in zip(pieces, starts, strict=False)]
    return Mesh("dummy", np.vstack([piece.points for piece in pieces]), np.vstack(triangles).astype(np.int32))


def with_skeleton(person: Person) -> Skeleton:
    assert person.skeleton is not None, person.reason
    return person.skeleton


@pytest.mark.parametrize("make", [shattered, in_pieces])
def test_limbs_are_found_on_a_surface_wrapped_round_the_body(make: object) -> None:
    person = understand(make())  # type: ignore[operator]
    found, same = with_skeleton(person), with_skeleton(sound())
    assert found.own.all()
    assert len(found.limb) == person.body.vertex_count
    for limb in (HEAD, RIGHT_ARM, LEFT_LEG):
        assert np.linalg.norm(found.curves[limb][-1] - same.curves[limb][-1]) < NEAR
        assert np.linalg.norm(found.curves[limb][0] - same.curves[limb][0]) < NEAR
    assert found.forward @ same.forward > np.cos(np.radians(5.0))
    assert "wrapped" in person.notes[0]


def test_a_rough_scan_has_limbs(shared_data: Path) -> None:
    scan = load_mesh(shared_data / "garmentcode" / "mean_all.obj", role="avatar", key="avatar")
    noise = np.random.default_rng(3).normal(size=scan.points.shape) * NOISE
    found, same = (with_skeleton(understand(replace(scan, points=scan.points + off))) for off in (noise, 0.0))
    assert found.is_of_wrap
    assert not same.is_of_wrap
    for ours, theirs in zip(found.curves, same.curves, strict=True):
        assert np.linalg.norm(ours[-1] - theirs[-1]) < NEAR


def test_a_sound_body_is_not_wrapped() -> None:
    assert not with_skeleton(sound()).is_of_wrap
    assert sound().notes == ()


def test_balls_are_wrapped_by_balls() -> None:
    centres = np.array([[0.0, 0.0, 0.0], [1.1, 1.1, 0.0]])
    one = sphere(radius=0.5, centre=(0.0, 0.0, 0.0))
    triangles = np.vstack([one.triangles, one.triangles + len(one.points)])
    points, triangles = wrapped(np.vstack([one.points + centre for centre in centres]), triangles)
    distance = np.linalg.norm(points[:, None] - centres, axis=2).min(axis=1) - 0.5
    assert np.abs(distance).max() < 1.5 * 2.1 / CELLS
    corners = points[triangles]
    volume = np.einsum("ni,ni->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    assert volume == pytest.approx(np.pi / 3.0, rel=0.05)


def test_what_nothing_sticks_out_of_is_not_wrapped() -> None:
    ball = sphere(radius=0.5, centre=(3.0, 2.0, 1.0))
    assert all(len(of) == 0 for of in wrapped(ball.points, ball.triangles))


def test_a_floor_under_a_body_is_not_wrapped_with_it() -> None:
    body = sound().body
    start = body.vertex_count
    low = body.points[:, 1].min()
    corners = np.array([[-1.0, low, -1.0], [1.0, low, -1.0], [1.0, low, 1.0], [-1.0, low, 1.0]])
    under = np.array([[0, 2, 1], [0, 3, 2]], dtype=np.int32) + start
    points, _ = wrapped(np.vstack([body.points, corners]), np.vstack([body.triangles, under]))
    assert np.abs(points[:, 2]).max() < 0.5


def test_samples_are_dense_enough_and_few_where_a_triangle_is_thin() -> None:
    rng, apart = np.random.default_rng(3), 0.01
    thin = np.array([[[0.0, 0.0, 0.0], [0.002, 0.0, 0.0], [0.5, 0.9, 0.0]]])
    assert len(_samples(thin, apart)) < 400
    for corners in (thin, rng.uniform(0.0, 0.2, (4, 3, 3))):
        weights = rng.dirichlet([1.0, 1.0, 1.0], 500)
        inside = (weights @ corners).reshape(-1, 3)
        off = np.linalg.norm(inside[:, None] - _samples(corners, apart), axis=2).min(axis=1)
        assert off.max() <= apart


def test_a_torn_body_on_no_floor_is_wrapped_at_most_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    body, made = sound().body, []
    kept = np.random.default_rng(117).random(body.triangle_count) > 0.7

    def counted(points: Points, triangles: Indices) -> tuple[Points, Indices]:
        made.append("")
        return wrapped(points, triangles)

    monkeypatch.setattr("warp_cloth.anatomy.skeleton.wrapped", counted)
    skeleton_or_reason(Mesh("torn", body.points, body.triangles[kept]))
    assert len(made) <= 2

"""The exact collider against brute force, and its sign on meshes that are not closed, cross or nest."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from meshfiles import as_mesh

from warp_cloth.avatar.exact import build_exact_collider, depths_under, penetration, signed_distances
from warp_cloth.base.mesh import Mesh

ROUNDING = 2.0e-6  # [m]: float32 positions within a metre


def ball(radius: float = 0.1, subdivisions: int = 2) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)


def closest_on_segment(point: np.ndarray, start: np.ndarray, end: np.ndarray) -> float:
    way = end - start
    share = np.clip((point - start) @ way / (way @ way), 0.0, 1.0)
    return float(np.linalg.norm(point - start - share * way))


def distance_to_triangle(point: np.ndarray, corner: np.ndarray) -> float:
    """To the plane where the foot is inside, else to the nearest side."""
    a, b, c = corner
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal)
    sides = ((a, b), (b, c), (c, a))
    if all(np.cross(end - start, point - start) @ normal >= 0.0 for start, end in sides):
        return abs(float((point - a) @ normal))
    return min(closest_on_segment(point, start, end) for start, end in sides)


def test_distance_is_that_of_brute_force() -> None:
    shape = trimesh.creation.box((0.2, 0.1, 0.15))
    turn = trimesh.transformations.rotation_matrix(0.5, (1.0, 2.0, 3.0))
    shape.apply_transform(turn)
    mesh = as_mesh(shape)
    points = np.random.default_rng(0).uniform(-0.2, 0.2, (300, 3))
    found = signed_distances(points, mesh, "cpu")
    expected = [min(distance_to_triangle(p, corner) for corner in mesh.points[mesh.triangles]) for p in points]
    assert np.abs(np.abs(found) - expected).max() < ROUNDING
    assert ((found < 0.0) == (np.abs(points @ turn[:3, :3]) < [0.1, 0.05, 0.075]).all(axis=1)).all()


def test_closest_points_are_exact() -> None:
    mesh = as_mesh(ball(subdivisions=3))
    corners = mesh.points[mesh.triangles]
    off = 1.0 + np.random.default_rng(5).uniform(-0.5, 0.5, (3, 100, 1))
    towards = corners[:100, 0], corners[:100, :2].mean(axis=1), corners[:100].mean(axis=1)  # corners, sides, middles
    points = np.concatenate([each * far for each, far in zip(towards, off, strict=True)])
    found = build_exact_collider(mesh, "cpu").closest(points, exact=1.0)
    every = trimesh.triangles.closest_point(np.tile(corners, (len(points), 1, 1)), points.repeat(len(corners), axis=0))
    distance = np.linalg.norm(every.reshape(len(points), -1, 3) - points[:, None], axis=2)
    np.testing.assert_allclose(np.linalg.norm(found.points - points, axis=1), distance.min(axis=1), atol=1e-15)
    np.testing.assert_allclose(found.weights.sum(axis=1), 1.0, atol=1e-15)


def test_normal_leads_out_of_both_sides_and_from_the_surface() -> None:
    exact = build_exact_collider(as_mesh(ball(subdivisions=4)), "cpu")
    way = np.random.default_rng(1).normal(size=(200, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    for radius in (0.05, 0.097, 0.105):
        found = exact.sample(radius * way)
        assert np.einsum("ij,ij->i", found[:, :3], way).min() > 0.99
    mesh = as_mesh(ball())
    centroids = mesh.points[mesh.triangles].mean(axis=1)
    found = build_exact_collider(mesh, "cpu").sample(centroids)
    assert np.einsum("ij,ij->i", found[:, :3], centroids).min() > 0.0
    assert np.isfinite(found).all()


def test_beyond_reach_there_is_no_contact() -> None:
    exact = build_exact_collider(as_mesh(ball()), "cpu", reach=0.01)
    found = exact.sample(np.array([[0.0, 0.0, 0.12], [3.0, 0.0, 0.0], [0.02, 0.03, 0.12]]))
    assert (found == [0.0, 0.0, 0.0, np.float32(0.01)]).all()


def test_open_neck_keeps_its_inside() -> None:
    """A ball whose cap is cut away: deep inside is inside, above the hole is outside."""
    shape = ball(subdivisions=4)
    shape.update_faces(shape.triangles_center[:, 1] < 0.08)
    found = signed_distances(np.array([[0.0, 0.0, 0.0], [0.0, -0.09, 0.0], [0.0, 0.12, 0.0]]), as_mesh(shape), "cpu")
    assert (np.sign(found) == [-1.0, -1.0, 1.0]).all()


def test_inner_and_crossing_parts_stay_inside() -> None:
    eye = ball(0.02, 3)
    eye.apply_translation((0.0, 0.0, 0.05))
    hand = ball(0.1, 4)
    hand.apply_translation((0.12, 0.0, 0.0))
    mesh = as_mesh(ball(0.1, 4), eye, hand)
    inside = np.array([[0.0, 0.0, 0.05], [0.0, 0.0, 0.08], [0.06, 0.0, 0.0], [-0.09, 0.0, 0.0]])
    outside = np.array([[0.0, 0.0, 0.11], [0.06, 0.0, 0.1], [0.23, 0.0, 0.0]])
    assert (signed_distances(inside, mesh, "cpu") < 0.0).all()
    assert (signed_distances(outside, mesh, "cpu") > 0.0).all()


def test_mesh_that_is_inside_out_is_turned() -> None:
    mesh = as_mesh(ball())
    turned = Mesh("turned", mesh.points, np.ascontiguousarray(mesh.triangles[:, ::-1]))
    points = np.random.default_rng(2).uniform(-0.15, 0.15, (100, 3))
    np.testing.assert_allclose(signed_distances(points, turned, "cpu"), signed_distances(points, mesh, "cpu"))


def test_far_from_the_origin_nothing_changes() -> None:
    mesh = as_mesh(ball())
    points = np.random.default_rng(3).uniform(-0.15, 0.15, (200, 3))
    moved = Mesh("moved", mesh.points + 1.0e5, mesh.triangles)
    shift = signed_distances(points + 1.0e5, moved, "cpu") - signed_distances(points, mesh, "cpu")
    assert np.abs(shift).max() < ROUNDING


def test_penetration_states_depth_in_millimetres() -> None:
    mesh = as_mesh(trimesh.creation.box((1.0, 1.0, 1.0)))
    points = np.zeros((1000, 3))
    points[:, 2] = 0.6  # 100 mm outside
    points[:10, 2] = 0.498  # 2 mm inside
    points[0, 2] = 0.495  # 5 mm inside
    found = penetration(points, mesh, "cpu")
    assert found.max == pytest.approx(5.0, abs=1.0e-3)
    assert 2.0 < found.p999 < 5.0
    assert found.fraction == pytest.approx(0.01)


def test_depths_are_the_distances_of_what_is_inside() -> None:
    neck, other = ball(subdivisions=4), ball(0.1, 3)
    neck.update_faces(neck.triangles_center[:, 1] < 0.08)
    other.apply_translation((0.07, 0.03, 0.0))
    turned = trimesh.Trimesh(neck.vertices, neck.faces[:, ::-1])
    shapes = [ball(), neck, turned, trimesh.util.concatenate([ball(), other]), trimesh.util.concatenate([neck, other])]
    meshes = [as_mesh(shape) for shape in shapes]
    assert [mesh.closed for mesh in meshes] == [True, False, False, True, False]
    points = [np.random.default_rng(5 + n).uniform(-0.15, 0.15, (1500 - 100 * n, 3)) for n in range(5)]
    exact = [build_exact_collider(mesh, "cpu") for mesh in meshes]
    counts = [len(some) for some in points]
    found = depths_under(np.concatenate([*points, points[0]]), [*counts, 0, counts[0]], [*exact, exact[1], None])
    for mesh, some, depths in zip(meshes, points, found, strict=False):
        np.testing.assert_array_equal(depths, np.maximum(-signed_distances(some, mesh, "cpu"), 0.0))
        assert 0.05 < (depths > 0.0).mean() < 0.5
    assert [len(depths) for depths in found[5:]] == [0, counts[0]]
    assert not found[6].any(), "nothing is there"


def test_penetration_of_a_shape_that_is_not_finite_is_not_a_number() -> None:
    points = np.array([[0.0, 0.0, 0.0], [np.nan, 0.0, 0.0]])
    distances = signed_distances(points, as_mesh(ball()), "cpu")
    assert distances[0] < 0.0
    assert np.isnan(distances[1])
    assert np.isnan(penetration(points, as_mesh(ball()), "cpu").max)


@pytest.mark.cuda
def test_cuda_measures_what_the_cpu_measures() -> None:
    points = np.random.default_rng(4).uniform(-0.15, 0.15, (500, 3))
    mesh = as_mesh(ball(subdivisions=4))
    assert np.abs(signed_distances(points, mesh, "cuda:0") - signed_distances(points, mesh, "cpu")).max() < ROUNDING

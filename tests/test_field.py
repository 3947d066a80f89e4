"""The contact field against analytic distances and the exact mesh; its continuity, on which rest depends."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
import warp as wp
from meshfiles import as_mesh

from warp_cloth.avatar.depth import build_depth_buffers
from warp_cloth.avatar.exact import build_exact_collider
from warp_cloth.avatar.field import FieldBuild, build_contact_field
from warp_cloth.base.mesh import Mesh

PIXEL = 0.002  # [m]; the grid is 5 mm then
RADIUS = 0.15  # of the test sphere [m]
SPHERE_ERROR = 4.0e-4  # [m] near the surface: mesh sag, the pixels' stairs at the silhouette, spline rounding
SPHERE_TILT = 3.0  # [degrees], likewise
DEEP_ERROR = 0.15  # share of the radius: upwind sweeps on 5 mm are of first order
BODY_ERROR = {50: 1.5e-4, 99: 1.5e-3}  # [m], percentiles where a view sees; measured 0.07 and 0.6 to 0.9 mm
OFFSET = 0.003  # [m] contact offset of a garment
OFFSET_LOST = 0.0015  # [m] by which the level set at the offset may come nearer than it; measured 0.9 to 1.3 mm
STEP = 5.0e-5  # [m] of the walk
STEEPEST = 1.6  # distance gained per distance walked; measured 1.3 in creases
NORMAL_STEP = 0.2  # change of the unit normal in one step of the walk: 5 mm of grid turn it in some 100 steps


def sphere(centre: float = 0.0) -> Mesh:
    mesh = as_mesh(trimesh.creation.icosphere(subdivisions=5, radius=RADIUS))
    return replace(mesh, points=mesh.points + centre)


def bake(mesh: Mesh, device: str = "cpu", lower: float = -np.inf, upper: float = np.inf) -> FieldBuild:
    """The field round a mesh, between two heights."""
    low, high = mesh.points.min(axis=0) - 0.03, mesh.points.max(axis=0) + 0.03
    low[1], high[1] = max(low[1], lower), min(high[1], upper)
    return build_contact_field(build_depth_buffers(mesh.points, mesh.triangles, low, high, PIXEL, device))


def directions(count: int) -> np.ndarray:
    way = np.random.default_rng(0).normal(size=(count, 3))
    return way / np.linalg.norm(way, axis=1)[:, None]


def tilt(normals: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Angle between unit vectors [degrees]."""
    return np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", normals, expected), -1.0, 1.0)))


def test_sphere_distance_and_normal_near_the_surface() -> None:
    field, way = bake(sphere()), directions(5000)
    distance = np.random.default_rng(1).uniform(-0.01, 0.009, len(way))
    found = field.sample(way * (RADIUS + distance)[:, None])
    assert np.abs(found[:, 3] - distance).max() < SPHERE_ERROR
    assert tilt(found[:, :3], way).max() < SPHERE_TILT


def test_sphere_interior_leads_out() -> None:
    """As deep as the body goes: the distance grows with depth and the normal points outward."""
    field, way = bake(sphere()), directions(3000)
    depth = np.random.default_rng(2).uniform(0.01, 0.95 * RADIUS, len(way))
    found = field.sample(way * (RADIUS - depth)[:, None])
    assert np.abs(found[:, 3] + depth).max() < DEEP_ERROR * RADIUS
    assert (np.einsum("ij,ij->i", found[:, :3], way)[depth < 0.8 * RADIUS] > 0.9).all()


def test_centre_has_a_unit_normal() -> None:
    found = bake(sphere()).sample(np.zeros((1, 3)))
    assert np.isfinite(found).all()
    assert np.linalg.norm(found[0, :3]) == pytest.approx(1.0, abs=1.0e-5)


def test_far_away_and_outside_the_grid_there_is_no_contact() -> None:
    field = bake(sphere())
    points = np.array(
        [
            [0.0, 0.0, RADIUS + 0.025],
            [9.0, 0.0, 0.0],
            [0.0, -9.0, 0.0],
            [1.0e6, 1.0e6, -1.0e6],
            [np.nan, 0.0, 0.0],
            [0.0, np.inf, 0.0],
        ]
    )
    found = field.sample(points)
    assert (found[:, :3] == 0.0).all()
    assert (found[:, 3] >= field.reach).all()


def test_region_without_avatar_is_far_everywhere() -> None:
    mesh = sphere()
    buffers = build_depth_buffers(mesh.points, mesh.triangles, np.full(3, 1.0), np.full(3, 1.2), PIXEL, "cpu")
    found = build_contact_field(buffers).sample(np.random.default_rng(0).uniform(0.9, 1.3, (200, 3)))
    assert (found[:, :3] == 0.0).all()


def test_finger_is_no_thinner_than_it_is() -> None:
    """A rod of 8 mm, aslant to the grid, keeps its surface and an inside."""
    rod = trimesh.creation.capsule(height=0.08, radius=0.004, count=[24, 24])
    rod.apply_transform(trimesh.transformations.rotation_matrix(0.6, (1.0, 0.4, 0.3)))
    field = bake(as_mesh(rod))
    middle = rod.vertices.mean(axis=0)
    axis = np.linalg.svd(rod.vertices - middle, full_matrices=False)[2][0]
    along = middle + np.linspace(-0.03, 0.03, 50)[:, None] * axis
    assert field.sample(along)[:, 3].max() < -0.001
    across = np.cross(axis, directions(50))
    across /= np.linalg.norm(across, axis=1)[:, None]
    found = field.sample(along + 0.007 * across)
    assert np.abs(found[:, 3] - 0.003).max() < 0.001
    assert tilt(found[:, :3], across).max() < 20.0


def test_two_builds_have_the_same_bits() -> None:
    one, other = bake(sphere()).values.numpy(), bake(sphere()).values.numpy()
    assert (one == other).all()


def test_shift_far_from_the_origin_changes_nothing() -> None:
    points = directions(2000) * np.random.default_rng(3).uniform(RADIUS - 0.02, RADIUS + 0.01, (2000, 1))
    near, far = bake(sphere()).sample(points), bake(sphere(1.0e5)).sample(points + 1.0e5)
    assert np.abs(near[:, 3] - far[:, 3]).max() < 5.0e-5


def walk(field: FieldBuild, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Largest change of distance per distance walked, and of the normal per step, on lines through near space."""
    steps = np.arange(-0.02, 0.02, STEP)
    line = start[:, None] + directions(len(start))[:, None] * steps[None, :, None]
    found = field.sample(line.reshape(-1, 3)).reshape(len(start), len(steps), 4)
    near = (found[:, :, 3] > -OFFSET) & (found[:, :, 3] < field.reach)
    near = near[:, 1:] & near[:, :-1]
    change = np.abs(np.diff(found[:, :, 3], axis=1)) / STEP
    turn = np.linalg.norm(np.diff(found[:, :, :3], axis=1), axis=2)
    return change[near], turn[near]


def test_walk_round_a_sphere_meets_no_jump() -> None:
    change, turn = walk(bake(sphere()), directions(300) * RADIUS)
    assert change.max() < 1.1
    assert turn.max() < 0.005


@wp.kernel
def look(
    mesh: wp.uint64,
    start: wp.array(dtype=wp.vec3f),  # [m], shape [N]
    way: wp.vec3f,
    seen_out: wp.array(dtype=wp.int32),  # set to 1 where nothing is in the way
):
    """Marks the points from which a view is open."""
    point = wp.tid()
    if not wp.mesh_query_ray_anyhit(mesh, start[point], way, 100.0):
        seen_out[point] = 1


def seen(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    """Whether the front, the back or the top view sees each point."""
    tree = build_exact_collider(Mesh(mesh.name, mesh.points, mesh.triangles), "cpu")
    start = wp.array(points - np.array(tree.collider.origin), dtype=wp.vec3f, device="cpu")
    found = wp.zeros(len(points), dtype=wp.int32, device="cpu")
    for way in ((0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)):
        wp.launch(look, dim=len(points), inputs=[tree.mesh.id, start, wp.vec3f(*way), found], device="cpu")
    return found.numpy() != 0


@pytest.mark.parametrize("name", ["garmentcode/mean_all.obj", "anny/female_avg_T_pose.obj"])
def test_trunk_of_a_body(shared_data: Path, name: str) -> None:
    """Between thigh and shoulder: distance against the exact one, the offset kept, no jump across silhouettes."""
    mesh = as_mesh(trimesh.load(shared_data / name, process=False))
    field = bake(mesh, lower=0.7, upper=1.5)
    exact = build_exact_collider(mesh, "cpu", reach=1.0)
    whole = trimesh.Trimesh(mesh.points, mesh.triangles, process=False)
    surface, face = trimesh.sample.sample_surface(whole, 20000, seed=1)
    trunk = (surface[:, 1] > 0.9) & (surface[:, 1] < 1.4) & (np.abs(surface[:, 0]) < 0.5)  # no hands
    surface, normal = surface[trunk], whole.face_normals[face[trunk]]

    points = surface + normal * np.random.default_rng(4).uniform(-0.01, 0.009, (len(surface), 1))
    error = np.abs(field.sample(points)[:, 3] - exact.sample(points)[:, 3])
    error = error[seen(mesh, surface + 2.0e-4 * normal)]
    assert len(error) > 0.9 * len(surface)
    for percent, bound in BODY_ERROR.items():
        assert np.percentile(error, percent) < bound

    level = surface + OFFSET * normal
    for _ in range(20):
        found = field.sample(level)
        level = level + 0.8 * found[:, :3] * (OFFSET - found[:, 3:])
    kept = np.abs(field.sample(level)[:, 3] - OFFSET) < 1.0e-4
    assert kept.mean() > 0.99
    assert exact.sample(level[kept])[:, 3].min() > OFFSET - OFFSET_LOST

    change, turn = walk(field, surface[:: len(surface) // 300])
    assert change.max() < STEEPEST
    assert turn.max() < NORMAL_STEP


@pytest.mark.cuda
def test_cuda_bakes_what_the_cpu_bakes() -> None:
    points = directions(2000) * np.random.default_rng(5).uniform(RADIUS - 0.02, RADIUS + 0.009, (2000, 1))
    on_cpu, on_cuda = bake(sphere()).sample(points), bake(sphere(), "cuda:0").sample(points)
    assert np.abs(on_cpu[:, 3] - on_cuda[:, 3]).max() < 1.0e-4
    one, other = bake(sphere(), "cuda:0").values.numpy(), bake(sphere(), "cuda:0").values.numpy()
    assert (one == other).all()

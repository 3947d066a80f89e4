"""Peeled depth buffers: rays through closed meshes balance, whatever is nested or crosses; what three views miss."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from meshfiles import as_mesh

from warp_cloth.avatar.depth import build_depth_buffers
from warp_cloth.avatar.exact import build_exact_collider
from warp_cloth.avatar.field import FieldBuild, build_contact_field
from warp_cloth.avatar.layers import LayeredBuffers, build_layered_buffers
from warp_cloth.base.mesh import Mesh
from warp_cloth.kernels.avatar.layers import UNBALANCED
from warp_cloth.loading import load_mesh

PIXEL = 0.002  # [m]
RADIUS = 0.05  # of the test's limbs [m]
DEPTH_ERROR = 2.0e-5  # [m]: float32 edge functions over triangles seen aslant
NEAR_ERROR = 3.0e-4  # [m] near a smooth surface: facets of the mesh, the spline's rounding on 5 mm
BODIES = ("garmentcode/mean_all.obj", *(f"anny/female_avg_{pose}.obj" for pose in ("A_pose", "T_pose", "arms_down")))


def limb(x: float, radius: float = RADIUS, z: float = 0.0) -> trimesh.Trimesh:
    """An upright capsule, 0.4 m between its centres."""
    shape = trimesh.creation.capsule(height=0.4, radius=radius, count=[64, 64])
    shape.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (1.0, 0.0, 0.0)))
    shape.apply_translation((x, 0.0, z))
    return shape


def draw(mesh: Mesh, device: str = "cpu", margin: float = 0.03) -> LayeredBuffers:
    lower, upper = mesh.bounds()
    return build_layered_buffers(mesh.points, mesh.triangles, lower - margin, upper + margin, PIXEL, device)


def intervals(buffers: LayeredBuffers, axis: int, column: int, row: int) -> np.ndarray:
    """Low and high ends inside the avatar under a pixel [m], nearest to the viewer first; shape [N, 2]."""
    view = buffers.views[axis]
    place = row * view.columns + column
    start, count = view.start.numpy()[place], view.count.numpy()[place]
    return view.ends.numpy()[start : start + count] + buffers.origin[axis]


def test_layers_of_two_limbs_are_the_closed_form() -> None:
    buffers = draw(as_mesh(limb(0.0), limb(0.0, z=0.15)))
    column, row = (round(-buffers.origin[axis] / PIXEL) for axis in (0, 1))
    x = buffers.origin[0] + column * PIXEL
    half = np.sqrt(RADIUS**2 - x**2)
    expected = [[0.15 - half, 0.15 + half], [-half, half]]
    np.testing.assert_allclose(intervals(buffers, 2, column, row), expected, atol=1.0e-4)  # facets of the capsule
    assert buffers.layers == (1, 1, 2)


def test_nested_and_crossing_parts_are_one_interval() -> None:
    buffers = draw(as_mesh(limb(0.0), limb(0.0, 0.02), limb(0.03)))
    column, row = (round(-buffers.origin[axis] / PIXEL) for axis in (0, 1))
    assert len(intervals(buffers, 2, column, row)) == 1
    assert buffers.unbalanced == 0


@pytest.mark.parametrize("pixel", [0.01, 0.002])
def test_rays_through_edges_and_vertices_balance(pixel: float) -> None:
    """A grid of cubes whose every edge and vertex lies under a pixel: each ray enters as often as it leaves."""
    box = trimesh.creation.box((0.04, 0.04, 0.04)).subdivide().subdivide()
    shifts = [np.array([i, j, k]) * 0.08 for i in range(2) for j in range(2) for k in range(2)]
    mesh = as_mesh(*(box.copy().apply_translation(shift) for shift in shifts))
    buffers = build_layered_buffers(mesh.points, mesh.triangles, np.full(3, -0.04), np.full(3, 0.12), pixel, "cpu")
    assert buffers.unbalanced == 0
    for axis in range(3):
        count = buffers.views[axis].count.numpy()
        assert set(np.unique(count)) == {0, 2}


@pytest.mark.parametrize("name", BODIES)
def test_rays_through_real_bodies_balance(shared_data: Path, name: str) -> None:
    mesh = load_mesh(shared_data / name, role="avatar", key="avatar")
    assert draw(mesh).unbalanced == 0


def test_depth_of_a_box_askew_is_the_closed_form() -> None:
    half = np.array([0.1, 0.05, 0.075])
    box = trimesh.creation.box(2.0 * half).subdivide()
    turn = trimesh.transformations.rotation_matrix(0.7, (1.0, 0.3, 0.2))
    box.apply_transform(turn)
    buffers = draw(as_mesh(box))
    pick = np.random.default_rng(0)
    for axis in range(3):
        view = buffers.views[axis]
        covered = np.flatnonzero(view.count.numpy() == 1)
        for place in pick.choice(covered, 50, replace=False):
            start = np.zeros(3)
            start[(axis + 1) % 3] = buffers.origin[(axis + 1) % 3] + place % view.columns * PIXEL
            start[(axis + 2) % 3] = buffers.origin[(axis + 2) % 3] + place // view.columns * PIXEL
            local, way = turn[:3, :3].T @ start, turn[axis, :3]
            sides = np.stack([(-half - local) / way, (half - local) / way])
            expected = [sides.min(axis=0).max(), sides.max(axis=0).min()]
            found = intervals(buffers, axis, place % view.columns, place // view.columns)[0]
            np.testing.assert_allclose(found, expected, atol=DEPTH_ERROR)


def test_mesh_that_encloses_nothing_leaves_its_rays_unbalanced() -> None:
    shape = limb(0.0)
    shape.update_faces(shape.triangles_center[:, 2] > 0.0)  # the front half
    buffers = draw(as_mesh(shape))
    assert buffers.unbalanced > 1000
    assert (buffers.views[2].count.numpy() == UNBALANCED).any()


def field_of(mesh: Mesh, layered: bool) -> FieldBuild:
    lower, upper = mesh.bounds()
    build = build_layered_buffers if layered else build_depth_buffers
    return build_contact_field(build(mesh.points, mesh.triangles, lower - 0.03, upper + 0.03, PIXEL, "cpu"))


def test_gap_that_front_back_and_top_do_not_see_is_free_in_all_layers() -> None:
    """A limb beside a trunk, 16 mm apart, a plate before it, one behind and one above: open to the sides only."""
    wall = [trimesh.creation.box((0.4, 0.5, 0.02)) for _ in range(2)]
    wall[0].apply_translation((0.0, 0.0, 0.12))
    wall[1].apply_translation((0.0, 0.0, -0.12))
    roof = trimesh.creation.box((0.4, 0.02, 0.4)).apply_translation((0.0, 0.28, 0.0))
    x = RADIUS + 0.008
    mesh = as_mesh(limb(-x), limb(x), *wall, roof)
    way = np.stack([np.linspace(-0.007, 0.007, 15), np.zeros(15), np.zeros(15)], axis=1)
    truth = 0.008 - np.abs(way[:, 0])
    layered = field_of(mesh, True).sample(way)[:, 3]
    assert (field_of(mesh, False).sample(way)[:, 3] < 0.0).all()
    assert np.abs(layered - truth)[np.abs(way[:, 0]) > 0.004].max() < NEAR_ERROR
    assert np.abs(layered - truth).max() < 1.0e-3  # between them the field rounds its ridge off


def test_field_of_all_layers_near_a_round_limb() -> None:
    mesh = as_mesh(limb(0.0))
    field, exact = field_of(mesh, True), build_exact_collider(mesh, "cpu")
    random = np.random.default_rng(1)
    way = random.normal(size=(4000, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    points = way * (RADIUS + random.uniform(-0.006, 0.009, (4000, 1)))
    points[:, 1] += np.where(way[:, 1] > 0.0, 0.2, -0.2)
    error = np.abs(field.sample(points)[:, 3] - exact.sample(points)[:, 3])
    assert error.max() < NEAR_ERROR


@pytest.mark.cuda
def test_cuda_draws_the_layers_that_the_cpu_draws() -> None:
    mesh = as_mesh(limb(0.0), limb(0.03))
    on_cpu, on_cuda = draw(mesh), draw(mesh, "cuda:0")
    for one, other in zip(on_cpu.views, on_cuda.views, strict=True):
        assert (one.count.numpy() == other.count.numpy()).all()
    one, other = build_contact_field(on_cpu).values.numpy(), build_contact_field(on_cuda).values.numpy()
    assert (one == other).all()

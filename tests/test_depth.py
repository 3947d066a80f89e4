"""Depth buffers against closed forms and exact ray casts; the silhouette's own error; the paper's plain look-up."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
import warp as wp
from meshfiles import as_mesh

from warp_cloth.avatar.depth import DepthBuffers, build_depth_buffers, contact_bounds
from warp_cloth.base.errors import InputError

PIXEL = 0.002  # [m]
RADIUS = 0.15  # of the test sphere [m]
SPHERE_SAG = 2.0e-4  # [m]: flat faces of the sphere mesh lie up to 0.05 mm inside it, seen up to 70 degrees aslant
SILHOUETTE = 0.1  # pixels: the sphere's silhouette is found to a tenth of a pixel, from the thickness next to it
BODY_SILHOUETTE = 1.0  # pixels: the same for 98 % of a body's outline, which has folds and slivers
ROUNDING = 2.0e-5  # [m]: depth at a pixel's centre; float32 edge functions over triangles seen aslant
BETWEEN = 5.0e-4  # [m], 99 % of samples between pixels on smooth parts: curvature over one 2 mm pixel
STEEP = 4.0  # pixels of depth across a cell above which it holds a silhouette


def sphere() -> tuple[np.ndarray, np.ndarray]:
    mesh = as_mesh(trimesh.creation.icosphere(subdivisions=5, radius=RADIUS))
    return mesh.points, mesh.triangles


def body(data: Path, name: str) -> tuple[np.ndarray, np.ndarray]:
    mesh = as_mesh(trimesh.load(data / name, process=False))
    return mesh.points, mesh.triangles


def draw(points: np.ndarray, triangles: np.ndarray, device: str = "cpu") -> DepthBuffers:
    lower, upper = points.min(axis=0) - 0.02, points.max(axis=0) + 0.02
    return build_depth_buffers(points, triangles, lower, upper, PIXEL, device)


def pixel_centres(buffers: DepthBuffers, image: np.ndarray, across: int, up: int) -> tuple[np.ndarray, np.ndarray]:
    rows, columns = np.mgrid[: image.shape[0], : image.shape[1]]
    return buffers.origin[across] + columns * PIXEL, buffers.origin[up] + rows * PIXEL


@wp.kernel
def cast_rays(
    mesh: wp.uint64, start: wp.array(dtype=wp.vec3f), way: wp.vec3f, distance_out: wp.array(dtype=wp.float32)
):
    """Distance to the first hit along each ray, infinite where there is none."""
    ray = wp.tid()
    hit = wp.mesh_query_ray(mesh, start[ray], way, 100.0)
    distance_out[ray] = wp.where(hit.result, hit.t, wp.inf)


def ray_depths(points: np.ndarray, triangles: np.ndarray, start: np.ndarray, way: np.ndarray) -> np.ndarray:
    mesh = wp.Mesh(
        wp.array(points.astype(np.float32), dtype=wp.vec3f, device="cpu"),
        wp.array(triangles.reshape(-1), dtype=wp.int32, device="cpu"),
    )
    found = wp.empty(len(start), dtype=wp.float32, device="cpu")
    given = wp.array(start.astype(np.float32), dtype=wp.vec3f, device="cpu")
    wp.launch(cast_rays, dim=len(start), inputs=[mesh.id, given, wp.vec3f(*way)], outputs=[found], device="cpu")
    return found.numpy()


@pytest.mark.parametrize(("view", "across", "up"), [("front", 0, 1), ("back", 0, 1), ("top", 0, 2)])
def test_sphere_depth_is_the_closed_form(view: str, across: int, up: int) -> None:
    buffers = draw(*sphere())
    image = getattr(buffers, view).numpy()
    x, y = pixel_centres(buffers, image, across, up)
    off_axis = np.hypot(x, y)
    assert np.isinf(image[off_axis > RADIUS]).all()
    covered = off_axis < 0.94 * RADIUS
    toward = {"front": buffers.origin[2], "back": -buffers.origin[2], "top": buffers.origin[1]}[view]
    error = image[covered] + toward - np.sqrt(RADIUS**2 - off_axis[covered] ** 2)
    assert np.abs(error).max() < SPHERE_SAG


def test_sphere_silhouette_is_found_within_a_tenth_of_a_pixel() -> None:
    buffers = draw(*sphere())
    angle = np.linspace(0.0, 2.0 * np.pi, 2000)
    radii = RADIUS + PIXEL * np.linspace(-1.5, 1.5, 301)
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    levels = buffers.levels((ring[:, None] * radii[None, :, None]).reshape(-1, 3)).reshape(len(angle), -1)
    assert (levels[:, 0] > 0.0).all()
    assert (levels[:, -1] < 0.0).all()
    found = radii[np.argmax(levels < 0.0, axis=1)]
    error = found - RADIUS
    assert np.percentile(np.abs(error), 99) < SILHOUETTE * PIXEL
    assert np.abs(error).max() < PIXEL


def test_region_sees_what_the_whole_sees() -> None:
    points, triangles = sphere()
    whole = draw(points, triangles)
    lower = whole.origin + np.array([20, 30, 40]) * PIXEL
    part = build_depth_buffers(points, triangles, lower, lower + 0.1, PIXEL, "cpu")
    rows, columns = part.front.shape
    expected = whole.front.numpy()[30 : 30 + rows, 20 : 20 + columns] - 40 * PIXEL
    np.testing.assert_allclose(part.front.numpy(), expected, rtol=0.0, atol=ROUNDING)


def test_no_crack_between_triangles() -> None:
    """A box turned askew, drawn finely: every pixel well within its outline shows the near side, none the far one."""
    box = trimesh.creation.box((0.2, 0.2, 0.2))
    for _ in range(4):
        box = box.subdivide()
    turn = trimesh.transformations.rotation_matrix(0.7, (1.0, 0.3, 0.2))
    box.apply_transform(turn)
    points, triangles = np.asarray(box.vertices, dtype=np.float64), np.asarray(box.faces, dtype=np.int32)
    buffers = build_depth_buffers(points, triangles, points.min(axis=0), points.max(axis=0), 0.0005, "cpu")
    thickness = buffers.front.numpy() + buffers.back.numpy()
    rows, columns = thickness.shape
    middle = thickness[rows // 4 : -rows // 4, columns // 4 : -columns // 4]
    assert middle.min() > 0.05


@pytest.mark.parametrize("name", ["garmentcode/mean_all.obj", "anny/female_avg_A_pose.obj"])
def test_body_depth_matches_ray_casts(shared_data: Path, name: str) -> None:
    points, triangles = body(shared_data, name)
    buffers = draw(points, triangles)
    image = buffers.front.numpy()
    random = np.random.default_rng(0)
    column = random.uniform(0.0, image.shape[1] - 1.001, 20000)
    row = random.uniform(0.0, image.shape[0] - 1.001, 20000)

    def exact(column: np.ndarray, row: np.ndarray) -> np.ndarray:
        x, y = buffers.origin[0] + column * PIXEL, buffers.origin[1] + row * PIXEL
        start = np.stack([x, y, np.full_like(x, 2.0)], axis=1)
        return 2.0 - ray_depths(points, triangles, start, np.array([0.0, 0.0, -1.0])) - buffers.origin[2]

    i, j = column.astype(int), row.astype(int)
    hit = exact(i.astype(float), j.astype(float))
    assert (np.isfinite(hit) == np.isfinite(image[j, i])).all()
    covered = np.isfinite(hit)
    assert np.abs(hit[covered] - image[j, i][covered]).max() < ROUNDING

    s, t = column - i, row - j
    corner = np.stack([image[j, i], image[j, i + 1], image[j + 1, i], image[j + 1, i + 1]])
    smooth = np.isfinite(corner).all(axis=0)
    corner, s, t = corner[:, smooth], s[smooth], t[smooth]
    sampled = (corner[0] * (1 - s) + corner[1] * s) * (1 - t) + (corner[2] * (1 - s) + corner[3] * s) * t
    error = np.abs(sampled - exact(column[smooth], row[smooth]))
    spread = corner.max(axis=0) - corner.min(axis=0)
    smooth = spread < STEEP * PIXEL
    assert smooth.mean() > 0.9
    assert np.percentile(error[smooth], 99) < BETWEEN
    assert np.mean(error > spread + BETWEEN) < 0.001  # silhouettes too: never beyond the pixels around


def test_body_silhouette_is_found_within_a_pixel(shared_data: Path) -> None:
    """The outline's rightmost point in each row of pixels, against the exact section of the mesh."""
    points, triangles = body(shared_data, "anny/female_avg_arms_down.obj")
    buffers = draw(points, triangles)
    edges = np.concatenate([points[triangles[:, [a, (a + 1) % 3]]] for a in range(3)])
    error = []
    for row in range(20, buffers.front.shape[0] - 20, 4):
        y = buffers.origin[1] + row * PIXEL
        start, end = edges[:, 0], edges[:, 1]
        crossing = (start[:, 1] < y) != (end[:, 1] < y)
        start, end = start[crossing], end[crossing]
        share = (y - start[:, 1]) / (end[:, 1] - start[:, 1])
        section = start + share[:, None] * (end - start)
        widest = section[section[:, 0].argmax()]
        bulge = buffers.bulge.numpy()[row]
        last = np.flatnonzero(bulge > 0.0).max()
        found = last + bulge[last] / (bulge[last] - bulge[last + 1])
        error.append(found - (widest[0] - buffers.origin[0]) / PIXEL)
    assert np.percentile(np.abs(error), 98) < BODY_SILHOUETTE + 0.2  # a slanted outline in a row of pixels


def test_shift_far_from_the_origin_changes_nothing() -> None:
    points, triangles = sphere()
    near, far = draw(points, triangles), draw(points + 1.0e5, triangles)
    assert near.front.shape == far.front.shape
    thick = near.bulge.numpy() > (0.3 * RADIUS) ** 2  # away from the silhouette, where a rounding decides on a pixel
    assert np.abs(near.front.numpy()[thick] - far.front.numpy()[thick]).max() < 1.0e-6
    assert (np.isfinite(near.front.numpy()) != np.isfinite(far.front.numpy())).mean() < 1.0e-3


def test_region_without_avatar_is_empty() -> None:
    points, triangles = sphere()
    buffers = build_depth_buffers(points, triangles, np.full(3, 1.0), np.full(3, 1.2), PIXEL, "cpu")
    assert np.isinf(buffers.front.numpy()).all()
    assert (buffers.levels(np.random.default_rng(0).uniform(0.9, 1.3, (100, 3))) < 0.0).all()


def test_absurd_size_is_refused_before_memory_is_taken() -> None:
    points, triangles = sphere()
    with pytest.raises(InputError, match=r"collision\.pixel_mm: .* pixels; set a larger pixel"):
        build_depth_buffers(points, triangles, np.zeros(3), np.full(3, 1000.0), PIXEL, "cpu")


def test_contact_bounds_is_what_both_boxes_share() -> None:
    garment = np.array([[-0.3, 1.0, -0.2], [0.3, 1.4, 0.5]])
    avatar = np.array([[-0.6, 0.0, -0.1], [0.2, 1.7, 0.1]])
    lower, upper = contact_bounds(garment, avatar, 0.1)
    np.testing.assert_allclose(lower, [-0.4, 0.9, -0.2])
    np.testing.assert_allclose(upper, [0.3, 1.5, 0.2])


def test_plain_look_up_answers_with_the_nearest_view() -> None:
    buffers = draw(*sphere())
    plain = buffers.plain()
    for way in ([0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.2, 0.3, 0.9], [0.0, 1.0, 0.0], [0.1, 0.9, 0.2]):
        unit = np.array(way) / np.linalg.norm(way)
        contact = plain.sample(unit[None] * (RADIUS - 0.004))[0]
        assert abs(contact[3] + 0.004) < SPHERE_SAG
        assert contact[:3] @ unit > 0.999
    far = plain.sample(np.array([[0.0, 0.0, RADIUS + 0.05], [5.0, 0.0, 0.0], [np.nan, 0.0, 0.0]]))
    assert (far[:, :3] == 0.0).all()
    assert (far[:, 3] >= 0.01).all()


@pytest.mark.cuda
def test_cuda_draws_what_the_cpu_draws() -> None:
    on_cpu, on_cuda = draw(*sphere()), draw(*sphere(), device="cuda:0")
    for view in ("front", "back", "top"):
        one, other = getattr(on_cpu, view).numpy(), getattr(on_cuda, view).numpy()
        both = np.isfinite(one) & np.isfinite(other)
        assert (np.isfinite(one) != np.isfinite(other)).mean() < 1.0e-3
        assert np.percentile(np.abs(one[both] - other[both]), 99.9) < ROUNDING

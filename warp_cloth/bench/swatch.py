"""Meshes of flat specimens, strips and discs, in the xz plane with the warp along -z."""

from __future__ import annotations

import numpy as np

from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.shapes import square

RING_SIDES = 6  # vertices that a ring has more than the next inner one


def strip(width: float, length: float, edge: float) -> Mesh:
    """A rectangle in a regular grid of about this edge length [m]; y of its panel is along its length."""
    columns, rows = max(round(width / edge), 1), max(round(length / edge), 1)
    count = max(columns, rows) + 1
    whole = square(side=1.0, vertices_per_side=count)
    texcoords = whole.texcoords if whole.texcoords is not None else np.zeros((0, 3, 2))
    cell = 1.0 / (count - 1)
    inside = (texcoords.mean(axis=1) < np.array([columns, rows]) * cell).all(axis=1)
    flat = texcoords[inside] / cell * np.array([width / columns, length / rows])
    used, triangles = np.unique(whole.triangles[inside], return_inverse=True)
    points = np.zeros((len(used), 3))
    triangles = triangles.reshape(-1, 3)
    points[triangles.ravel(), 0] = flat[..., 0].ravel() - 0.5 * width
    points[triangles.ravel(), 2] = 0.5 * length - flat[..., 1].ravel()
    return Mesh("strip", points, triangles.astype(np.int32), texcoords=flat)


def disc(radius: float, hole: float, rings: int, spacing: float | None = None) -> Mesh:
    """A disc of concentric rings, without those inside ``hole`` [m]; a ring lies on the hole's edge or close to it.

    ``spacing`` [m] is the distance between rings, counted from the rim; None: evenly, from the disc's centre.
    """
    step = radius / rings if spacing is None else spacing
    first = max(round(rings * hole / radius), 1)
    starts = {ring: RING_SIDES * (ring * (ring - 1) - first * (first - 1)) // 2 for ring in range(first, rings + 1)}
    circles = []
    for ring in range(first, rings + 1):
        angle = np.arange(RING_SIDES * ring) * 2.0 * np.pi / (RING_SIDES * ring)
        circles.append((radius - step * (rings - ring)) * np.column_stack([np.cos(angle), np.sin(angle)]))
    flat = np.concatenate(circles)
    triangles = np.concatenate([_between(ring, starts[ring], starts[ring + 1]) for ring in range(first, rings)])
    points = np.column_stack([flat[:, 0], np.zeros(len(flat)), -flat[:, 1]])
    return Mesh("disc", points, triangles.astype(np.int32), texcoords=flat[triangles])


def _between(ring: int, inner: int, outer: int) -> np.ndarray:
    """Triangles between a ring and the next, whose first vertices are ``inner`` and ``outer``."""
    side, step = (indices.ravel() for indices in np.meshgrid(np.arange(RING_SIDES), np.arange(ring + 1), indexing="ij"))
    here = inner + (side * ring + step) % (RING_SIDES * ring)
    there = outer + side * (ring + 1) + step
    beyond = outer + (side * (ring + 1) + step + 1) % (RING_SIDES * (ring + 1))
    after = inner + (side * ring + step + 1) % (RING_SIDES * ring)
    pointing = np.column_stack([here, there, beyond])
    filling = np.column_stack([here, beyond, after])[step < ring]
    return np.concatenate([pointing, filling])


def on_finer_disc(coarse: Mesh, points: Points, fine: Mesh) -> Points:
    """Interpolated points of a disc [m] from those of a ``coarse`` one; both meshes are as they were cut."""
    (radius, angle), (fine_radius, fine_angle) = _polar(coarse), _polar(fine)
    rings = np.unique(radius.round(9))
    shapes = np.empty((len(rings), fine.vertex_count, 3))
    for index, ring in enumerate(rings):
        on_ring = np.isclose(radius, ring)
        for axis in range(3):
            shapes[index, :, axis] = np.interp(fine_angle, angle[on_ring], points[on_ring, axis], period=2.0 * np.pi)
    outer = np.clip(np.searchsorted(rings, fine_radius.round(9), side="left"), 1, len(rings) - 1)
    t = ((fine_radius - rings[outer - 1]) / (rings[outer] - rings[outer - 1]))[:, None]
    vertices = np.arange(fine.vertex_count)
    return (1.0 - t) * shapes[outer - 1, vertices] + t * shapes[outer, vertices]


def _polar(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Radius [m] and angle of every vertex of a disc as it was cut."""
    return np.hypot(mesh.points[:, 0], mesh.points[:, 2]), np.arctan2(mesh.points[:, 2], mesh.points[:, 0])


def along(mesh: Mesh) -> tuple[Points, Points]:
    """Coordinates of every vertex across and along its strip as it was cut [m], shape [V] each."""
    length = float(mesh.points[:, 2].max() - mesh.points[:, 2].min())
    return mesh.points[:, 0], 0.5 * length - mesh.points[:, 2]

"""Flat pieces of cloth that a textile laboratory cuts: strips and discs, in the xz plane, the warp along -z."""

from __future__ import annotations

import numpy as np

from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.shapes import square

RING_SIDES = 6  # a ring has six vertices more than the next inner one


def strip(width: float, length: float, edge: float) -> Mesh:
    """A rectangle in a regular grid of about this edge length [m]: x across, y of its panel along it."""
    columns, rows = max(round(width / edge), 1), max(round(length / edge), 1)
    count = max(columns, rows) + 1
    whole = square(side=1.0, vertices_per_side=count)
    texcoords = whole.texcoords if whole.texcoords is not None else np.zeros((0, 3, 2))
    cell = 1.0 / (count - 1)
    kept = (texcoords.mean(axis=1) < np.array([columns, rows]) * cell).all(axis=1)
    flat = texcoords[kept] / cell * np.array([width / columns, length / rows])
    used, triangles = np.unique(whole.triangles[kept], return_inverse=True)
    points = np.zeros((len(used), 3))
    triangles = triangles.reshape(-1, 3)
    points[triangles.ravel(), 0] = flat[..., 0].ravel() - 0.5 * width
    points[triangles.ravel(), 2] = 0.5 * length - flat[..., 1].ravel()
    return Mesh("strip", points, triangles.astype(np.int32), texcoords=flat)


def disc(radius: float, hole: float, rings: int, spacing: float | None = None) -> Mesh:
    """A disc of rings around a hexagon, without those inside ``hole`` [m]; one ring lies on the hole's edge or near.

    ``spacing`` [m] is how far the rings are apart, counted from the rim; None: evenly, from the disc's middle.
    """
    step = radius / rings if spacing is None else spacing
    first = max(round(rings * hole / radius), 1)
    starts = {ring: RING_SIDES * (ring * (ring - 1) - first * (first - 1)) // 2 for ring in range(first, rings + 1)}
    circles = []
    for ring in range(first, rings + 1):
        turn = np.arange(RING_SIDES * ring) * 2.0 * np.pi / (RING_SIDES * ring)
        circles.append((radius - step * (rings - ring)) * np.column_stack([np.cos(turn), np.sin(turn)]))
    flat = np.concatenate(circles)
    triangles = np.concatenate([_between(ring, starts[ring], starts[ring + 1]) for ring in range(first, rings)])
    points = np.column_stack([flat[:, 0], np.zeros(len(flat)), -flat[:, 1]])
    return Mesh("disc", points, triangles.astype(np.int32), texcoords=flat[triangles])


def _between(ring: int, inner: int, outer: int) -> np.ndarray:
    """Triangles between a ring and the next; the two start at these vertices."""
    side, step = (part.ravel() for part in np.meshgrid(np.arange(RING_SIDES), np.arange(ring + 1), indexing="ij"))
    here = inner + (side * ring + step) % (RING_SIDES * ring)
    there = outer + side * (ring + 1) + step
    beyond = outer + (side * (ring + 1) + step + 1) % (RING_SIDES * (ring + 1))
    after = inner + (side * ring + step + 1) % (RING_SIDES * ring)
    pointing = np.column_stack([here, there, beyond])
    filling = np.column_stack([here, beyond, after])[step < ring]
    return np.concatenate([pointing, filling])


def on_finer_disc(coarse: Mesh, points: Points, fine: Mesh) -> Points:
    """Where a disc's vertices are [m] if a coarser one, ``coarse`` as it was cut, lies at ``points``."""
    (radius, turn), (finer, finer_turn) = _polar(coarse), _polar(fine)
    rings = np.unique(radius.round(9))
    shapes = np.empty((len(rings), fine.vertex_count, 3))
    for index, ring in enumerate(rings):
        on_it = np.isclose(radius, ring)
        for axis in range(3):
            shapes[index, :, axis] = np.interp(finer_turn, turn[on_it], points[on_it, axis], period=2.0 * np.pi)
    outer = np.clip(np.searchsorted(rings, finer.round(9), side="left"), 1, len(rings) - 1)
    share = ((finer - rings[outer - 1]) / (rings[outer] - rings[outer - 1]))[:, None]
    every = np.arange(fine.vertex_count)
    return (1.0 - share) * shapes[outer - 1, every] + share * shapes[outer, every]


def _polar(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Radius [m] and angle of every vertex of a disc as it was cut."""
    return np.hypot(mesh.points[:, 0], mesh.points[:, 2]), np.arctan2(mesh.points[:, 2], mesh.points[:, 0])


def along(mesh: Mesh) -> tuple[Points, Points]:
    """Place of every vertex across and along its strip [m], as it was cut; shape [V] each."""
    length = float(mesh.points[:, 2].max() - mesh.points[:, 2].min())
    return mesh.points[:, 0], 0.5 * length - mesh.points[:, 2]

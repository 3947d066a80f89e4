"""Flips keep a triangulation Delaunay, the same that SciPy makes, and never lose the side of an outline."""

from __future__ import annotations

import numpy as np
from scipy.spatial import Delaunay

from warp_cloth.pattern.delaunay import doubled_areas, triangulated
from warp_cloth.pattern.flips import flipped, inserted

COUNT = 300


def disc(seed: int) -> tuple[np.ndarray, int]:
    """A ring of vertices, and others within it."""
    angle = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    rng = np.random.default_rng(seed)
    inner = rng.normal(0.0, 0.3, (4 * COUNT, 2))
    inner = inner[np.hypot(*inner.T) < 0.9][:COUNT]
    return np.concatenate([np.column_stack([np.cos(angle), np.sin(angle)]), inner]), len(angle)


def as_set(triangles: np.ndarray) -> set[tuple[int, ...]]:
    return set(map(tuple, np.sort(triangles, axis=1).tolist()))


def test_moved_vertices_are_as_triangulated_anew() -> None:
    points, rim = disc(1)
    triangles = Delaunay(points).simplices.astype(np.int64)
    moved = points + np.concatenate([np.zeros((rim, 2)), np.random.default_rng(2).normal(0.0, 0.01, (COUNT, 2))])
    while len(turned := triangles[doubled_areas(moved, triangles) <= 0.0].ravel()):
        moved[turned] = points[turned]
    made = flipped(moved, triangles)
    assert as_set(made) == as_set(Delaunay(moved).simplices)
    assert (doubled_areas(moved, made) > 0.0).all()


def test_inserted_vertices_are_as_triangulated_anew() -> None:
    points, _ = disc(3)
    before = len(points) - COUNT // 3
    made = inserted(points, Delaunay(points[:before]).simplices.astype(np.int64), before)
    assert made is not None
    assert as_set(made) == as_set(Delaunay(points).simplices)


def test_vertices_outside_are_not_put_in() -> None:
    points = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)])
    assert inserted(points, np.array([[0, 1, 2]]), 3) is None


def test_sides_are_kept() -> None:
    """An L, whose inner corner's sides are no edges of the Delaunay triangulation of all its vertices."""
    corners = np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 0.1), (0.1, 0.1), (0.1, 2.0), (0.0, 2.0)])
    sides = np.column_stack([np.arange(6), (np.arange(6) + 1) % 6])
    added = np.array([(1.0, 0.05), (0.05, 1.0)])
    points = np.concatenate([corners, added])
    made = inserted(points, triangulated(corners, sides, np.zeros(6, dtype=np.int64)), 6)
    edges = {frozenset(edge) for triangle in made.tolist() for edge in zip(triangle, np.roll(triangle, 1), strict=True)}
    assert {frozenset(side) for side in sides.tolist()} <= edges
    assert np.isclose(doubled_areas(points, made).sum(), 2.0 * (0.2 + 0.19))

"""Garments that no tailor would cut: edges of all lengths, needles, caps, starts far from any rest shape."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warp_cloth.shapes.simple import sphere

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Drawn = tuple[Floats, Ints, "Floats | None"]  # points [m], triangles, texture coordinates of each vertex [m]


def sheet(x: ArrayLike, y: ArrayLike) -> Drawn:
    """A vertical sheet over these ticks [m], alternately cut; its texture coordinates are its own x and y."""
    across, up = np.meshgrid(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    points = np.stack([across.ravel(), up.ravel(), np.zeros(across.size)], axis=1)
    width = across.shape[1]
    column, row = np.meshgrid(np.arange(width - 1), np.arange(across.shape[0] - 1))
    a = (row * width + column).ravel()
    b, c, d = a + 1, a + width, a + width + 1
    even = ((row + column) % 2 == 0).ravel()[:, None]
    first = np.where(even, np.stack([a, b, d], axis=1), np.stack([a, b, c], axis=1))
    second = np.where(even, np.stack([a, d, c], axis=1), np.stack([b, d, c], axis=1))
    return points, np.concatenate([first, second]), points[:, :2].copy()


def square(count: int = 9, side: float = 0.5) -> Drawn:
    """An even sheet, its top at y = 1.5 m."""
    ticks = np.linspace(0.0, side, count)
    return sheet(ticks - 0.5 * side, ticks + 1.5 - side)


def graded(shortest: float, longest: float, count: int = 10) -> Drawn:
    """A sheet whose ticks stand closer and closer: edges from the shortest to the longest [m]."""
    steps = np.geomspace(shortest, longest, count)
    ticks = np.concatenate([[0.0], np.cumsum(steps)])
    return sheet(ticks - 0.5 * ticks[-1], 1.5 - ticks[::-1])


def needles(ratio: float, count: int = 6) -> Drawn:
    """A sheet of triangles that are ``ratio`` times as long as wide."""
    long = np.linspace(0.0, 0.5, count)
    return sheet(long / ratio, long + 1.0)


def caps(flatness: float, count: int = 6) -> Drawn:
    """A sheet in which every triangle has a vertex that nearly lies on its longest side."""
    points, triangles, _ = square(count)
    corners = points[triangles]
    lengths = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    longest = np.argmax(lengths, axis=1)
    rows = np.arange(len(triangles))
    a, b, c = (corners[rows, (longest + turn) % 3] for turn in range(3))
    foot = 0.5 * (a + b) * (1.0 - flatness) + c * flatness
    extra = len(points) + rows
    ids = [triangles[rows, (longest + turn) % 3] for turn in range(3)]
    parts = [np.stack([ids[i], ids[(i + 1) % 3], extra], axis=1) for i in range(3)]
    whole = np.concatenate([points, foot])
    return whole, np.concatenate(parts), whole[:, :2].copy()


def moved(drawn: Drawn, move: Callable[[Floats], Floats]) -> Drawn:
    """The same cloth, cut as before, that starts elsewhere."""
    points, triangles, flat = drawn
    return move(points), triangles, flat


def torn(times: float) -> Drawn:
    """Two halves that one seam joins, so far apart that its edges start ``times`` as long as they are."""
    points, triangles, flat = square(10)
    edge = 0.5 / 9
    apart = np.where(points[:, :1] > 0.0, times * edge, 0.0) * np.array([0.0, 0.0, 1.0])
    return points + apart, triangles, flat


def crumpled(size: float) -> Drawn:
    """Half of a sheet drawn together to a heap of this size [m]."""
    chance = np.random.default_rng(1)

    def heap(points: Floats) -> Floats:
        low = points[:, 1] < points[:, 1].mean()
        points = points.copy()
        points[low] = [0.0, 1.25, 0.0] + size * chance.standard_normal((int(low.sum()), 3))
        return points

    return moved(square(9), heap)


def ball(radius: float, *, inside_out: bool = False, centre: tuple[float, float, float] = (0.0, 1.2, 0.0)) -> Drawn:
    """A closed garment; ``inside_out``: every vertex on the other side of the centre."""
    mesh = sphere(radius=radius, centre=centre, edge=0.4 * radius)
    points = 2.0 * np.array(centre) - mesh.points if inside_out else mesh.points
    return points, mesh.triangles.astype(np.int64), None


def tube(radius: float, cut: float, count: int = 24, rows: int = 7) -> Drawn:
    """A tube round the y axis, cut ``cut`` times as wide as it starts."""
    angle = np.linspace(0.0, 2.0 * np.pi, count + 1)
    height = np.linspace(1.05, 1.35, rows)
    flat, triangles, texture = sheet(angle * radius * cut, height)
    ring = flat[:, 0] / (radius * cut)
    points = np.stack([radius * np.cos(ring), flat[:, 1], radius * np.sin(ring)], axis=1)
    return np.round(points, 12), triangles, texture  # the seam's two sides are the same numbers, and weld

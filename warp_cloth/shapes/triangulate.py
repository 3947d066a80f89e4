"""Meshing of a flat panel: a hexagonal lattice inside an outline, with its Delaunay triangulation.

Own code: ``scipy.spatial.Delaunay`` saves 0.1 s of the 0.9 s that the T-shirt takes, but importing it takes 0.36 s, and
it leaves slivers along the outline, so that the panels (and every result of the T-shirt) would change.
``mapbox_earcut`` adds no inner vertices and is not Delaunay.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Indices, Points

REACH = 2.0  # spacings: no empty circle in such a point set is wider, so Delaunay partners are this near
CLEARANCE = 0.62  # spacings between lattice and outline: less makes slivers, more makes wide triangles
JITTER = 1e-5  # spacings; breaks ties of four points on a circle
SMOOTHING_ROUNDS = 12


def triangulate(outline: Points, spacing: float) -> tuple[Points, Indices]:
    """Points, the outline's first, shape [N, 2], and counter-clockwise triangles that fill it, shape [F, 3].

    ``outline`` is a counter-clockwise polygon [m], shape [n, 2], whose edges are about ``spacing`` long; they all
    become edges of triangles.
    """
    points = np.vstack([outline, _lattice(outline, spacing)])
    triangles = _delaunay(points, outline, spacing)
    inner = np.arange(len(outline), len(points))
    one = triangles.ravel()
    other = np.roll(triangles, -1, axis=1).ravel()
    degree = np.bincount(one, minlength=len(points)).astype(float)
    for _ in range(SMOOTHING_ROUNDS):
        mean = [np.bincount(one, points[other, axis], len(points)) / degree for axis in range(2)]
        points[inner] = np.column_stack(mean)[inner]
    return points, _delaunay(points, outline, spacing).astype(np.int32)


def contains(outline: Points, points: Points) -> NDArray[np.bool_]:
    """Whether points lie in a polygon (even-odd rule), shape [N]."""
    inside = np.zeros(len(points), dtype=bool)
    x, y = points.T
    for (x0, y0), (x1, y1) in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        if y0 != y1:
            inside ^= ((y0 > y) != (y1 > y)) & (x < x0 + (y - y0) * (x1 - x0) / (y1 - y0))
    return inside


def _lattice(outline: Points, spacing: float) -> Points:
    """Points of a hexagonal lattice inside an outline and clear of it."""
    low, high = outline.min(axis=0), outline.max(axis=0)
    rows = np.arange(low[1] + 0.5 * spacing, high[1], spacing * np.sqrt(0.75))
    columns = np.arange(low[0], high[0] + spacing, spacing)
    x, y = np.meshgrid(columns, rows)
    x = x + 0.5 * spacing * (np.arange(len(rows)) % 2)[:, None]
    spots = np.column_stack([x.ravel(), y.ravel()])
    spots = spots[contains(outline, spots)]
    clear = np.full(len(spots), np.inf)
    for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        along = end - start
        fraction = np.clip((spots - start) @ along / (along @ along), 0, 1)
        away = spots - start - fraction[:, None] * along
        clear = np.minimum(clear, np.einsum("ij,ij->i", away, away))
    return spots[clear > (CLEARANCE * spacing) ** 2]


def _delaunay(points: Points, outline: Points, spacing: float) -> NDArray[np.int64]:
    """Delaunay triangles inside the outline: triples of near points whose circumcircle is empty."""
    random = np.random.default_rng(0)  # a fixed seed: the same panel every time
    spots = points + random.uniform(-JITTER, JITTER, points.shape) * spacing
    near = _near(spots, REACH * spacing)
    found = []
    first, second = np.triu_indices(near.shape[1], 1)
    for ids in np.array_split(np.arange(len(spots)), 1 + len(spots) * len(first) // 500_000):
        j, k = near[ids][:, first].ravel(), near[ids][:, second].ravel()
        i = np.repeat(ids, len(first))
        keep = (j > i) & (k > i)  # padding is -1: each triple is seen once, from its lowest vertex
        i, j, k = i[keep], j[keep], k[keep]
        to_j, to_k = spots[j] - spots[i], spots[k] - spots[i]
        twice = 2 * (to_j[:, 0] * to_k[:, 1] - to_j[:, 1] * to_k[:, 0])
        square_j, square_k = _squared(to_j), _squared(to_k)
        with np.errstate(divide="ignore", invalid="ignore"):  # three points on a line have no circle: dropped
            centre = np.column_stack(
                [to_k[:, 1] * square_j - to_j[:, 1] * square_k, to_j[:, 0] * square_k - to_k[:, 0] * square_j]
            )
            centre /= twice[:, None]
            radius = _squared(centre)
            keep = radius < (REACH * spacing / 2) ** 2
        i, j, k, centre, radius, twice = (array[keep] for array in (i, j, k, centre, radius, twice))
        others = near[i]
        away = spots[others] - (spots[i] + centre)[:, None, :]
        blocked = (_squared(away) < radius[:, None]) & (others >= 0)
        blocked &= (others != j[:, None]) & (others != k[:, None])
        keep = ~blocked.any(axis=1)
        turned = (twice < 0)[keep, None]
        found.append(np.where(turned, np.column_stack([i, k, j])[keep], np.column_stack([i, j, k])[keep]))
    triangles = np.concatenate(found)
    triangles = triangles[contains(outline, points[triangles].mean(axis=1))]
    _check(triangles, len(points), len(outline))
    return triangles


def _squared(vectors: Points) -> Any:
    """Squared lengths of vectors, shape [..., 2]; ``sum`` along so short an axis takes several times as long."""
    return vectors[..., 0] ** 2 + vectors[..., 1] ** 2


def _near(points: Points, reach: float) -> NDArray[np.int64]:
    """Neighbours within reach of each point, padded with -1, shape [N, most]; found by cells of a grid."""
    cell = np.floor((points - points.min(axis=0)) / reach).astype(np.int64) + 1
    width = cell[:, 0].max() + 2
    key = cell[:, 1] * width + cell[:, 0]
    order = np.argsort(key, kind="stable")
    count = np.bincount(key, minlength=int(key.max() + width + 2))
    start = np.concatenate([[0], np.cumsum(count)])
    slots = np.arange(count.max())
    blocks = []
    for step in (-width - 1, -width, -width + 1, -1, 0, 1, width - 1, width, width + 1):
        begin, size = start[key + step], count[key + step]
        member = np.minimum(begin[:, None] + slots, len(points) - 1)
        blocks.append(np.where(slots < size[:, None], order[member], -1))
    candidates = np.hstack(blocks)
    away = points[candidates] - points[:, None, :]
    near = (_squared(away) < reach**2) & (candidates >= 0)
    near &= candidates != np.arange(len(points))[:, None]
    most = near.sum(axis=1).max()
    front = np.argsort(~near, axis=1, kind="stable")[:, :most]
    return np.where(np.take_along_axis(near, front, 1), np.take_along_axis(candidates, front, 1), -1)


def _check(triangles: NDArray[np.int64], point_count: int, outline_count: int) -> None:
    """Checks that the triangles form a disc with exactly the outline's edges as its boundary."""
    one, other = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    forward, backward = one * point_count + other, other * point_count + one
    rim = np.setdiff1d(forward, backward)
    step = np.arange(outline_count)
    wanted = step * point_count + (step + 1) % outline_count
    whole = len(triangles) == 2 * point_count - outline_count - 2  # Euler's formula for a disc
    if not whole or not np.array_equal(rim, np.sort(wanted)) or len(np.unique(forward)) < len(forward):
        raise InputError("panel", "its outline cannot be meshed", "choose a shorter edge")

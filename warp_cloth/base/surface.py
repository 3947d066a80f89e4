"""Meshes of implicit forms: surface nets on a grid, relaxed and projected onto the surface."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices, Points

Quads = NDArray[np.int64]
Values = NDArray[np.float64]


def surface_nets(values: NDArray[np.float64], origin: Points, spacing: float) -> tuple[Points, Quads]:
    """Vertices [m] and outward quads of the zero level of grid values, negative inside (Gibson 1998).

    One vertex for each cell that the surface crosses, at the mean of the crossings on the cell's edges; one quad
    for each grid edge that it crosses.
    """
    shape = np.array(values.shape)
    inside = values < 0
    sums = np.zeros((*(shape - 1), 3))
    counts = np.zeros(shape - 1, dtype=np.int64)
    crossings = []
    for axis in range(3):
        first = tuple(slice(None, -1) if a == axis else slice(None) for a in range(3))
        second = tuple(slice(1, None) if a == axis else slice(None) for a in range(3))
        edge = np.argwhere(inside[first] != inside[second])
        at = tuple(edge.T)
        start, end = values[first][at], values[second][at]
        spot = edge.astype(float)
        spot[:, axis] += start / (start - end)
        one, two = (axis + 1) % 3, (axis + 2) % 3
        cells = []
        for d1, d2 in ((-1, -1), (0, -1), (0, 0), (-1, 0)):  # the four cells around the edge
            cell = edge.copy()
            cell[:, one] += d1
            cell[:, two] += d2
            np.add.at(sums, tuple(cell.T), spot)
            np.add.at(counts, tuple(cell.T), 1)
            cells.append(np.ravel_multi_index(tuple(cell.T), tuple(shape - 1)))
        quads = np.column_stack(cells)
        leaves = inside[first][at]  # the edge leaves the body: its quad faces along the axis
        crossings.append(np.where(leaves[:, None], quads, quads[:, ::-1]))
    used = np.flatnonzero(counts)
    index = np.full(counts.size, -1)
    index[used] = np.arange(len(used))
    points = origin + spacing * sums.reshape(-1, 3)[used] / counts.reshape(-1)[used, None]
    return points, index[np.vstack(crossings)]


def without_saddles(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values whose sign is never the same at just two opposite corners of a grid square.

    There surface nets would join four quads along one edge: a ridge that runs along the grid's diagonal, as an arm
    in A-pose does, makes many. Of the outer corners the one nearer the surface is taken in; where the surface runs
    exactly is settled by projection afterwards.
    """
    values = values.copy()
    flat = values.reshape(-1)
    inward = -1e-6  # [m] in, but hardly
    strides = (values.shape[1] * values.shape[2], values.shape[2], 1)
    found = True
    while found:
        found = False
        for one, two in ((0, 1), (1, 2), (2, 0)):
            corner = tuple(slice(None, -1) if axis in (one, two) else slice(None) for axis in range(3))
            base = np.arange(flat.size).reshape(values.shape)[corner].ravel()
            a, c = base, base + strides[one] + strides[two]
            b, d = base + strides[one], base + strides[two]
            inside = flat < 0
            saddle = (inside[a] == inside[c]) & (inside[b] == inside[d]) & (inside[a] != inside[b])
            if saddle.any():
                found = True
                a, b, c, d = a[saddle], b[saddle], c[saddle], d[saddle]
                first, second = np.where(inside[a], b, a), np.where(inside[a], d, c)
                flat[np.where(flat[first] < flat[second], first, second)] = inward
    return values


def is_closed_manifold(quads: Quads, vertex_count: int) -> bool:
    """True where every edge joins two quads that agree in winding, and each vertex has one ring of quads."""
    one = quads.ravel()
    other = np.roll(quads, -1, axis=1).ravel()
    key, reverse = one * vertex_count + other, other * vertex_count + one
    order = np.argsort(key)
    if np.any(np.diff(key[order]) == 0) or not np.array_equal(key[order], np.sort(reverse)):
        return False
    corner = np.arange(len(one)).reshape(quads.shape)
    opposite = order[np.searchsorted(key[order], reverse)]  # corner that starts the same edge from its other end
    following = np.roll(corner, -1, axis=1).ravel()[opposite]  # next corner round the same vertex
    label = corner.ravel()
    for _ in range(5):  # doubling: 32 steps are more than any vertex has corners
        label = np.minimum(label, label[following])
        following = following[following]
    return len(np.unique(label)) == vertex_count


def relax(points: Points, quads: Quads, project: Callable[[Points], Points], rounds: int) -> Points:
    """Even out a quad mesh: each vertex half way to its neighbours' mean, then back onto the surface."""
    one = quads.ravel()
    other = np.roll(quads, -1, axis=1).ravel()
    degree = np.bincount(one, minlength=len(points))
    for _ in range(rounds):
        mean = np.column_stack(
            [np.bincount(one, weights=points[other, a], minlength=len(points)) / degree for a in range(3)]
        )
        points = project(0.5 * (points + mean))
    return points


def split_quads(points: Points, quads: Quads) -> Indices:
    """Two triangles for each quad, cut along the shorter diagonal."""
    corners = points[quads]
    length = np.linalg.norm(corners[:, [0, 1]] - corners[:, [2, 3]], axis=2)
    turned = np.where((length[:, 0] <= length[:, 1])[:, None], quads, np.roll(quads, -1, axis=1))
    return np.vstack([turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]]).astype(np.int32)


def grid_values(
    value: Callable[[Points], Values], low: Points, high: Points, spacing: float
) -> tuple[NDArray[np.float64], Points]:
    """Values on a grid that covers a box symmetric in x, and the grid's origin; only x >= 0 is evaluated."""
    half = np.arange(0.5, high[0] / spacing + 2) * spacing
    y = np.arange(low[1] - 2 * spacing, high[1] + 2 * spacing, spacing)
    z = np.arange(low[2] - 2 * spacing, high[2] + 2 * spacing, spacing)
    spots = np.stack(np.meshgrid(half, y, z, indexing="ij"), axis=-1)
    right = value(spots.reshape(-1, 3)).reshape(spots.shape[:3])
    return np.concatenate([right[::-1], right]), np.array([-half[-1], y[0], z[0]])

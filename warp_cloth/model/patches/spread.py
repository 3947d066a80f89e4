"""Graph embedding: coordinates of vertices from edge distances, so that sheets that touch lie far apart."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices, Points
from warp_cloth.base.stored_value import SMALLEST, stored
from warp_cloth.base.topology import ragged_rows
from warp_cloth.garment.rest import Floats

LANDMARKS = 8  # vertices from which edges are counted; more of them add little
AXES = 3  # principal axes of these counts
PACKAGES = ("model/patches", "base")  # whose code the axes depend on
SLIGHT = 1e-3  # weight of the loaded shape, which separates vertices that no edges connect


def spread_places(ends: Indices, points: Points) -> Floats:
    """Coordinates in which vertices with few edges between them are near, shape [V, AXES + 3].

    Edges are counted from landmarks as far apart as possible; principal axes of these counts are the coordinates.
    """
    places = _stored_axes(ends, len(points))
    shape = points - points.mean(axis=0)
    scale = SLIGHT * max(float(np.ptp(places, axis=0).max()), 1.0) / max(float(np.ptp(shape, axis=0).max()), 1e-30)
    return np.concatenate([places.astype(np.float64), shape * scale], axis=1)


def _stored_axes(ends: Indices, count: int) -> NDArray[np.float32]:
    """``_axes``, from the user's cache on disk where the same mesh has been cut before, in any shape."""
    if count < SMALLEST:
        return _axes(ends, count)
    return stored("axes", PACKAGES, partial(_axes, ends, count), ends, count)


def _axes(ends: Indices, count: int) -> NDArray[np.float32]:
    """Principal axes of the counts of edges, shape [V, AXES]."""
    neighbours = _Neighbours(ends, count)
    seed = int(neighbours.hops(0).argmax())
    counts = np.empty((LANDMARKS, count), dtype=np.float32)
    nearest = np.full(count, np.inf, dtype=np.float32)
    for row in counts:
        row[:] = neighbours.hops(seed)
        np.minimum(nearest, row, out=nearest)
        seed = int(nearest.argmax())
    counts -= counts.mean(axis=1, keepdims=True)
    _, axes = np.linalg.eigh(counts @ counts.T)
    return np.asarray(counts.T @ axes[:, -AXES:], dtype=np.float32)


class _Neighbours:
    """Adjacency of vertices."""

    def __init__(self, ends: Indices, vertex_count: int) -> None:
        self._start, order = ragged_rows(ends.ravel(), vertex_count)
        self._other = ends[:, ::-1].ravel()[order]
        self._found_by = np.empty(vertex_count, dtype=np.int64)

    def hops(self, vertex: int) -> NDArray[np.int32]:
        """Number of edges from a vertex to each other one; where unreachable, twice the largest number plus one."""
        hops = np.full(len(self._found_by), -1, dtype=np.int32)
        front, hop = np.array([vertex]), 0
        hops[front] = 0
        while len(front):
            first = self._start[front].astype(np.int64)
            count = self._start[front + 1] - first
            rank = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
            found = self._other[np.repeat(first, count) + rank]
            found = found[hops[found] < 0]
            self._found_by[found] = np.arange(len(found))  # of several that found the same vertex, the last
            front = found[self._found_by[found] == np.arange(len(found))]
            hop += 1
            hops[front] = hop
        hops[hops < 0] = 2 * hops.max() + 1
        return hops

"""Geodesic distances along the edges of a mesh, and level lines of a value that is known at its vertices."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices, Points

if TYPE_CHECKING:
    from warp_cloth.kernels.anatomy.heap import HeapState

Floats = NDArray[np.float64]
SHORTEST = 1e-9  # [m] of an edge


class EdgeGraph:
    """Edges with lengths, along which distances are measured, on the CPU.

    By a kernel, as a fit needs Warp anyway: distances have the bits of ``scipy.sparse.csgraph.dijkstra``, which takes
    as long, but whose import takes 0.14 s.
    """

    def __init__(self, edges: Indices, lengths: Floats, vertex_count: int) -> None:
        """``edges``: vertices, shape [E, 2]; ``lengths`` [m], shape [E]."""
        import warp as wp

        from warp_cloth.kernels.anatomy.geodesics import link_vertices

        self._count = vertex_count
        row = np.zeros(vertex_count + 1, dtype=np.int32)
        np.cumsum(np.bincount(edges.ravel(), minlength=vertex_count), out=row[1:])
        self._edges = wp.array(edges, dtype=wp.int32, device="cpu")
        neighbours, edge = (wp.empty(2 * len(edges), dtype=wp.int32, device="cpu") for _ in range(2))
        place = wp.array(row[:-1], dtype=wp.int32, device="cpu")
        wp.launch(link_vertices, 1, inputs=[self._edges, place], outputs=[neighbours, edge], device="cpu")
        length = wp.array(np.maximum(lengths, SHORTEST), dtype=wp.float64, device="cpu")
        self._graph = wp.array(row, dtype=wp.int32, device="cpu"), neighbours, edge, length

    def distances(self, sources: Indices | int) -> Floats:
        """Distance of every vertex from the nearest source [m], shape [V]; infinite where no edges lead."""
        import warp as wp

        from warp_cloth.kernels.anatomy.geodesics import measure_distances

        start = wp.array(np.atleast_1d(sources), dtype=wp.int32, device="cpu")
        heap = empty_heap(self._count)
        wp.launch(measure_distances, 1, inputs=[*self._graph, start, heap], device="cpu")
        return np.asarray(heap.distance.numpy(), dtype=np.float64)

    def parts(self) -> NDArray[np.int32]:
        """The lowest vertex of each vertex's connected part, shape [V]."""
        import warp as wp

        from warp_cloth.kernels.anatomy.geodesics import label_parts

        label = wp.array(np.arange(self._count), dtype=wp.int32, device="cpu")
        wp.launch(label_parts, 1, inputs=[self._edges, label], device="cpu")
        return np.asarray(label.numpy(), dtype=np.int32)


def empty_heap(count: int) -> HeapState:
    """A heap for numbers up to ``count``, all infinitely far."""
    import warp as wp

    from warp_cloth.kernels.anatomy.heap import NOWHERE, HeapState

    heap = HeapState()
    heap.distance = wp.full(count, np.inf, dtype=wp.float64, device="cpu")
    heap.heap, heap.place = (wp.full(count, NOWHERE, dtype=int, device="cpu") for _ in range(2))
    return heap


def row_lengths(vectors: Points) -> Floats:
    """Length of each row, shape [N, 3]: as ``numpy.linalg.norm``, in a third of its time; shape [N]."""
    x, y, z = vectors.T
    return np.asarray(np.sqrt(x * x + y * y + z * z), dtype=np.float64)


def nearest_points(points: Points, queries: Points) -> NDArray[np.int64]:
    """The number of the point, shape [V, 3], that is nearest to each query, shape [Q, 3]; shape [Q]."""
    import warp as wp

    from warp_cloth.kernels.anatomy.geodesics import find_nearest

    axis = int(np.argmax(np.ptp(points, axis=0)))
    order = np.argsort(points[:, axis], kind="stable")
    start = np.searchsorted(points[order, axis], queries[:, axis])
    inputs = [
        wp.array(points[order], dtype=wp.vec3d, device="cpu"), axis,
        wp.array(queries, dtype=wp.vec3d, device="cpu"), wp.array(start, dtype=wp.int32, device="cpu"),
    ]  # fmt: skip
    found = wp.empty(len(queries), dtype=wp.int32, device="cpu")
    wp.launch(find_nearest, len(queries), inputs=inputs, outputs=[found], device="cpu")
    return np.asarray(order[found.numpy()], dtype=np.int64)


@dataclass(frozen=True, eq=False)
class LevelLines:
    """The segments in which triangles meet given levels of a value."""

    level: NDArray[np.int64]  # number of the level of each segment, shape [S]
    start: Points  # its ends [m], shape [S, 3]
    end: Points
    count: int  # of levels

    def girths(self) -> Floats:
        """Length of each level's line [m], shape [levels]."""
        girths = np.bincount(self.level, row_lengths(self.end - self.start), self.count)
        return np.asarray(girths, dtype=np.float64)

    def centres(self) -> Points:
        """Middle of each level's line, weighted by length [m], shape [levels, 3]."""
        length = row_lengths(self.end - self.start)
        middle = 0.5 * (self.start + self.end)
        sums = [np.bincount(self.level, length * middle[:, axis], self.count) for axis in range(3)]
        return np.stack(sums, axis=1) / np.maximum(self.girths(), 1e-12)[:, None]

    def ring(self, level: int) -> tuple[Points, Points]:
        """The segments of one level: their ends."""
        own = self.level == level
        return self.start[own], self.end[own]


def level_lines(points: Points, triangles: Indices, values: Floats, levels: Floats) -> LevelLines:
    """Level lines of ``values``, shape [V], at ascending ``levels``; triangles with infinite values have none."""
    a, b, c = (values[triangles[:, corner]] for corner in range(3))
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    # few triangles meet a level, where levels end far from most
    near = np.flatnonzero((high > levels[:1].min(initial=np.inf)) & (low <= levels[-1:].max(initial=-np.inf)))
    near = near[np.isfinite(high[near]) & np.isfinite(low[near])]
    first, last = np.searchsorted(levels, low[near], "right"), np.searchsorted(levels, high[near], "left")
    count = np.maximum(last - first, 0)
    triangle = np.repeat(near, count)
    level = np.arange(len(triangle)) - np.repeat(np.cumsum(count) - count, count) + np.repeat(first, count)
    corners = triangles[triangle]
    value = values[corners]
    above = value > levels[level][:, None]
    # the corner that lies alone on its side of the level: the line leaves through both of its edges
    is_above = above[:, 0].astype(np.int8) + above[:, 1] + above[:, 2] == 1
    alone = above == is_above[:, None]
    lone = np.where(alone[:, 0], 0, np.where(alone[:, 1], 1, 2))
    row = np.arange(len(triangle))
    here, at = value[row, lone], points[corners[row, lone]]

    def towards(step: int) -> Points:
        other = (lone + step) % 3
        there = value[row, other]
        fraction = ((levels[level] - here) / (there - here))[:, None]
        return at * (1.0 - fraction) + points[corners[row, other]] * fraction

    return LevelLines(level, towards(1), towards(2), len(levels))

"""Geodesic distances along the edges of a mesh, and level lines of a value that is known at its vertices."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices, Points

Floats = NDArray[np.float64]


class EdgeGraph:
    """Edges with lengths, along which distances are measured."""

    def __init__(self, edges: Indices, lengths: Floats, vertex_count: int) -> None:
        """``edges``: vertices, shape [E, 2]; ``lengths`` [m], shape [E]."""
        from scipy.sparse import coo_matrix  # takes 0.2 s: imported where limbs are looked for

        positive = np.maximum(lengths, 1e-9)  # a stored 0 is no edge to SciPy
        shape = (vertex_count, vertex_count)
        self._matrix: Any = coo_matrix((positive, (edges[:, 0], edges[:, 1])), shape=shape).tocsr()

    def distances(self, sources: Indices | int) -> Floats:
        """Distance of every vertex from the nearest source [m], shape [V]; infinite where no edges lead."""
        from scipy.sparse.csgraph import dijkstra

        found = dijkstra(self._matrix, directed=False, indices=np.atleast_1d(sources), min_only=True)
        return np.asarray(found, dtype=np.float64)


@dataclass(frozen=True, eq=False)
class LevelLines:
    """The segments in which triangles meet given levels of a value."""

    level: NDArray[np.int64]  # number of the level of each segment, shape [S]
    start: Points  # its ends [m], shape [S, 3]
    end: Points
    count: int  # of levels

    def girths(self) -> Floats:
        """Length of each level's line [m], shape [levels]."""
        girths = np.bincount(self.level, np.linalg.norm(self.end - self.start, axis=1), self.count)
        return np.asarray(girths, dtype=np.float64)

    def centres(self) -> Points:
        """Middle of each level's line, weighted by length [m], shape [levels, 3]."""
        length = np.linalg.norm(self.end - self.start, axis=1)
        middle = 0.5 * (self.start + self.end)
        sums = [np.bincount(self.level, length * middle[:, axis], self.count) for axis in range(3)]
        return np.stack(sums, axis=1) / np.maximum(self.girths(), 1e-12)[:, None]

    def ring(self, level: int) -> tuple[Points, Points]:
        """The segments of one level: their ends."""
        own = self.level == level
        return self.start[own], self.end[own]


def level_lines(points: Points, triangles: Indices, values: Floats, levels: Floats) -> LevelLines:
    """Level lines of ``values``, shape [V], at ascending ``levels``; triangles with infinite values have none."""
    of_corners = values[triangles]
    finite = np.isfinite(of_corners).all(axis=1)
    low = np.where(finite, of_corners.min(axis=1), np.inf)
    high = np.where(finite, of_corners.max(axis=1), -np.inf)
    first, last = np.searchsorted(levels, low, "right"), np.searchsorted(levels, high, "left")
    count = np.maximum(last - first, 0)
    triangle = np.repeat(np.arange(len(triangles)), count)
    level = np.arange(len(triangle)) - np.repeat(np.cumsum(count) - count, count) + np.repeat(first, count)
    value = of_corners[triangle]
    above = value > levels[level][:, None]
    # the corner that lies alone on its side of the level: the line leaves through both of its edges
    lone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), above.argmin(axis=1))
    row = np.arange(len(triangle))

    def towards(step: int) -> Points:
        other = (lone + step) % 3
        here, there = value[row, lone], value[row, other]
        fraction = ((levels[level] - here) / (there - here))[:, None]
        corners = triangles[triangle]
        return points[corners[row, lone]] * (1.0 - fraction) + points[corners[row, other]] * fraction

    return LevelLines(level, towards(1), towards(2), len(levels))

"""Pieces of cloth that fall free: nothing is below them that could catch them, and they would never rest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.connected import connected_components
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.base.threads import concatenate
from warp_cloth.garment.garment import Garment

CAUGHT = 0.02  # [m]; what comes so near to a body beside it may be caught
REGION = 4.0  # [m] beyond the middle of the plan; what is farther counts as there
SEWN = 1.5  # length of an edge over its rest length, from which a seam is open, and may pull the piece elsewhere


class Catcher:
    """What can catch the cloth of some garments: a body, and other pieces of cloth.

    A piece is what edges connect. Cells of a plan catch a piece, if anything of the body, or of other pieces, in them
    or next to them is below its highest point there; a large triangle of the body counts in all cells of its box. A
    pinned piece does not fall, nor is one told to whose seams are still open.
    """

    def __init__(self, garments: Sequence[Garment], body: Mesh | None) -> None:
        """Prepares what does not change while cloth moves: pieces, and where the body is.

        Args:
            garments: in their order.
            body: the avatar; None: there is none.
        """
        starts = np.cumsum([0, *(len(garment.points) for garment in garments)]).tolist()
        self._edges = concatenate([garment.rest.topology.edges for garment in garments], starts)
        self._lengths = np.concatenate([garment.rest.edge_length for garment in garments])
        self._piece = connected_components(starts[-1], *self._edges.T)
        self._pieces = np.unique(self._piece)
        self._pinned = concatenate([garment.pins for garment in garments], starts)
        self._cell = CAUGHT + float(self._lengths.max(initial=0.0))
        around = np.concatenate([garment.points for garment in garments]) if body is None else body.points
        plan = around[:, [0, 2]]
        self._middle = np.median(plan, axis=0)
        corner = np.maximum(plan.min(axis=0), self._middle - REGION)  # of what is there; cells begin at it
        self._origin = corner - self._cell * np.ceil((corner - self._middle + REGION) / self._cell)
        size = int(2.0 * REGION / self._cell) + 5
        self._body = np.full((size, size), np.inf)  # the lowest of it in every cell [m]
        if body is not None:
            self._add_body(body)
        self._near_body = _around(self._body).reshape(-1)

    def falling(self, points: Points) -> NDArray[np.bool_]:
        """Which vertices are of pieces that nothing can catch, where they are now [m], y up and finite; shape [V]."""
        where = np.ravel_multi_index((*self._columns(points).T,), self._body.shape)
        held = np.zeros(len(points), dtype=np.bool_)
        held[self._piece[self._pinned]] = True
        a, b = self._edges.T
        is_open = np.linalg.norm(points[a] - points[b], axis=1) > SEWN * self._lengths
        held[self._piece[a[is_open]]] = True
        falls = np.zeros(len(points), dtype=np.bool_)
        for number in self._pieces[~held[self._pieces]]:
            mine = self._piece == number
            near = self._near_body
            if not mine.all():
                below = self._body.copy()
                np.minimum.at(below.reshape(-1), where[~mine], points[~mine, 1])
                near = _around(below).reshape(-1)
            falls |= mine & ~(near[where[mine]] < points[mine, 1] + CAUGHT).any()
        return falls

    def _columns(self, points: Points) -> NDArray[np.int64]:
        """The cell of the plan that each point is in, shape [N, 2]."""
        plan = np.clip(points[:, [0, 2]], self._middle - REGION, self._middle + REGION)
        return np.floor((plan - self._origin) / self._cell).astype(np.int64) + 1

    def _add_body(self, body: Mesh) -> None:
        columns = self._columns(body.points)
        np.minimum.at(self._body, (*columns.T,), body.points[:, 1])
        corners, lowest = columns[body.triangles], body.points[body.triangles, 1].min(axis=1)
        first, last = corners.min(axis=1), corners.max(axis=1) + 1
        for k in np.flatnonzero((last - first > 2).any(axis=1)).tolist():  # no corner of it may be in a cell between
            own = self._body[first[k, 0] : last[k, 0], first[k, 1] : last[k, 1]]
            np.minimum(own, lowest[k], out=own)


def _around(lowest: Points) -> Points:
    """The least of each cell and the eight next to it."""
    for axis in (0, 1):
        wide = np.pad(lowest, [(1, 1) if axis == each else (0, 0) for each in (0, 1)], constant_values=np.inf)
        parts = (np.take(wide, range(k, k + lowest.shape[axis]), axis=axis) for k in range(3))
        lowest = np.minimum.reduce([*parts])
    return lowest

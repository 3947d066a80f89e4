"""Pieces of cloth that fall free: nothing is below them that could catch them, and they would never rest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.connected import connected_components
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.garment.garment import Garment

CAUGHT = 0.02  # [m]; what comes so near to a body beside it may be caught
REGION = 4.0  # [m] beyond the middle of the plan; what is farther counts as there
SEWN = 1.5  # length of an edge over its rest length, from which a seam is open, and may pull the piece elsewhere


def falling(garments: Sequence[Garment], points: Points, body: Mesh | None) -> NDArray[np.bool_]:
    """Which vertices are of pieces that nothing can catch, y up, shape [V].

    A piece is what edges connect. Cells of a plan catch a piece, if anything of the body, or of other pieces, in them
    or next to them is below its highest point there; a large triangle of the body counts in all cells of its box. A
    pinned piece does not fall, nor is one told to whose seams are still open.

    Args:
        garments: in their order.
        points: of their vertices now [m], all finite, shape [V, 3].
        body: the avatar; None: there is none.
    """
    piece, held, longest = _pieces(garments, points)
    cell = CAUGHT + longest
    plan = points[:, [0, 2]] if body is None else np.concatenate([points[:, [0, 2]], body.points[:, [0, 2]]])
    middle = np.median(plan, axis=0)
    plan = np.clip(plan, middle - REGION, middle + REGION)
    columns = np.floor((plan - plan.min(axis=0)) / cell).astype(np.int64) + 1
    shape = tuple(columns.max(axis=0) + 2)
    where = np.ravel_multi_index((columns[:, 0], columns[:, 1]), shape)
    cloth = where[: len(points)]
    under = np.full(shape, np.inf)
    if body is not None:
        np.minimum.at(under.reshape(-1), where[len(points) :], body.points[:, 1])
        corners, lowest = columns[len(points) :][body.triangles], body.points[body.triangles, 1].min(axis=1)
        first, last = corners.min(axis=1), corners.max(axis=1) + 1
        for k in np.flatnonzero((last - first > 2).any(axis=1)).tolist():  # no corner of it may be in a cell between
            own = under[first[k, 0] : last[k, 0], first[k, 1] : last[k, 1]]
            np.minimum(own, lowest[k], out=own)
    falls = np.zeros(len(points), dtype=np.bool_)
    for number in np.unique(piece[~held]):
        mine = piece == number
        below = under.copy()
        np.minimum.at(below.reshape(-1), cloth[~mine], points[~mine, 1])
        falls |= mine & ~(_around(below).reshape(-1)[cloth[mine]] < points[mine, 1] + CAUGHT).any()
    return falls


def _pieces(garments: Sequence[Garment], points: Points) -> tuple[NDArray[np.int64], NDArray[np.bool_], float]:
    """The piece of each vertex, whether it is pinned or its seams are open, shape [V]; the longest edge at rest [m]."""
    pieces, held, longest, first = [], [], 0.0, 0
    for garment in garments:
        count, (a, b) = len(garment.points), garment.rest.topology.edges.T
        own = points[first : first + count]
        number = connected_components(count, a, b)
        is_open = np.linalg.norm(own[a] - own[b], axis=1) > SEWN * garment.rest.edge_length
        holds = np.zeros(count, dtype=np.bool_)
        holds[number[a[is_open]]] = True
        holds[number[garment.pins]] = True
        pieces.append(number + first)
        held.append(holds[number])
        longest = max(longest, float(garment.rest.edge_length.max(initial=0.0)))
        first += count
    return np.concatenate(pieces), np.concatenate(held), longest


def _around(lowest: Points) -> Points:
    """The least of each cell and the eight next to it."""
    for axis in (0, 1):
        wide = np.pad(lowest, [(1, 1) if axis == each else (0, 0) for each in (0, 1)], constant_values=np.inf)
        parts = (np.take(wide, range(k, k + lowest.shape[axis]), axis=axis) for k in range(3))
        lowest = np.minimum.reduce([*parts])
    return lowest

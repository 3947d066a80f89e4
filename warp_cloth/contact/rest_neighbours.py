"""Rest neighbours: vertices so near in the rest shape that their cloth is within a thickness without being folded."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices
from warp_cloth.base.topology import ragged_rows
from warp_cloth.garment.rest import Floats, RestShape
from warp_cloth.garment.triangles import triangle_areas


def rest_near_rows(
    triangles: Indices, rest: RestShape, vertex_count: int, distance: float
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Rows of the vertices near each vertex, itself among them: starts, shape [V + 1], and vertices.

    Near means within ``distance`` [m] along edges, or across a triangle whose height is less than that.
    """
    itself = np.arange(vertex_count)
    pairs = np.stack([itself, itself], axis=1)
    pairs = np.concatenate([pairs, _within(rest, vertex_count, distance), _across(triangles, rest, distance)])
    first, second = np.concatenate([pairs, pairs[:, ::-1]]).T
    first, second = np.divmod(np.unique(first * vertex_count + second), vertex_count)
    starts = np.zeros(vertex_count + 1, dtype=np.int32)
    np.cumsum(np.bincount(first, minlength=vertex_count), out=starts[1:])
    return starts, second.astype(np.int32)


def _within(rest: RestShape, vertex_count: int, distance: float) -> NDArray[np.int64]:
    """Pairs of vertices whose shortest path along edges is at most ``distance`` [m] (a search by edge counts)."""
    short = rest.edge_length <= distance
    ends = rest.topology.edges[short].astype(np.int64)
    edge_length = np.concatenate([rest.edge_length[short]] * 2)
    origin, target = np.concatenate([ends, ends[:, ::-1]]).T
    start, order = ragged_rows(origin, vertex_count)
    found = np.zeros((0, 2), dtype=np.int64)
    pairs, length = np.stack([origin, target], axis=1), edge_length
    while len(pairs):
        found = np.concatenate([found, pairs])
        reached = pairs[:, 0] * vertex_count + pairs[:, 1]
        # extend each path by one edge
        last = pairs[:, 1]
        count = (start[1:] - start[:-1])[last]
        row = np.repeat(np.arange(len(pairs)), count)
        within = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
        edge = order[start[last[row]] + within]
        total = length[row] + edge_length[edge]
        step = np.stack([pairs[row, 0], target[edge]], axis=1)
        key = step[:, 0] * vertex_count + step[:, 1]
        known = np.isin(key, np.concatenate([found[:, 0] * vertex_count + found[:, 1], reached]))
        fresh = (total <= distance) & ~known & (step[:, 0] != step[:, 1])
        order_by = np.lexsort((total[fresh], key[fresh]))
        step, total, key = step[fresh][order_by], total[fresh][order_by], key[fresh][order_by]
        first = np.concatenate([[True], key[1:] != key[:-1]]) if len(key) else np.zeros(0, dtype=bool)
        pairs, length = step[first], total[first]
    return found


def _across(triangles: Indices, rest: RestShape, distance: float) -> NDArray[np.int64]:
    """Each corner whose height is below ``distance`` [m], with the ends of the opposite side and the wing beyond."""
    topology = rest.topology
    sides: Floats = rest.edge_length[topology.triangle_edges]
    height = 2.0 * triangle_areas(sides)[:, None] / sides  # over the sides (0,1), (1,2), (2,0)
    triangle, side = np.nonzero(height < distance)
    corner = triangles[triangle, (side + 2) % 3]
    pairs = [np.stack([corner, triangles[triangle, end]], axis=1) for end in (side, (side + 1) % 3)]
    hinge_of_edge = np.full(len(topology.edges), -1)
    hinge_of_edge[topology.hinge_edges] = np.arange(len(topology.hinges))
    hinge = hinge_of_edge[topology.triangle_edges[triangle, side]]
    inner = hinge >= 0
    pairs.append(topology.hinges[hinge[inner], 2:4])
    return np.concatenate(pairs).astype(np.int64)

"""Crossing count: where garments pass through themselves and each other, as every report states."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from warp_cloth.base.mesh import Indices, Points
from warp_cloth.kernels.contact import crossing as kernels

FIRST_CAPACITY = 1024  # crossings; if there are more, the search runs again with enough capacity
TREE_BYTES = 72  # of a wp.Bvh for each of its boxes


@dataclass(frozen=True, eq=False)
class Sheets:
    """The triangles and edges of several garments over one array of vertices."""

    triangles: Indices  # shape [F, 3]
    edges: Indices  # shape [E, 2]
    triangle_edges: Indices  # edges of each triangle, shape [F, 3]
    garment: Indices  # garment of each triangle, shape [F]
    vertex_start: tuple[int, ...]  # first vertex of each garment, and the vertex count

    @property
    def vertex_count(self) -> int:
        return self.vertex_start[-1]


@dataclass(frozen=True, eq=False)
class Crossings:
    """Edges that pass through triangles, in order, and the pairs of triangles that cross by them."""

    pierced: Indices  # edge and triangle, shape [N, 2]
    pairs: Indices  # triangles, the lower first, shape [M, 2]

    @property
    def faces(self) -> Indices:
        """Every triangle that crosses another, in order."""
        return np.unique(self.pairs)


def find_crossings(points: Points, sheets: Sheets, device: wp.DeviceLike = None) -> Crossings:
    """Finds edges that pass through triangles, in float64.

    Triangles with a common vertex cross where the side opposite to it in one passes through the other.

    Args:
        points: vertices [m], shape [V, 3].
        sheets: their triangles and edges.
        device: that searches.
    """
    if not np.isfinite(points).all():
        none = np.zeros((0, 2), dtype=np.int32)
        return Crossings(none, none)
    with wp.ScopedDevice(device):
        position = wp.array(np.ascontiguousarray(points), dtype=wp.vec3d)
        triangles, edges = wp.array(sheets.triangles, dtype=wp.vec3i), wp.array(sheets.edges, dtype=wp.vec2i)
        item = wp.zeros(len(points), dtype=wp.int32)  # all of one
    pierced = find_pierced(position, triangles, edges, item)
    return Crossings(pierced, triangle_pairs(pierced, sheets))


def find_pierced(position: wp.array, triangles: wp.array, edges: wp.array, item: wp.array) -> Indices:
    """Edges and the triangles that they pass through, in order, shape [N, 2].

    Args:
        position: vertices on a device [m], all finite, wp.vec3d.
        triangles: their corners, wp.vec3i.
        edges: their ends, wp.vec2i.
        item: of each vertex; those of different items do not collide.
    """
    with wp.ScopedDevice(position.device):
        lower, upper = (wp.empty(len(triangles), dtype=wp.vec3f) for _ in range(2))
        group = wp.empty(len(triangles), dtype=wp.int32)
        boxes = [lower, upper, group]
        wp.launch(kernels.box_triangles, dim=len(triangles), inputs=[position, triangles, item], outputs=boxes)
        tree = wp.Bvh(lower, upper, groups=group)
        inputs = [tree.id, position, edges, triangles, item]
        capacity = FIRST_CAPACITY
        while True:
            count, crossing = wp.zeros(1, dtype=wp.int32), wp.empty(capacity, dtype=wp.vec2i)
            wp.launch(kernels.find_crossings, dim=len(edges), inputs=inputs, outputs=[count, crossing])
            found = int(count.numpy()[0])
            if found <= capacity:
                break
            capacity = found
        pierced = crossing.numpy().reshape(-1, 2)[:found]
    return pierced[np.lexsort((pierced[:, 1], pierced[:, 0]))]


def search_bytes(vertex_count: int, edge_count: int, triangle_count: int) -> int:
    """Device memory of ``find_crossings``, without the few pairs that it finds [bytes]."""
    vertex, edge, triangle, box = (wp.types.type_size_in_bytes(k) for k in (wp.vec3d, wp.vec2i, wp.vec3i, wp.vec3f))
    item = wp.types.type_size_in_bytes(wp.int32)
    own = (vertex + item) * vertex_count + edge * edge_count
    return own + (triangle + 2 * box + item + TREE_BYTES) * triangle_count


def triangle_pairs(pierced: Indices, sheets: Sheets) -> Indices:
    """The triangles at each edge, each with the triangle that the edge passes through; every pair once."""
    if not len(pierced):
        return np.zeros((0, 2), dtype=np.int32)
    sides = sheets.triangle_edges.ravel()
    crosses = np.zeros(len(sheets.edges), dtype=bool)
    crosses[pierced[:, 0]] = True
    crossing = np.flatnonzero(crosses[sides])
    order = crossing[np.argsort(sides[crossing], kind="stable")]
    first = np.searchsorted(sides[order], pierced[:, 0], side="left")
    last = np.searchsorted(sides[order], pierced[:, 0], side="right")
    row = np.repeat(np.arange(len(pierced)), last - first)
    within = np.arange(len(row)) - np.repeat(np.cumsum(last - first) - (last - first), last - first)
    adjacent = order[first[row] + within] // 3
    pairs = np.sort(np.stack([adjacent, pierced[row, 1]], axis=1), axis=1)
    return np.unique(pairs, axis=0).astype(np.int32)

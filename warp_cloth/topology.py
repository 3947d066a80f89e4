"""Edges and hinges of a triangle mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_cloth.mesh import Indices


@dataclass(frozen=True, eq=False)
class Topology:
    """Edges, which triangles they bound, and hinges (inner edges with their two wings)."""

    edges: Indices  # vertex ids, lower first, sorted, shape [E, 2]
    triangle_edges: Indices  # edges of the sides (0,1), (1,2), (2,0), shape [F, 3]
    hinge_edges: Indices  # edge of each hinge, shape [H]
    hinge_triangles: Indices  # its two triangles, shape [H, 2]
    hinges: Indices  # axis start, axis end, wing of the first and of the second triangle, shape [H, 4]


def build_topology(triangles: Indices, vertex_count: int) -> Topology:
    """Edges and hinges of a mesh whose edges have one or two triangles each."""
    corners = np.asarray(triangles, dtype=np.int64)
    starts = corners.ravel()
    ends = np.roll(corners, -1, axis=1).ravel()
    keys = np.minimum(starts, ends) * vertex_count + np.maximum(starts, ends)
    unique, edge_of_side = np.unique(keys, return_inverse=True)
    edges = np.stack([unique // vertex_count, unique % vertex_count], axis=1)
    sides = np.argsort(edge_of_side, kind="stable")  # sides grouped by edge
    count = np.bincount(edge_of_side, minlength=len(unique))
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    inner = np.flatnonzero(count == 2)
    pair = np.stack([sides[first[inner]], sides[first[inner] + 1]], axis=1)  # the two sides of each inner edge
    wings = corners[pair // 3, (pair % 3 + 2) % 3]
    # the axis runs as in its first triangle, so that flat, consistently wound cloth has equal normals
    axis = np.stack([starts[pair[:, 0]], ends[pair[:, 0]]], axis=1)
    return Topology(
        edges=edges.astype(np.int32),
        triangle_edges=edge_of_side.reshape(-1, 3).astype(np.int32),
        hinge_edges=inner.astype(np.int32),
        hinge_triangles=(pair // 3).astype(np.int32),
        hinges=np.concatenate([axis, wings], axis=1).astype(np.int32),
    )


def ragged_rows(owner: NDArray[np.integer], row_count: int) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Row starts, shape [row_count + 1], and the order that sorts entries by owner, ties as they stood."""
    starts = np.zeros(row_count + 1, dtype=np.int32)
    np.cumsum(np.bincount(owner, minlength=row_count), out=starts[1:])
    return starts, np.argsort(owner, kind="stable")

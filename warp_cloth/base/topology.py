"""Edges and hinges of a triangle mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices
from warp_cloth.base.threads import map_in_threads

SHARED_BITS = 16
SHARE = 1 << 15  # keys that fit a processor's caches


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
    sides = stable_order(keys)  # grouped by edge
    ordered = keys[sides]
    new = np.append(True, ordered[1:] != ordered[:-1])[: len(ordered)]
    unique, edge_of_side = ordered[new], np.empty_like(keys)
    edge_of_side[sides] = np.cumsum(new) - 1
    edges = np.stack([unique // vertex_count, unique % vertex_count], axis=1)
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
    return starts, stable_order(owner)


def stable_order(keys: NDArray[np.integer]) -> NDArray[np.int64]:
    """The order that sorts keys of 0 and more, ties as they stood: numpy.argsort, but linear in their number.

    Keys of two bytes NumPy counts rather than compares. So larger ones are shared out by their upper bits first.
    """
    bits = int(keys.max(initial=0)).bit_length()
    shift = max(bits - SHARED_BITS, bits - (len(keys) // SHARE).bit_length(), 0)
    if len(keys) <= SHARE or shift == 0:
        return np.argsort(_narrow(keys, bits), kind="stable")
    shares = (keys >> shift).astype(np.uint16)
    order = np.argsort(shares, kind="stable")
    ends = np.cumsum(np.bincount(shares))

    def sort(part: slice) -> None:
        own = order[part]
        order[part] = own[np.argsort(_narrow(keys[own] & ((1 << shift) - 1), shift), kind="stable")]

    starts = np.append(0, ends[:-1])
    map_in_threads(sort, [slice(*span) for span in zip(starts[starts < ends], ends[starts < ends], strict=True)])
    return order


def _narrow(keys: NDArray[np.integer], bits: int) -> NDArray[np.integer]:
    return keys.astype(np.uint16) if bits <= SHARED_BITS else keys


def sorted_keys(keys: NDArray[Any]) -> NDArray[Any]:
    """The different keys, in order (numpy.unique hashes them, which takes ten times as long where most differ)."""
    ordered = np.sort(keys)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])[: len(ordered)]]

"""Edges and hinges of a triangle mesh, and sorts of integer keys in linear time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.layers import sheet_rims
from warp_cloth.base.mesh import Indices
from warp_cloth.base.threads import map_in_threads

COUNTED_BITS = 16
GROUP = 1 << 15  # keys that fit a processor's caches


@dataclass(frozen=True, eq=False)
class Topology:
    """Edges of a mesh, its triangles' edges, and its hinges: inner edges with their two wings."""

    edges: Indices  # vertices, lower first, sorted, shape [E, 2]
    triangle_edges: Indices  # edges of the sides (0,1), (1,2), (2,0), shape [F, 3]
    hinge_edges: Indices  # edge of each hinge, shape [H]
    hinge_triangles: Indices  # its two triangles, shape [H, 2]
    hinges: Indices  # axis start, axis end, wing of the first and of the second triangle, shape [H, 4]
    rims: tuple[NDArray[np.int64], ...] | None = (
        None  # edges with one triangle, by sheet, where more than two meet at others
    )

    @cached_property
    def boundary_loops(self) -> tuple[Indices, ...]:
        """Vertices along each closed line of edges with a single triangle, the longest loop first.

        With ``rims``, of those alone: what ends at a seam of layers is no rim.
        """
        if self.rims is None:
            alone = np.bincount(self.triangle_edges.ravel(), minlength=len(self.edges)) == 1
            return self._loops([self.edges[alone]])
        return self._loops([self.edges[rim] for rim in self.rims])

    @staticmethod
    def _loops(borders: Sequence[Indices]) -> tuple[Indices, ...]:
        loops = [loop for border in borders for loop in _walked(border)]
        return tuple(sorted((loop for loop in loops if len(loop) > 2), key=len, reverse=True))


def _walked(border: Indices) -> list[Indices]:
    """The vertices along each closed line of edges, shape [N] each."""
    following: dict[int, list[int]] = {}
    for a, b in border.tolist():
        following.setdefault(a, []).append(b)
        following.setdefault(b, []).append(a)
    loops = []
    while following:
        loop = [next(iter(following))]
        while following.get(loop[-1]):
            here = loop[-1]
            there = following[here].pop()
            following[there].remove(here)
            loop.append(there)
        for vertex in loop:
            if not following.get(vertex, True):
                del following[vertex]
        loops.append(np.array(loop[:-1] or loop, dtype=np.int32))
    return loops


def build_topology(triangles: Indices, vertex_count: int) -> Topology:
    """Edges and hinges of triangles, shape [F, 3]; where more than two meet at an edge, it has no hinge."""
    corners = np.asarray(triangles, dtype=np.int64)
    starts = corners.ravel()
    ends = np.roll(corners, -1, axis=1).ravel()
    keys = np.minimum(starts, ends) * vertex_count + np.maximum(starts, ends)
    sides = stable_argsort(keys)  # grouped by edge
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
        rims=sheet_rims(corners, edge_of_side, len(unique)) if (count > 2).any() else None,
    )


def mesh_edges(triangles: Indices, vertex_count: int) -> Indices:
    """The edges of triangles, shape [F, 3], as in a Topology: vertices, lower first, sorted, shape [E, 2]."""
    a, b, c = triangles.T.astype(np.int64)
    sides = [np.minimum(p, q) * vertex_count + np.maximum(p, q) for p, q in ((a, b), (b, c), (c, a))]
    unique = sorted_unique(np.concatenate(sides))
    return np.stack([unique // vertex_count, unique % vertex_count], axis=1).astype(np.int32)


def triangles_across(triangles: Indices, of_one: NDArray[np.bool_]) -> Indices:
    """The triangles between the vertices of one part of a mesh, a flag of each vertex, and the others, shape [N, 3]."""
    sides = of_one[triangles]
    return triangles[sides.any(axis=1) & ~sides.all(axis=1)]


def ragged_rows(owner: NDArray[np.integer], row_count: int) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """CSR rows of entries by owner: row starts, shape [row_count + 1], and the stable order of the entries."""
    starts = np.zeros(row_count + 1, dtype=np.int32)
    np.cumsum(np.bincount(owner, minlength=row_count), out=starts[1:])
    return starts, stable_argsort(owner)


def stable_argsort(keys: NDArray[np.integer]) -> NDArray[np.int64]:
    """``numpy.argsort(keys, kind="stable")`` of integers from 0, in time linear in their number.

    NumPy sorts keys of two bytes by counting. So larger keys are first divided into groups by their upper bits.
    """
    bits = int(keys.max(initial=0)).bit_length()
    shift = max(bits - COUNTED_BITS, bits - (len(keys) // GROUP).bit_length(), 0)
    if len(keys) <= GROUP or shift == 0:
        return np.argsort(_narrow(keys, bits), kind="stable")
    groups = (keys >> shift).astype(np.uint16)
    order = np.argsort(groups, kind="stable")
    ends = np.cumsum(np.bincount(groups))

    def sort(group: slice) -> None:
        own = order[group]
        order[group] = own[np.argsort(_narrow(keys[own] & ((1 << shift) - 1), shift), kind="stable")]

    starts = np.append(0, ends[:-1])
    map_in_threads(sort, [slice(*span) for span in zip(starts[starts < ends], ends[starts < ends], strict=True)])
    return order


def _narrow(keys: NDArray[np.integer], bits: int) -> NDArray[np.integer]:
    return keys.astype(np.uint16) if bits <= COUNTED_BITS else keys


def sorted_unique(keys: NDArray[Any]) -> NDArray[Any]:
    """``numpy.unique(keys)`` by sorting: NumPy hashes, which takes ten times as long where most keys differ."""
    ordered = np.sort(keys)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])[: len(ordered)]]


def used_ids(ids: NDArray[Any], count: int) -> NDArray[np.int64]:
    """The unique ids, all below ``count``, in order."""
    used = np.zeros(count, dtype=np.bool_)
    used[ids] = True
    return np.flatnonzero(used)

"""Vertices, edges and triangles of each patch and their local numbers within it, on the host."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices
from warp_cloth.base.topology import ragged_rows, sorted_unique
from warp_cloth.kernels.base.options import RANKS

Keys = NDArray[np.int64]
Numbers = NDArray[np.integer[Any]]  # of elements, of either width


class Members:
    """Elements of one kind in every patch, and their local numbers: indices within the patch."""

    def __init__(self, patch: Keys, element: Numbers, total: int, patch_count: int) -> None:
        self._total = total
        self._keys = sorted_unique(patch.astype(np.int64) * total + element)
        self.patch, self.element = self._keys // total, self._keys % total
        self.count = np.bincount(self.patch, minlength=patch_count)
        self.start = np.cumsum(self.count) - self.count
        self.listed, self.listed_patch = self.element, self.patch
        self._number = np.arange(len(self._keys)) - self.start[self.patch]

    def arrange(self, key: Numbers, last: NDArray[np.bool_] | None = None) -> None:
        """Numbers them in the order of ``key`` within their patches, those of ``last`` after the others."""
        order = np.lexsort((key, np.zeros(len(key), dtype=bool) if last is None else last, self.patch))
        self._number = np.empty_like(order)
        self._number[order] = np.arange(len(order)) - self.start[self.patch]
        self.listed = self.element[order]

    def _at(self, patch: Keys, element: Numbers) -> tuple[Keys, NDArray[np.bool_]]:
        wanted = patch * self._total + element
        at = np.minimum(np.searchsorted(self._keys, wanted), len(self._keys) - 1)
        return at, self._keys[at] == wanted

    def place(self, number: Keys, count: Keys) -> None:
        """Gives them these local numbers; of the ``count`` numbers of a patch some may be unused."""
        self.count, self._number = count, number
        self.start = np.cumsum(count) - count
        self.listed = np.zeros(count.sum(), dtype=np.int64)
        self.listed[self.start[self.patch] + number] = self.element
        self.listed_patch = np.repeat(np.arange(len(count)), count)

    def member(self, patch: Keys, element: Numbers) -> Keys:
        """Index of an element among all patches' members, -1 where the patch does not have it."""
        at, there = self._at(patch, element)
        return np.where(there, at, -1)

    def find(self, patch: Keys, element: Numbers) -> Keys:
        """Local numbers of elements, of any shape; 0 where the patch does not have the element."""
        if not len(self._keys):
            return np.zeros(np.broadcast(patch, element).shape, dtype=np.int64)
        at, there = self._at(patch, element)
        return np.where(there, self._number[at], 0)

    def has(self, patch: Keys, element: Numbers) -> NDArray[np.bool_]:
        """Whether each patch has that element."""
        return self._at(patch, element)[1] if len(self._keys) else np.zeros(len(patch), dtype=bool)


def edge_numbers(edges: Indices) -> Indices:
    """Edges without the sign of their hinge's torque (``Elements.edges``)."""
    return np.where(edges < 0, -1 - edges, edges)


def packed_bits(numbers: Keys, bits: int) -> NDArray[np.uint64]:
    """Numbers of ``bits`` bits packed into 64-bit words, shape [N, up to 64 / ``bits``] to [N]."""
    shifts = (bits * np.arange(numbers.shape[1])).astype(np.uint64)
    return np.bitwise_or.reduce(numbers.astype(np.uint64) << shifts, axis=1)


class Portion:
    """Some of a garment's patches: their vertices, and where these are in the flattened ends and corners.

    ``owner`` and ``lane`` of all the garment's vertices are shared with the other portions, which write other vertices.
    """

    def __init__(self, groups: list[Indices], base: int, owner: Keys, lane: Keys, ends: Keys, corners: Keys) -> None:
        self.owned = np.array([len(group) for group in groups])
        self.first = np.cumsum(self.owned) - self.owned
        self.vertices = np.concatenate(groups).astype(np.int64)
        self.patch = np.repeat(np.arange(len(groups)), self.owned)
        owner[self.vertices] = base + self.patch
        lane[self.vertices] = np.arange(len(self.vertices)) - self.first[self.patch]
        self.ends, self.corners, self.garment_vertices = ends, corners, len(owner)
        self._owner, self._lane, self._base = owner, lane, base

    def owner(self, vertices: Numbers) -> Keys:
        """The patch of this portion that owns each vertex; no valid number where another portion has it."""
        return self._owner[vertices] - self._base

    def lane(self, patch: Keys, vertices: Numbers) -> Keys:
        """Local number of a vertex in its patch; -1 where the patch does not own it."""
        return np.where(self.owner(vertices) == patch, self._lane[vertices], -1)

    def ranks(self, *vertices: Numbers) -> Keys:
        """For each patch, how often a vertex occurs in one of these lists, at most."""
        most = np.ones(len(self.owned), dtype=np.int64)
        for each in vertices:
            often = np.bincount(self.first[self.owner(each)] + self._lane[each], minlength=len(self.vertices))
            most = np.maximum(most, np.maximum.reduceat(often, self.first))
        return most

    def ranked(self, ranks: Keys, vertices: Numbers, entries: Keys, nothing: Keys) -> NDArray[np.int32]:
        """Entries of each vertex by rank, transposed within its patch, RANKS packed to a row; shape [rows, RANKS / 2].

        ``nothing``: each patch's entry where a vertex has no more.
        """
        patch, lane = self.owner(vertices), self._lane[vertices]
        start, order = ragged_rows(self.first[patch] + lane, len(self.vertices))
        patch, lane = patch[order], lane[order]
        rank = np.arange(len(order)) - start[self.first[patch] + lane]
        size = word_count(ranks) * self.owned
        begin = np.cumsum(size) - size
        ranked = np.repeat(nothing, size)[:, None].repeat(RANKS, axis=1)
        ranked[begin[patch] + rank // RANKS * self.owned[patch] + lane, rank % RANKS] = entries[order]
        return ranked.astype(np.uint16).view(np.int32)


def word_count(ranks: Keys) -> Keys:
    """Number of rows of RANKS entries for so many ranks."""
    return -(-ranks // RANKS)

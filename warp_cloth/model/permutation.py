"""Permutation of vertices: from the garments' numbers to the order in which patches own them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices


class Permutation:
    """The order of vertices in the arrays of kernels: the garments', or the patches'.

    ``order``: the garments' numbers of the vertices in the new order, shape [V]; None: the identity on ``count``.
    """

    def __init__(self, order: Indices | None, count: int = 0) -> None:
        self.order = order
        self.count = count if order is None else len(order)
        if order is not None:
            # new number by the garments' number; the last entry maps -1, no vertex, to itself
            self.rank = np.full(len(order) + 1, -1, dtype=np.int32)
            self.rank[order] = np.arange(len(order), dtype=np.int32)

    @property
    def key(self) -> bytes:
        """Cache key; distinguishes permutations of equally many vertices."""
        return b"" if self.order is None else self.order.tobytes()

    def part(self, first: int, end: int) -> Permutation:
        """The permutation of one garment's vertices, contiguous in both orders, numbered from its first one."""
        return Permutation(None if self.order is None else self.order[first:end] - first, end - first)

    def of(self, vertices: Indices) -> Indices:
        """New numbers of the garments' vertices; -1, no vertex, stays -1."""
        return vertices if self.order is None else self.rank[vertices]

    def rows(self, values: NDArray[Any]) -> NDArray[Any]:
        """Rows of the garments' vertices in the new order."""
        return values if self.order is None else values[self.order]

    def lists(self, start: Indices, entries: Indices) -> tuple[Indices, Indices]:
        """CSR lists of the garments' vertices in the new order; list v is entries[start[v] : start[v + 1]]."""
        if self.order is None:
            return start, entries
        counts = np.diff(start)[self.order]
        ends = np.cumsum(counts)
        place = np.arange(len(entries)) + np.repeat(np.asarray(start[:-1])[self.order] - (ends - counts), counts)
        return np.concatenate([[0], ends]).astype(np.int32), entries[place]

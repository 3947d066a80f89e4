"""Numbers of vertices: the garments' own, or as patches own them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices


class Permutation:
    """Numbers of vertices as kernels have them: the garments' own, or as patches own them.

    ``order``: theirs in the garments, in the patches' order, shape [V]; None: they are the same, ``count`` of them.
    """

    def __init__(self, order: Indices | None, count: int = 0) -> None:
        self.order = order
        self.count = count if order is None else len(order)
        if order is not None:
            # by the garments' numbers; the last one is of what is none
            self.rank = np.full(len(order) + 1, -1, dtype=np.int32)
            self.rank[order] = np.arange(len(order), dtype=np.int32)

    @property
    def key(self) -> bytes:
        """What tells it from others of as many vertices."""
        return b"" if self.order is None else self.order.tobytes()

    def part(self, first: int, end: int) -> Permutation:
        """The numbers of a garment's vertices, which lie together in both, counted from its first one."""
        return Permutation(None if self.order is None else self.order[first:end] - first, end - first)

    def of(self, vertices: Indices) -> Indices:
        """The numbers of the garments' vertices; -1, none, stays so."""
        return vertices if self.order is None else self.rank[vertices]

    def rows(self, values: NDArray[Any]) -> NDArray[Any]:
        """What the garments' vertices have, by those numbers."""
        return values if self.order is None else values[self.order]

    def lists(self, start: Indices, entries: Indices) -> tuple[Indices, Indices]:
        """Lists of entries, one for each vertex, row v of which goes from start[v] to start[v + 1]."""
        if self.order is None:
            return start, entries
        counts = np.diff(start)[self.order]
        ends = np.cumsum(counts)
        place = np.arange(len(entries)) + np.repeat(np.asarray(start[:-1])[self.order] - (ends - counts), counts)
        return np.concatenate([[0], ends]).astype(np.int32), entries[place]

"""Numbers of vertices: the garments' own, or as patches own them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.mesh import Indices


class Numbering:
    """Numbers of vertices as kernels have them: the garments' own, or as patches own them.

    ``order``: theirs in the garments, in the patches' order, shape [V]; None: they are the same.
    """

    def __init__(self, order: Indices | None) -> None:
        self.order = order
        if order is not None:
            self._rank = np.full(len(order) + 1, -1, dtype=np.int32)  # the last one of what is none
            self._rank[order] = np.arange(len(order), dtype=np.int32)

    def of(self, vertices: Indices) -> Indices:
        """The numbers of the garments' vertices; -1, none, stays so."""
        return vertices if self.order is None else self._rank[vertices]

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

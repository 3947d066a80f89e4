"""The vertices, edges and triangles of those items of many that still iterate, for kernels that pass over all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.kernels.base.subset import GROUP
from warp_cloth.model.model import ClothModel


class Listed:
    """Groups of neighbours (kernels.base.subset), of which items have so many one after another."""

    def __init__(self, starts: Sequence[int], device: str) -> None:
        """``starts``: the first of each item's, and how many there are in all."""
        self._starts, self._device = np.asarray(starts, dtype=np.int64), device
        self.groups = wp.empty(0, dtype=wp.int32, device=device)  # none: all
        self.size = int(self._starts[-1])  # threads that it takes

    def choose(self, items: NDArray[np.bool_]) -> None:
        """Lists those of some items, shape [items]."""
        if items.all():
            self.groups, self.size = wp.empty(0, dtype=wp.int32, device=self._device), int(self._starts[-1])
            return
        first, last = self._starts[:-1] // GROUP, -(-self._starts[1:] // GROUP)
        there = items & (np.diff(self._starts) > 0)
        edge = np.zeros(int(last[-1]) + 1, dtype=np.int64)
        np.add.at(edge, first[there], 1)
        np.add.at(edge, last[there], -1)
        groups = np.flatnonzero(np.cumsum(edge)[:-1])
        self.groups = wp.array(groups, dtype=wp.int32, device=self._device)
        self.size = GROUP * len(groups)


class AtWork:
    """What is listed of a model's vertices, edges and triangles."""

    def __init__(self, model: ClothModel) -> None:
        def starts(own: Sequence[int]) -> list[int]:
            return [own[model.vertex_start.index(first)] for first in model.item_start]

        triangles = np.cumsum([0, *(len(each.corners) for each in model.garments)])
        self._device, self._each = model.device, list[Listed]()
        self.vertices = self.more(model.item_start)
        self.edges = self.more(starts(model.edge_start))
        self.triangles = self.more(starts(triangles.tolist()))

    def more(self, starts: Sequence[int]) -> Listed:
        """Something else that items have, as of Listed."""
        self._each.append(Listed(starts, self._device))
        return self._each[-1]

    def choose(self, items: NDArray[np.bool_]) -> None:
        """Lists those of some items, shape [items]; graphs that were captured before know nothing of it."""
        for each in self._each:
            each.choose(items)

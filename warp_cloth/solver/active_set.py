"""Active set: the vertices, edges and triangles of the items that still iterate (kernels.base.active_set)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.kernels.base.active_set import GROUP
from warp_cloth.model.model import ClothModel


class ActiveGroups:
    """Groups of elements of one kind, of which items have so many one after another."""

    def __init__(self, starts: Sequence[int], device: str) -> None:
        """``starts``: the first element of each item, and the element count."""
        self._starts, self._device = np.asarray(starts, dtype=np.int64), device
        self.groups = wp.empty(0, dtype=wp.int32, device=device)  # empty: all
        self.size = int(self._starts[-1])  # threads of a launch

    def choose(self, items: NDArray[np.bool_]) -> None:
        """Activates the groups of these items, shape [items]."""
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


class ActiveSet:
    """The active groups of a model's vertices, edges and triangles."""

    def __init__(self, model: ClothModel) -> None:
        def starts(own: Sequence[int]) -> list[int]:
            return [own[model.vertex_start.index(first)] for first in model.item_start]

        triangles = np.cumsum([0, *(len(each.corners) for each in model.garments)])
        self._device, self._each = model.device, list[ActiveGroups]()
        self.vertices = self.add(model.item_start)
        self.edges = self.add(starts(model.edge_start))
        self.triangles = self.add(starts(triangles.tolist()))

    def add(self, starts: Sequence[int]) -> ActiveGroups:
        """Active groups of another kind of elements, which follow from now on; ``starts`` as in ActiveGroups."""
        self._each.append(ActiveGroups(starts, self._device))
        return self._each[-1]

    def choose(self, items: NDArray[np.bool_]) -> None:
        """Activates these items, shape [items]; graphs captured before are not updated."""
        for each in self._each:
            each.choose(items)

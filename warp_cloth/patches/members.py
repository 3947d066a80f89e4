"""Which vertices, edges and triangles a patch has, and as which it counts them, on the host."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.mesh import Indices
from warp_cloth.topology import sorted_keys

Keys = NDArray[np.int64]
Numbers = NDArray[np.integer[Any]]  # of elements, of either width


class Members:
    """Which of some elements each patch has, and as which it counts them."""

    def __init__(self, patch: Keys, element: Numbers, total: int, patch_count: int) -> None:
        self._total = total
        self._keys = sorted_keys(patch.astype(np.int64) * total + element)
        self.patch, self.element = self._keys // total, self._keys % total
        self.count = np.bincount(self.patch, minlength=patch_count)
        self.start = np.cumsum(self.count) - self.count
        self.listed, self.listed_patch = self.element, self.patch
        self._number = np.arange(len(self._keys)) - self.start[self.patch]

    def arrange(self, key: Numbers, last: NDArray[np.bool_] | None = None) -> None:
        """Counts them in the order of ``key`` within their patches, these after the others."""
        order = np.lexsort((key, np.zeros(len(key), dtype=bool) if last is None else last, self.patch))
        self._number = np.empty_like(order)
        self._number[order] = np.arange(len(order)) - self.start[self.patch]
        self.listed = self.element[order]

    def _at(self, patch: Keys, element: Numbers) -> tuple[Keys, NDArray[np.bool_]]:
        wanted = patch * self._total + element
        at = np.minimum(np.searchsorted(self._keys, wanted), len(self._keys) - 1)
        return at, self._keys[at] == wanted

    def place(self, number: Keys, count: Keys) -> None:
        """Counts them by ``number`` within their patches, where not all of ``count`` are there."""
        self.count, self._number = count, number
        self.start = np.cumsum(count) - count
        self.listed = np.zeros(count.sum(), dtype=np.int64)
        self.listed[self.start[self.patch] + number] = self.element
        self.listed_patch = np.repeat(np.arange(len(count)), count)

    def member(self, patch: Keys, element: Numbers) -> Keys:
        """Which one of all patches' members an element is, -1 where the patch has no such element."""
        at, there = self._at(patch, element)
        return np.where(there, at, -1)

    def find(self, patch: Keys, element: Numbers) -> Keys:
        """Numbers of elements in their patches, whatever the shape; 0 where the patch has no such element."""
        if not len(self._keys):
            return np.zeros(np.broadcast(patch, element).shape, dtype=np.int64)
        at, there = self._at(patch, element)
        return np.where(there, self._number[at], 0)

    def has(self, patch: Keys, element: Numbers) -> NDArray[np.bool_]:
        """Whether each patch has that element."""
        return self._at(patch, element)[1] if len(self._keys) else np.zeros(len(patch), dtype=bool)


def edge_numbers(edges: Indices) -> Indices:
    """Edges without the sign that tells how their hinge's turn counts."""
    return np.where(edges < 0, -1 - edges, edges)


def words(numbers: Keys, bits: int) -> NDArray[np.uint64]:
    """Numbers of so many bits packed in a word, shape [N, up to 64 / ``bits``] to [N]."""
    shifts = (bits * np.arange(numbers.shape[1])).astype(np.uint64)
    return np.bitwise_or.reduce(numbers.astype(np.uint64) << shifts, axis=1)

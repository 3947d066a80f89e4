"""Bin packing of consecutive items: batches that fit a capacity."""

from __future__ import annotations

from collections.abc import Sequence


def consecutive_bins(sizes: Sequence[int], capacity: int) -> list[range]:
    """Ranges of consecutive items whose sizes sum to ``capacity`` at most; a larger item has a range of its own."""
    bins, first, total = [], 0, 0
    for index, size in enumerate(sizes):
        if index > first and total + size > capacity:
            bins.append(range(first, index))
            first, total = index, 0
        total += size
    return [*bins, range(first, len(sizes))] if sizes else []

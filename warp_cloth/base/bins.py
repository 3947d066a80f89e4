"""Work on many cut into as much as goes together."""

from __future__ import annotations

from collections.abc import Sequence


def pieces(sizes: Sequence[int], most: int) -> list[range]:
    """Consecutive numbers whose sizes add up to ``most`` at most, or one by itself."""
    found, first, total = [], 0, 0
    for at, size in enumerate(sizes):
        if at > first and total + size > most:
            found.append(range(first, at))
            first, total = at, 0
        total += size
    return [*found, range(first, len(sizes))] if sizes else []

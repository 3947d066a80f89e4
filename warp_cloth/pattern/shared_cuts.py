"""Cuts of edges that several joints share: each piece of such an edge is sewn to one whole piece of each layer."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from itertools import pairwise

from warp_cloth.pattern.specification import Side

LEAST = 4e-3  # [m] of an edge that is cut off
ROUNDS = 8  # cuts that lead to cuts of other layers, and these to more

Span = tuple[Side, float, float]  # an edge, and the fractions of its length from which to which a piece reaches
Pair = tuple[Span, Span]  # what is sewn together, the second against its own direction


def shared_cuts(pairs: Sequence[Sequence[Pair]], length: Callable[[Side], float]) -> list[list[Pair]]:
    """The pairs of each joint, parted wherever another joint parts one of their edges.

    Where no edge is in several joints, nothing changes. ``length`` of an edge [m].
    """
    uses = Counter(side for own in pairs for side in {span[0] for pair in own for span in pair})
    found = [list(own) for own in pairs]
    if max(uses.values(), default=0) < 2:
        return found
    stops = _Stops(length)
    for _ in range(ROUNDS):
        found = [[(stops.snapped(a), stops.snapped(b)) for a, b in own] for own in found]
        parted = [[part for pair in own for part in _parted(pair, stops)] for own in found]
        if parted == found:
            break
        found = parted
    return found


class _Stops:
    """Where edges are cut; places nearer to each other than LEAST are one."""

    def __init__(self, length: Callable[[Side], float]) -> None:
        self.length = length
        self.of: dict[Side, list[float]] = {}

    def snapped(self, span: Span) -> Span:
        """A span that ends at stops, to which its ends are added; what is shorter than LEAST is the piece it is at."""
        side, low, high = span
        low, high = self._at(side, low), self._at(side, high)
        return side, max(stop for stop in self.of[side] if stop < 1.0) if low == 1.0 else low, high

    def _at(self, side: Side, place: float) -> float:
        known = self.of.setdefault(side, [0.0, 1.0])
        nearest = min(known, key=lambda stop: abs(stop - place))
        if abs(nearest - place) * self.length(side) < LEAST:
            return nearest
        known.append(place)
        return place

    def within(self, span: Span, against: bool) -> list[float]:
        """Stops inside a span, as fractions of it, from its end where ``against``."""
        side, low, high = span
        shares = [(stop - low) / (high - low) for stop in self.of[side] if low < stop < high]
        return [1.0 - share for share in shares] if against else shares


def _parted(pair: Pair, stops: _Stops) -> list[Pair]:
    """A pair parted at the stops on either side."""
    (a, low, high), (b, start, end) = pair
    least = LEAST / max(min((high - low) * stops.length(a), (end - start) * stops.length(b)), LEAST)
    shares = [0.0]
    for share in sorted([*stops.within(pair[0], False), *stops.within(pair[1], True)]):
        if share - shares[-1] >= least and 1.0 - share >= least:
            shares.append(share)
    made = []
    for one, other in pairwise([*shares, 1.0]):
        there = (b, end - other * (end - start), end - one * (end - start))
        made.append((stops.snapped((a, low + one * (high - low), low + other * (high - low))), stops.snapped(there)))
    return made

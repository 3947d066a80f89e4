"""Handles of what is sewn: a garment is a ball with openings, and panels that are sewn the wrong way round add handles.

Where panels lie far apart, or a band flat beside the body, their places hardly tell which way round a seam is, or in
which order an edge is sewn to several others. What comes of it does: all of the 96 random designs are balls with
openings, and a panel that is turned between its neighbours joins openings that were apart.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from itertools import pairwise
from typing import Protocol

from warp_cloth.pattern.specification import Pattern, Side

ROUND = 9  # decimals of an edge's length to which places on it are the same


class SewnPiece(Protocol):
    """A part of an edge, from one fraction of its length to another."""

    @property
    def side(self) -> Side: ...
    @property
    def low(self) -> float: ...
    @property
    def high(self) -> float: ...


class SewnPair(Protocol):
    """Two such parts that are sewn together, the second's start to the first's end if in ``reverse``."""

    @property
    def pieces(self) -> tuple[SewnPiece, SewnPiece]: ...
    @property
    def reverse(self) -> bool: ...


class _Classes:
    """What is the same as what: union-find."""

    def __init__(self) -> None:
        self.above: dict[Hashable, Hashable] = {}

    def top(self, one: Hashable) -> Hashable:
        above = self.above.setdefault(one, one)
        while above != one:
            one, above = above, self.above[above]
        return one

    def join(self, one: Hashable, other: Hashable) -> None:
        self.above[self.top(one)] = self.top(other)

    def count(self) -> int:
        return len({self.top(each) for each in list(self.above)})


def handle_count(pattern: Pattern, seams: Sequence[SewnPair]) -> int:
    """Twice the handles of what these seams make of their panels: 0 for balls with openings.

    Each edge is sewn to one other at most at each place.
    """
    panels = {piece.side.panel for seam in seams for piece in seam.pieces}
    stops: dict[Side, set[float]] = {
        Side(panel, edge): {0.0, 1.0} for panel in panels for edge in range(len(pattern.panels[panel].edges))
    }
    for seam in seams:
        for piece in seam.pieces:
            stops[piece.side] |= {round(piece.low, ROUND), round(piece.high, ROUND)}

    def corner(side: Side, share: float) -> Hashable:
        share = round(share, ROUND)
        count = len(pattern.panels[side.panel].edges)
        return (side.panel, (side.edge + 1) % count, 0.0) if share == 1.0 else (side.panel, side.edge, share)

    corners, bodies = _Classes(), _Classes()
    open_: dict[tuple[Side, float], tuple[Hashable, Hashable]] = {}
    for side, at in stops.items():
        order = sorted(at)
        for low, high in pairwise(order):
            open_[side, low] = corner(side, low), corner(side, high)
            corners.top(open_[side, low][0])
    edges = len(open_)
    for seam in seams:
        one, other = seam.pieces
        start, end = (other.high, other.low) if seam.reverse else (other.low, other.high)
        corners.join(corner(one.side, one.low), corner(other.side, start))
        corners.join(corner(one.side, one.high), corner(other.side, end))
        bodies.join(one.side.panel, other.side.panel)
        for piece in (one, other):
            open_.pop((piece.side, round(piece.low, ROUND)), None)
        edges -= 1
    rims = _Classes()
    for start_of, end_of in open_.values():
        rims.join(corners.top(start_of), corners.top(end_of))
    return 2 * bodies.count() - (corners.count() - edges + len(panels)) - rims.count()

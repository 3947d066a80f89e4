"""Seams: pairs of pieces of edges that are sewn together."""

from __future__ import annotations

from dataclasses import dataclass

from warp_cloth.pattern.specification import Side


@dataclass(frozen=True)
class Piece:
    """A part of an edge, from one fraction of its length to another."""

    side: Side
    low: float = 0.0
    high: float = 1.0


@dataclass(frozen=True)
class Seam:
    """Two pieces that are sewn together over their whole lengths; ``reverse``: the first's start to the second's end.

    Loops run counter-clockwise as seen from outside, so a seam that continues the outer side is in reverse.
    """

    stitch: int
    pieces: tuple[Piece, Piece]
    reverse: bool

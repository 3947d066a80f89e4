"""Handles of what is sewn: a garment is a ball with openings, and panels that are sewn the wrong way round add handles.

Where panels lie far apart, or a band flat next to the body, their places hardly tell which way round a seam is, or in
which order an edge is sewn to several others. What comes of it does: all of the 96 random designs are balls with
openings, and a panel that is turned between its neighbours joins openings that were apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.connected import connected_components
from warp_cloth.pattern.seam import Seam
from warp_cloth.pattern.specification import Pattern, Side

ROUND = 9  # decimals of an edge's length to which places on it are the same


def handle_count(pattern: Pattern, seams: Sequence[Seam]) -> int:
    """Twice the handles of what these seams make of their panels: 0 for balls with openings.

    Each edge is sewn to one other at most at each place.
    """
    panels = sorted({piece.side.panel for seam in seams for piece in seam.pieces})
    stops: dict[Side, set[float]] = {
        Side(panel, edge): {0.0, 1.0} for panel in panels for edge in range(len(pattern.panels[panel].edges))
    }
    for seam in seams:
        for piece in seam.pieces:
            stops[piece.side] |= {round(piece.low, ROUND), round(piece.high, ROUND)}
    numbers: dict[tuple[int, int, float], int] = {}  # of corners

    def corner(side: Side, share: float) -> int:
        share, count = round(share, ROUND), len(pattern.panels[side.panel].edges)
        at = (side.panel, (side.edge + 1) % count, 0.0) if share == 1.0 else (side.panel, side.edge, share)
        return numbers.setdefault(at, len(numbers))

    open_ = {
        (side, low): (corner(side, low), corner(side, high))
        for side, at in stops.items()
        for low, high in pairwise(sorted(at))
    }
    edges, joined = len(open_) - len(seams), []
    for seam in seams:
        one, other = seam.pieces
        start, end = (other.high, other.low) if seam.reverse else (other.low, other.high)
        joined += [(corner(one.side, one.low), corner(other.side, start))]
        joined += [(corner(one.side, one.high), corner(other.side, end))]
        for piece in (one, other):
            open_.pop((piece.side, round(piece.low, ROUND)), None)
    at_corner = connected_components(len(numbers), *_columns(joined))
    rims = at_corner[np.array(list(open_.values()), dtype=np.int64).reshape(-1, 2)]
    rim = connected_components(len(numbers), *rims.T)[rims[:, 0]]
    places = {panel: place for place, panel in enumerate(panels)}
    bodies = [tuple(places[piece.side.panel] for piece in seam.pieces) for seam in seams]
    body = connected_components(len(panels), *_columns(bodies))
    corners, openings, balls = (len(np.unique(each)) for each in (at_corner, rim, body))
    return 2 * balls - (corners - edges + len(panels)) - openings


def _columns(pairs: Sequence[tuple[int, ...]]) -> NDArray[np.int64]:
    """Pairs as the first of each and the second of each, shape [2, N]."""
    return np.array(pairs, dtype=np.int64).reshape(-1, 2).T

"""A piece as it is cut."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.kinds import Named
from warp_cloth.pattern.specification import Dart


@dataclass(frozen=True, eq=False)
class Piece:
    """A piece as cut, its grain along +y, its loop counter-clockwise as drawn."""

    name: str
    size: str
    copies: tuple[int, int] | None  # as drawn, and mirrored; None: not stated
    edges: tuple[Chain, ...]
    mirror: tuple[int, ...] | None  # the edge that each is the mirror image of in a symmetric piece
    notches: Floats  # [m], shape [N, 2]
    lines: tuple[Floats, ...]  # inner lines, drawn only [m], shape [n, 2] each
    holes: tuple[tuple[Chain, ...], ...]  # cut out of it, counter-clockwise
    darts: tuple[Dart, ...]  # within it; others are edges
    notes: tuple[str, ...]
    what: Named  # what its texts say it is

    @property
    def outline(self) -> Floats:
        return np.concatenate([edge.points[:-1] for edge in self.edges])

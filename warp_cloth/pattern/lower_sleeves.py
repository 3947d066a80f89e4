"""Sleeves cut across: a lower piece, down to the wrist, sewn to the hem of the upper one."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import replace

import numpy as np

from warp_cloth.pattern.kinds import UNDER_SLEEVE
from warp_cloth.pattern.panel_roles import is_cut_across
from warp_cloth.pattern.piece import Piece
from warp_cloth.pattern.roles import UPWARDS, Shape, sleeve_roles, upright

LOWER_SLEEVE = "lower_sleeve"
AS_WIDE = 0.03  # relative, of its top and the hem that this is sewn to


def with_lower_sleeves(pieces: Sequence[Piece], stated: Set[str]) -> list[Piece]:
    """The pieces, those made lower sleeves that are named so, drawn upright, and as wide above as an upper one below.

    ``stated``: names left alone.
    """
    whole = [piece for piece in pieces if piece.what.kind == "sleeve" and piece.what.panel != UNDER_SLEEVE]
    hems = [(piece.what.side, _across(piece, "hem", upright(piece.edges, "sleeve"))) for piece in whole]

    def is_lower(piece: Piece) -> bool:
        if piece.what.kind != "sleeve" or piece.what.panel != UNDER_SLEEVE or piece.name in stated:
            return False
        top = _across(piece, "cap", UPWARDS)
        fits = [abs(top - hem) <= AS_WIDE * hem for side, hem in hems if side == piece.what.side]
        return is_cut_across(piece) and len(fits) == 1 and fits[0]

    return [
        replace(piece, what=replace(piece.what, kind=LOWER_SLEEVE, panel="", level=0)) if is_lower(piece) else piece
        for piece in pieces
    ]


def _across(piece: Piece, role: str, up: np.ndarray) -> float:
    """Length of a sleeve's hem or top [m]."""
    shape = Shape(piece.edges, up)
    return shape.length(sleeve_roles(shape).get(role, ()))

"""Fronts, backs and skirts that a file has in two layers, as outer and inner ones: those named layers are left out."""

from __future__ import annotations

import re
from collections.abc import Sequence, Set
from dataclasses import replace

import numpy as np

from warp_cloth.pattern.kinds import spaced
from warp_cloth.pattern.piece import Piece
from warp_cloth.pattern.tops import tube_roles
from warp_cloth.pattern.vocabulary import LAYER_WORDS

LAYERED = ("front", "back", "skirt", "skirt_front", "skirt_back")
AS_WIDE = 0.75  # of the other one's width; the inner one of two panels is narrower


def with_outer_layers(pieces: Sequence[Piece], stated: Set[str]) -> list[Piece]:
    """The pieces, layers over or under another one of what they are marked as such: one layer is sewn.

    What is named a layer has another piece for the same place, about as wide, that is named none. ``stated``: names
    left alone.
    """
    layers = [piece.what.kind in LAYERED and is_layer_by_name(piece.name) for piece in pieces]
    plain_ones = [piece for piece, is_layer in zip(pieces, layers, strict=True) if not is_layer]
    return [
        replace(piece, what=replace(piece.what, kind="none", is_layer=True))
        if is_layer and piece.name not in stated and any(_is_for_same_place(piece, other) for other in plain_ones)
        else piece
        for piece, is_layer in zip(pieces, layers, strict=True)
    ]


def is_layer_by_name(name: str) -> bool:
    return bool(re.search(LAYER_WORDS, spaced(name)))


def _is_for_same_place(layer: Piece, other: Piece) -> bool:
    one, its = layer.what, other.what
    if (one.side, one.panel) != (its.side, its.panel):
        return False
    if one.kind != its.kind:  # of a skirt, which the name of one of them does not say
        top = layer if its.kind.startswith("skirt") else other
        if one.kind.removeprefix("skirt_") != its.kind.removeprefix("skirt_") or tube_roles(top) is None:
            return False
    widths = [float(np.ptp(piece.outline[:, 0])) for piece in (layer, other)]
    return widths[0] > AS_WIDE * widths[1]

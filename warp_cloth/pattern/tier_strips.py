"""Tiers of a skirt that are strips cut several times: half of them for its front, half for its back."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import replace

import numpy as np

from warp_cloth.pattern.piece import Piece
from warp_cloth.pattern.roles import UPWARDS, Shape
from warp_cloth.pattern.specification import short


def with_faces_of_tiers(pieces: Sequence[Piece], stated: Set[str]) -> tuple[list[Piece], list[str]]:
    """The pieces, each tier of neither front nor back that is cut twice or more made one of each; and notes on these.

    Strips that are cut more often are joined, half of them in front; ``stated``: names of pieces of which a scene
    states how often they are cut, or where they are.
    """
    out: list[Piece] = []
    notes = []
    for piece in pieces:
        count = sum(piece.copies or (0, 0))
        is_one = piece.what.is_tier and piece.what.kind == "skirt" and piece.mirror is not None and count >= 2
        if not is_one or piece.name in stated or (count > 2 and not _is_rectangle(piece)):
            out.append(piece)
            continue
        wide = np.diag([0.5 * count, 1.0])
        edges = tuple(edge.turned(wide, np.zeros(2)) for edge in piece.edges)
        half = replace(piece, edges=edges, copies=(1, 0), notches=piece.notches if count == 2 else piece.notches[:0])
        front, back = (replace(half, what=replace(piece.what, kind=f"skirt_{face}")) for face in ("front", "back"))
        notes.append(f'piece "{short(piece.name)}" is a tier cut {count} times: half of it is in front, half behind')
        out += [replace(front, name=f"{piece.name} front"), replace(back, name=f"{piece.name} back")]
    return out, notes


def _is_rectangle(piece: Piece) -> bool:
    shape = Shape(piece.edges, UPWARDS)
    sides = np.prod(np.ptp(np.array(shape.box), axis=0))
    area = abs(sum(edge.area for edge in piece.edges))
    return bool(area > 0.999 * sides)

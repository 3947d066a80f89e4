"""Fronts and backs that end under the arms, all round: strapless tops and dresses, and not skirts.

Both are tubes with no neck and no armholes. A skirt is narrowest where it is worn, at its top; a strapless dress is
narrowest at the waist and widens to the bust, and what is too short for a skirt is a top if it is not narrower above.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warp_cloth.pattern.by_shape import is_bodice
from warp_cloth.pattern.piece import Piece
from warp_cloth.pattern.roles import UPWARDS, Roles, Shape, skirt_roles

STRAPLESS = "under_arms"  # a role without edges, which tells that a front or back is of such a top
WIDENS = 1.04  # bust over waist, at least; a skirt with a high waist is little wider above it
TO_WAIST = 0.12  # [m] from the bust's top down to the waist, at least; a skirt's high waist is lower
FLARES = 1.02  # hem over waist of a dress
TOO_SHORT = 0.28  # [m] for a skirt
WHOLE = 0.6  # of the widest place, that the upper end is wide at least; what is less hangs from something


@dataclass(frozen=True)
class _Side:
    """Half widths of a tube along its side [m], and how far that runs up in all and above its narrowest place."""

    top: float
    waist: float
    hem: float
    tall: float
    above_waist: float


def strapless_roles(shape: Shape) -> Roles:
    """hem, neck, and side at "+" and "-", as those of a skirt that is worn higher."""
    roles = skirt_roles(shape)
    return {"neck": roles.pop("waist"), **roles, STRAPLESS: ()}


def are_strapless(pieces: Sequence[Piece]) -> bool:
    """Whether the only front and the only back, both symmetric, are of a strapless top or dress, drawn upright."""
    sides = []
    for face in ("front", "back"):
        own = [piece for piece in pieces if piece.what.kind == face]
        side = _side_of(own[0]) if len(own) == 1 and not own[0].what.panel else None
        if side is None:
            return False
        sides.append(side)
    if all(side.tall < TOO_SHORT and side.top >= 0.99 * side.hem for side in sides):
        return True
    is_fitted = all(side.above_waist > TO_WAIST and side.hem > FLARES * side.waist for side in sides)
    return is_fitted and sum(side.top for side in sides) > WIDENS * sum(side.waist for side in sides)


def _side_of(piece: Piece) -> _Side | None:
    """The side of a tube; None: the piece is none."""
    shape = Shape(piece.edges, UPWARDS)
    if piece.mirror is None or len(shape.order) < 3 or is_bodice(piece):
        return None
    run = skirt_roles(shape)["side+"]
    if not run:
        return None
    points = np.concatenate([shape.turned[k].at(np.linspace(0.0, 1.0, 65)) for k in run])
    low, high = shape.box
    half = np.abs(points[:, 0] - 0.5 * (low[0] + high[0]))
    narrowest = int(half.argmin())
    above, tall = (float(points[-1, 1] - points[k, 1]) for k in (narrowest, 0))
    if half[-1] < WHOLE * half.max():
        return None
    return _Side(float(half[-1]), float(half[narrowest]), float(half[0]), tall, above)

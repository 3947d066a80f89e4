"""Fronts and backs cut across: a colour block below the chest, a midriff, a yoke of a skirt, one below another.

Each piece below the first has neither neck nor armholes, and is as wide above as what it is sewn to is below: so its
place is known, where it is as long at its sides in front and behind, and no layer of what it would be sewn to: that has
its width, too, and only names tell it from a piece below. It is taken for a skirt's, and what is below it for a tier.
"""

from __future__ import annotations

import re
from collections.abc import Sequence, Set
from dataclasses import replace
from itertools import pairwise, permutations

import numpy as np

from warp_cloth.pattern.cloth_layers import is_layer_by_name
from warp_cloth.pattern.kinds import spaced
from warp_cloth.pattern.part_roles import roles_of
from warp_cloth.pattern.piece import Piece
from warp_cloth.pattern.roles import UPWARDS, Shape, ends_of, upright
from warp_cloth.pattern.tops import tube_roles
from warp_cloth.pattern.vocabulary import ABOVE, BELOW, BETWEEN

PLAIN = (0.97, 1.03)  # waist over hem above, of what is cut across
GATHERED = 3.1  # the same at most, below a yoke
SIDES_ALIKE = 0.02  # relative, of a front and a back that are of one height
MOST = 4  # pieces one below another
APART = 0.02  # relative, by which hems fit better in one order than in any other
FACES = ("front", "back")


def with_stacked(pieces: Sequence[Piece], stated: Set[str]) -> list[Piece]:
    """The pieces, those that are cut across and lie below others as parts of a skirt; ``stated``: names left alone."""
    orders = [_from_above(_of_face(pieces, face, stated)) for face in FACES]
    (ahead, behind) = orders
    if not ahead or len(ahead) != len(behind):
        return list(pieces)
    tops = [
        [tube_roles(order[0], UPWARDS) is None for order in orders],
        [order[0].what.kind == "yoke" for order in orders],
    ]
    if any(one != other for one, other in tops):
        return list(pieces)
    low = int(tops[0][0])  # the first that is of the skirt
    for pair in zip(ahead[low:], behind[low:], strict=True):
        one, other = (_side(piece) for piece in pair)
        if abs(one - other) > SIDES_ALIKE * max(one, other):
            return list(pieces)
    made = {
        id(piece): replace(piece, what=replace(piece.what, kind=f"skirt_{face}", face="", level=level))
        for face, order in zip(FACES, orders, strict=True)
        for level, piece in enumerate(order[low:])
    }
    return [made.get(id(piece), piece) for piece in pieces]


def _of_face(pieces: Sequence[Piece], face: str, stated: Set[str]) -> list[Piece]:
    """What is named a front, or back: of a bodice or skirt, or the yoke of a skirt."""
    named = [
        piece
        for piece in pieces
        if piece.what.kind in (face, f"skirt_{face}") or (piece.what.kind == "yoke" and piece.what.face == face)
    ]
    is_plain = all(
        piece.mirror is not None and not piece.what.panel and not piece.what.is_tier and piece.name not in stated
        for piece in named
    )
    return named if is_plain and 2 <= len(named) <= MOST else []


def _from_above(own: Sequence[Piece]) -> list[Piece]:
    """The pieces from the uppermost on; empty: they do not fit, or fit as well in another order."""
    tubes = [piece for piece in own if tube_roles(piece, UPWARDS) is not None]
    tops = [piece for piece in own if piece not in tubes]
    if not tubes or len(tops) > 1 or (tops and not tops[0].what.kind.endswith(FACES)):
        return []
    if len(tubes) == 1 and tubes[0].what.kind.startswith("skirt"):  # a bodice and its skirt, or two skirts
        return []
    found = []
    for order in permutations(tubes):
        if "yoke" in [piece.what.kind for piece in order][1 if not tops else 0 :]:
            continue
        ranks = [(_height(piece), piece.what.kind.startswith("skirt")) for piece in order]
        if ranks != sorted(ranks):
            continue
        every = [*tops, *order]
        ratios = [_width(low, "waist") / max(_width(high, "hem"), 1e-9) for high, low in pairwise(every)]
        most = [GATHERED if _is_above_gathers(high, low) else PLAIN[1] for high, low in pairwise(every)]
        if all(PLAIN[0] <= ratio <= limit for ratio, limit in zip(ratios, most, strict=True)):
            found.append((sum(abs(ratio - 1.0) for ratio in ratios), every))
    found.sort(key=lambda each: each[0])
    is_sure = bool(found) and (len(found) < 2 or found[1][0] > found[0][0] + APART)
    best = found[0][1] if is_sure else []
    return [] if any(_may_be_layers(*pair) for pair in pairwise(best)) else best


def _height(piece: Piece) -> int:
    """Where a piece is by its name: 0 above others, 2 below; 1: between them, or not said."""
    name = spaced(piece.name)
    if re.search(BETWEEN, name):
        return 1
    return 0 if piece.what.kind == "yoke" or re.search(ABOVE, name) else 2 if re.search(BELOW, name) else 1


def _may_be_layers(high: Piece, low: Piece) -> bool:
    """Whether two pieces may lie on each other as well, by their names and shapes."""
    if is_layer_by_name(high.name) or is_layer_by_name(low.name):
        return True
    is_top = tube_roles(high, UPWARDS) is None
    is_told = _height(high) < _height(low) or any(re.search(BETWEEN, spaced(piece.name)) for piece in (high, low))
    if is_told or (is_top and low.what.kind.startswith("skirt")):
        return False
    above, longest = _below_arms(high) if is_top else (_width(high, "waist"), np.inf)
    widths = np.array([above, _width(low, "hem")]) / max(_width(high, "hem"), 1e-9)
    return bool(((widths > PLAIN[0]) & (widths < PLAIN[1])).all()) and _side(low) <= (1.0 + SIDES_ALIKE) * longest


def _below_arms(top: Piece) -> tuple[float, float]:
    """How wide a bodice is where its sides end, and how long these are [m]."""
    shape = Shape(top.edges, upright(top.edges, "front"))
    roles = roles_of("front", shape, True, False, False)
    sides = [roles.get(f"side{mark}", ()) for mark in "+-"]
    if not all(sides):
        return _width(top, "hem"), np.inf
    left, right = (
        max((each for k in run for each in (shape.turned[k].start, shape.turned[k].end)), key=lambda point: point[1])
        for run in sides
    )
    return float(np.hypot(*(left - right))), shape.length(sides[0])


def _is_above_gathers(high: Piece, low: Piece) -> bool:
    """Whether a skirt below may be gathered: names tell that it is one, and what is above none."""
    return low.what.kind.startswith("skirt") and not high.what.kind.startswith("skirt")


def _width(piece: Piece, role: str) -> float:
    """How wide a piece is at its upper or lower end [m]; of a bodice at its lower one."""
    roles = tube_roles(piece, UPWARDS)
    if roles is not None:
        return Shape(piece.edges, UPWARDS).length(roles[role])
    shape = Shape(piece.edges, upright(piece.edges, "front"))
    return shape.length(shape.run(*ends_of(shape)[0]))


def _side(piece: Piece) -> float:
    return Shape(piece.edges, UPWARDS).length((tube_roles(piece, UPWARDS) or {}).get("side+", ()))

"""Pocket openings: the corner between side and waist, cut out of a front of trousers or a skirt, a pocket behind it.

What is worn there is the pocket's facing, which goes on from the front's side and waist to the corner where these meet.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from warp_cloth.pattern.by_shape import is_leg_and_no_bodice
from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.panel_roles import half_skirt_roles, legged_roles
from warp_cloth.pattern.piece import Piece
from warp_cloth.pattern.roles import STRAIGHT, Shape, leg_roles, skirt_roles, upright
from warp_cloth.pattern.specification import short

GONE = (0.025, 0.25)  # [m] of side and of waist that an opening takes away
CORNER = np.radians([55.0, 125.0])  # turn of the outline at the corner
SHARP = np.radians(8.0)  # turn of the outline at either end of an opening, which is not bowed outwards: a hip is
AHEAD = 5e-3  # [m] of an edge that tells its direction at its end
STEPS = 25  # of an edge that is led on
AS_LONG = 0.01  # relative: to which the front's side is then as long as the back's


def without_pocket_openings(pieces: Sequence[Piece]) -> tuple[list[Piece], list[str]]:
    """The pieces, fronts of trousers and skirts with the corner that a pocket opening takes away; and notes on that.

    An opening is closed where the front's side is then as long as the back's, with a yoke above it or not, and nearer
    to that than with the opening as the end of the side.
    """
    backs = [_side(piece) for piece in pieces if piece.what.kind in ("back", "leg_back") and _is_leg(piece)]
    yokes = [edge.length for piece in pieces if piece.what.kind == "yoke" for edge in piece.edges]
    sides = [back + yoke for back in backs for yoke in (0.0, *yokes)]
    skirt_sides = [_skirt_side(piece) for piece in pieces if piece.what.kind == "skirt_back" and not piece.what.panel]
    out, notes = list(pieces), []
    for index, piece in enumerate(pieces):
        is_front = piece.what.kind in ("front", "leg_front") and piece.mirror is None
        closed = _best(piece, sides) if is_front and sides else None
        if piece.what.kind == "skirt_front" and not piece.what.panel and skirt_sides:
            closed = _best_skirt(piece, skirt_sides)
        if closed is not None:
            out[index] = closed
            why = "a pocket opening is closed, its side and waist going on to where they meet"
            notes.append(f'piece "{short(piece.name)}": {why}')
    return out, notes


def _best(front: Piece, sides: Sequence[float]) -> Piece | None:
    """A front without its opening, that of the ways to close it which brings its side nearest to one of these lengths.

    None: it has no opening, or none that leads there.
    """

    def lacks(piece: Piece) -> float:
        return min(abs(_side(piece) / side - 1.0) for side in sides)

    most = min(AS_LONG, lacks(front)) if _is_leg(front) else AS_LONG
    closed = [piece for piece in _closed(front) if _is_leg(piece) and lacks(piece) < most]
    return min(closed, key=lacks, default=None)


def _best_skirt(front: Piece, sides: Sequence[float]) -> Piece | None:
    """A skirt's front without its openings, on both sides of one on the fold; None: it has none, as for ``_best``."""

    def lacks(piece: Piece) -> float:
        return min(abs(_skirt_side(piece) / side - 1.0) for side in sides)

    closed = list(_closed(front)) if front.mirror is None else list(_closed_on_both_sides(front, front.mirror))
    fit = [piece for piece in closed if lacks(piece) < min(AS_LONG, lacks(front))]
    return min(fit, key=lacks, default=None)


def _skirt_side(piece: Piece) -> float:
    """Length of a skirt's side seam [m]; 0 where it is not told from the middle of half a skirt."""
    shape = Shape(piece.edges, upright(piece.edges, "skirt"))
    roles = skirt_roles(shape) if piece.mirror is not None else half_skirt_roles(shape)
    return shape.length(roles.get("side+") or roles.get("side-", ()))


def _is_leg(piece: Piece) -> bool:
    """Whether it is half of trousers, and of no romper, whose armhole lies as an opening does."""
    is_half = piece.mirror is None and is_leg_and_no_bodice(piece)
    return is_half and not legged_roles(Shape(piece.edges, upright(piece.edges, "front")))


def _side(piece: Piece) -> float:
    """Length of a leg's outer seam [m]."""
    shape = Shape(piece.edges, upright(piece.edges, "leg_front"))
    return shape.length(leg_roles(shape).get("outseam", ()))


def _closed(piece: Piece) -> Iterable[Piece]:
    """The piece with one of its edges replaced by the corner to which the edges next to it go on, if they meet."""
    for k in range(len(piece.edges)):
        if made := _corner(piece, k):
            yield replace(piece, edges=tuple(made.get(n, edge) for n, edge in enumerate(piece.edges) if n != k))


def _closed_on_both_sides(piece: Piece, mirror: Sequence[int]) -> Iterable[Piece]:
    """The symmetric piece with one of its edges, and that one's mirror image, so replaced."""
    count = len(piece.edges)
    for k in range(count):
        made, there = _corner(piece, k), _corner(piece, mirror[k]) if mirror[k] > k else {}
        if made and there and {*made}.isdisjoint({*there, mirror[k]}):
            kept = [n for n in range(count) if n not in (k, mirror[k])]
            edges = tuple((made | there).get(n, piece.edges[n]) for n in kept)
            yield replace(piece, edges=edges, mirror=tuple(kept.index(mirror[n]) for n in kept))


def _corner(piece: Piece, k: int) -> dict[int, Chain]:
    """The edges before and after an edge, led on to where they meet; none where it is no opening."""
    shape, count = Shape(piece.edges, upright(piece.edges, "leg_front")), len(piece.edges)
    if min(shape.turn_after(k - 1), shape.turn_after(k)) < SHARP or shape.bow(k) > STRAIGHT * shape.edges[k].chord:
        return {}
    before, after = piece.edges[k - 1], piece.edges[(k + 1) % count]
    meeting = _meeting(_going_on(before), _going_on(after.reversed)) if count > 4 else None
    if meeting is None:
        return {}
    return {
        (k - 1) % count: Chain(np.concatenate([before.points, meeting[0]])),
        (k + 1) % count: Chain(np.concatenate([meeting[1][::-1], after.points])),
    }


def _going_on(edge: Chain) -> Floats:
    """Points of an edge led on beyond its end, bent as it is before: its mirror image in the normal there."""
    reach = np.linspace(0.0, min(1.0, GONE[1] / edge.length), STEPS + 1)
    own = edge.at(1.0 - reach)
    along = own[0] - edge.at(np.array([max(0.0, 1.0 - AHEAD / edge.length)]))[0]
    along /= max(float(np.hypot(*along)), 1e-9)
    return np.asarray(own + 2.0 * np.outer((own[0] - own) @ along, along))


def _meeting(one: Floats, other: Floats) -> tuple[Floats, Floats] | None:
    """Of two lines what lies beyond their starts up to where they cross, as at an outer corner; None: they do not."""
    for n, (a, u) in enumerate(zip(one[:-1], np.diff(one, axis=0), strict=True)):
        for m, (b, v) in enumerate(zip(other[:-1], np.diff(other, axis=0), strict=True)):
            cross = float(u[0] * v[1] - u[1] * v[0])
            x, y = b - a
            at = ((x * v[1] - y * v[0]) / cross, (x * u[1] - y * u[0]) / cross) if abs(cross) > 1e-12 else (-1.0, -1.0)
            if not all(0.0 <= each < 1.0 for each in at):
                continue
            corner = [a + at[0] * u]
            runs = np.concatenate([one[1 : n + 1], corner]), np.concatenate([other[1 : m + 1], corner])
            far = min(float(np.hypot(*(corner[0] - line[0]))) for line in (one, other))
            angle = np.arctan2(-cross, -float(u @ v))  # by which the outline turns to the left
            return runs if far > GONE[0] and CORNER[0] < angle < CORNER[1] else None
    return None

"""What is marked along a piece's outline: the corners at which its edges end, and notches."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.dxf_drawn import CURVE, NOTCH, TURN, Drawn
from warp_cloth.pattern.loops import turns_of

CORNER = np.radians(35.0)  # turn that makes a corner where turn points do not state them
MARKED_CORNER = np.radians(60.0)  # and where the file calls the point one of a curve
SLIGHT, STANDS_OUT = np.radians(8.0), 3.0  # turn of a slighter one, and over the turns beside it in a curve
LONG, BENT = 0.05, np.radians(1.0)  # [m] of the sides of one that is still slighter, and its turn
RULED = 2.0  # times as long as a neighbouring side: a straight one
NEAR = 1.5e-3  # [m] from a mark to the outline that it belongs to
NOTCH_REACH = 0.03  # [m]: notches are on the cut line, and outlines may be sew lines
CUT_NOTCH = 0.012  # [m] from the middle of a notch to its corners
NO_POINTS = np.zeros((0, 2))

Marks = dict[int, Floats]  # points by layer [m], shape [N, 2]


def marks_of(drawn: Drawn, metres: float) -> Marks:
    """The marks of a piece as drawn; notches that are lines at their middles."""
    marks = {layer: metres * np.array(points) for layer, points in drawn.points.items() if points}
    lines = [metres * line.mean(axis=0)[None] for line in drawn.lines.get(NOTCH, [])]
    if lines:
        marks[NOTCH] = np.concatenate([marks.get(NOTCH, NO_POINTS), *lines])
    return {layer: marks[layer] for layer in (TURN, CURVE, NOTCH) if layer in marks}


def with_cut_notches(marks: Marks, notches: Floats) -> Marks:
    """Marks, with notches that were cut into the outline, shape [N, 2]; the corners of these are no turn points."""
    if not len(notches):
        return marks
    from scipy.spatial import cKDTree

    tree = cKDTree(notches)
    kept = {layer: points[tree.query(points)[0] > CUT_NOTCH] for layer, points in marks.items() if layer != NOTCH}
    own = marks.get(NOTCH, NO_POINTS)
    return kept | {NOTCH: np.concatenate([own[tree.query(own)[0] > CUT_NOTCH], notches]) if len(own) else notches}


def carried(marks: Marks, there: Floats, here: Floats) -> Marks:
    """The marks of a loop on the same loop in another size, which has as many points."""
    found = {}
    for layer, points in marks.items():
        apart, side, share = _nearest(points, there)
        near = apart <= (NOTCH_REACH if layer == NOTCH else NEAR)
        start, end = here[side[near]], here[(side[near] + 1) % len(here)]
        found[layer] = start + share[near, None] * (end - start)
    return found


def corners_of(loop: Floats, marks: Marks, ends: Floats) -> list[int]:
    """Points of a loop at which its edges end; ``ends``: where the lines that draw it do, shape [N, 2]."""
    turn = np.abs(turns_of(loop))
    curved = _marked(loop, marks.get(CURVE, NO_POINTS))
    stated = _marked(loop, marks.get(TURN, ends))
    if stated.sum() > max(12, 0.5 * len(loop)) and not curved.any():
        stated[:] = False  # all points are marked alike
    corner = stated | (turn > np.where(curved, MARKED_CORNER, CORNER))
    if not stated.any() and not curved.any():
        corner |= _slight_corners(loop, turn)
    found = np.flatnonzero(corner).tolist()
    if len(found) < 2:  # a disc, or a drop: parted where it turns most, and opposite
        first = found[0] if found else int(turn.argmax())
        reach = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(np.roll(loop, -first, axis=0), axis=0).T))])
        half = int(np.abs(reach - 0.5 * reach[-1]).argmin())
        found = sorted({first, (first + max(1, half)) % len(loop)})
    return found


def _slight_corners(loop: Floats, turn: Floats) -> NDArray[np.bool_]:
    """Points of a loop that turn less than a corner, and yet by far more than the curve that they would be of.

    Args:
        loop: shape [n, 2].
        turn: by how much it turns at each point [rad], shape [n].
    """
    ahead = np.hypot(*(np.roll(loop, -1, axis=0) - loop).T)  # the side from each point on
    behind = np.roll(ahead, 1)
    is_ruled = ahead > RULED * np.minimum(behind, np.roll(ahead, -1))
    bends = np.where(turn > CORNER, 0.0, turn)  # a curve ends at a corner
    after, before = np.where(is_ruled, 0.0, np.roll(bends, -1)), np.where(np.roll(is_ruled, 1), 0.0, np.roll(bends, 1))
    stands_out = turn > STANDS_OUT * np.maximum(after, before)
    is_long = np.minimum(ahead, behind) > LONG
    # of two sides alone between corners, as long as each other, a curve may have been drawn
    told = is_ruled | np.roll(is_ruled, 1) | (after > 0.0) | (before > 0.0) | is_long
    return np.asarray(stands_out & ((told & (turn > SLIGHT)) | (is_long & (turn > BENT))))


def notches_of(loop: Floats, marks: Marks) -> Floats:
    """Notches on the loop that they are near, shape [N, 2]."""
    points = marks.get(NOTCH, NO_POINTS)
    if not len(points):
        return NO_POINTS
    apart, side, share = _nearest(points, loop)
    near = apart <= NOTCH_REACH
    start, end = loop[side[near]], loop[(side[near] + 1) % len(loop)]
    return np.asarray(start + share[near, None] * (end - start))


def _marked(loop: Floats, marks: Floats) -> NDArray[np.bool_]:
    """Which points of a loop have a mark on them."""
    marked = np.zeros(len(loop), dtype=bool)
    if len(marks):
        from scipy.spatial import cKDTree

        apart, nearest = cKDTree(loop).query(marks)
        marked[nearest[apart <= NEAR]] = True
    return marked


def _nearest(points: Floats, loop: Floats) -> tuple[Floats, NDArray[np.int64], Floats]:
    """How far points are from a loop [m], the side that is nearest, and how far along it; shape [N] each."""
    along = np.roll(loop, -1, axis=0) - loop
    square = np.maximum((along**2).sum(axis=1), 1e-300)
    apart, side, at = np.empty(len(points)), np.zeros(len(points), dtype=np.int64), np.empty(len(points))
    for k, point in enumerate(points):
        share = np.clip(((point - loop) * along).sum(axis=1) / square, 0.0, 1.0)
        away = np.hypot(*(loop + share[:, None] * along - point).T)
        side[k] = int(away.argmin())
        apart[k], at[k] = away[side[k]], share[side[k]]
    return apart, side, at

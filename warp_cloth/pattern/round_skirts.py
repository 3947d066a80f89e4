"""Skirts cut as parts of a ring: which of their edges are waist, hem and sides, and which way is up.

A half or quarter circle has no top and bottom across the grain: its waist is what is hollow, all its way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.loops import turns_of
from warp_cloth.pattern.roles import BENT, UPWARDS, Roles, Shape

LEAST_TURN = np.radians(75.0)  # of a waist's arc; less is a skirt that hangs as drawn, its waist a little hollow
ALIKE_TURN = 0.7  # of the waist's turn, that its hem has at least
PLUMB = 0.05  # across over along the grain, of half a front's straight centre


@dataclass(frozen=True, eq=False)
class Ring:
    """A piece that is part of a ring: its edges by role, and the way from the hem up to the waist, shape [2]."""

    roles: Roles
    up: Floats


def ring_of(edges: Sequence[Chain], half: bool) -> Ring | None:
    """A piece as part of a ring, if its waist turns far enough; ``half``: of a front or back, with a centre."""
    shape = Shape(tuple(edges), UPWARDS)
    order, count = shape.order, len(shape.order)
    turns = {k: _turn(edges[k]) for k in order}
    firsts = [n for n in range(count) if abs(shape.turn_after(order[n - 1])) > BENT]
    runs = [shape.run(first, firsts[(n + 1) % len(firsts)]) for n, first in enumerate(firsts)]
    if len(runs) != 4:
        return None
    total = [sum(turns[k] for k in run) for run in runs]
    waist = int(np.argmin(total))
    sides = [runs[(waist + n) % 4] for n in (1, 2, 3)]
    hem = total[(waist + 2) % 4]
    if total[waist] > -LEAST_TURN or hem < -ALIKE_TURN * total[waist]:
        return None
    down, low, rise = sides  # counter-clockwise: from the waist down the side at -x, along the hem, and up
    if not all(shape.is_straight(k) for k in (*down, *rise)):
        return None
    up = _middle(edges, runs[waist]) - _middle(edges, low)
    ends = {"waist": runs[waist], "hem": low}
    if not half:
        return Ring(ends | {"side-": down, "side+": rise}, up / np.linalg.norm(up))
    if _is_plumb(edges, down) == _is_plumb(edges, rise):
        return None
    centre, side, mark = (down, rise, "+") if _is_plumb(edges, down) else (rise, down, "-")
    return Ring(ends | {"centre": centre, f"side{mark}": side}, np.array([0.0, np.sign(up[1])]))


def _turn(edge: Chain) -> float:
    """How far an edge turns to the left on its way [rad]."""
    return float(turns_of(edge.points)[1:-1].sum())


def _middle(edges: Sequence[Chain], run: Sequence[int]) -> Floats:
    middles = [edges[k].at(np.array([0.5]))[0] for k in run]
    return np.asarray(np.average(middles, axis=0, weights=[edges[k].length for k in run]))


def _is_plumb(edges: Sequence[Chain], run: Sequence[int]) -> bool:
    """Whether a run goes straight along the grain, as a front's centre does."""
    across, along = np.abs(edges[run[-1]].end - edges[run[0]].start)
    return bool(across < PLUMB * along)

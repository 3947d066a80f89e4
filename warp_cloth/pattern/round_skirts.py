"""Skirts cut as parts of a ring: which of their edges are waist, hem and sides, and which way is up.

A half or quarter circle has no top and bottom across the grain: its waist is what is hollow, all its way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.roles import BENT, Roles, Shape

LEAST_TURN = np.radians(75.0)  # of a waist's arc; less is a skirt that hangs as drawn, its waist a little hollow
ALIKE_TURN = 0.7  # of the waist's turn, that its hem has at least
UPWARDS = np.array([0.0, 1.0])
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
    if half:
        plumb = {mark: _direction(edges, run) for mark, run in (("-", down), ("+", rise))}
        centre = [mark for mark, way in plumb.items() if abs(way[0]) < PLUMB * abs(way[1])]
        if len(centre) != 1:
            return None
        side = "-" if centre[0] == "+" else "+"
        named = {"-": down, "+": rise}
        up = np.array([0.0, np.sign(up[1])])
        return Ring(ends | {"centre": named[centre[0]], f"side{side}": named[side]}, up)
    return Ring(ends | {"side-": down, "side+": rise}, up / np.linalg.norm(up))


def _turn(edge: Chain) -> float:
    """How far an edge turns to the left on its way [rad]."""
    steps = np.diff(edge.points, axis=0)
    a, b = steps[:-1], steps[1:]
    return float(np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1)).sum())


def _middle(edges: Sequence[Chain], run: Sequence[int]) -> Floats:
    middles = [edges[k].at(np.array([0.5]))[0] for k in run]
    return np.asarray(np.average(middles, axis=0, weights=[edges[k].length for k in run]))


def _direction(edges: Sequence[Chain], run: Sequence[int]) -> Floats:
    return np.asarray(edges[run[-1]].end - edges[run[0]].start)

"""Fronts and backs of garments without a bodice that end between the legs: briefs, bikini bottoms.

Their two slanting edges, as a rule hollow, are openings for legs, where a bodice has armholes: what tells is the short
edge in the middle between them, the crotch, and across from it one edge, the waist, with no neck and no shoulders.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.kinds import plain
from warp_cloth.pattern.leg_openings import CROTCH_UP_TO, REACH
from warp_cloth.pattern.panel_roles import smooth_runs
from warp_cloth.pattern.piece import Piece
from warp_cloth.pattern.roles import UPWARDS, Roles, Shape

# [m] of a crotch that its length alone tells; a halter top may be wider between its armholes, as nappies are there
SURE_UP_TO = 0.12
NARROW = 0.5  # crotch over width, at most
ALIKE = 0.03  # relative difference of the crotches of front and back
LEVEL, PLUMB = 0.25, 0.05  # rise over run of a crotch, and across over along of the middle of a half
DOUBTED = 0.7  # factor on how sure the kind is, so that nothing of it is sewn unasked
# Words for such garments that mean no other: a "slip" is also a petticoat, a "culotte" also a skirt
WORDS = (
    r"\bbriefs?\b|\bpant(y|ies)\b|\bthong\b|knickers|unterhose|\bbragas?\b|\bmutand|\bcalcinha|\bmajtk"
    r"|трус|内裤|內褲|三角裤|ショーツ|\bnappy\b|\bnappies\b|\bdiaper"
)


@dataclass(frozen=True, eq=False)
class Brief:
    """A piece that ends between the legs: its edges by role, and the way from its crotch up to its waist, shape [2]."""

    roles: Roles
    up: Floats
    crotch: float  # length in the whole garment [m]
    is_hollow: bool  # its openings for legs are cut out, as a back's that covers more may not be


def brief_of(edges: Sequence[Chain], mirror: Sequence[int] | None) -> Brief | None:
    """A piece as the front or back of briefs, whole or half, if it has the shape of one.

    Args:
        edges: its outline, counter-clockwise, its grain along y.
        mirror: as Piece's.
    """
    shape = Shape(tuple(edges), UPWARDS)
    count = len(shape.order)
    firsts = [n for n in range(count) if len(smooth_runs(shape, (shape.order[n - 1], shape.order[n]))) == 2]
    runs = [shape.run(first, firsts[(n + 1) % len(firsts)]) for n, first in enumerate(firsts)]
    found = []
    for n in range(len(runs)) if len(runs) in (5, 6, 7) else ():
        brief = _from(shape, [*runs[n:], *runs[:n]], mirror)
        found += [brief] if brief is not None else []
    return found[0] if len(found) == 1 else None


def _from(shape: Shape, runs: Sequence[tuple[int, ...]], mirror: Sequence[int] | None) -> Brief | None:
    """A brief whose crotch is the first of these runs from corner to corner, as the loop goes; None: it is none."""
    crotch = runs[0]
    if mirror is not None:  # crotch, leg, side, waist (which may have a corner in its middle), side, leg
        if {mirror[k] for k in crotch} != {*crotch} or len(runs) < 6:
            return None
        (right, up), (down, left) = runs[1:3], runs[-2:]
        waist = tuple(k for run in runs[3:-2] for k in run)
        sides: Roles = {"side+": up, "side-": down, "leg+": right, "leg-": left}
    elif len(runs) != 5:
        return None
    elif _is_plumb(shape, runs[4]):  # its middle comes down to the crotch: at -x, if that is its lower end
        right, up, waist, centre = runs[1:]
        sides = {"side+": up, "leg+": right, "centre": centre}
    elif _is_plumb(shape, runs[1]):
        centre, waist, down, left = runs[1:]
        sides = {"side-": down, "leg-": left, "centre": centre}
    else:
        return None
    across, along = np.abs(_chord(shape, crotch))
    width = float(np.ptp(np.array(shape.box), axis=0)[0])
    if along > LEVEL * across or not shape.length(crotch) < NARROW * min(width, shape.length(waist)):
        return None
    legs, others = ([run for role, run in sides.items() if (role[:3] == "leg") is wanted] for wanted in (True, False))
    if min(abs(float(_chord(shape, run)[0])) for run in legs) < REACH:
        return None
    if any(shape.is_concave(k) for run in others for k in run):
        return None
    hollow = all(any(shape.is_concave(k) for k in run) for run in legs)
    rise = float(np.mean([shape.middle(k)[1] for k in waist]) - np.mean([shape.middle(k)[1] for k in crotch]))
    whole = shape.length(crotch) * (1.0 if mirror is not None else 2.0)
    if whole > CROTCH_UP_TO:
        return None
    return Brief({"crotch": crotch, "waist": waist} | sides, np.array([0.0, np.sign(rise)]), whole, hollow)


def _chord(shape: Shape, run: Sequence[int]) -> Floats:
    return np.asarray(sum(shape.chord(k) for k in run))


def _is_plumb(shape: Shape, run: Sequence[int]) -> bool:
    across, along = np.abs(_chord(shape, run))
    return all(shape.is_straight(k) for k in run) and bool(across < PLUMB * along)


def briefs_sure(fronts: Sequence[Piece], backs: Sequence[Piece]) -> float | None:
    """How sure it is that these pieces are of briefs; None: none of them looks as if.

    It is where front and back both have the shape, with crotches of one length, which is short, or a name says so.
    """
    found = [[brief_of(piece.edges, piece.mirror) for piece in pieces] for pieces in (fronts, backs)]
    crotches = [[each.crotch for each in briefs if each is not None] for briefs in found]
    if not any(each.is_hollow for briefs in found for each in briefs if each is not None):
        return None
    if any(len(each) != len(briefs) or not briefs for each, briefs in zip(crotches, found, strict=True)):
        return DOUBTED
    least, most = min(map(min, crotches)), max(map(max, crotches))
    is_named = any(re.search(WORDS, plain(piece.name)) for piece in (*fronts, *backs))
    is_short = most <= SURE_UP_TO or is_named
    return 1.0 if is_short and most <= (1.0 + ALIKE) * least else DOUBTED

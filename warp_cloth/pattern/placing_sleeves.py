"""Sleeves of one piece and of two laid round the arms."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warp_cloth.base.curves import arc_lengths
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.figure import UP, Figure
from warp_cloth.pattern.kinds import BOTH, HALF_SLEEVES, LEFT
from warp_cloth.pattern.levels import WHOLE_TURN, spans
from warp_cloth.pattern.lower_sleeves import LOWER_SLEEVE
from warp_cloth.pattern.sleeves import sleeve_side, under_sleeve_of
from warp_cloth.pattern.wrap import Wrap

SLEEVES = ("sleeve", *HALF_SLEEVES)
FROM_ARMPIT = 0.015  # [m] from where the arm leaves the trunk to a sleeve's underarm point
# [m] of a sleeve's underarm, from which the end of a shorter one starts as far out: it would be drawn into the bodice
# with its cap, which is longer than all else of it, before that is sewn in
OUTSIDE = 0.16


def sleeve(parts: Sequence[Part], index: int, figure: Figure) -> Wrap:
    under = under_sleeve_of(parts, index)
    share = 1.0 if under is None else _share(parts[index], parts[under[0]])
    side = sleeve_side(parts, index)
    return _round_arm(parts, index, figure, side, share, top_of_arm(figure, side))


def under_sleeve(parts: Sequence[Part], index: int, figure: Figure) -> Wrap | None:
    for sleeve in (each for each, part in enumerate(parts) if part.kind == "sleeve"):
        under = under_sleeve_of(parts, sleeve)
        if under is not None and under[0] == index:
            share = 1.0 - _share(parts[sleeve], parts[index])
            side = sleeve_side(parts, sleeve)
            return _round_arm(parts, index, figure, side, share, -top_of_arm(figure, side))
    return None


def half_sleeve(parts: Sequence[Part], index: int, figure: Figure) -> Wrap | None:
    """Round the front or the back of the arm."""
    part = parts[index]
    if part.side == BOTH or not part.roles:
        return None
    face = figure.forward if part.kind == "front_sleeve" else -figure.forward
    return _round_arm(parts, index, figure, part.side, 0.5, face)


def lower_sleeve(parts: Sequence[Part], index: int, figure: Figure) -> Wrap:
    """Round the arm below the upper piece."""
    side = sleeve_side(parts, index)
    return _round_arm(parts, index, figure, side, 1.0, top_of_arm(figure, side), _longest(parts, SLEEVES))


def _share(upper: Part, under: Part) -> float:
    """How much of the arm an upper sleeve covers."""
    widths = [part.shape.width(0.5) for part in (upper, under)]
    return float(np.clip(widths[0] / max(sum(widths), 1e-6), 0.2, 0.8))


def _round_arm(
    parts: Sequence[Part], index: int, figure: Figure, side: int, share: float, face: Floats, above: float = 0.0
) -> Wrap:
    """Round a share of the arm, its middle on the side that ``face`` points to; ``above``: length of what is above."""
    part = parts[index]
    under = underarm(part)
    levels, least, most = spans(part, under)
    below = levels <= under
    at_armpit = max(int(below.sum()) - 1, 0)
    width = np.where(below, most - least, (most - least)[at_armpit])
    centre = np.where(below, 0.5 * (least + most), 0.5 * (least + most)[at_armpit])
    distance = (above + under - levels) * np.where(levels < above + under, shortened(parts, figure), 1.0)
    farther = max(OUTSIDE - (above or under - float(levels[0])), 0.0)
    origin, toward = along_limb(figure.arms[1 if side == LEFT else 0], distance + FROM_ARMPIT + farther)
    across, outward = around_arm(toward, face)
    bend = share * WHOLE_TURN / np.maximum(width, 0.04)
    return Wrap(part.up, levels, centre, bend, origin + outward / bend[:, None], across, outward)


def underarm(part: Part) -> float:
    """The level of a sleeve's underarm point."""
    cap, turned = part.roles.get("cap", ()), part.shape.turned
    return float(min(turned[cap[0]].start[1], turned[cap[-1]].end[1]) if cap else part.shape.box[1][1])


def shortened(parts: Sequence[Part], figure: Figure) -> float:
    """How much shorter sleeves and cuffs start than they are, so that they end above the hand."""
    long = length_to_hem(parts)
    cuff = max(
        (float(min(each.shape.box[1] - each.shape.box[0])) for each in parts if each.kind == "cuff"), default=0.0
    )
    return min(1.0, (figure.to_wrist - FROM_ARMPIT) / max(long + cuff, 1e-3))


def length_to_hem(parts: Sequence[Part]) -> float:
    """How long sleeves are below the arm [m], with their lower pieces."""
    return _longest(parts, SLEEVES) + _longest(parts, (LOWER_SLEEVE,))


def _longest(parts: Sequence[Part], kinds: Sequence[str]) -> float:
    return max((underarm(each) - float(each.shape.box[0][1]) for each in parts if each.kind in kinds), default=0.0)


def top_of_arm(figure: Figure, side: int) -> Floats:
    """Which way the top of an arm faces, as it is held aside."""
    return UP + side * figure.left


def around_arm(toward: Floats, face: Floats) -> tuple[Floats, Floats]:
    """Directions across a sleeve, seen from outside, and outwards, where ``face`` points; shape [L, 3] each.

    Args:
        toward: along the arm, shape [L, 3].
        face: shape [3].
    """
    outward = face - toward * (toward @ face)[:, None]
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    return np.cross(-toward, outward), outward


def along_limb(curve: Floats, distance: Floats) -> tuple[Floats, Floats]:
    """Points of a limb at distances from where it begins [m], and its direction there; straight on beyond its ends."""
    reached = arc_lengths(curve)
    ends = [0.0, *np.unique(np.clip(np.arange(0.05, reached[-1], 0.05), 0.0, reached[-1])), reached[-1]]
    spots = np.stack([np.interp(ends, reached, curve[:, axis]) for axis in range(3)], axis=1)
    near = spots[min(3, len(spots) - 1)]
    first = (near - spots[0]) / max(float(np.linalg.norm(near - spots[0])), 1e-9)
    last = (spots[-1] - spots[-2]) / max(float(np.linalg.norm(spots[-1] - spots[-2])), 1e-9)
    points = np.stack([np.interp(distance, ends, spots[:, axis]) for axis in range(3)], axis=1)
    points += np.minimum(distance, 0.0)[:, None] * first + np.maximum(distance - reached[-1], 0.0)[:, None] * last
    straight = (spots[-1] - spots[0]) / max(float(np.linalg.norm(spots[-1] - spots[0])), 1e-9)
    return points, np.tile(straight, (len(distance), 1))

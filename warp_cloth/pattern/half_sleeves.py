"""Sleeves of a front and a back half, as a specification's seams tell them: each laid round half of the arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.figure import Figure
from warp_cloth.pattern.joints import Joint
from warp_cloth.pattern.kinds import BOTH, LEFT, RIGHT
from warp_cloth.pattern.levels import spans
from warp_cloth.pattern.placing_sleeves import FROM_ARMPIT, along_limb
from warp_cloth.pattern.wrap import Laid, Wrap

HALF_TURN = 0.97 * np.pi
LEAST_WIDTH = 0.04  # [m]


@dataclass(frozen=True)
class _Half:
    """A half of a sleeve: its edges at the armhole, and where that is."""

    cap: tuple[int, ...]
    is_front: bool
    side: int


def half_sleeves(
    parts: Sequence[Part], joints: Sequence[Joint], wraps: Sequence[Laid], figure: Figure
) -> dict[int, Laid]:
    """Where those unknown parts start that are halves of sleeves: round the arms.

    Such a part is sewn to one front or back, on one side of it, and along the two edges next to that seam to another
    such part.
    """
    halves = {index: half for index in range(len(parts)) if (half := _half(parts, joints, wraps, figure, index))}
    mates = {index: _mates(joints, index) & {*halves} for index in halves}
    pairs = {index for index, mate in mates.items() if len(mate) == 1 and mates[next(iter(mate))] == {index}}
    out: dict[int, Laid] = {}
    for index in sorted(pairs):
        half, other = halves[index], halves[next(iter(mates[index]))]
        if half.side == other.side and half.is_front != other.is_front:
            out[index] = _round_half_arm(parts[index], half, figure)
    return out


def _mates(joints: Sequence[Joint], index: int) -> set[int]:
    """Parts that one is sewn to by two joints or more."""
    met = [
        there.panel
        for joint in joints
        for mine, theirs in ((joint.one, joint.other), (joint.other, joint.one))
        for here, there in zip(mine, theirs, strict=False)
        if here.panel == index != there.panel
    ]
    return {each for each in met if met.count(each) > 1}


def _half(
    parts: Sequence[Part], joints: Sequence[Joint], wraps: Sequence[Laid], figure: Figure, index: int
) -> _Half | None:
    if parts[index].roles:
        return None
    cap: set[int] = set()
    faces: set[str] = set()
    spots: list[Floats] = []
    for joint in joints:
        for mine, theirs in ((joint.one, joint.other), (joint.other, joint.one)):
            kinds = {parts[side.panel].kind for side in theirs}
            if {side.panel for side in mine} == {index} and kinds <= {"front", "back"}:
                cap |= {side.edge for side in mine}
                faces |= kinds
                spots += [
                    wraps[side.panel].placed(parts[side.panel].edges[side.edge].at(np.array([0.5]))) for side in theirs
                ]
    if len(faces) != 1 or len(cap) == len(parts[index].edges):
        return None
    aside = float((np.concatenate(spots).mean(axis=0) - figure.middle) @ figure.left)
    return _Half(tuple(sorted(cap)), faces == {"front"}, LEFT if aside > 0.0 else RIGHT if aside < 0.0 else BOTH)


def _round_half_arm(part: Part, half: _Half, figure: Figure) -> Wrap:
    """Round the front or the back of the arm, its cap at the shoulder."""
    count = len(part.edges)
    beside = {(k + step) % count for k in half.cap for step in (-1, 1)} - {*half.cap}
    lean = np.zeros(2)
    for k in beside:  # the seams along the arm, both from the hem to the cap
        edge = part.edges[k]
        lean += edge.end - edge.start if (k + 1) % count in half.cap else edge.start - edge.end
    up = lean / max(float(np.hypot(*lean)), 1e-9)
    upright = replace(part, up=up)
    inward = -1.0 if half.is_front == (half.side == LEFT) else 1.0  # which way across it the underarm is
    turned = upright.shape.turned
    under = float(max((point for k in half.cap for point in (turned[k].start, turned[k].end)),
                      key=lambda point: inward * float(point[0]))[1])  # fmt: skip
    levels, least, most = spans(upright, under)
    below = levels <= under
    at_armpit = max(int(below.sum()) - 1, 0)
    width = np.where(below, most - least, (most - least)[at_armpit])
    centre = np.where(below, 0.5 * (least + most), 0.5 * (least + most)[at_armpit])
    share = min(1.0, (figure.to_wrist - FROM_ARMPIT) / max(under - float(levels[0]), 1e-3))
    distance = (under - levels) * np.where(levels < under, share, 1.0)
    origin, toward = along_limb(figure.arms[1 if half.side == LEFT else 0], distance + FROM_ARMPIT)
    face = figure.forward if half.is_front else -figure.forward
    outward = face - toward * (toward @ face)[:, None]
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    bend = HALF_TURN / np.maximum(width, LEAST_WIDTH)
    return Wrap(up, levels, centre, bend, origin + outward / bend[:, None], np.cross(-toward, outward), outward)

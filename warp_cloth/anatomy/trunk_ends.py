"""How high a trunk is: its crotch, and the roots of its arms as if they hung, by three witnesses.

A hat, heels, a bent head or a crown that a scan lacks make the stature wrong; holes in the armpits, noise and loose
clothes the arms' roots; a beard, a double chin or a cut the neck. The middle one of three is right where one is wrong.
"""

from __future__ import annotations

import numpy as np

from warp_cloth.anatomy.levels import LevelAt
from warp_cloth.anatomy.skeleton import LEFT_LEG, RIGHT_LEG, Skeleton
from warp_cloth.anatomy.stance import Stance
from warp_cloth.base.mesh import Points

# An arm that is raised takes its root with it: how far, of the trunk's length (RISE), by its degrees below the
# horizontal (FALL). Of two bodies in five poses each the roots are then within 1 % of the trunk's length of one height.
FALL, RISE = (-60.0, 0.0, 45.0, 75.0), (0.1, 0.08, 0.03, 0.0)
OF_STATURE = 0.765  # roots of hanging arms above the floor: 0.74 to 0.78 in people
OF_NECK = 0.745  # the same above the crotch, of the height of the neck's narrowest section: 0.72 to 0.79
# Of the way from the crotch to the head's root: where the neck is looked for, and at how many levels.
NECK, NECK_LEVELS = (0.82, 1.1), 15

HEAD_HIGH = 0.13  # of the stature, from the neck's narrowest section to the crown: more in most people
HEAD_LEVELS = 12  # between these
HEAD_WIDER = 1.2  # level girth of a head over the tape round its neck, at least: 1.29 in the heaviest


def trunk_ends(
    skeleton: Skeleton, stance: Stance, at: LevelAt, up: Points, floor: float, stature: float, crotch: float | None
) -> tuple[float, float]:
    """Heights along the unit vector ``up`` of a trunk's crotch and of its arms' roots if they hung [m].

    Args:
        skeleton: of the body.
        stance: of the body.
        at: the trunk's level at a height.
        up: shape [3].
        floor: height that its feet would stand on [m].
        stature: of the body, which may be wrong [m].
        crotch: its height, where that is known [m].
    """
    roots = [float(curve[joint] @ up) for curve, joint in zip(skeleton.curves, skeleton.joints, strict=True)]
    low = 0.5 * (roots[RIGHT_LEG] + roots[LEFT_LEG]) if crotch is None else crotch
    by_arms = low + 0.5 * sum((roots[arm.number] - low) * (1.0 - _rise(arm.upper, up)) for arm in stance.arms)
    neck = _neck(at, low, float(skeleton.spine[-1] @ up))
    if neck is None:
        return low, by_arms
    return low, sorted((by_arms, floor + OF_STATURE * stature, low + OF_NECK * (neck - low)))[1]


def _rise(arm: Points, up: Points) -> float:
    """How much of the trunk's length the root of an upper arm is higher than of one that hangs."""
    fall = np.degrees(np.arcsin(np.clip(-arm @ up, -1.0, 1.0)))
    return float(np.interp(fall, FALL, RISE))


def _neck(at: LevelAt, crotch: float, head: float) -> float | None:
    """The height of the neck's narrowest section [m]; None: none is narrower than both those below and above it."""
    heights = crotch + np.linspace(*NECK, NECK_LEVELS) * (head - crotch)
    levels = [at(float(height)) for height in heights]
    girths = [np.inf if level is None else level.girth for level in levels]
    narrowest = int(np.argmin(girths))
    return float(heights[narrowest]) if 0 < narrowest < len(heights) - 1 else None


def lacks_head(at: LevelAt, neck: float, crown: float, stature: float, tape: float) -> bool:
    """Whether little is above a neck, and nowhere much wider than it, as on a dress form.

    Args:
        at: the section of trunk or head at a height.
        neck: height of the neck's narrowest section [m].
        crown: height of the top [m].
        stature: of the body [m].
        tape: round the neck [m].
    """
    if crown - neck > HEAD_HIGH * stature:
        return False
    sections = [at(float(height)) for height in np.linspace(neck, crown, HEAD_LEVELS, endpoint=False)[1:]]
    return max((each.girth for each in sections if each is not None), default=0.0) < HEAD_WIDER * tape

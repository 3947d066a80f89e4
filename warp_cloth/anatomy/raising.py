"""Limbs that hang, raised clear of the trunk and each other, for cloth to be laid round them: they come home last."""

from __future__ import annotations

import numpy as np

from warp_cloth.anatomy.openings import ARMS
from warp_cloth.anatomy.skeleton import Skeleton, outward_of
from warp_cloth.base.curves import arc_lengths
from warp_cloth.base.mesh import Points

# From down, of upper arms that come home last: sleeveless cloth lies on the shoulders then. 45 in an A-pose.
ARMS_AWAY = np.radians(42.0)
RAISED = 0.7  # cosine between a thigh and down, below which it is raised: 45 degrees
LEGS_AWAY = np.radians(25.0)  # from down, of thighs that come home last


def raised_limb(skeleton: Skeleton, limb: int) -> Points | None:
    """The curve of an arm or a leg, turned out where it leaves the trunk until its upper half is that far from down.

    None: the limb does not hang. Points [m], shape [N, 3], as the limb's curve.
    """
    angle = ARMS_AWAY if limb in ARMS else LEGS_AWAY
    curve, joint = skeleton.curves[limb], skeleton.joints[limb]
    upper = curve[joint : joint + (len(curve) - joint) // 2]
    way, outward = upper[-1] - upper[0], outward_of(skeleton, limb)
    turn = angle - float(np.arctan2(way @ outward, -way @ skeleton.up))
    if not 0.0 < turn < 2.0 * angle:  # a raised arm may lie beyond the vertical, seen from the front
        return None
    off = curve[joint:] - curve[joint]
    across, along = off @ outward, off @ skeleton.up
    aside = (np.cos(turn) - 1.0) * across - np.sin(turn) * along
    above = np.sin(turn) * across + (np.cos(turn) - 1.0) * along
    raised = curve[joint:] + aside[:, None] * outward + above[:, None] * skeleton.up
    return np.asarray(np.vstack([curve[:joint], raised]))


def standing_leg(skeleton: Skeleton, leg: int) -> Points | None:
    """The curve of a leg that is raised to the front, as it sits or steps up, straight down instead and as far out.

    None: its thigh points down. Points [m], shape [N, 3], as the limb's curve.
    """
    curve, joint = skeleton.curves[leg], skeleton.joints[leg]
    way = curve[joint + (len(curve) - joint) // 2] - curve[joint]
    if float(way @ -skeleton.up) > RAISED * float(np.linalg.norm(way)):
        return None
    down = np.sin(LEGS_AWAY) * outward_of(skeleton, leg) - np.cos(LEGS_AWAY) * skeleton.up
    below = arc_lengths(curve[joint:])[1:, None] * down
    return np.asarray(np.vstack([curve[: joint + 1], curve[joint] + below]))

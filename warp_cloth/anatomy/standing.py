"""Garments that were placed for one who stands, moved with the trunk of a body that sits, strides or bows."""

from __future__ import annotations

import numpy as np

from warp_cloth.anatomy.skeleton import Skeleton
from warp_cloth.anatomy.stance import stance_of
from warp_cloth.base.curves import arc_lengths
from warp_cloth.base.mesh import Points

ANKLE = 0.032  # of the span, above the floor: 0.027 to 0.038 in people of any age and weight
TOES = 0.003  # of the span, that the toes' middle is above the floor
LOWERED = 0.03  # of the span, that the hips are lower than in one who stands, at least: 6 cm; 2 cm in one who walks
LEANS = 15.0  # degrees that the trunk leans, at least; 5 in those who stand upright


def moved_from_standing(points: Points, skeleton: Skeleton) -> Points | None:
    """Points round a standing body [m], shape [V, 3], moved as its trunk is; None: it stands as they want."""
    stance = stance_of(skeleton)
    vertical, hips = stance.vertical, skeleton.spine[0]
    floor = min(float((leg.curve @ vertical).min()) for leg in stance.legs) - TOES * skeleton.span
    legs = max(float(arc_lengths(leg.curve[leg.end :])[-1]) for leg in stance.legs)
    lowered = legs + ANKLE * skeleton.span - (float(hips @ vertical) - floor)
    is_lower, leans = lowered > LOWERED * skeleton.span, stance.trunk_lean > LEANS
    if not is_lower and not leans:
        return None
    moved = points - vertical * (lowered if is_lower else 0.0)
    if not leans:
        return moved
    turned: Points = hips + (moved - hips) @ _rotation(vertical, skeleton.up).T
    return turned


def _rotation(before: Points, after: Points) -> Points:
    """The smallest rotation that takes one unit vector to another that is not opposite, shape [3, 3]."""
    x, y, z = np.cross(before, after)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    rotation: Points = np.eye(3) + cross + cross @ cross / (1.0 + float(before @ after))
    return rotation

"""Which part of a body cloth lies on, in words."""

from __future__ import annotations

import numpy as np

from warp_cloth.anatomy.geodesics import nearest_points
from warp_cloth.anatomy.openings import ARMS, LEGS
from warp_cloth.anatomy.skeleton import ANKLE, HEAD, TRUNK, WRIST, Skeleton
from warp_cloth.base.curves import arc_lengths
from warp_cloth.base.mesh import Points

# Lowest height of each part of a standing body of which no limbs can be identified, of its own.
HEIGHTS = {"neck and shoulders": 0.82, "chest": 0.68, "waist": 0.57, "hip": 0.42, "legs": -np.inf}
# Where each part of a trunk begins, of the way from the hips to the shoulders; a face is the trunk's in many bodies.
TRUNK_PARTS = {"head": 1.22, "neck and shoulders": 0.95, "chest": 0.62, "waist": 0.3, "hip": -np.inf}
ENDS = {**dict.fromkeys(ARMS, ("hand", "hands", WRIST)), **dict.fromkeys(LEGS, ("foot", "feet", ANKLE))}
ONE_SIDE = 0.8  # of what lies on arms, hands, legs or feet, from which on it is said of one of them


def part_under(points: Points, skeleton: Skeleton) -> str:
    """The part of a person that most of these points are nearest to, with its side; ``points`` [m], shape [N, 3]."""
    own = np.flatnonzero(skeleton.own)
    nearest = own[nearest_points(skeleton.skin[own], points)]
    limbs, stations = skeleton.limb[nearest], skeleton.station[nearest]
    kinds = {"head": limbs == HEAD, "trunk": limbs == TRUNK}
    for one, many, pair in (("arm", "arms", ARMS), ("leg", "legs", LEGS)):
        length = np.array([arc_lengths(skeleton.curves[limb])[-1] for limb in range(TRUNK)] + [np.inf])[limbs]
        end_one, end_many, reach = ENDS[pair[0]]
        is_end = (1.0 - stations) * length < reach * skeleton.span
        of_pair = np.isin(limbs, pair)
        for name, several, which in ((end_one, end_many, of_pair & is_end), (one, many, of_pair & ~is_end)):
            right = np.count_nonzero(which & (limbs == pair[0]))
            side = max(right, np.count_nonzero(which) - right) >= ONE_SIDE * np.count_nonzero(which)
            kinds[f"{'right' if 2 * right > np.count_nonzero(which) else 'left'} {name}" if side else several] = which
    most = max(kinds, key=lambda name: int(np.count_nonzero(kinds[name])))
    if most != "trunk":
        return most
    axis = skeleton.shoulders - skeleton.spine[0]
    along = float(np.median((points[kinds["trunk"]] - skeleton.spine[0]) @ axis / (axis @ axis)))
    return next(name for name, lowest in TRUNK_PARTS.items() if along > lowest)


def part_at_height(height: float) -> str:
    """The part of a standing body at a height, of its own."""
    return next(name for name, lowest in HEIGHTS.items() if height > lowest)

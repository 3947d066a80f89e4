"""Cloth that a limb meets on its way home without being its sleeve: a wide skirt, the side of a dress."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warp_cloth.anatomy.geodesics import nearest_points
from warp_cloth.anatomy.linking import Wearing
from warp_cloth.anatomy.openings import ARMS, LEGS
from warp_cloth.base.mesh import Indices, Points

BEYOND_SLEEVE = 0.3  # [m] from an arm's opening; cloth farther off that the arm meets is no sleeve
HAND = 0.1  # [m] from a limb's curve: cloth that the limb would come upon
# [m] that a limb may move at once, where it meets cloth. Arms that came down in twelve steps onto a wide skirt left
# 454 and 1,970 crossing faces in it, in steps of 2 cm there 8 and 44, of 1 cm none.
STEP = 0.01


def loose_cloth(wearing: Wearing) -> list[Indices]:
    """The triangles that each limb may meet: of an arm, those far from its opening and nearer to the hem.

    Of a leg all, where it has no opening of its own.
    """
    triangles, distances = wearing.triangles, wearing.distances()
    count = len(wearing.start)
    to_hem = next((each for limbs, each in distances.items() if set(LEGS) <= set(limbs)), np.zeros(count))
    far = np.full(count, np.inf)
    to_arm = [np.min([far, *(each for limbs, each in distances.items() if arm in limbs)], axis=0) for arm in ARMS]
    none = triangles[:0]
    arms = [triangles[((near > BEYOND_SLEEVE) & (near > to_hem))[triangles].all(axis=1)] for near in to_arm]
    return [none, *arms, *(none if (leg,) in wearing.limbs else triangles for leg in LEGS)]


def met(loose: Sequence[Indices], points: Points, before: Sequence[Points], after: Sequence[Points]) -> float:
    """How far limbs move between these curves where they come upon loose cloth of the garment at ``points`` [m].

    ``loose``: the vertices that each limb may meet.
    """
    farthest = 0.0
    for limb, vertices in enumerate(loose):
        moves = np.linalg.norm(after[limb] - before[limb], axis=1)
        if not len(vertices) or float(moves.max()) <= STEP:
            continue
        reach, middles = HAND + 0.5 * moves, 0.5 * (before[limb] + after[limb])
        low, high = middles.min(axis=0) - reach.max(), middles.max(axis=0) + reach.max()
        cloth = points[vertices]
        cloth = cloth[((cloth > low) & (cloth < high)).all(axis=1)]  # that anything of the limb can reach
        if not len(cloth):
            continue
        away = np.linalg.norm(cloth[nearest_points(cloth, middles)] - middles, axis=1)
        farthest = max(farthest, float(moves[away < reach].max(initial=0.0)))
    return farthest

"""Wide skirts closed before they are sewn, as they start above the arms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.anatomy.linking import Wearing
from warp_cloth.anatomy.openings import ARMS, LEGS
from warp_cloth.base.mesh import Points

HALF_CIRCLE = np.radians(90.0)  # of a fan, from down to one side
CLOSED = np.radians(65.0)  # the same once it is closed
ROUND = 0.2  # spread of a round hem's distance from its centre, over their mean


def skirt_closed(wearing: Wearing, points: Points) -> Points:
    """A dress's wide skirt, a fan of more than half a circle at ``points`` [m], closed until it lies below its waist.

    Such a fan reaches above the arms, and front and back would be sewn over them. Returns all vertices, shape [V, 3].
    """
    distances = wearing.distances()
    tops = [own for limbs, own in distances.items() if set(limbs) & set(ARMS)]
    if LEGS not in distances or not tops:
        return points
    hem = next(each for each, limbs in zip(wearing.openings, wearing.limbs, strict=True) if limbs == LEGS)
    skeleton = wearing.skeleton
    flat = np.stack([points @ skeleton.left, points @ skeleton.up], axis=1)
    centre = _circle_centre(flat[hem.loop])
    away = flat - centre
    aside = np.arctan2(away[:, 0], -away[:, 1])  # from down
    of_skirt = distances[LEGS] < np.min(tops, axis=0)
    radius = np.linalg.norm(away, axis=1)
    is_round = float(radius[hem.loop].std()) < ROUND * float(radius[hem.loop].mean())
    if not is_round or float(np.abs(aside[hem.loop]).max()) < HALF_CIRCLE:
        return points
    widest = float(np.abs(aside[of_skirt]).max(initial=0.0))
    closed = aside * np.where(of_skirt, CLOSED / widest, 1.0)
    there = centre + radius[:, None] * np.stack([np.sin(closed), -np.cos(closed)], axis=1)
    change = np.where(of_skirt[:, None], there - flat, 0.0)
    moved: Points = points + change[:, :1] * skeleton.left + change[:, 1:] * skeleton.up
    return moved


def _circle_centre(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The centre of the circle that comes nearest to points of a plane, shape [N, 2] (Kasa's least squares)."""
    equations = np.column_stack([2.0 * points, np.ones(len(points))])
    found = np.linalg.lstsq(equations, (points**2).sum(axis=1), rcond=None)[0]
    centre: NDArray[np.float64] = found[:2]
    return centre

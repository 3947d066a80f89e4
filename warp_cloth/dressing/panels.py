"""Panels moved apart before they are sewn: wide skirts that start above the arms, wide legs that overlap."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.anatomy.linking import Wearing
from warp_cloth.anatomy.openings import ARMS, LEGS
from warp_cloth.base.connected import connected_components
from warp_cloth.base.mesh import Indices, Points
from warp_cloth.base.topology import mesh_edges, triangles_across

SEAM = 4.0  # of the median length of edges, from which one spans a seam
CLOSED = np.radians(65.0)  # of a closed fan, from down to one side
ROUND = 0.2  # spread of a round hem's distance from its centre, over their mean
OVERLAP = 0.03  # [m] that wide legs reach farther over the middle than at the crotch
BELOW = 0.1  # [m] below the crotch, from where on
STEEPEST = 1.0  # sideways over down, that a leg is turned at most


def parted(wearing: Wearing, points: Points) -> Points:
    """The garment at ``points`` [m], shape [V, 3], with its panels where they can be sewn round a body."""
    return legs_parted(wearing, skirt_closed(wearing, points))


def legs_parted(wearing: Wearing, points: Points) -> Points:
    """Wide legs of trousers, whose panels overlap in the middle, turned out until they do so only as at the crotch.

    They would be sewn through each other. Returns all vertices, shape [V, 3].
    """
    seam = wearing.between_legs
    if not len(seam):
        return points
    aside, height = points @ wearing.skeleton.left, points @ wearing.skeleton.up
    middle, crotch = float(np.median(aside[seam])), float(height[seam].min())
    below = np.maximum(crotch - height, 0.0)
    out = np.where(wearing.on_left, 1.0, -1.0)
    beyond = np.maximum(-(aside - middle) * out, 0.0)  # how far each vertex lies on the other side
    some = below > BELOW
    wider = beyond[some] - float(beyond[~some].max(initial=0.0))  # than at the crotch, where fitted legs overlap, too
    if float(wider.max(initial=0.0)) < OVERLAP:
        return points
    slope = min(float((wider / below[some]).max()), STEEPEST)
    moved: Points = points + (slope * below * out)[:, None] * wearing.skeleton.left
    return moved


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
    radius = np.linalg.norm(away, axis=1)
    mean = float(radius[hem.loop].mean())
    is_round = float(radius[hem.loop].std()) < ROUND * mean
    if not is_round or float(np.ptp(flat[hem.loop, 1])) < mean:  # as high as half a circle; a straight hem is not
        return points
    of_skirt = _of_hem(wearing.triangles, points, hem.loop)
    if of_skirt[np.min(tops, axis=0) == 0.0].any():  # one piece, not of panels
        of_skirt = distances[LEGS] < np.min(tops, axis=0)
    widest = float(np.abs(aside[of_skirt]).max(initial=0.0))
    closing = CLOSED / widest
    seam = np.intersect1d(triangles_across(wearing.triangles, of_skirt), np.flatnonzero(of_skirt))
    # the waist keeps its length: as a fan about its own centre it would be narrower than the legs within are apart
    waist = float(radius[seam].mean()) if len(seam) else 0.0
    closed, farther = closing * aside, radius + waist * (1.0 / closing - 1.0)
    there = centre + farther[:, None] * np.stack([np.sin(closed), -np.cos(closed)], axis=1)
    change = np.where(of_skirt[:, None], there - flat, 0.0)
    if len(seam):  # the waist of a fan lies all about its centre, that of the closed one below
        change[of_skirt, 1] -= change[seam, 1].mean()
    moved: Points = points + change[:, :1] * skeleton.left + change[:, 1:] * skeleton.up
    return moved


def _of_hem(triangles: Indices, points: Points, hem: NDArray[np.integer]) -> NDArray[np.bool_]:
    """Which vertices belong to the panels that end at a hem: seams yet to close are longer than a panel's edges."""
    edges = mesh_edges(triangles, len(points))
    lengths = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    within = edges[lengths < SEAM * np.median(lengths)]
    panel = connected_components(len(points), *within.T)
    return np.isin(panel, panel[hem])


def _circle_centre(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The centre of the circle that comes nearest to points of a plane, shape [N, 2] (Kasa's least squares)."""
    equations = np.column_stack([2.0 * points, np.ones(len(points))])
    found = np.linalg.lstsq(equations, (points**2).sum(axis=1), rcond=None)[0]
    centre: NDArray[np.float64] = found[:2]
    return centre

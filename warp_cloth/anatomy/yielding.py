"""Skin that yields where limbs press on the body, so that there is room for cloth.

In models of bodies, arms that hang close pass through the trunk, and thighs through each other. Between them cloth has
no place to be: it can neither come to rest nor get out of the other cloth there.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from warp_cloth.anatomy.geodesics import Floats, nearest_points, row_lengths
from warp_cloth.anatomy.skeleton import HEAD, LEFT_ARM, LEFT_LEG, RIGHT_ARM, RIGHT_LEG, Skeleton
from warp_cloth.base.mesh import Mesh, Points, signed_volumes, vertex_normals

Numbers = NDArray[np.int64]  # of vertices, shape [N]

PRESSED = 1e-3  # [m] that skin passes through other skin, from which on both yield; what merely touches stays
ROOM = 0.01  # [m] between them then: for two sheets of cloth, each 3 mm off the skin; 6 mm were not enough
REACH = 0.03  # [m]; what is farther away, or deeper, is not what a limb presses on
# [m] from where a limb is joined to the body, up to which skin yields less: the fold there is no pressure.
FOLD = 0.04
FACING = -0.2  # largest cosine between normals of skin that presses on skin
ROUNDS = 4  # of moving both sides by half of what is missing: up to 2 mm are, in the end


def yielded(body: Mesh, skeleton: Skeleton) -> Points | None:
    """The body's vertices [m], shape [V, 3], where skin has yielded; None: no limb presses on anything.

    Arms press on all but the head, legs on each other. None also of limbs that were found on a surface wrapped round
    the body: its own may be in pieces that overlap, and would come apart.
    """
    if skeleton.is_of_wrap:
        return None
    own = body.points[body.triangles[skeleton.own[body.triangles[:, 0]]]]
    points, sign = body.points, np.sign(signed_volumes(own - own.mean(axis=(0, 1))).sum())  # -1: it is inside out
    pairs = [tuple(_near_each_other(points, *pair)) for pair in _pairs(skeleton)]
    share: Floats | None = None
    for _ in range(ROUNDS):
        normals = sign * vertex_normals(points, body.triangles).astype(np.float64)
        sides = [(one, *_missing(points, normals, one, other)) for pair in pairs for one, other in (pair, pair[::-1])]
        if share is None:
            pressed = [one[lack > ROOM + PRESSED] for one, lack, _ in sides]
            if not any(len(each) for each in pressed):
                return None
            share = _shares(body, skeleton)
            if not (share[np.concatenate(pressed)] == 1.0).any():
                return None
        move = np.zeros_like(points)
        for one, lack, away in sides:
            move[one] += (0.5 * share[one] * lack)[:, None] * away
        points = points + move
    return points


def _pairs(skeleton: Skeleton) -> Iterator[tuple[Numbers, Numbers]]:
    """Vertices of a limb, and of what it may press on."""
    limb = np.where(skeleton.own, skeleton.limb, HEAD)
    yield np.flatnonzero(limb == RIGHT_ARM), np.flatnonzero((limb != RIGHT_ARM) & (limb != HEAD))
    yield np.flatnonzero(limb == LEFT_ARM), np.flatnonzero(~np.isin(limb, (RIGHT_ARM, LEFT_ARM, HEAD)))
    yield np.flatnonzero(limb == RIGHT_LEG), np.flatnonzero(limb == LEFT_LEG)


def _near_each_other(points: Points, one: Numbers, other: Numbers) -> Iterator[Numbers]:
    """Those of each side that are within reach of the other's bounds."""
    for own, its in ((one, other), (other, one)):
        low, high = points[its].min(axis=0, initial=np.inf) - REACH, points[its].max(axis=0, initial=-np.inf) + REACH
        yield own[((points[own] > low) & (points[own] < high)).all(axis=1)]


def _missing(points: Points, normals: Points, one: Numbers, other: Numbers) -> tuple[Floats, Points]:
    """How much room is missing at vertices of one side [m], shape [N], and the unit vectors away from the other."""
    if not len(one) or not len(other):
        return np.zeros(len(one)), np.zeros((len(one), 3))
    near = other[nearest_points(points[other], points[one])]
    across, away = points[one] - points[near], normals[near]
    gap = np.einsum("ij,ij->i", across, away)  # negative: inside
    presses = (row_lengths(across) < REACH) & (np.einsum("ij,ij->i", normals[one], away) < FACING)
    return np.where(presses, np.maximum(ROOM - gap, 0.0), 0.0), away


def _shares(body: Mesh, skeleton: Skeleton) -> Floats:
    """How freely the skin yields at each vertex, 0 to 1 by the distance to where a limb is joined, shape [V]."""
    limb = skeleton.limb[body.triangles]
    joined = np.unique(body.triangles[(limb != limb[:, :1]).any(axis=1)])
    nearest = joined[nearest_points(body.points[joined], body.points)]
    return np.asarray(np.minimum(row_lengths(body.points - body.points[nearest]) / FOLD, 1.0))

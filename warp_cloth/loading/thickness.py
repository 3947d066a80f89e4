"""Cloth modelled with its thickness, as a modelling tool's "solidify" makes it: which of its two sides is the cloth.

Both as cloth would be a bag without openings, twice as heavy and stiff, that hides where limbs go.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.connected import connected_components, mesh_parts
from warp_cloth.base.mesh import face_normals
from warp_cloth.base.trims import nearest_faces
from warp_cloth.loading.raw import Floats, Ints
from warp_cloth.loading.unique_rows import edges_of

THICKEST = 0.025  # [m], as a padded jacket; nearly all of either side is nearer to the other one
NEARLY_ALL = 95.0  # per cent
SAMPLED = 2000  # faces of each side, evenly: what most of them say is asked
ALIKE = 0.7  # area of one side over the other's, at least
OPPOSITE = -0.7  # mean cosine between the normals of faces on one side and of the nearest on the other, at most
# [degrees] by which the surface turns where it leaves a side for its rim: a square rim by 90, a round one by less
TURNS = (65.0, 40.0, 25.0)


@dataclass(frozen=True, eq=False)
class Shell:
    """The faces of thick cloth that are carried along with the side of it that is next to the body."""

    carried: NDArray[np.bool_]  # shape [F]
    thickness: float  # [m], the median


def shell_among(points: Floats, triangles: Ints, looked_at: NDArray[np.bool_]) -> Shell | None:
    """The outer sides and the rims of cloth that is modelled with its thickness, part by part; None: there is none.

    Args:
        points: [m], shape [V, 3].
        triangles: wound consistently, shape [F, 3].
        looked_at: whether a triangle may be such cloth, shape [F].
    """
    carried = np.zeros(len(triangles), dtype=bool)
    thicknesses = []
    part = mesh_parts(len(points), triangles)[triangles[:, 0]]
    for number in np.unique(part[looked_at]).tolist():
        own = np.flatnonzero((part == number) & looked_at)
        found = _shell(points, triangles[own])
        if found is not None:
            carried[own] = found.carried
            thicknesses.append((len(own), found.thickness))
    return Shell(carried, max(thicknesses)[1]) if thicknesses else None


def _shell(points: Floats, triangles: Ints) -> Shell | None:
    """The same of one connected part."""
    _, number, count = np.unique(np.sort(edges_of(triangles), axis=1), axis=0, return_inverse=True, return_counts=True)
    if (count == 1).any():  # it has openings: it is one sheet
        return None
    order = np.argsort(number.ravel(), kind="stable")
    first = (np.cumsum(count) - count)[count == 2]
    pairs = np.stack([order[first], order[first + 1]]) // 3  # the faces at each edge
    normals = face_normals(points[triangles])
    area = np.linalg.norm(normals, axis=1)
    normals = normals / np.where(area > 0.0, area, 1.0)[:, None]
    turn = np.einsum("ij,ij->i", normals[pairs[0]], normals[pairs[1]])
    for degrees in TURNS:
        smooth = turn > np.cos(np.radians(degrees))
        of_side = _two_sides(len(triangles), pairs, smooth, area)
        if of_side is None:
            continue
        thickness = _thickness(points, triangles, normals, area, of_side)
        if thickness is not None:
            inner = 0 if area[of_side == 0].sum() <= area[of_side == 1].sum() else 1
            return Shell(of_side != inner, thickness)
    return None


def _two_sides(count: int, pairs: Ints, smooth: NDArray[np.bool_], area: Floats) -> Ints | None:
    """Side 0 or 1 of each face, -1: the rim between them; None: it does not have two that are as large.

    A side is the largest patch without a sharp edge, with those that touch it but not the other side.
    """
    patch = connected_components(count, *pairs[:, smooth])
    size = np.bincount(patch, area, minlength=count)
    sides = np.argsort(-size, kind="stable")[:2]
    touches = np.zeros((2, count), dtype=bool)
    one, other = patch[pairs]
    for own, side in zip(touches, sides, strict=True):
        own[one[other == side]] = own[other[one == side]] = own[side] = True
    touches[0, sides[1]] = touches[1, sides[0]] = False
    kind = np.where(touches[0] & ~touches[1], 0, np.where(touches[1] & ~touches[0], 1, -1))[patch]
    areas = [float(area[kind == side].sum()) for side in (0, 1)]
    rim = float(area[kind < 0].sum())
    return kind if min(areas) >= max(ALIKE * max(areas), rim) and min(areas) > 0.0 else None


def _thickness(points: Floats, triangles: Ints, normals: Floats, area: Floats, of_side: Ints) -> float | None:
    """The median distance between the sides [m]; None: they do not lie on each other, facing away."""
    middles = points[triangles].mean(axis=1)
    medians = []
    for side in (0, 1):
        here, there = np.flatnonzero(of_side == side), np.flatnonzero(of_side == 1 - side)
        here = here[:: max(1, len(here) // SAMPLED)]
        nearest, away = nearest_faces(middles[here], points, triangles[there])
        facing = np.einsum("ij,ij->i", normals[here], normals[there[nearest]])
        if np.percentile(away, NEARLY_ALL) > THICKEST or np.average(facing, weights=area[here]) > OPPOSITE:
            return None
        medians.append(float(np.median(away)))
    return min(medians)

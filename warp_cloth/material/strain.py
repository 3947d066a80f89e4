"""Strain of a worn garment along its yarns, per triangle, relative to its rest shape."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices, Points, face_normals
from warp_cloth.material.constants import THINNEST_FRACTION, Sheet

Floats = NDArray[np.float64]


def face_strains(points: Points, sheet: Sheet) -> dict[str, Floats]:
    """Strains of every triangle, shape [F] each; those of yarns only where the garment has a warp direction.

    The deformation of a triangle takes the unit vectors along weft and warp to u and v. Then

        strain_warp = |v| - 1,  strain_weft = |u| - 1,  strain_bias = max(|u + v|, |u - v|) / sqrt 2 - 1,
        shear = asin(u . v / |u| |v|) in degrees,  strain = largest principal stretch - 1.

    Triangles without area at rest have strain 0.
    """
    used = sheet.areas > THINNEST_FRACTION * float(np.median(sheet.areas))
    corners = points[sheet.triangles[used]]
    sides = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)  # columns are the sides from the first corner
    flat = np.swapaxes(sheet.flat[used, 1:] - sheet.flat[used, :1], 1, 2)
    u, v = _along_axes(sides, flat)
    uu, vv, uv = (np.einsum("ij,ij->i", a, b) for a, b in ((u, u), (v, v), (u, v)))
    middle, half = 0.5 * (uu + vv), np.hypot(0.5 * (uu - vv), uv)
    found = {"strain": np.sqrt(middle + half) - 1.0}
    if sheet.directed:
        size = np.maximum(np.sqrt(uu * vv), np.finfo(float).tiny)
        found["strain_warp"] = np.sqrt(vv) - 1.0
        found["strain_weft"] = np.sqrt(uu) - 1.0
        found["strain_bias"] = np.sqrt(middle + np.abs(uv)) - 1.0
        found["shear"] = np.degrees(np.arcsin(np.clip(uv / size, -1.0, 1.0)))
    return {name: _filled(values, used) for name, values in found.items()}


def _along_axes(sides: Floats, flat: Floats) -> tuple[Floats, Floats]:
    """Where deformations take the unit vectors of the plane, shape [F, 3] each.

    Args:
        sides: two sides of each triangle as columns [m], shape [F, 3, 2].
        flat: the same at rest, in the plane, shape [F, 2, 2].
    """
    (a, b), (c, d) = flat[:, 0].T, flat[:, 1].T
    p, q = sides[:, :, 0], sides[:, :, 1]
    size = (a * d - b * c)[:, None]
    return (p * d[:, None] - q * c[:, None]) / size, (q * a[:, None] - p * b[:, None]) / size


def _filled(values: Floats, used: NDArray[np.bool_]) -> Floats:
    """The values at the triangles that are used, 0 at the others."""
    filled = np.zeros(len(used))
    filled[used] = values
    return filled


def vertex_means(values: Floats, areas: Floats, triangles: Indices, count: int) -> Floats:
    """Means of the values of the triangles around every vertex, weighted by area; shape [V]."""
    corner = triangles.ravel()
    total = np.bincount(corner, np.repeat(values * areas, 3), count)
    weight = np.bincount(corner, np.repeat(areas, 3), count)
    return total / np.maximum(weight, np.finfo(float).tiny)


def vertex_areas(points: Points, triangles: Indices) -> Floats:
    """A third of the area of the triangles around every vertex [m2], shape [V]."""
    double = np.linalg.norm(face_normals(points[triangles]), axis=1)
    return np.asarray(np.bincount(triangles.ravel(), np.repeat(double / 6.0, 3), len(points)), dtype=np.float64)

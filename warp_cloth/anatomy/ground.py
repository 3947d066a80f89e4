"""A floor or plinth that a scan's feet are grown together with: found as the one large flat top below a body."""

from __future__ import annotations

import numpy as np

from warp_cloth.anatomy.geodesics import Floats, row_lengths
from warp_cloth.base.mesh import Indices, Points

STEEPEST = 0.97  # cosine of the angle between a flat top's normal and the axis
BINS = 100  # of the extent along the axis, in which area that faces along it is added up
# Of the extent squared, the area of a flat top: over 6 cm of the height the tops of a person's feet have 0.006.
LARGE = 0.03
LOWER = 0.5  # of the extent: a floor is lower; above it are shoulders, and a sitter's chair
CLEAR = 0.012  # of the extent, above that top, where the body is cut: a scan rounds where feet meet the floor


def above_ground(points: Points, triangles: Indices) -> Indices | None:
    """The triangles of a mesh that lie above a floor at its end along an axis, shape [N, 3]; None: there is none.

    ``points`` [m], shape [V, 3]; ``triangles`` wound outwards, shape [F, 3].
    """
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    normal = np.cross(b - a, c - a)
    twice = np.maximum(row_lengths(normal), np.finfo(float).tiny)
    extent = float(np.ptp(points[triangles].reshape(-1, 3), axis=0).max())
    for axis in (1, 2, 0):
        for sign in (1.0, -1.0):
            height = sign * points[:, axis]
            flat = sign * normal[:, axis] > STEEPEST * twice
            top = _top(height[triangles].mean(axis=1)[flat], 0.5 * twice[flat], float(height[triangles].min()), extent)
            if top is not None:
                return triangles[(height > top + CLEAR * extent)[triangles].all(axis=1)]
    return None


def _top(height: Floats, area: Floats, low: float, extent: float) -> float | None:
    """The height of the highest large flat top [m]; None: there is none.

    Args:
        height: of triangles that face along the axis [m], shape [N].
        area: of these [m2], shape [N].
        low: the lowest height of the mesh [m].
        extent: of the mesh [m].
    """
    place = np.clip(((height - low) / extent * BINS).astype(np.int64), 0, BINS - 1)
    size = np.bincount(place, area, BINS)
    pairs = size[:-1] + size[1:]  # a floor may lie on the border of two
    large = np.flatnonzero(pairs[: int(LOWER * BINS)] > LARGE * extent**2)
    if not len(large):
        return None
    near = (place >= large[-1]) & (place <= large[-1] + 1)
    return float(np.average(height[near], weights=area[near]))

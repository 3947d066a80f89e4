"""Sides and areas of triangles, in float64."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.chunks import map_chunks, map_rows
from warp_cloth.base.threads import concatenate

Floats = NDArray[np.float64]


def triangle_sides(corners: Floats) -> Floats:
    """Lengths of the sides (0,1), (1,2), (2,0) of triangles, shape [F, 3]."""

    def some(part: slice) -> Floats:
        own = corners[part]
        return np.asarray(np.linalg.norm(np.roll(own, -1, axis=1) - own, axis=2))

    return concatenate(map_chunks(some, len(corners)))


def triangle_areas(sides: Floats) -> Floats:
    """Areas [m2] from side lengths, Kahan's stable form of Heron's formula, shape [F]."""
    return map_rows(_areas, sides)


def _areas(sides: Floats) -> Floats:
    c, b, a = np.sort(sides, axis=1).T
    product = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c))
    return np.asarray(0.25 * np.sqrt(np.maximum(product, 0.0)))

"""Parts of a body's mesh that the body wears: they are open where it passes through them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.lids import Rims
from warp_cloth.base.mesh import Points

Indices = NDArray[np.int64]

MOST_PARTS, MOST_HOLES = 16, 32  # with more, or more holes in one part, a mesh is torn, not dressed
SAMPLES = 48  # vertices of a part that tell whether it lies round another one, or within it, as a mouth does
AROUND, ACROSS = 12, (0.0, 0.3, 0.6, 0.9)  # samples of a hole: round its rim, and from its middle to there


def worn_parts(points: Points, triangles: Indices, part: Indices, rims: Rims) -> int:
    """How many parts are worn by another: it passes through two of their holes or more, and they through none of its.

    Args:
        points: vertices and, after these, the tips of the cones that close the holes [m], shape [V, 3].
        triangles: of the closed surface, shape [F, 3].
        part: of each triangle, shape [F].
        rims: vertices round each hole.
    """
    parts = np.unique(part).tolist()
    if not 2 <= len(parts) <= MOST_PARTS:
        return 0
    of_point = np.full(len(points), -1, dtype=np.int64)
    of_point[triangles] = part[:, None]
    surface = {number: points[triangles[part == number]] for number in parts}
    holes: dict[int, list[Points]] = {number: [] for number in parts}
    for rim in rims:
        if of_point[rim[0]] >= 0:
            holes[int(of_point[rim[0]])].append(_across(points[rim]))

    if max(len(each) for each in holes.values()) > MOST_HOLES:
        return 0

    def passed(cloth: int, body: int) -> int:
        """How many holes of a part another one passes through."""
        return sum(bool(_is_within(hole, surface[body]).any()) for hole in holes[cloth])

    def is_worn(cloth: int, body: int) -> bool:
        if body == cloth or passed(cloth, body) < 2 or passed(body, cloth):
            return False
        own = np.flatnonzero(of_point == cloth)
        some = points[own[np.linspace(0, len(own) - 1, SAMPLES).astype(int)]]
        return bool(_is_within(some, surface[body]).mean() < 0.5)

    return sum(any(is_worn(cloth, body) for body in parts) for cloth in parts if len(holes[cloth]) > 1)


def _across(rim: Points) -> Points:
    """Samples of the cone over a hole [m], shape [N, 3]."""
    tip, some = rim.mean(axis=0), rim[np.linspace(0, len(rim), AROUND, endpoint=False).astype(int)]
    return np.concatenate([tip + share * (some - tip) for share in ACROSS])


def _is_within(points: Points, corners: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether points [m], shape [N, 3], lie within a closed surface, by its winding round them; shape [N].

    ``corners`` of its triangles [m], shape [F, 3, 3], wound either way.
    """
    found = np.zeros(len(points), dtype=np.bool_)
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    for number in np.flatnonzero(((points > low) & (points < high)).all(axis=1)):
        a, b, c = np.moveaxis(corners - points[number], 1, 0)
        x, y, z = (np.linalg.norm(each, axis=1) for each in (a, b, c))
        volume = np.einsum("ij,ij->i", a, np.cross(b, c))
        rest = x * y * z
        for u, v, w in ((a, b, z), (b, c, x), (c, a, y)):
            rest = rest + np.einsum("ij,ij->i", u, v) * w
        found[number] = abs(float(np.arctan2(volume, rest).sum())) > np.pi
    return found

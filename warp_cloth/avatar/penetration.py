"""Penetration between vertices: edges that run through a limb, faces so large that the avatar shows through."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Points

STRETCHED = 0.2  # strain from which an edge is checked: one through a limb is longer than the limb is thick
DEEP = 0.2  # depth over an edge's length from which it runs through: over a round limb a long edge dips less
PLACES = np.linspace(0.0, 1.0, 9)[1:-1]  # sampled along an edge
LARGE = 0.018  # [m]; over a nose or a finger, 14 mm in radius, a shorter edge at the usual offset stays outside
ROUNDING = 1e-3  # relative; more than that of a length computed from a float32 strain
# barycentric weights of samples in a face
WITHIN = np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4], [1, 1, 0], [0, 1, 1], [1, 0, 1], [1, 1, 1]])


def edge_places(
    points: Points, edges: NDArray[np.int32], strains: NDArray[np.float64]
) -> tuple[Points, NDArray[np.float64]]:
    """Samples along the edges that are checked [m], shape [N, 3], and these edges' lengths [m].

    ``points`` [m], shape [V, 3]; ``edges`` are pairs of them, shape [E, 2]; ``strains`` are theirs, shape [E].
    """
    checked = edges[strains > STRETCHED]
    if not np.isfinite(points).all():
        checked = checked[:0]
    first, last = points[checked[:, 0], None], points[checked[:, 1], None]
    along = (first + (last - first) * PLACES[:, None]).reshape(-1, 3)
    return along, np.linalg.norm(last - first, axis=2)[:, 0]


def pierced(depths: NDArray[np.float32], lengths: NDArray[np.float64]) -> tuple[int, float]:
    """How many edges run through the avatar, and how deep they lie under its surface [mm].

    From the depths of ``edge_places`` in it [m].
    """
    depth = np.nan_to_num(depths).reshape(len(lengths), len(PLACES)).max(axis=1)
    through = depth > DEEP * lengths
    return int(through.sum()), 1e3 * float(depth[through].max(initial=0.0))


def may_show(longest: float) -> bool:
    """Whether the avatar may show through a triangle, by the longest edge [m], allowing for its rounding."""
    return not longest * (1.0 + ROUNDING) < LARGE


def face_places(points: Points, triangles: NDArray[np.int32]) -> Points:
    """Samples in those triangles that are large enough for the avatar to show through [m], shape [N, 3].

    ``points`` [m], shape [V, 3].
    """
    extents = np.zeros(len(triangles))
    for axis in points.T:
        first, second, third = axis[triangles.T]  # NumPy is slow at reductions over three columns
        highest, lowest = np.maximum(np.maximum(first, second), third), np.minimum(np.minimum(first, second), third)
        extents = np.maximum(extents, highest - lowest)
    large = points[triangles[extents > LARGE]]
    if not np.isfinite(large).all():
        large = large[:0]
    return np.asarray(((WITHIN / WITHIN.sum(axis=1, keepdims=True)) @ large).reshape(-1, 3))


def shown(depths: NDArray[np.float32]) -> tuple[int, float]:
    """How many triangles the avatar shows through, and how deep they lie under its surface [mm].

    From the depths of ``face_places`` in it [m].
    """
    depth = np.nan_to_num(depths).reshape(-1, len(WITHIN)).max(axis=1)
    return int((depth > 0.0).sum()), 1e3 * float(depth.max(initial=0.0))

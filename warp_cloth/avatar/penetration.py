"""Penetration between vertices: edges that run through a limb, faces so large that the avatar shows through."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_cloth.avatar.openings import Opening
from warp_cloth.base.mesh import Points
from warp_cloth.model.result import Penetration

STRETCHED = 0.2  # strain from which an edge is checked: one through a limb is longer than the limb is thick
DEEP = 0.2  # depth over an edge's length from which it runs through: over a round limb a long edge dips less
PLACES = np.linspace(0.0, 1.0, 9)[1:-1]  # sampled along an edge
VISIBLE = 1.0  # [mm]; a smaller part of the avatar that shows through is not noticed
LARGE = (
    0.014  # [m]; the rim of an ear comes through an edge of 19 mm by 1.4 mm, a nose or finger hardly through one of 18
)
ROUNDING = 1e-3  # relative; more than that of a length computed from a float32 strain
# Barycentric weights of samples in a face, and in one that the avatar shows through: 2.5 mm apart where sides have 40
# mm. Of an ear's rim in a face of 21 mm they found 1.2 mm where samples twice as far apart found 0.9.
WITHIN = np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4], [1, 1, 0], [0, 1, 1], [1, 0, 1], [1, 1, 1]])
CLOSER = np.array([[i, j, 16 - i - j] for i in range(17) for j in range(17 - i) if max(i, j, 16 - i - j) < 16])


@dataclass(frozen=True, eq=False)
class Samples:
    """Points in some edges or faces at which their depth in the avatar is measured."""

    points: Points  # [m], as many for each element, shape [N, 3]
    elements: NDArray[np.int64]  # the edges or faces that they lie in, shape [K]
    lengths: NDArray[np.float64]  # of these edges [m], shape [K]; empty for faces

    def depths(self, depths: NDArray[np.float32]) -> NDArray[np.float32]:
        """The greatest of the depths at an element's points [m], shape [K]."""
        each = len(depths) // max(len(self.elements), 1)
        found: NDArray[np.float32] = np.nan_to_num(depths).reshape(len(self.elements), each).max(axis=1, initial=0.0)
        return found


def edge_places(points: Points, edges: NDArray[np.int32], strains: NDArray[np.float64]) -> Samples:
    """Samples along the edges that are checked.

    ``points`` [m], shape [V, 3]; ``edges`` are pairs of them, shape [E, 2]; ``strains`` are theirs, shape [E].
    """
    checked = np.flatnonzero(strains > STRETCHED)
    if not np.isfinite(points).all():
        checked = checked[:0]
    first, last = (points[edges[checked, end], None] for end in (0, 1))
    along = (first + (last - first) * PLACES[:, None]).reshape(-1, 3)
    return Samples(along, checked, np.linalg.norm(last - first, axis=2)[:, 0])


def pierced(samples: Samples, depths: NDArray[np.float32]) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """The edges that run through the avatar, and how deep each lies under its surface [m], both shape [K].

    ``depths`` are those of ``edge_places`` [m].
    """
    depth = samples.depths(depths)
    through = depth > DEEP * samples.lengths
    return samples.elements[through], depth[through]


def may_show(longest: float) -> bool:
    """Whether the avatar may show through a triangle, by the longest edge [m], allowing for its rounding."""
    return not longest * (1.0 + ROUNDING) < LARGE


def face_places(points: Points, triangles: NDArray[np.int32]) -> Samples:
    """Samples in those triangles that are large enough for the avatar to show through; ``points`` [m], shape [V, 3]."""
    extents = np.zeros(len(triangles))
    for axis in points.T:
        first, second, third = axis[triangles.T]  # NumPy is slow at reductions over three columns
        highest, lowest = np.maximum(np.maximum(first, second), third), np.minimum(np.minimum(first, second), third)
        extents = np.maximum(extents, highest - lowest)
    return places_in(points, triangles, np.flatnonzero(extents > LARGE), WITHIN)


def places_in(
    points: Points, triangles: NDArray[np.int32], faces: NDArray[np.int64], weights: NDArray[np.int64]
) -> Samples:
    """Samples in these triangles, at these barycentric weights, shape [S, 3]; ``points`` [m], shape [V, 3]."""
    large = points[triangles[faces]]
    if not np.isfinite(large).all():
        faces, large = faces[:0], large[:0]
    within = np.asarray(((weights / weights.sum(axis=1, keepdims=True)) @ large).reshape(-1, 3))
    return Samples(within, faces, np.zeros(0))


def shown(samples: Samples, depths: NDArray[np.float32]) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """The triangles that the avatar shows through, and how deep each lies under its surface [m], both shape [K].

    ``depths`` are those of ``face_places`` [m].
    """
    depth = samples.depths(depths)
    inside = depth > 0.0
    return samples.elements[inside], depth[inside]


@dataclass(frozen=True, eq=False)
class Overlap:
    """Where cloth lies under the surface of the exact avatar mesh. Indices count through a scene's garments."""

    summary: Penetration
    vertex_depths: NDArray[np.float32]  # 0 outside [m], shape [V]
    edges: NDArray[np.int64]  # that pass through the avatar, shape [K]
    edge_depths: NDArray[np.float32]  # of these [m], shape [K]
    faces: NDArray[np.int64]  # that it shows through, shape [L]
    face_depths: NDArray[np.float32]  # of these [m], shape [L]
    openings: tuple[Opening, ...] = ()

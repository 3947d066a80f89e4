"""A tape laid round part of a body: where a plane cuts it, without hollows."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices, Points
from warp_cloth.base.section import Section, convex_hull, section_at


@dataclass(frozen=True, eq=False)
class Tape:
    """A closed tape."""

    length: float  # [m]
    line: Points  # its corners, the first again at the end [m], shape [N, 3]


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane through a body, with coordinates."""

    origin: Points  # [m], shape [3]
    axes: Points  # unit vectors along the plane, shape [2, 3]
    normal: Points  # unit vector, shape [3]

    @classmethod
    def through(cls, origin: Points, normal: Points) -> Plane:
        """The plane through a point, square to a direction that need not have length 1."""
        unit = normal / np.linalg.norm(normal)
        first = np.cross(unit, np.eye(3)[np.argmin(np.abs(unit))])
        first /= np.linalg.norm(first)
        return cls(origin, np.stack([first, np.cross(unit, first)]), unit)

    def section(self, points: Points, triangles: NDArray[np.integer]) -> Section:
        off = points - self.origin
        return section_at(off @ self.normal, off @ self.axes.T, triangles)

    def in_space(self, flat: Points) -> Points:
        """Points of the plane, shape [N, 2], in space [m], shape [N, 3]."""
        return np.asarray(self.origin + flat @ self.axes, dtype=np.float64)

    def tape(self, flat: Points) -> Tape:
        """The tape round points of the plane [m], shape [N, 2]."""
        hull = convex_hull(flat)
        corners = np.array([*hull, hull[0]], dtype=np.float64)
        length = sum(math.dist(p, q) for p, q in zip(hull, hull[1:] + hull[:1], strict=True))
        return Tape(length, self.in_space(corners))


def tape_round(
    points: Points, triangles: NDArray[np.integer], origin: Points, normal: Points, side: Points | None = None
) -> Tape | None:
    """The tape round the part of a mesh round ``origin`` in the plane through it; None: none is.

    Args:
        points: [m], shape [V, 3].
        triangles: those that may be cut, shape [F, 3].
        origin: the middle of the limb [m], shape [3].
        normal: its direction, shape [3].
        side: a point of a plane and its normal, shape [2, 3]: only what lies on the normal's side of it is taped.
    """
    plane = Plane.through(origin, normal)
    section = plane.section(points, triangles)
    ends = _part_round_origin(section)
    if ends is None:
        return None
    if side is not None:
        inside = (plane.in_space(ends) - side[0]) @ side[1] >= 0.0
        ends = ends[inside]
    return plane.tape(ends) if len(ends) > 2 else None


def _part_round_origin(section: Section) -> Points | None:
    """The ends of the widest part whose tape goes round the origin, shape [N, 2]; None: there is none."""
    around = [ends for ends in (part.reshape(-1, 2) for part in section.parts()) if _surrounds(ends)]
    return max(around, key=lambda ends: float(np.ptp(ends, axis=0).sum()), default=None)


def _surrounds(ends: Points) -> bool:
    """Whether the convex hull of points contains the origin: no gap between their directions is half a turn."""
    turn = np.sort(np.arctan2(ends[:, 1], ends[:, 0]))
    gaps = np.diff(turn, append=turn[0] + 2.0 * np.pi)
    return bool(gaps.max() < np.pi)


def shortest(tapes: Iterable[Tape | None]) -> Tape | None:
    return min((tape for tape in tapes if tape is not None), key=lambda tape: tape.length, default=None)


def longest(tapes: Iterable[Tape | None]) -> Tape | None:
    return max((tape for tape in tapes if tape is not None), key=lambda tape: tape.length, default=None)


def part_of(points: Points, triangles: Indices, chosen: NDArray[np.bool_]) -> tuple[Points, NDArray[np.int64]]:
    """The triangles of which a corner is chosen, shape [V], and their vertices: points [m] and triangles."""
    a, b, c = (chosen[triangles[:, corner]] for corner in range(3))
    used, corners = np.unique(triangles[a | b | c], return_inverse=True)
    return points[used], corners.reshape(-1, 3)

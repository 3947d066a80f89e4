"""Feet drawn in to the ankles while a long skirt is put on, and grown out of them within it, blunt.

A skirt that is sewn closes round the ankles, with the toes outside; and cloth, which meets the body by its vertices
alone, lets toes through that come home. So each foot is a ball at the end of its shin until all else is at home, and
then grows out as its convex hull, thickened by about the distance of the cloth's vertices.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from warp_cloth.anatomy.openings import LEGS
from warp_cloth.anatomy.skeleton import Skeleton
from warp_cloth.base.curves import arc_lengths, curve_point
from warp_cloth.base.mesh import Points

HEEL = 0.13  # of the span, from the toes: where shin and foot meet above the heel, at any age and in any pose
BLUNT = 0.02  # [m] round the hull of a foot that is drawn in or grows: 2 cm are between vertices of fine panels
NEAR = 0.1  # [m] above the ankles, from where cloth may come upon the feet: more than it follows the skin from
STEP = 0.01  # [m] that toes come out at once


class Feet:
    """The feet of a body, drawn in once cloth may come upon them."""

    def __init__(self, points: Points, skeleton: Skeleton, *, may_be_met: bool) -> None:
        """``points``: the body's vertices at home [m], shape [V, 3]; ``may_be_met``: by cloth, or they stay out."""
        self._may_be_met = may_be_met
        self._points, self._skeleton = points, skeleton
        lengths = [float(arc_lengths(skeleton.curves[leg])[-1]) for leg in LEGS]
        self._ankles = [1.0 - HEEL * skeleton.span / length for length in lengths]  # stations of the legs' curves
        self._length: float | None = None  # from 0, balls at the ankles, to 1, at home; None: they are not drawn in

    def draw_in(self, cloth: Points, curves: Sequence[Points]) -> None:
        """Draws them in where cloth at these points [m] hangs low enough to come upon those of a body along curves."""
        if self._may_be_met and self._length is None and self._is_near(cloth, curves):
            self._length = 0.0

    def grow(self, cloth: Points, home: Sequence[Points]) -> Iterator[None]:
        """Lets those that are drawn in come out of a body at home: in steps, or at once if clear of ``cloth`` [m]."""
        if self._length is None:
            return
        if not self._is_near(cloth, home):
            self._length = None
            yield
            return
        ways = [hull - ankle for (_, _, hull), ankle in zip(self._blunt, self._at(home), strict=True)]
        longest = max(float(np.linalg.norm(way, axis=1).max(initial=0.0)) for way in ways)
        steps = max(int(np.ceil(longest / STEP)), 1)
        for step in range(1, steps + 1):
            self._length = step / steps
            yield

    def on(self, body: Points, curves: Sequence[Points]) -> Points:
        """The vertices of a body along these curves [m], shape [V, 3], with its feet drawn in if they are."""
        if self._length is None:
            return body
        points = body.copy()
        for (own, out, hull), ankle in zip(self._blunt, self._at(curves), strict=True):
            points[own] = ankle + self._length * (hull - ankle) + BLUNT * out
        return points

    @cached_property
    def _blunt(self) -> list[tuple[NDArray[np.intp], Points, Points]]:
        """Of each foot its vertices, the way out of it through each of them, and where that leaves its hull [m]."""
        limb, station = self._skeleton.limb, self._skeleton.station
        owned = [np.flatnonzero((limb == leg) & (station > at)) for leg, at in zip(LEGS, self._ankles, strict=True)]
        return [(own, *_onto_hull(self._points[own])) for own in owned]

    def _is_near(self, cloth: Points, curves: Sequence[Points]) -> bool:
        """Whether cloth at these points [m] hangs low enough to come upon the feet of a body along these curves."""
        up = self._skeleton.up
        return float((cloth @ up).min()) < max(float(ankle @ up) for ankle in self._at(curves)) + NEAR

    def _at(self, curves: Sequence[Points]) -> list[Points]:
        """The ankles of a body along these curves [m], each shape [3]."""
        pairs = zip(LEGS, self._ankles, strict=True)
        return [curve_point(curves[leg], ankle * (len(curves[leg]) - 1)) for leg, ankle in pairs]


def _onto_hull(points: Points) -> tuple[Points, Points]:
    """Unit vectors from the middle of some points through each of them, and where these leave their hull [m].

    Both shape [N, 3]. Points that span no volume are their own hull.
    """
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return _ways_out(points, points.mean(axis=0) if len(points) else np.zeros(3)), points
    middle = points[hull.vertices].mean(axis=0)
    out = _ways_out(points, middle)
    normals, offsets = hull.equations[:, :3], hull.equations[:, 3]
    rates = out @ normals.T  # at which each comes nearer to the planes of the hull's faces
    ways = np.divide(-(normals @ middle + offsets), rates, out=np.full_like(rates, np.inf), where=rates > 1e-9)
    return out, middle + ways.min(axis=1, keepdims=True) * out


def _ways_out(points: Points, middle: Points) -> Points:
    """Unit vectors from the middle through each point, shape [N, 3]; zero for one in the middle."""
    off = points - middle
    return np.asarray(off / np.maximum(np.linalg.norm(off, axis=1, keepdims=True), 1e-9))

"""A body's surface along other curves than its own, and thinner: from in a garment to home, in steps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from warp_cloth.anatomy.geodesics import Floats, row_lengths
from warp_cloth.anatomy.openings import ARMS, LEGS
from warp_cloth.anatomy.outermost import outermost_distances
from warp_cloth.anatomy.raising import raised_limb, standing_leg
from warp_cloth.anatomy.skeleton import TRUNK, Skeleton
from warp_cloth.base.curves import arc_lengths, resampled
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.dressing.routes import smoothed

STATIONS = 60  # along each curve
SMOOTHING = 3  # times that tangents are smoothed
TINY = 1e-9  # [m]
ROOT = 20  # points along the part of a limb's curve that leads from the spine to its joint


class PosedBody:
    """A body whose vertices follow the curves of their limbs."""

    def __init__(self, body: Mesh, skeleton: Skeleton, *, chest_stays: bool = False) -> None:
        """``chest_stays``: below the armpits, under arms that turn.

        It would stand out from under raised arms and hold a waistband up; but cloth that arms pass through tears where
        they leave their roots behind.
        """
        self._skeleton = skeleton
        limbs = [resampled(smoothed(curve, 2), STATIONS) for curve in skeleton.curves]
        self.home = [*limbs, resampled(skeleton.spine, STATIONS)]  # the trunk's last
        limb, self._station = self._with_roots(body.points)
        self._of_limb = [np.flatnonzero(limb == number) for number in range(TRUNK)]
        limbs_of = zip(self.home[:TRUNK], self._of_limb, strict=True)
        self._tangents = [_unit(_at(_tangents(curve), self._station[own])) for curve, own in limbs_of]  # of each vertex
        self._of_trunk = np.flatnonzero(limb == TRUNK)
        self._turns = ~(chest_stays & np.isin(limb, ARMS) & (skeleton.limb == TRUNK))[:, None]
        self._base = skeleton.spine_at(body.points)  # the point that each vertex is thinned towards
        for curve, own in zip(self.home[:TRUNK], self._of_limb, strict=True):
            self._base[own] = _at(curve, self._station[own])
        self._offset = body.points - self._base
        self._shares = _shares(body, limb, self._offset)
        off = self._base[self._of_trunk][:, None] - self.home[TRUNK]
        self._station[self._of_trunk] = np.linalg.norm(off, axis=2).argmin(axis=1) / (STATIONS - 1)

    def _with_roots(self, points: Points) -> tuple[NDArray[np.int8], Floats]:
        """Limb and station of each vertex, where shoulders and hips belong to their limbs.

        A thin trunk without shoulders would let a garment slide down.
        """
        skeleton = self._skeleton
        limb, station = skeleton.limb.copy(), skeleton.station.copy()
        trunk = np.flatnonzero(limb == TRUNK)
        nearest = np.linalg.norm(points[trunk] - skeleton.spine_at(points[trunk]), axis=1)
        for number in (*ARMS, *LEGS):
            joint, lengths = skeleton.joints[number], arc_lengths(skeleton.curves[number])
            first_point, last_point = skeleton.curves[number][joint - 1 : joint + 1]
            root = np.linspace(first_point, last_point, ROOT)
            away = np.linalg.norm(points[trunk][:, None] - root, axis=2)
            closer = away.min(axis=1) < nearest
            nearest = np.where(closer, away.min(axis=1), nearest)
            limb[trunk[closer]] = number
            first, last = lengths[joint - 1 : joint + 1] / lengths[-1]
            station[trunk[closer]] = first + (last - first) * away.argmin(axis=1)[closer] / (ROOT - 1)
        return limb, station

    def points(self, curves: Sequence[Points], thickness: float) -> Points:
        """The vertices along these curves, the trunk's last, at most ``thickness`` off them [m], shape [V, 3].

        Those within a limb stay within it.
        """
        base, offset = self._base + self.slid(curves), self._offset.copy()
        for number, (curve, own) in enumerate(zip(curves[:TRUNK], self._of_limb, strict=True)):
            station = self._station[own]
            base[own] = _at(curve, station)
            tangents = self._tangents[number], _unit(_at(_tangents(curve), station))
            offset[own] = np.where(self._turns[own], _rotated(offset[own], *tangents), offset[own])
        most = thickness * self._shares
        found: Points = base + offset * np.minimum(1.0, most / np.maximum(row_lengths(offset), TINY))[:, None]
        return found

    def slid(self, curves: Sequence[Points]) -> Points:
        """How far the trunk's vertices are drawn up along it, from home [m], shape [V, 3]."""
        moves = np.zeros_like(self._base)
        moves[self._of_trunk] = _at(curves[TRUNK] - self.home[TRUNK], self._station[self._of_trunk])
        return moves

    def trunk_up_to(self, end: Points) -> Points:
        """The trunk's curve drawn together below the shoulders, to end no lower than this point [m]."""
        skeleton, curve = self._skeleton, self.home[TRUNK]
        top, heights = float(skeleton.shoulders @ skeleton.up), curve @ skeleton.up
        lowness = np.clip((top - heights) / max(top - float(heights.min()), 1e-6), 0.0, 1.0)
        raised: Points = curve + lowness[:, None] * max(float(end @ skeleton.up - heights.min()), 0.0) * skeleton.up
        return raised

    def away(self, limbs: Sequence[int]) -> list[Points] | None:
        """The curves at home, but with those of these limbs that hang raised from down; None: none of them hangs.

        Legs of who sits stand.
        """
        skeleton = self._skeleton
        raised = {limb: raised_limb(skeleton, limb) for limb in limbs}
        standing = {leg: standing_leg(skeleton, leg) for leg in set(limbs) & set(LEGS)}
        raised |= {leg: curve for leg, curve in standing.items() if curve is not None}
        hanging = {limb: curve for limb, curve in raised.items() if curve is not None}
        curves = list(self.home)
        for limb, curve in hanging.items():
            curves[limb] = resampled(smoothed(curve, 2), STATIONS)
        return curves if hanging else None

    def stands_up(self, curves: Sequence[Points]) -> bool:
        """Whether a leg that is raised to the front at home is straight down in these curves."""
        skeleton = self._skeleton
        return any(curves[leg] is not self.home[leg] and standing_leg(skeleton, leg) is not None for leg in LEGS)

    def at_shoulders(self, posed: Sequence[Points], others: Sequence[Points]) -> list[Points]:
        """Curves with the arms as in ``posed``, but from the shoulders that are at home, and all else as ``others``."""
        curves = list(others)
        for arm in ARMS:
            home, joint = self._skeleton.curves[arm], self._skeleton.joints[arm]
            lengths = arc_lengths(home)
            shoulder = round(float(lengths[joint] / lengths[-1]) * (STATIONS - 1))
            moved = posed[arm] + self.home[arm][shoulder] - posed[arm][shoulder]
            curves[arm] = np.vstack([self.home[arm][:shoulder], moved[shoulder:]])
        return curves

    @staticmethod
    def between(first: Sequence[Points], last: Sequence[Points], fraction: float) -> list[Points]:
        """The curves between two sets of them, 0 and 1: directions and lengths of their segments in between."""
        return [_between(*pair, fraction) for pair in zip(first, last, strict=True)]


def _shares(body: Mesh, limb: NDArray[np.int8], offset: Points) -> Floats:
    """How far out each vertex is on its limb, as a fraction of how far that reaches there, shape [V].

    What lies within a limb, as a mouth does in a head, would be drawn onto one surface with the skin, and keep cloth
    that lies there as the skin grows: a high collar ended between the teeth, torn.
    """
    length = row_lengths(offset)
    out = offset / np.maximum(length, TINY)[:, None]
    shares = np.ones(len(length))
    for number in range(TRUNK + 1):
        own = np.flatnonzero((limb == number) & (length > TINY))
        triangles = body.triangles[(limb[body.triangles] == number).all(axis=1)]
        reach = outermost_distances(body.points, triangles, body.points[own] - offset[own], out[own])
        shares[own] = np.minimum(1.0, length[own] / np.maximum(reach, TINY))
    return shares


def _between(home: Points, posed: Points, fraction: float) -> Points:
    if fraction <= 0.0 or posed is home:
        return home
    first, last = np.diff(home, axis=0), np.diff(posed, axis=0)
    first_length, last_length = (np.linalg.norm(each, axis=1, keepdims=True) for each in (first, last))
    a, b = first / np.maximum(first_length, TINY), last / np.maximum(last_length, TINY)
    angle = np.arccos(np.clip((a * b).sum(axis=1, keepdims=True), -1.0, 1.0))
    sine = np.sin(angle)
    is_small = sine < 1e-4
    safe = np.where(is_small, 1.0, sine)
    turned = (np.sin((1.0 - fraction) * angle) * a + np.sin(fraction * angle) * b) / safe
    direction = np.where(is_small, (1.0 - fraction) * a + fraction * b, turned)
    direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), TINY)
    start = (1.0 - fraction) * home[0] + fraction * posed[0]
    segments = direction * ((1.0 - fraction) * first_length + fraction * last_length)
    return np.vstack([start, start + np.cumsum(segments, axis=0)])


def _at(curve: Points, station: Floats) -> Points:
    """Interpolated rows of an array over a curve's stations, 0 to 1: as by ``numpy.interp``, in half its time."""
    stations = np.linspace(0.0, 1.0, len(curve))
    slopes = np.diff(curve, axis=0) / np.diff(stations)[:, None]
    before = np.searchsorted(stations, station, side="right") - 1
    inside = np.clip(before, 0, len(slopes) - 1)
    found = slopes[inside] * (station - stations[inside])[:, None] + curve[inside]
    ends = before != inside
    found[ends] = curve[np.clip(before[ends], 0, len(curve) - 1)]
    return found


def _tangents(curve: Points) -> Points:
    """Unit tangents at the points of a curve, shape [N, 3]."""
    return _unit(smoothed(np.gradient(curve, axis=0), SMOOTHING))


def _rotated(vectors: Points, before: Points, after: Points) -> Points:
    """Vectors turned by the least rotation from one unit vector to another, row by row (Rodrigues' formula)."""
    a, b, v = before.T, after.T, vectors.T
    cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    axis = _cross(a, b)  # of the length of the sine
    along = axis * (axis[0] * v[0] + axis[1] * v[1] + axis[2] * v[2]) / np.maximum(1.0 + cosine, 1e-3)
    turned: Points = (v * cosine + _cross(axis, v) + along).T
    return turned


def _cross(a: Points, b: Points) -> Points:
    """Cross products of columns, shape [3, N]: as ``numpy.cross``, in a third of its time."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _unit(vectors: Points) -> Points:
    """Rows of length 1."""
    unit: Points = vectors / np.maximum(row_lengths(vectors), TINY)[:, None]
    return unit

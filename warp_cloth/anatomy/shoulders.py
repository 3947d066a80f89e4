"""Does a garment lie on the shoulders? Where the frontal plane through the roots of the arms cuts its cloth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warp_cloth.anatomy.geodesics import Floats
from warp_cloth.anatomy.openings import ARMS, Limbs
from warp_cloth.anatomy.skeleton import HEAD, LEFT_ARM, RIGHT_ARM, Skeleton, outward_of
from warp_cloth.base.mesh import Indices, Points
from warp_cloth.base.section import section_at, segments_at

# Distances from the middle of the body, across and up from the root of an arm, over that of the root.
EDGE = (0.7, 0.95)  # where the top of the shoulder is measured
NEAR_PLANE = 0.25  # that far before and behind the root
# Of the height of the shoulder's top: straps on the edge of the shoulders reach 0.6, those hanging on the arms 0.52.
ON_TOP = 0.56
BEGAN = 0.5  # the same where a garment starts, perhaps a little low
ON_ARM = 1.25  # cloth that begins so far out lies on the arm, however that is raised
ROOT = 1.0  # the arm's root: cloth on a shoulder starts no farther out, nor is worn so if it began by the neck
# Cloth that begins so near the neck lies on the shoulder, however low: between the neck and a raised arm is a hollow.
BY_NECK = 0.75
# A garment has slipped to one side where it begins so far out on that side, and so near the middle on the other one,
# and began about alike.
OUTSIDE, INSIDE, ALIKE = 0.95, 0.5, 0.25
# Panels start with their shoulder seams a little below the skin, since these are drawn straight: 1 to 4 cm.
SEAM = 0.025  # [m]
ACROSS = np.linspace(0.5, 0.9, 9)  # from the middle, over that of the root: where it is measured
FARTHER = np.linspace(0.95, 1.1, 4)  # the same, of straps that are farther out
OUTER = np.linspace(0.9, 1.5, 13)  # the same, of shoulders wider than the body's, outside a hood
WALL = 0.5  # fall of cloth between two of these places, of which the inner one is on the side of a hood
LAID = (0.5, 0.7)  # the same: straps are laid between these, as near as can be to where they were placed
LOW = 0.3  # [m] below the skin: cloth so far down is no shoulder's


@dataclass(frozen=True)
class Cover:
    """Cloth, or skin, over one shoulder: where it begins, seen from the middle, and how high it reaches."""

    inner: float  # inf: there is none above the arm's root
    top: float  # -inf: there is none on this side


@dataclass(frozen=True, eq=False)
class Strap:
    """Cloth over one shoulder that lies too far out."""

    place: Points  # of its highest point in the frontal plane [m], shape [3]
    inwards: Points  # the way from there to the top of the shoulder, of length 1, shape [3]
    off: float  # how far it is too far out [m]


@dataclass(frozen=True, eq=False)
class Shoulders:
    """The shoulders that a garment lay over as it started."""

    sides: dict[int, _Side]  # of each arm with an opening of its own, where the head has one, too
    begun: dict[int, Cover]  # the garment where it started
    skin: dict[int, float]  # how high their tops are

    @classmethod
    def of(cls, limbs: Sequence[Limbs], start: Points, triangles: Indices, skeleton: Skeleton) -> Shoulders:
        """Of the body of a garment whose openings are for these limbs.

        Args:
            limbs: whom each opening is for.
            start: the garment's points where it started, moved onto the body [m], shape [V, 3].
            triangles: shape [F, 3].
            skeleton: of the body.
        """
        sides = {arm: _Side(skeleton, arm) for arm in _with_shoulders(limbs)}
        begun = {arm: side.cover(start, triangles) for arm, side in sides.items()}
        return cls(sides, begun, {arm: side.skin_top(skeleton.skin) for arm, side in sides.items()})

    @property
    def placed(self) -> list[int]:
        """The arms whose shoulder the garment lay over."""
        begun, skin = self.begun, self.skin
        told = [arm for arm in self.sides if np.isfinite(skin[arm])]  # on a coarse body no vertex may be there
        return [arm for arm in told if _began_on(begun[arm], skin[arm])]

    def slipped(self, worn: Points, triangles: Indices) -> tuple[int, ...]:
        """The arms whose shoulder the garment has slipped off, with its points as worn [m], shape [V, 3]."""
        begun, skin, now = self.begun, self.skin, {}
        if lay := self.placed:
            now = {arm: side.cover(worn, triangles) for arm, side in self.sides.items()}
        slipped = [arm for arm in lay if not _lies(now[arm], skin[arm], begun[arm])]
        if not slipped and len(lay) == 2 and abs(begun[RIGHT_ARM].inner - begun[LEFT_ARM].inner) < ALIKE:
            outer, inner = sorted(self.sides, key=lambda arm: -now[arm].inner)
            slipped = [outer] if now[outer].inner > OUTSIDE and now[inner].inner < INSIDE else []
        return tuple(slipped)

    def straps(self, worn: Points, triangles: Indices) -> list[Strap]:
        """The cloth over each shoulder that lies too far out, at ``worn`` [m], shape [V, 3]."""
        found = []
        for arm in self.placed:
            side, target = self.sides[arm], float(np.clip(self.begun[arm].inner, *LAID))
            inner, highest = side.cover(worn, triangles).inner, side.highest(worn, triangles)
            if highest is None or not (inner := min(inner, float(highest[0]))) > target:
                continue
            way = np.array([target - inner, self.skin[arm] - float(highest[1])])
            inwards = side.direction(way / float(np.linalg.norm(way)))
            found.append(Strap(side.place(highest), inwards, (inner - target) * side.width))
        return found


def height_over_shoulders(limbs: Sequence[Limbs], points: Points, triangles: Indices, skeleton: Skeleton) -> float:
    """How much higher a garment of panels starts than on one whose shoulders it fits [m]; 0: it has no shoulders.

    Measured where its cloth is nearest above the skin, as collars and hoods stand up; ``points`` [m], shape [V, 3].
    """
    heights = []
    for arm in _with_shoulders(limbs):
        side = _Side(skeleton, arm)
        for across in (ACROSS, FARTHER):
            gaps = side.tops(points, triangles, across) - side.skin_tops(skeleton.skin, across)
            gaps = gaps[gaps * side.width > -LOW]  # also not where there is none, nan
            if len(gaps):
                gap = float(gaps.min())
                heights.append(min(gap, _outside_hood(side, points, triangles, skeleton.skin)) * side.width + SEAM)
                break
    return sum(heights) / len(heights) if heights else 0.0


def _outside_hood(side: _Side, points: Points, triangles: Indices, skin: Points) -> float:
    """How high cloth is above a narrow shoulder outside a hood, or a wide collar, that stands on all of it.

    Infinite where none stands there, or the cloth outside it is no shoulder's since it lies lower than the skin.
    """
    tops = side.tops(points, triangles, OUTER)
    walls = np.flatnonzero(tops[:-1] - tops[1:] > WALL)
    if not len(walls):
        return float("inf")
    # beyond its root the arm hangs; the shoulder of who is larger is as high there as at its edge
    gap = float(np.nanmin(tops[walls[-1] + 1 :])) - float(side.skin_tops(skin, ACROSS)[-1])
    return gap if gap > 0.0 else float("inf")


def _with_shoulders(limbs: Sequence[Limbs]) -> list[int]:
    """The arms with an opening of their own, beside one for the head: other garments need not lie on a shoulder."""
    return [arm for arm in ARMS if (arm,) in limbs and any(HEAD in each and arm not in each for each in limbs)]


def _began_on(cover: Cover, skin: float) -> bool:
    """Whether cloth starts over a shoulder whose top is that high."""
    return cover.inner < BY_NECK or (cover.inner < ROOT and cover.top > BEGAN * skin)


def _lies(cover: Cover, skin: float, begun: Cover) -> bool:
    """Whether cloth that began at ``begun`` lies on a shoulder whose top is that high."""
    outermost = ROOT if begun.inner < BY_NECK else ON_ARM
    return cover.inner < BY_NECK or (cover.inner <= outermost and cover.top >= ON_TOP * skin)


class _Side:
    """Coordinates about the root of one arm: outwards from the middle, up and forward from the root."""

    def __init__(self, skeleton: Skeleton, arm: int) -> None:
        self._middle = skeleton.middle
        root = skeleton.curves[arm][skeleton.joints[arm]] - self._middle
        out = outward_of(skeleton, arm)
        self.width = max(float(root @ out), 1e-6)  # of the root from the middle [m]; the unit of all coordinates
        self._axes = np.stack([out, skeleton.up, skeleton.forward], axis=1) / self.width
        self._root = root @ self._axes * (0.0, 1.0, 1.0)

    def cover(self, points: Points, triangles: Indices) -> Cover:
        """Of a garment's cloth, in the frontal plane through the root."""
        own = self._section(points, triangles)
        above = own[own[:, 1] > 0.0]
        return Cover(float(above[:, 0].min(initial=np.inf)), float(own[:, 1].max(initial=-np.inf)))

    def highest(self, points: Points, triangles: Indices) -> Floats | None:
        """Where the cloth in the frontal plane through the root is highest, shape [2]; None: there is none."""
        own = self._section(points, triangles)
        return own[int(own[:, 1].argmax())] if len(own) else None

    def _section(self, points: Points, triangles: Indices) -> Floats:
        """Ends of the segments along which that plane cuts a garment on this side, shape [N, 2]."""
        here = (points - self._middle) @ self._axes - self._root
        ends = segments_at(here[:, 2], here[:, :2], triangles).reshape(-1, 2)
        return ends[ends[:, 0] > 0.0]

    def place(self, here: Floats) -> Points:
        """A place of the frontal plane through the root [m], shape [3]."""
        coordinates = np.array([here[0], here[1], 0.0]) + self._root
        place: Points = self._middle + self.width**2 * self._axes @ coordinates
        return place

    def direction(self, here: Floats) -> Points:
        """A direction in that plane, shape [3]."""
        way: Points = self.width * self._axes[:, :2] @ here
        return way

    def skin_top(self, body: Points) -> float:
        """How high the shoulder's top lies above the root; -inf where no vertex is near."""
        here = (body - self._middle) @ self._axes - self._root
        is_near = (here[:, 0] > EDGE[0]) & (here[:, 0] < EDGE[1]) & (np.abs(here[:, 2]) < NEAR_PLANE)
        return float(here[is_near, 1].max(initial=-np.inf))

    def tops(self, points: Points, triangles: Indices, columns: Floats) -> Floats:
        """How high the cloth on the shoulder reaches at these distances across, in that plane; nan: there is none.

        That is the part of the section that reaches highest there: another one lies below the arm.
        """
        here = (points - self._middle) @ self._axes - self._root
        section = section_at(here[:, 2], here[:, :2], triangles)
        across, up = section.ends[:, :, 0], section.ends[:, :, 1]
        spans = across[:, 1] - across[:, 0]
        along = (columns[:, None] - across[:, 0]) / np.where(spans == 0.0, np.inf, spans)
        heights = np.where(
            (along >= 0.0) & (along <= 1.0) & (spans != 0.0), up[:, 0] + along * (up[:, 1] - up[:, 0]), -np.inf
        )
        if not np.isfinite(heights).any():
            return np.full(len(columns), np.nan)
        highest = section.part[int(heights.max(axis=0).argmax())]
        found = heights[:, section.part == highest].max(axis=1)
        return np.where(np.isfinite(found), found, np.nan)

    def skin_tops(self, body: Points, columns: Floats) -> Floats:
        """How high the skin reaches at these distances across."""
        here = (body - self._middle) @ self._axes - self._root
        near = here[np.abs(here[:, 2]) < NEAR_PLANE]
        width = columns[1] - columns[0]
        return np.array([near[np.abs(near[:, 0] - place) < width, 1].max(initial=-np.inf) for place in columns])

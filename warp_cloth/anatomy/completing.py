"""Bodies that lack limbs, completed so that the rest can be understood: amputees, dress forms and torsos.

A limb that one side lacks is taken from the other: the body is joined with its mirror image. A trunk that lacks its
head, or both arms or legs, gets plain ones of a person's proportions, in an A-pose; a bust a lower trunk, too, and hips
that end below the chest an upper one. The pole that a form stands on is left out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warp_cloth.anatomy.geodesics import Floats
from warp_cloth.base.lids import cones, with_tips
from warp_cloth.base.mesh import Indices, Points
from warp_cloth.base.section import Sections
from warp_cloth.base.topology import used_ids

Surface = tuple[Points, Indices]
Box = tuple[float, float, float, float]  # extents of a section from right to left, and from back to front [m]

CELL = 0.006  # of the extent: a vertex whose mirror image is within two of these of the surface has a like
PLANES = np.linspace(-0.06, 0.06, 49)  # of the extent, from the middle of the vertices
MOST_ASKED = 20_000  # vertices, spread over all
MIRRORED = (0.6, 0.995)  # part of the vertices that have a like, of who lacks a limb on one side

LEVELS = 120  # at which a trunk is cut
LOWEST = 5  # level, from the bottom, at which legs that end early are cut
MOST_ENDS, SCRAP = 2, 0.1  # parts of that section, and their least width, of that of the shoulders
JOIN = 1.25  # times as wide as two levels below: arms are part of the section
SHOULDERS = 1.3  # width of the shoulders over that of the chest where arms leave it
FLAT = 0.9  # depth over width of the shoulders at most: 0.4 to 0.7 in people, 1 in a bottle
NECK = 0.65  # of the shoulders' width, that of a neck at most
TRUNK = (1.0, 2.2)  # length of a trunk, from crotch to neck, over the shoulders' width: 1.2 to 1.4 in people
# Of that length: legs that are shorter end early (0.87 in the newborn, else 1.2), and how long they are made.
SHORT_LEGS, LEGS = 0.8, 1.25
# Of the shoulders' width, above the neck: what is lower is no head; nor is what is lower than the second and nowhere
# wider than the neck by that factor.
STUB, HEAD, WIDER = 0.3, 0.5, 1.15
# Width of a body with arms above its elbows, which are so far up the trunk, over that of its shoulders.
ARMS, ELBOWS = 1.22, 0.35
RING = 16  # corners of a plain limb's sections
# Of the shoulders' width, the length of a bust at least, from where it is cut above the crotch to the neck; and of its
# whole height how far up the chest is at least.
BUST, BUST_BEGINS = 0.45, 0.1
TALLEST_HEAD, WIDEST_HEAD = 1.2, 0.8  # of the shoulders' width, what is above the neck: 0.6 and 0.55 in people
PLAIN_TRUNK, SHOULDERS_TO_HIPS = 1.3, 1.25  # length of a trunk over its shoulders' width, and that over the hips'
# A plain trunk's half width, over the shoulders', at these heights over its length, and its depth over its width.
BARREL, BARREL_LEVELS, BARREL_DEPTH = (0.36, 0.38, 0.3, 0.36, 0.4, 0.17), (0.05, 0.15, 0.45, 0.7, 0.85, 1.0), 0.6
# Of the hips' width, the least of a leg, of the legs' length below them, and of what is above the crotch.
LEG, LEGS_LEFT, HIPS_LEFT = 0.25, 0.5, 0.15
POLE = 0.25  # of the largest width above it, that of a pole at most
POLE_LENGTH = 0.04  # of the extent, at least

# To the left, up and forward: of who is upright along y and faces +z, and of who is upright along z and faces -y; and
# from those to the same of who faces what was left.
FACING_Z = np.eye(3)
FACING_BACK = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
QUARTER = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])


@dataclass(frozen=True, eq=False)
class _Trunk:
    """A trunk along y, its front along z, measured by its horizontal sections [m]."""

    middle: float  # between right and left
    depth: float  # of the neck's middle, between back and front
    width: float  # of the shoulders
    neck: float  # heights: of the lowest section above the shoulders that is as narrow as a neck,
    crotch: float  # of the lowest section across the middle,
    bottom: float
    feet: tuple[Box, ...]  # the lowest sections: of both legs, or one of the trunk
    has_head: bool
    has_arms: bool
    has_all: bool = True  # from crotch to neck; else it is a bust, or hips

    def limbs(self) -> list[Surface]:
        """Plain limbs, and a plain trunk, for those that it lacks."""
        found, width = [], self.width
        if not self.has_all:
            base = np.array([self.middle, self.crotch, self.depth])
            way = (0.0, self.neck - self.crotch, 0.0)
            barrel, corners = _tube(base, way, BARREL_LEVELS, width * np.array(BARREL))
            barrel[:, 2] = self.depth + BARREL_DEPTH * (barrel[:, 2] - self.depth)
            found.append((barrel, corners))
        if not self.has_head:
            base = np.array([self.middle, self.neck, self.depth])
            radii = width * np.array([0.13, 0.13, 0.19, 0.19, 0.12])
            found.append(_tube(base, (0.0, width, 0.0), (-0.1, 0.15, 0.3, 0.55, 0.66), radii))
        lacks_legs = self.crotch - self.bottom < SHORT_LEGS * (self.neck - self.crotch)
        ankles = self.crotch - LEGS * (self.neck - self.crotch) + 0.08 * width
        for side in (1.0, -1.0):
            if not self.has_arms:
                root = np.array([self.middle + 0.38 * side * width, self.neck - 0.14 * width, self.depth])
                found.append(_tube(root, (side * width, -width, 0.0), (0.0, 1.0), (0.1 * width, 0.06 * width)))
            if lacks_legs:
                end = self._end(side)
                ankle = np.array([end[0], ankles, end[2]])
                found.append(_tube(end, ankle - end, (0.0, 1.0), (0.15 * width, 0.08 * width)))
                found.append(_tube(ankle, (0.0, 0.0, width), (-0.1, 0.45), (0.08 * width, 0.08 * width)))
        return found

    def _end(self, side: float) -> Points:
        """Where a leg that ends early is continued, shape [3]."""
        height = self.bottom + 0.1 * self.width
        right, left, back, front = max(self.feet, key=lambda box: side * (box[0] + box[1]))
        x = self.middle + 0.25 * side * (left - right) if len(self.feet) == 1 else 0.5 * (right + left)
        return np.array([x, height, 0.5 * (back + front)])


@dataclass(frozen=True, eq=False)
class Completed:
    """A body's surface with limbs that it may lack."""

    points: Points  # [m], shape [N, 3], the body's own the first
    triangles: Indices  # shape [F, 3]
    own: NDArray[np.int64]  # the body's vertices that it has, without those of a stand, shape [M]


def completed(points: Points, triangles: Indices) -> Iterator[Completed]:
    """Surfaces of a body with limbs that it may lack, one after another.

    ``points`` [m], shape [V, 3]; ``triangles`` of a closed surface, shape [F, 3].
    """
    mirrored, own = list(_mirrored(points, triangles)), used_ids(triangles, len(points))
    yield from (Completed(*surface, own) for surface in mirrored)
    for surface in ((points, triangles), *mirrored[:1]):  # a torso may lack one arm, too
        yield from _with_plain_limbs(*surface)


def _with_plain_limbs(points: Points, triangles: Indices) -> Iterator[Completed]:
    """A trunk, or hips, upright along y or z, with plain limbs where it lacks its own; then what stands on a pole."""
    first = _Upright.of(points, triangles, FACING_Z)
    seen = (first, first.turned(), _Upright.of(points, triangles, FACING_BACK))
    for each in seen:
        yield from each.with_limbs_of(_trunk_of(each.levels))
    forms: list[_Upright] = []
    for each in seen:
        yield from each.with_limbs_of(_hips_of(each.levels))
        yield from each.with_limbs_of(_bust_of(each.levels))
        forms = [form.turned() for form in forms] if each is seen[1] else list(each.above_poles())
        for form in forms:
            yield from form.with_limbs_of(_trunk_of(form.levels) or _bust_of(form.levels))


@dataclass(frozen=True, eq=False)
class _Upright:
    """A surface, and its sections in a frame that it may be upright in."""

    points: Points  # [m], shape [V, 3]
    triangles: Indices  # shape [F, 3]
    frame: Points  # unit vectors to the left, up and forward, shape [3, 3]
    levels: _Levels

    @classmethod
    def of(cls, points: Points, triangles: Indices, frame: Points) -> _Upright:
        return cls(points, triangles, frame, _Levels.of(points @ frame.T, triangles))

    def turned(self) -> _Upright:
        """The same of who faces what was left; it need not be cut again."""
        return replace(self, frame=QUARTER @ self.frame, levels=self.levels.turned())

    def above_poles(self) -> Iterator[_Upright]:
        """What stands on its poles."""
        for height in self.levels.tops_of_poles():
            above, faces = closed_above(self.points, self.triangles, self.frame[1], height)
            if len(faces):  # else all are as tall as the pole, such as a sheet's
                yield _Upright.of(above, faces, self.frame)

    def with_limbs_of(self, trunk: _Trunk | None) -> Iterator[Completed]:
        """The surface with the limbs that this trunk lacks; none, where there is nothing to add."""
        limbs = [] if trunk is None else trunk.limbs()
        if limbs:
            own = (self.points, self.triangles)
            whole = _joined([own, *((each @ self.frame, corners) for each, corners in limbs)])
            yield Completed(*whole, used_ids(self.triangles, len(self.points)))


def closed_above(points: Points, triangles: Indices, up: Points, height: float) -> Surface:
    """The part of a closed surface above a height [m] along the unit vector ``up``, its holes closed."""
    above = triangles[(points[triangles] @ up > height).all(axis=1)]
    lids, rims = cones(above.astype(np.int64), len(points))
    return with_tips(points, rims), np.vstack([above, lids.astype(np.int32)])


def _mirrored(points: Points, triangles: Indices) -> Iterator[Surface]:
    """A body joined with its mirror image, or with that of its upper or lower half alone."""
    from scipy import ndimage

    own = points[used_ids(triangles, len(points))]
    low, extent = own.min(axis=0), np.ptp(own, axis=0)
    size = CELL * float(extent.max())
    cells = ((own - low) / size).astype(np.int64)
    is_near = np.zeros(cells.max(axis=0) + 1, dtype=np.bool_)
    is_near[tuple(cells.T)] = True
    is_near = ndimage.binary_dilation(is_near)
    best, step = (0.0, 0, 0.0), len(own) // MOST_ASKED + 1
    own, cells = own[::step], cells[::step]
    for axis in range(3):
        middle = 0.5 * float(np.percentile(own[:, axis], 30) + np.percentile(own[:, axis], 70))
        for plane in (middle + PLANES * float(extent.max())).tolist():
            image = cells.copy()
            image[:, axis] = np.floor((2.0 * plane - own[:, axis] - low[axis]) / size)
            is_within = (image[:, axis] >= 0) & (image[:, axis] < is_near.shape[axis])
            best = max(best, (float(is_near[tuple(image[is_within].T)].sum() / len(own)), axis, plane))
    alike, axis, plane = best
    if not MIRRORED[0] < alike < MIRRORED[1]:
        return
    image = points.copy()
    image[:, axis] = 2.0 * plane - image[:, axis]
    upright = int(np.argmax(np.where(np.arange(3) == axis, 0.0, extent)))
    is_upper = points[triangles][:, :, upright].mean(axis=1) > low[upright] + 0.5 * extent[upright]
    for kept in (np.ones(len(is_upper), dtype=np.bool_), is_upper, ~is_upper):
        yield _joined([(points, triangles), (image, triangles[kept][:, ::-1])])


@dataclass(frozen=True, eq=False)
class _Levels:
    """A surface's horizontal sections."""

    used: Points  # its vertices [m], shape [N, 3]
    heights: Floats  # [m], shape [LEVELS]
    boxes: tuple[list[Box], ...]  # of the parts of each section

    @classmethod
    def of(cls, points: Points, triangles: Indices) -> _Levels:
        used = points[used_ids(triangles, len(points))]
        bottom, top = (float(height) for height in (used[:, 1].min(), used[:, 1].max()))
        heights = bottom + (np.arange(LEVELS) + 0.5) * (top - bottom) / LEVELS
        sections = Sections(points, triangles)
        boxes = tuple([_box(part) for part in sections.at(height).parts()] for height in heights.tolist())
        return cls(used, heights, boxes)

    def turned(self) -> _Levels:
        """The same in QUARTER of its frame."""
        boxes = tuple([(-front, -back, right, left) for right, left, back, front in level] for level in self.boxes)
        return _Levels(self.used @ QUARTER.T, self.heights, boxes)

    @cached_property
    def middle(self) -> float:
        """Between right and left [m]."""
        return 0.5 * float(np.percentile(self.used[:, 0], 5) + np.percentile(self.used[:, 0], 95))

    @property
    def bottom(self) -> float:
        return float(self.used[:, 1].min())

    @property
    def top(self) -> float:
        return float(self.used[:, 1].max())

    @cached_property
    def across(self) -> list[Box | None]:
        """The widest part of each section that lies across the middle."""
        parts = ([box for box in level if box[0] < self.middle < box[1]] for level in self.boxes)
        return [max(level, key=_width, default=None) for level in parts]

    @cached_property
    def width(self) -> Floats:
        """Of these [m]; 0: there is none."""
        return np.array([0.0 if box is None else _width(box) for box in self.across])

    def tops_of_poles(self) -> list[float]:
        """Heights at which poles end below something wide [m], the highest first."""
        size = np.array([_extent(level) for level in self.boxes])
        narrow = size < POLE * np.maximum.accumulate(size[::-1])[::-1]
        ends = np.flatnonzero(narrow[:-1] & ~narrow[1:])
        least = math.ceil(POLE_LENGTH * LEVELS)
        poles = [int(end) for end in ends[::-1] if end + 1 >= least and narrow[end + 1 - least : end + 1].all()]
        return [float(self.heights[end]) for end in poles]


def _trunk_of(levels: _Levels) -> _Trunk | None:
    """The trunk of a body along y; None: it is none."""
    found = _upper_trunk(levels, 0.5)
    if found is None or not TRUNK[0] * found.width < found.neck - found.crotch < TRUNK[1] * found.width:
        return None
    return found if 1 <= len(found.feet) <= MOST_ENDS else None


def _bust_of(levels: _Levels) -> _Trunk | None:
    """The trunk of which the upper part is there; None: it is none."""
    found = _upper_trunk(levels, BUST_BEGINS)
    if found is None or not BUST * found.width < found.neck - found.crotch <= TRUNK[0] * found.width:
        return None
    heads = [_extent(level) for height, level in zip(levels.heights, levels.boxes, strict=True) if height > found.neck]
    if levels.top - found.neck > TALLEST_HEAD * found.width or max(heads, default=0.0) > WIDEST_HEAD * found.width:
        return None
    end, half = found.neck - PLAIN_TRUNK * found.width, 0.4 * found.width
    hips = (found.middle - half, found.middle + half, found.depth - half, found.depth + half)
    return replace(found, crotch=end, bottom=end, feet=(hips,), has_all=False)


def _upper_trunk(levels: _Levels, begins: float) -> _Trunk | None:
    """What is like a trunk from its chest up, which begins so far up what lies across the middle; None: nothing is."""
    boxes, heights, across, width = levels.boxes, levels.heights, levels.across, levels.width
    if not all(boxes):
        return None
    apart = np.flatnonzero(width[: LEVELS * 2 // 3] == 0.0)
    crotch = int(apart[-1]) + 1 if len(apart) else 0
    first = crotch + begins * (LEVELS - crotch)
    joins = crotch + 2 + np.flatnonzero(width[crotch + 2 :] > JOIN * width[crotch:-2])
    joins = joins[joins > first]
    upper = np.arange(int(first), joins[0] if len(joins) else LEVELS)
    if not len(upper):
        return None
    chest = int(upper[np.argmax(width[upper])])
    shoulders = (SHOULDERS if len(joins) else 1.0) * float(width[chest])
    narrow = chest + np.flatnonzero(width[chest:] < NECK * shoulders)
    if not len(narrow):
        return None
    neck, level = float(heights[narrow[0]]), across[chest]
    box = across[int(narrow[0])]
    if level is None or box is None or level[3] - level[2] > FLAT * shoulders:
        return None
    feet = _apart([each for each in boxes[LOWEST] if _width(each) > SCRAP * shoulders])
    above = width[narrow[0] :]
    is_wider = above.max() > WIDER * np.minimum.accumulate(above)[int(above.argmax())]
    high = (levels.top - neck) / shoulders
    has_head = high > HEAD or (high > STUB and bool(is_wider))
    sides = boxes[crotch + round(ELBOWS * (narrow[0] - crotch)) : narrow[0]]
    reach = max(max(each[1] for each in level) - min(each[0] for each in level) for level in sides)
    has_arms = reach > ARMS * shoulders
    low, depth = float(heights[crotch]), 0.5 * (box[2] + box[3])
    return _Trunk(levels.middle, depth, shoulders, neck, low, levels.bottom, feet, has_head, has_arms)


def _hips_of(levels: _Levels) -> _Trunk | None:
    """The trunk of which the lower part is there, with its legs or their upper ends; None: it is none."""
    boxes, heights, across, widths = levels.boxes, levels.heights, levels.across, levels.width
    if not all(boxes):
        return None
    apart = np.flatnonzero(widths == 0.0)
    crotch = int(apart[-1]) + 1 if len(apart) else 0
    if not 0 < crotch < LEVELS - 1 or not widths[crotch:].all():
        return None
    widest = crotch + int(widths[crotch:].argmax())
    hips, box, top = float(widths[widest]), across[widest], across[-1]
    low, above = float(heights[crotch]), levels.top - float(heights[crotch])
    legs = boxes[crotch - 1]
    if box is None or top is None or len(legs) != 2 or min(_width(leg) for leg in legs) < LEG * hips:
        return None
    is_whole = low - levels.bottom > LEGS_LEFT * hips and HIPS_LEFT * hips < above < PLAIN_TRUNK * hips
    if not is_whole or _width(top) < NECK * hips or box[3] - box[2] > FLAT * hips:
        return None
    feet = _apart([each for each in boxes[LOWEST] if _width(each) > SCRAP * hips])
    if len(feet) != MOST_ENDS:
        return None
    width, depth = SHOULDERS_TO_HIPS * hips, 0.5 * (top[2] + top[3])
    neck = low + PLAIN_TRUNK * width
    return _Trunk(levels.middle, depth, width, neck, low, levels.bottom, feet, False, False, has_all=False)


def _apart(boxes: Sequence[Box]) -> tuple[Box, ...]:
    """The widest of boxes that overlap, as those of a leg and of the other's mirror image do."""
    found: list[Box] = []
    for box in sorted(boxes, key=_width, reverse=True):
        right, left, back, front = box
        if not any(right < each[1] and each[0] < left and back < each[3] and each[2] < front for each in found):
            found.append(box)
    return tuple(found)


def _extent(boxes: Sequence[Box]) -> float:
    """From side to side, or from back to front, of boxes together, whichever is more [m]; 0 of none."""
    low, high = np.min(boxes or [(0.0,) * 4], axis=0), np.max(boxes or [(0.0,) * 4], axis=0)
    return float(max(high[1] - low[0], high[3] - low[2]))


def _width(box: Box) -> float:
    return box[1] - box[0]


def _box(part: Floats) -> Box:
    x, z = part[..., 0], part[..., 1]
    return float(x.min()), float(x.max()), float(z.min()), float(z.max())


def _tube(start: Points, way: ArrayLike, stations: Sequence[float], radii: ArrayLike) -> Surface:
    """A closed tube round an axis: from ``start`` [m] at these stations along ``way`` [m], with these radii [m]."""
    along = np.asarray(way, dtype=np.float64)
    across = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    across /= np.linalg.norm(across)
    other = np.cross(along / np.linalg.norm(along), across)
    angle = np.arange(RING) * (2.0 * np.pi / RING)
    ring = np.outer(np.cos(angle), across) + np.outer(np.sin(angle), other)
    centres = start + np.outer(stations, along)
    points = (centres[:, None] + np.asarray(radii)[:, None, None] * ring).reshape(-1, 3)
    here, there = np.arange(RING), np.roll(np.arange(RING), -1)
    sides = [
        np.stack([first, second, third], axis=1) + RING * n
        for n in range(len(centres) - 1)
        for first, second, third in ((here, there, there + RING), (here, there + RING, here + RING))
    ]
    last, ends = RING * (len(centres) - 1), np.full(RING, len(points))
    lids = [np.stack([there, here, ends], axis=1), np.stack([here + last, there + last, ends + 1], axis=1)]
    return np.vstack([points, centres[[0, -1]]]), np.vstack([*sides, *lids])


def _joined(surfaces: Sequence[Surface]) -> Surface:
    """Several surfaces as one."""
    first = np.cumsum([0, *(len(points) for points, _ in surfaces)])
    triangles = [corners + start for (_, corners), start in zip(surfaces, first[:-1], strict=True)]
    return np.vstack([points for points, _ in surfaces]), np.vstack(triangles).astype(np.int32)

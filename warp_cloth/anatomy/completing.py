"""Bodies that lack limbs, completed so that the rest can be understood: amputees, dress forms and torsos.

A limb that one side lacks is taken from the other: the body is joined with its mirror image. A trunk that lacks its
head, or both arms or legs, gets plain ones of a person's proportions, in an A-pose.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from warp_cloth.anatomy.geodesics import Floats
from warp_cloth.base.mesh import Indices, Points
from warp_cloth.base.section import Sections

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


@dataclass(frozen=True, eq=False)
class _Trunk:
    """A trunk along y, its front along z, measured by its horizontal sections [m]."""

    middle: float  # between right and left
    depth: float  # of the neck's middle, between back and front
    width: float  # of the shoulders
    neck: float  # heights: of the lowest section above the shoulders that is as narrow as a neck,
    crotch: float  # of the lowest section across the middle,
    top: float
    bottom: float
    feet: tuple[Box, ...]  # the lowest sections: of both legs, or one of the trunk
    has_head: bool
    has_arms: bool

    def limbs(self) -> list[Surface]:
        """Plain limbs for those that it lacks."""
        found, width = [], self.width
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


def completed(points: Points, triangles: Indices) -> Iterator[Surface]:
    """Surfaces of a body with limbs that it may lack, one after another.

    ``points`` [m], shape [V, 3]; ``triangles`` of a closed surface, shape [F, 3].
    """
    mirrored = list(_mirrored(points, triangles))
    yield from mirrored
    for surface in ((points, triangles), *mirrored[:1]):  # a torso may lack one arm, too
        yield from _with_plain_limbs(*surface)


def _with_plain_limbs(points: Points, triangles: Indices) -> Iterator[Surface]:
    """A trunk that is upright along y or z with plain limbs where it lacks its own."""
    for left, up, forward in ((0, 1, 2), (2, 1, 0), (0, 2, 1)):
        frame = np.eye(3)[[left, up, forward]]
        if np.linalg.det(frame) < 0.0:  # who faces +x has its left at -z; who is upright along z faces -y
            frame[0 if up == 1 else 2] *= -1.0
        trunk = _trunk_of(points @ frame.T, triangles)
        limbs = [] if trunk is None else trunk.limbs()
        if limbs:
            yield _joined([(points, triangles), *((each @ frame, corners) for each, corners in limbs)])


def _mirrored(points: Points, triangles: Indices) -> Iterator[Surface]:
    """A body joined with its mirror image, or with that of its upper or lower half alone."""
    from scipy import ndimage

    own = points[np.unique(triangles)]
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


def _trunk_of(points: Points, triangles: Indices) -> _Trunk | None:
    """The trunk of a body along y; None: it is none."""
    used = points[np.unique(triangles)]
    bottom, top = float(used[:, 1].min()), float(used[:, 1].max())
    heights = bottom + (np.arange(LEVELS) + 0.5) * (top - bottom) / LEVELS
    sections = Sections(points, triangles)
    boxes = [[_box(part) for part in sections.at(height).parts()] for height in heights.tolist()]
    if not all(boxes):
        return None
    middle = 0.5 * float(np.percentile(used[:, 0], 5) + np.percentile(used[:, 0], 95))
    across = [max((box for box in level if box[0] < middle < box[1]), key=_width, default=None) for level in boxes]
    width = np.array([0.0 if box is None else _width(box) for box in across])
    apart = np.flatnonzero(width[: LEVELS * 2 // 3] == 0.0)
    crotch = int(apart[-1]) + 1 if len(apart) else 0
    joins = crotch + 2 + np.flatnonzero(width[crotch + 2 :] > JOIN * width[crotch:-2])
    joins = joins[joins > 0.5 * (crotch + LEVELS)]
    upper = np.arange((crotch + LEVELS) // 2, joins[0] if len(joins) else LEVELS)
    if not len(upper):
        return None
    chest = int(upper[np.argmax(width[upper])])
    shoulders = (SHOULDERS if len(joins) else 1.0) * float(width[chest])
    narrow = chest + np.flatnonzero(width[chest:] < NECK * shoulders)
    if not len(narrow):
        return None
    neck, level = float(heights[narrow[0]]), across[chest]
    box = across[int(narrow[0])]
    length = neck - float(heights[crotch])
    if level is None or box is None or level[3] - level[2] > FLAT * shoulders:
        return None
    feet = _apart([each for each in boxes[LOWEST] if _width(each) > SCRAP * shoulders])
    if not TRUNK[0] * shoulders < length < TRUNK[1] * shoulders or not 1 <= len(feet) <= MOST_ENDS:
        return None
    above = width[narrow[0] :]
    is_wider = above.max() > WIDER * np.minimum.accumulate(above)[int(above.argmax())]
    high = (top - neck) / shoulders
    has_head = high > HEAD or (high > STUB and bool(is_wider))
    sides = boxes[crotch + round(ELBOWS * (narrow[0] - crotch)) : narrow[0]]
    reach = max(max(each[1] for each in level) - min(each[0] for each in level) for level in sides)
    has_arms = reach > ARMS * shoulders
    depth = 0.5 * (box[2] + box[3])
    return _Trunk(middle, depth, shoulders, neck, float(heights[crotch]), top, bottom, feet, has_head, has_arms)


def _apart(boxes: Sequence[Box]) -> tuple[Box, ...]:
    """The widest of boxes that overlap, as those of a leg and of the other's mirror image do."""
    found: list[Box] = []
    for box in sorted(boxes, key=_width, reverse=True):
        right, left, back, front = box
        if not any(right < each[1] and each[0] < left and back < each[3] and each[2] < front for each in found):
            found.append(box)
    return tuple(found)


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

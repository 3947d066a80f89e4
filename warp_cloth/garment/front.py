"""Which side of a garment is its front, by its panels' names and its cut.

As garments are drafted for people: a neckline is lower in front; at the waist the front is wider than the back; below
the hips there is more cloth behind. Each alone is often wrong (a low back, a straight skirt), so they are added up.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_cloth.anatomy.geodesics import Floats
from warp_cloth.anatomy.linking import Wearing
from warp_cloth.anatomy.openings import ARMS, OPEN
from warp_cloth.anatomy.skeleton import HEAD, Skeleton
from warp_cloth.base.mesh import Mesh, Points

# Sums of cues, each 1 where the neckline is 10 cm lower on one side than on the other, or front and back differ by 10 %
# of both. Of 96 random designs with necklines as deep behind as in front the sum is -1.3 to 5, below -0.5 in nine.
CERTAIN, DOUBTFUL = 1.5, 0.5
NECKLINE, WIDTH = 10.0, 10.0  # cue per metre, and per part of the cloth
MOST_NECKLINE, MOST_WIDTH, MOST_BELOW = 2.0, 2.0, 3.0  # of each cue
NAMED = 10.0  # the cue of panels' names: they are sure
WAIST = (0.2, 0.6)  # of the way from the hips to the shoulders: the cloth there is a bodice's or a waistband's
SLICE = 0.02  # [m] of height, in which front and back are compared
NARROW, ALIKE = 0.1, 0.5  # [m] of a front or back, and their ratio, from which on both are whole
TRUNK_WIDTH = 1.15  # times as far from the middle as the roots of the arms: cloth farther out is a sleeve's
BETWEEN = 0.2  # of the way from the neck to the hem, on either side of its middle: there an open front has its edges
MIDDLE = 0.1  # of a neckline's width, on either side of its middle
LEAST = 0.05  # [m2] of cloth below the hips: less tells little
VERTICAL = np.array([0.0, 1.0, 0.0])
LEANS = 0.966  # cosine between trunk and vertical: what leans by 15 degrees wears what was turned with its trunk
SIDES = (("front", "back"), ("f", "b"), ("vorder", "rück"), ("vorder", "hinter"), ("devant", "dos"))


@dataclass(frozen=True)
class Front:
    """How far a garment lies with its front before its wearer."""

    score: float  # positive: the front is in front
    reason: str  # what speaks most for its back being in front: a clause


def front_of(wearing: Wearing, points: Points, areas: Floats, mesh: Mesh) -> Front:
    """Whether the front of a garment at ``points`` [m], shape [V, 3], is in front of its wearer.

    ``areas``: of its triangles at rest [m2], shape [F].
    """
    halves = _Halves.of(wearing, points, areas)
    if halves is None:
        return Front(0.0, "")
    named = NAMED * _named_sides(mesh, halves.ahead)
    lower = _neckline(wearing, points)
    wider, below = halves.wider_at_waist(), halves.more_below()
    cues = (
        (named, "panels that are named as its back lie in front"),
        (_most(NECKLINE * lower, MOST_NECKLINE), f"its neckline is {-100 * lower:.0f} cm lower behind than in front"),
        (_most(WIDTH * wider, MOST_WIDTH), f"it is {-100 * wider:.0f} % wider behind than in front at the waist"),
        (_most(-WIDTH * below, MOST_BELOW), f"it has {100 * below:.0f} % more cloth in front below the hips"),
    )
    return Front(sum(value for value, _ in cues), min(cues)[1])


@dataclass(frozen=True, eq=False)
class _Halves:
    """A garment's triangles, and whether each lies before or behind its middle."""

    areas: Floats  # at rest [m2], shape [F]
    ahead: Floats  # of the middle [m], shape [F]
    heights: Floats  # above the hips, 1 at the shoulders, shape [F]
    is_trunk: NDArray[np.bool_]  # near the middle from left to right, shape [F]
    rise: float  # from the hips to the shoulders [m]

    @classmethod
    def of(cls, wearing: Wearing, points: Points, areas: Floats) -> _Halves | None:
        """None: nothing of it is round the trunk."""
        skeleton = wearing.skeleton
        up, forward = _upright(skeleton)
        off = points[wearing.triangles].mean(axis=1) - skeleton.spine[0]
        rise = float((skeleton.shoulders - skeleton.spine[0]) @ up)
        ahead, sideways = off @ forward, off @ skeleton.left
        sideways = sideways - 0.5 * (sideways.min() + sideways.max())
        is_trunk = np.abs(sideways) < TRUNK_WIDTH * _shoulder_width(skeleton)
        if not is_trunk.any() or rise <= 0.0:
            return None
        middle = 0.5 * (ahead[is_trunk].min() + ahead[is_trunk].max())
        return cls(areas, ahead - middle, off @ up / rise, is_trunk, rise)

    def wider_at_waist(self) -> float:
        """How much wider the front is at the waist, of the whole; level by level, since hems differ in height."""
        count = max(int((WAIST[1] - WAIST[0]) * self.rise / SLICE), 1)
        edges = np.linspace(*WAIST, count + 1)
        front, back = (self._widths(edges, side * self.ahead > 0.0) for side in (1.0, -1.0))
        narrower, wider = np.minimum(front, back), np.maximum(front, back)
        whole = (narrower > NARROW) & (narrower > ALIKE * wider)
        return float(((front - back)[whole] / (front + back)[whole]).mean()) if whole.any() else 0.0

    def _widths(self, edges: Floats, own: NDArray[np.bool_]) -> Floats:
        """Width [m] of some of the trunk's cloth between these heights, shape [len(edges) - 1]."""
        own = own & self.is_trunk
        total = np.histogram(self.heights[own], edges, weights=self.areas[own])[0]
        widths: Floats = total / (np.diff(edges) * self.rise)
        return widths

    def more_below(self) -> float:
        """How much more cloth is in front below the hips, of the whole."""
        below = self.heights < 0.0
        front, back = (float(self.areas[below & (side * self.ahead > 0.0)].sum()) for side in (1.0, -1.0))
        return (front - back) / max(front + back, LEAST)


def _upright(skeleton: Skeleton) -> tuple[Points, Points]:
    """The vertical of a garment on a body, and its forward, shape [3] each.

    A trunk leans a little against the vertical, in which a garment is drawn: panels before and behind would differ.
    """
    up = VERTICAL if float(skeleton.up @ VERTICAL) > LEANS else skeleton.up
    forward = np.cross(skeleton.left, up)
    return up, forward / np.linalg.norm(forward)


def _shoulder_width(skeleton: Skeleton) -> float:
    """Half the distance between the roots of the arms [m]."""
    right, left = (skeleton.curves[arm][skeleton.joints[arm]] @ skeleton.left for arm in ARMS)
    return 0.5 * abs(float(left - right))


def _neckline(wearing: Wearing, points: Points) -> float:
    """How much lower the opening for the head is in front than behind [m]; 0: it has none.

    What is open from neck to hem is mostly a jacket, whose opening is in front; a gown that opens behind tells nothing.
    """
    up, forward = _upright(wearing.skeleton)
    pairs = list(zip(wearing.openings, wearing.limbs, strict=True))
    if OPEN in wearing.limbs:
        slit = next(points[opening.loop] for opening, limbs in pairs if limbs == OPEN)
        height, ahead = slit @ up, points @ forward
        between = np.abs(height - 0.5 * (height.min() + height.max())) < BETWEEN * np.ptp(height)
        is_ahead = bool(between.any()) and (slit[between] @ forward).mean() > 0.5 * (ahead.min() + ahead.max())
        return MOST_NECKLINE / NECKLINE if is_ahead else 0.0
    loops = [points[opening.loop] for opening, limbs in pairs if HEAD in limbs]
    if not loops:
        return 0.0
    neck = max(loops, key=lambda loop: float((loop @ up).mean()))
    across, ahead, height = neck @ wearing.skeleton.left, neck @ forward, neck @ up
    central = np.abs(across - 0.5 * (across.min() + across.max())) < MIDDLE * np.ptp(across)
    is_front = ahead > 0.5 * (ahead.min() + ahead.max())
    front, back = height[central & is_front], height[central & ~is_front]
    return float(back.mean() - front.mean()) if len(front) and len(back) else 0.0


def _named_sides(mesh: Mesh, ahead: Floats) -> float:
    """1: panels with a front's name lie before those with a back's, -1: behind; 0: no names tell.

    A name is a front's where another one is the same with the word for the back: "left_ftorso" and "left_btorso".
    """
    if mesh.panels is None or len(mesh.panels) != len(ahead):
        return 0.0
    number = {name.casefold(): index for index, name in enumerate(mesh.panel_names)}
    before, count = 0.0, 0
    for name, index in number.items():
        for front, back in SIDES:
            counterpart = number.get(re.sub(rf"(?<![^\W\d_]){front}", back, name))
            if counterpart is None or counterpart == index:
                continue
            places = [ahead[mesh.panels == panel] for panel in (index, counterpart)]
            if all(len(place) for place in places):
                before += float(np.sign(places[0].mean() - places[1].mean()))
                count += 1
    return before / count if count else 0.0


def _most(cue: float, limit: float) -> float:
    return min(max(cue, -limit), limit)

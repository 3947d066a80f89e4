"""Bands laid as rings: collars, waistbands, cuffs and bands at the hem."""

from __future__ import annotations

from collections.abc import Sequence, Set

import numpy as np

from warp_cloth.base.curves import arc_lengths
from warp_cloth.pattern.band_rings import has_wrists, is_round_armhole
from warp_cloth.pattern.collars import FALL, STAND
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.figure import UP, Figure
from warp_cloth.pattern.joints import Joint
from warp_cloth.pattern.kinds import COLLARS, LEFT, RIGHT
from warp_cloth.pattern.levels import WHOLE_TURN, repeated
from warp_cloth.pattern.placing_sleeves import (
    FROM_ARMPIT,
    SLEEVES,
    along_limb,
    around_arm,
    length_to_hem,
    shortened,
    top_of_arm,
)
from warp_cloth.pattern.specification import Side
from warp_cloth.pattern.wrap import Laid, Wrap

FLARE = 0.5  # of its width, by which the outer edge of a collar's fall starts farther out than its seam
ABOVE_NECK = 0.01  # [m] from the neckline to that edge, which else would start within fronts and back
BESIDE_FOOT = 0.2  # [m] from the toes to a cuff of trousers


def band(
    parts: Sequence[Part], joints: Sequence[Joint], found: Sequence[Laid | None], index: int, figure: Figure
) -> Wrap | None:
    """A band as a ring, its ends where its joint begins; ``found``: where other parts start."""
    part = parts[index]
    low, high = part.shape.box
    size = high - low
    lengthwise = np.array([part.up[1], -part.up[0]]) if size[0] > size[1] else part.up
    length, width = float(size.max()), float(size.min())
    points = np.concatenate([edge.points for edge in part.edges])
    # +x of the ring along the band, so that "up" is to its left
    along = np.array([-lengthwise[1], lengthwise[0]])
    lower = any(each.kind.startswith(("leg", "skirt", "gore")) for each in parts)
    below_hem = part.kind == "hem_band" or (part.kind == "waistband" and not lower)
    if _is_sewn_high(parts, joints, index, along) is (part.kind != "cuff" and not below_hem):
        along = -along  # what it is sewn to would be on its other side
    bend = WHOLE_TURN / length
    spots = points @ along
    levels = np.array([spots.min(), spots.max()])
    x = points @ np.array([along[1], -along[0]])
    centre = np.full(2, 0.5 * (x.min() + x.max()))
    if part.kind == "cuff":
        spots = [] if any(each.kind in SLEEVES for each in parts) else _spots(parts, joints, found, {index})
        at = np.concatenate(spots).mean(axis=0) if spots and has_wrists(parts) else None
        return _cuff(parts, index, figure, along, levels, centre, bend, at)
    # a ring begins behind for a collar, at the right side round a waist, at the left below a hem; see band_rings.py
    is_collar = part.kind in COLLARS
    from_back = is_collar or any(each.kind == "leg" for each in parts)
    from_left = below_hem and not any(each.kind == "gore" for each in parts)  # these begin on the right
    outward = figure.forward if from_back else -figure.left if from_left else figure.left
    halves = _halves(parts, joints, index)
    if len(halves) > 1:  # it lies before or behind
        is_front = any(parts[side.panel].kind.endswith("front") for side in _mates(joints, index))
        outward, bend = figure.forward if is_front else -figure.forward, 0.5 * bend
    if _opens_in_front(parts, joints, index):
        outward = -figure.forward
    bottom = _above_neck(parts, figure) if is_collar else float(figure.middle[1])
    if below_hem:
        fronts = [each for each in parts if each.kind == "front"]
        tall = max((float(np.ptp(each.shape.box, axis=0)[1]) for each in fronts), default=0.6)
        bottom = float(figure.neck[1]) - tall - width
        if lower and (spots := _spots(parts, joints, found, {index})):
            bottom = float(np.concatenate(spots)[:, 1].mean()) - width
    middle = np.stack([figure.at_height(bottom), figure.at_height(bottom + width)])
    across, out = repeated(np.cross(UP, outward), outward, 2)
    if part.kind == FALL:
        return _fall(parts, figure, Wrap(along, levels, centre, np.full(2, bend), middle, across, out), width)
    if is_collar:
        middle[:, [0, 2]] = figure.neck[[0, 2]]
    else:  # an ellipse as wide and deep as what it is sewn to: wider, it would fold down
        half, deep, ahead = _extent(parts, joints, found, halves, figure)
        middle += ahead * figure.forward
        half, deep = (half, deep) if abs(outward @ figure.left) > 0.5 else (deep, half)
        out = out * max(1.0, half * bend)
        across = across * max(1.0, deep * bend)
    return Wrap(along, levels, centre, np.full(2, bend), middle + out / bend, across, out)


def _opens_in_front(parts: Sequence[Part], joints: Sequence[Joint], index: int) -> bool:
    """Whether a band's ends are in front: what it is sewn to begins at a front and ends at another, or it is a fall."""
    if parts[index].kind == FALL:
        return True
    runs = [
        other
        for joint in joints
        for one, other in ((joint.one, joint.other), (joint.other, joint.one))
        if all(side.panel == index for side in one) and not any(parts[side.panel].kind in COLLARS for side in other)
    ]
    return any(parts[run[0].panel].kind == parts[run[-1].panel].kind == "front" for run in runs)


def _width_of(parts: Sequence[Part], kind: str) -> float:
    return max((float(np.ptp(each.shape.box, axis=0).min()) for each in parts if each.kind == kind), default=0.0)


def _drop(width: float) -> float:
    """How far below a fall's seam its outer edge starts [m]."""
    return float(width * np.sqrt(1.0 - FLARE**2))


def _above_neck(parts: Sequence[Part], figure: Figure) -> float:
    """The height at which a collar starts: the neckline's, or higher, so that a fall ends above that."""
    low = _drop(_width_of(parts, FALL)) + ABOVE_NECK - _width_of(parts, STAND)
    return float(figure.neck[1]) + (max(low, 0.0) if any(each.kind == FALL for each in parts) else 0.0)


def _fall(parts: Sequence[Part], figure: Figure, ring: Wrap, width: float) -> Wrap:
    """A collar's fall, turned down: from the top of its stand a cone that widens downwards.

    Args:
        ring: the fall as an upright ring, its levels from the stand to the outer edge; ``origin`` on the axis.
        width: from one level to the other [m].
    """
    top = _above_neck(parts, figure) + _width_of(parts, STAND)
    radius = 1.0 / ring.curvature[0]
    aside = FLARE * width
    height = np.array([top, top - _drop(width)])
    middle = np.stack([figure.at_height(y) for y in height])
    middle[:, [0, 2]] = figure.neck[[0, 2]]
    wider = np.array([1.0, 1.0 + aside / radius])[:, None]
    across, out = wider * ring.across, wider * ring.outward
    return Wrap(ring.along, ring.levels, ring.centre, ring.curvature, middle + out * radius, across, out)


def _is_sewn_high(parts: Sequence[Part], joints: Sequence[Joint], index: int, along: Floats) -> bool | None:
    """Whether a band is sewn to others by its farther side in this direction; None: it is sewn to none."""
    edges = parts[index].edges
    runs = [run for joint in joints for run in (joint.one, joint.other) if all(side.panel == index for side in run)]
    run = max(runs, key=lambda each: sum(edges[side.edge].length for side in each), default=())
    if not run:
        return None
    spots = np.concatenate([edge.points for edge in edges]) @ along
    own = np.concatenate([edges[side.edge].points for side in run]) @ along
    return bool(own.mean() > 0.5 * (spots.min() + spots.max()))


def _mates(joints: Sequence[Joint], index: int) -> list[Side]:
    """The edges that a part is sewn to."""
    pairs = [pair for joint in joints for pair in ((joint.one, joint.other), (joint.other, joint.one))]
    return [side for mine, theirs in pairs if any(side.panel == index for side in mine) for side in theirs]


def _halves(parts: Sequence[Part], joints: Sequence[Joint], index: int) -> Set[int]:
    """A band, and those of its kind whose ends are sewn to its own."""
    kind = parts[index].kind
    others = {side.panel for side in _mates(joints, index) if parts[side.panel].kind == kind}
    return {index} | (others if kind in ("waistband", "hem_band") else set())


def _spots(
    parts: Sequence[Part], joints: Sequence[Joint], found: Sequence[Laid | None], bands: Set[int]
) -> list[Floats]:
    """Points along each edge that bands are sewn to, where it starts [m], shape [9, 3]."""
    return [
        wrap.placed(parts[side.panel].edges[side.edge].at(np.linspace(0.0, 1.0, 9)))
        for index in sorted(bands)
        for side in _mates(joints, index)
        if side.panel not in bands and (wrap := found[side.panel]) is not None
    ]


def _extent(
    parts: Sequence[Part], joints: Sequence[Joint], found: Sequence[Laid | None], bands: Set[int], figure: Figure
) -> tuple[float, float, float]:
    """Half the width and depth of what bands are sewn to, and how far ahead its middle is [m]; else of the trunk."""
    spots = _spots(parts, joints, found, bands)
    if not spots:
        return figure.half_width, 0.5 * (figure.front + figure.back), 0.5 * (figure.front - figure.back)
    off = np.concatenate(spots) - figure.middle
    aside, ahead = off @ figure.left, off @ figure.forward
    return 0.5 * float(np.ptp(aside)), 0.5 * float(np.ptp(ahead)), 0.5 * float(ahead.min() + ahead.max())


def _cuff(
    parts: Sequence[Part],
    index: int,
    figure: Figure,
    along: Floats,
    levels: Floats,
    centre: Floats,
    bend: float,
    at: Floats | None,
) -> Wrap:
    """At the end of the sleeve, or of the leg where there are no sleeves; ``at``: of one in one with the body."""
    part = parts[index]
    side = part.side or (RIGHT if part.twin is not None and part.twin < index else LEFT)
    sleeves = [each for each in parts if each.kind in SLEEVES]
    at_armhole = is_round_armhole(parts, index)
    curve = (figure.arms if sleeves or at_armhole else figure.legs)[1 if side == LEFT else 0]
    width = float(levels[1] - levels[0])
    share = shortened(parts, figure) if sleeves else 1.0
    reach = float(arc_lengths(curve)[-1]) - BESIDE_FOOT - width
    long = share * length_to_hem(parts) if sleeves else reach
    long = 0.0 if at_armhole else long
    origin, toward = along_limb(curve, np.array([long + share * width, long]) + FROM_ARMPIT)
    if at is not None:  # such sleeves lie straight out from the body
        toward = np.tile(side * figure.left, (2, 1))
        origin = at + np.array([[width], [0.0]]) * toward
    across, outward = around_arm(toward, top_of_arm(figure, side))
    return Wrap(along, levels, centre, np.full(2, bend), origin + outward / bend, across, outward)

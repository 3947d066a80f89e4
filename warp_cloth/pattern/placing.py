"""Each part laid round what it covers: trunk, arm, leg, neck or head; others where their seams lead."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from warp_cloth.pattern.bibs import BIB
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.figure import UP, Figure
from warp_cloth.pattern.joints import Joint
from warp_cloth.pattern.kinds import BOTH, LEFT, STRIPS, YOKE_OF
from warp_cloth.pattern.levels import LEVELS, WHOLE_TURN, armpit_of, repeated, spans
from warp_cloth.pattern.lower_sleeves import LOWER_SLEEVE
from warp_cloth.pattern.placing_bands import band
from warp_cloth.pattern.placing_gores import cone, gore
from warp_cloth.pattern.placing_sleeves import half_sleeve, lower_sleeve, sleeve, under_sleeve
from warp_cloth.pattern.placing_straps import below_straps, strap
from warp_cloth.pattern.runs import faces_of, role_of
from warp_cloth.pattern.specification import Side
from warp_cloth.pattern.strapless import STRAPLESS
from warp_cloth.pattern.straps import STRAP
from warp_cloth.pattern.tiers import above_of
from warp_cloth.pattern.wrap import Laid, Wrap, flat_wrap

MOST_ROLLED = 0.6 * np.pi  # a half of the trunk's cover on either side of its middle
GAP = 0.005  # [m] between a part and the body's middle
ABOVE_CROTCH = 0.06  # [m] over which a leg widens to the trunk
BELOW_CROTCH = 0.03  # [m] from the body's crotch to that of briefs, which is sewn there between the legs
BESIDE_HEAD = 0.02  # [m]
REACH = 0.05  # [m] that a part beyond a seam is taken to go on as the one before


def wraps_of(parts: Sequence[Part], joints: Sequence[Joint], figure: Figure) -> tuple[Laid, ...]:
    """Where each part starts."""
    found: list[Laid | None] = [_by_kind(parts, index, figure) for index in range(len(parts))]
    bands = [index for index, part in enumerate(parts) if part.kind in STRIPS]  # where what they are sewn to starts
    for index, wrap in [(index, band(parts, joints, found, index, figure)) for index in bands]:
        found[index] = wrap
    for index in (index for index, part in enumerate(parts) if part.kind == STRAP):
        found[index] = strap(parts, joints, found, index, figure)
    for _ in range(len(parts)):
        missing = [index for index, wrap in enumerate(found) if wrap is None]
        if not missing:
            break
        led = {index: _led(parts, joints, found, index) for index in missing}
        if not any(led.values()):
            break
        for index, wrap in led.items():
            found[index] = wrap
    laid = [wrap or _aside(parts[index], figure, index) for index, wrap in enumerate(found)]
    layers = Counter(joint.one for joint in joints if joint.is_layer)
    for joint in reversed(joints):
        if joint.is_layer:
            layers[joint.one] -= 1  # how many layers of this seam come before
            for panel in {side.panel for side in joint.other if parts[side.panel].kind in (*STRIPS, "")}:
                laid[panel] = laid[panel].farther_out((layers[joint.one] + 1) * GAP)
    return tuple(laid)


def _by_kind(parts: Sequence[Part], index: int, figure: Figure) -> Laid | None:
    part = parts[index]
    by_kind: dict[str, Callable[[], Laid | None]] = {
        "front": lambda: _bodice(parts, index, figure, True),
        "back": lambda: _bodice(parts, index, figure, False),
        BIB: lambda: _trunk(part, figure, True) if BIB in part.roles else None,
        "yoke": lambda: _trunk(part, figure, False) if part.roles else None,
        "front_yoke": lambda: _trunk(part, figure, True) if part.roles else None,
        "side_front": lambda: _side_panel(parts, index, figure, True),
        "side_back": lambda: _side_panel(parts, index, figure, False),
        "skirt_front": lambda: _skirt(parts, index, figure, True),
        "skirt_back": lambda: _skirt(parts, index, figure, False),
        "tier_front": lambda: _trunk(part, figure, True, lowered=above_of(parts, index)),
        "tier_back": lambda: _trunk(part, figure, False, lowered=above_of(parts, index)),
        "side_skirt_front": lambda: _side_panel(parts, index, figure, True),
        "side_skirt_back": lambda: _side_panel(parts, index, figure, False),
        "gore": lambda: cone(parts, index, figure) or gore(parts, index, figure),
        "leg_front": lambda: _leg(part, figure, True),
        "leg_back": lambda: _leg(part, figure, False),
        "leg": lambda: _whole_leg(part, figure),
        "sleeve": lambda: sleeve(parts, index, figure),
        "under_sleeve": lambda: under_sleeve(parts, index, figure),
        LOWER_SLEEVE: lambda: lower_sleeve(parts, index, figure),
        "front_sleeve": lambda: half_sleeve(parts, index, figure),
        "back_sleeve": lambda: half_sleeve(parts, index, figure),
        "hood": lambda: _hood(part, figure),
    }
    return by_kind[part.kind]() if part.kind in by_kind else None


def _skirt(parts: Sequence[Part], index: int, figure: Figure, is_front: bool) -> Laid | None:
    return cone(parts, index, figure) or _trunk(parts[index], figure, is_front, _side_panel_width(parts, index))


def _frame(figure: Figure, is_front: bool) -> tuple[Floats, Floats, float]:
    """The directions of a piece's +x and outer side, and how far from the trunk's middle it lies."""
    sign = 1.0 if is_front else -1.0
    return sign * figure.left, sign * figure.forward, figure.front if is_front else figure.back


def _lens(drop: float, half: Floats) -> Floats:
    """The curvature at which cloth ``half`` [m] from its middle lies ``drop`` [m] behind it, about [1/m]."""
    half = np.maximum(half, 0.05)
    return np.minimum(2.0 * drop / half**2, MOST_ROLLED / half)


def _middle_of(part: Part, is_front: bool, least: Floats, most: Floats) -> float:
    """Where across a front or back the trunk's middle lies."""
    if part.side == BOTH:
        return float(0.5 * (least.min() + most.max()))
    inner_low = (part.side == LEFT) == is_front  # its middle is at the inner side
    return float(least.min() - GAP if inner_low else most.max() + GAP)


def _side_panel_width(parts: Sequence[Part], index: int) -> float:
    """How far a front or back goes on in side panels [m]."""
    face = next(face for face in faces_of(parts, parts[index].kind) if face[0] == index)
    return max((float(np.ptp(parts[panel].shape.box, axis=0)[0]) for panel in face[1:]), default=0.0)


def _below_yoke(parts: Sequence[Part], index: int) -> float:
    """How far below its neck a front or back begins [m]: where its yoke ends."""
    if "top" not in parts[index].roles:
        return 0.0
    yoke = YOKE_OF[parts[index].kind]
    heights = [float(np.ptp(part.shape.box, axis=0)[1]) for part in parts if part.kind == yoke and part.roles]
    return max(heights, default=0.0)


def _bodice(parts: Sequence[Part], index: int, figure: Figure, is_front: bool) -> Wrap | None:
    part = parts[index]
    if "inseam" in part.roles:  # in one with a leg
        return _leg(replace(part, roles={"crotch": part.roles["centre"]}), figure, is_front)
    lowered = _below_yoke(parts, index) + below_straps(parts, index, figure)
    return _trunk(part, figure, is_front, _side_panel_width(parts, index), lowered)


def _trunk(part: Part, figure: Figure, is_front: bool, side_panels: float = 0.0, lowered: float = 0.0) -> Wrap:
    levels, least, most = spans(part)
    top = _top(part, figure) - lowered
    centre = np.full(LEVELS, _middle_of(part, is_front, least, most))
    half = np.maximum(most - centre, centre - least) + side_panels
    return _round_trunk(part, figure, is_front, levels, centre, half, top + levels - levels[-1])


def _top(part: Part, figure: Figure) -> float:
    """The height at which the top of a front or back starts."""
    if not part.kind.removeprefix("side_").startswith(("skirt", "tier")):
        if STRAPLESS in part.roles:
            return figure.armpit + armpit_of(part)
        is_bib = BIB in part.roles  # above the waist
        return float(figure.middle[1] + np.ptp(part.shape.box, axis=0)[1] if is_bib else figure.neck[1])
    if "crotch" in part.roles:  # of briefs, which end there
        return figure.crotch - BELOW_CROTCH + float(np.ptp(part.shape.box, axis=0)[1])
    return float(figure.middle[1])


def _round_trunk(
    part: Part, figure: Figure, is_front: bool, levels: Floats, centre: Floats, half: Floats, height: Floats
) -> Wrap:
    """Levels at these heights, the trunk's middle at ``centre``, each bent as what covers ``half`` of it is."""
    across, outward, depth = _frame(figure, is_front)
    chest = np.maximum(half, 0.5 * half.max())
    origin = np.stack([figure.at_height(y) + depth * outward for y in height])
    return Wrap(part.up, levels, centre, _lens(depth, chest), origin, *repeated(across, outward))


def _side_panel(parts: Sequence[Part], index: int, figure: Figure, is_front: bool) -> Wrap | None:
    """As the middle panel goes on: the princess seams of both at one place, from their tops down."""
    part = parts[index]
    face = part.kind.removeprefix("side_")
    middle = next((each[0] for each in faces_of(parts, face) if index in each), None)
    own = part.roles.get("princess", ())
    there = () if middle is None or part.side == BOTH else role_of(parts, middle, "princess", part.side)
    if middle is None or not own or not there:
        return None
    seam, other = _run_points(part, own), _run_points(parts[middle], there)
    levels, least, most = spans(part)
    high, its_least, its_most = spans(parts[middle])
    up = levels + float(other[:, 1].max() - seam[:, 1].max())
    reach = np.interp(up, other[:, 1], other[:, 0]) - _middle_of(parts[middle], is_front, its_least, its_most)
    centre = np.interp(levels, seam[:, 1], seam[:, 0]) - reach - GAP * np.sign(reach)
    half = np.maximum(most - centre, centre - least)
    return _round_trunk(part, figure, is_front, levels, centre, half, _top(part, figure) + up - high[-1])


def _run_points(part: Part, run: Sequence[int]) -> Floats:
    """Points along edges [m], from the lowest to the highest, shape [N, 2]."""
    points = np.concatenate([part.shape.turned[k].at(np.linspace(0.0, 1.0, 65)) for k in run])
    return np.asarray(points[points[:, 1].argsort(kind="stable")])


def _leg(part: Part, figure: Figure, is_front: bool) -> Wrap | None:
    """Half a tube round the leg up to the crotch, and round the trunk above."""
    if part.side == BOTH or "crotch" not in part.roles:
        return _trunk(part, figure, is_front)
    across, outward, depth = _frame(figure, is_front)
    crotch = part.roles["crotch"]
    shape = part.shape
    tips = np.array([point for k in crotch for point in (shape.turned[k].start, shape.turned[k].end)])
    fork = float(tips[:, 1].min())
    levels, least, most = spans(part, fork)
    inner_low = (part.side == LEFT) == is_front
    curve = figure.legs[1 if part.side == LEFT else 0]
    room = (figure.crotch - figure.ankle) / max(fork - float(levels[0]), 1e-3)
    height = figure.crotch - 0.01 + (levels - fork) * np.where(levels < fork, min(1.0, room), 1.0)
    tube = levels <= fork
    width = most - least
    centre = np.where(tube, 0.5 * (least + most), least - GAP if inner_low else most + GAP)
    half = np.where(tube, width, np.maximum(width, 0.05))
    bend = np.where(tube, np.pi / np.maximum(width, 0.05), _lens(depth, half))
    radius = np.maximum(width, 0.05) / np.pi
    order = np.argsort(curve[:, 1], kind="stable")
    beside = (curve - figure.middle) @ figure.left
    ahead = (curve - figure.middle) @ figure.forward
    side = np.abs(np.interp(height, curve[order, 1], beside[order]))
    side = part.side * np.maximum(side, radius + 2 * GAP)
    depths = np.interp(height, curve[order, 1], ahead[order])
    origin = np.stack(
        [
            figure.at_height(y) + (s * figure.left + d * figure.forward + r * outward if low else depth * outward)
            for y, s, d, r, low in zip(height, side, depths, radius + GAP, tube, strict=True)
        ]
    )
    kept = tube | (levels > fork + ABOVE_CROTCH)
    kept[-1] = True
    frames = repeated(across, outward, int(kept.sum()))
    if kept.sum() < 2:
        return _trunk(part, figure, is_front)
    return Wrap(part.up, levels[kept], centre[kept], bend[kept], origin[kept], *frames)


def _whole_leg(part: Part, figure: Figure) -> Wrap | None:
    """A tube round the leg up to the crotch, and round that half of the trunk above."""
    if part.side == BOTH or not part.roles.get("crotch+"):
        return None
    outward, across = part.side * figure.left, -part.side * figure.forward  # its +x is at the back on the left
    fork = min(float(part.shape.turned[part.roles["crotch+"][0]].start[1]),
               float(part.shape.turned[part.roles["crotch-"][-1]].end[1]))  # fmt: skip
    levels, least, most = spans(part, fork)
    room = (figure.crotch - figure.ankle) / max(fork - float(levels[0]), 1e-3)
    height = figure.crotch - 0.01 + (levels - fork) * np.where(levels < fork, min(1.0, room), 1.0)
    tube = levels <= fork
    width = np.maximum(most - least, 0.05)
    bend = np.where(tube, WHOLE_TURN, np.pi) / width
    curve = figure.legs[1 if part.side == LEFT else 0]
    order = np.argsort(curve[:, 1], kind="stable")
    beside = np.interp(height, curve[order, 1], ((curve - figure.middle) @ outward)[order])
    ahead = np.interp(height, curve[order, 1], ((curve - figure.middle) @ figure.forward)[order])
    beside = np.where(tube, np.maximum(beside, 1.0 / bend + GAP), GAP)
    middle = np.stack([figure.at_height(y) for y in height]) + beside[:, None] * outward
    middle += np.where(tube, ahead, 0.0)[:, None] * figure.forward
    kept = tube | (levels > fork + ABOVE_CROTCH)
    kept[-1] = True
    origin = middle + outward / bend[:, None]
    centre = 0.5 * (least + most)
    frames = repeated(across, outward, int(kept.sum()))
    return Wrap(part.up, levels[kept], centre[kept], bend[kept], origin[kept], *frames)


def _hood(part: Part, figure: Figure) -> Wrap | None:
    neck = part.roles.get("neck", ())
    if part.side == BOTH or not neck:
        return None
    shape = part.shape
    points = np.concatenate([shape.turned[k].at(np.linspace(0.0, 1.0, 33)) for k in neck])
    x, y = float(points[:, 0].mean()), float(points[:, 1].mean())
    place = np.array([part.up[1], -part.up[0]]) * x + part.up * y
    outward = part.side * figure.left
    origin = figure.neck + (figure.half_head + BESIDE_HEAD) * outward
    return flat_wrap(part.up, place, origin, np.cross(UP, outward), UP)


def _led(parts: Sequence[Part], joints: Sequence[Joint], found: Sequence[Laid | None], index: int) -> Wrap | None:
    """A part laid flat where it fits best to what it is sewn to: Kabsch's rotation of its seams onto the others'.

    Points inside the part are matched with those that the other part has if it goes on beyond the seam, so that a
    single straight seam is enough.
    """
    own: list[Floats] = []
    there: list[Floats] = []
    for joint in joints:
        for mine, theirs, against in ((joint.one, joint.other, False), (joint.other, joint.one, True)):
            if len(mine) == len(theirs):
                for a, b in zip(mine, theirs, strict=True):
                    wrap = found[b.panel]
                    if a.panel == index and b.panel != index and wrap is not None:
                        own.append(np.concatenate(_beside(parts, a, False, 1.0)))
                        there.append(wrap.placed(np.concatenate(_beside(parts, b, True, -1.0))))
            elif {side.panel for side in mine} == {index} and index not in {side.panel for side in theirs}:
                beside = [_beside(parts, side, not against, -1.0) for side in theirs]
                laid = [(found[side.panel], two) for side, two in zip(theirs, beside, strict=True)]
                placed = [[wrap.placed(points) for points in two] for wrap, two in laid if wrap is not None]
                if len(placed) == len(theirs):
                    own += _evenly([_beside(parts, side, against, 1.0) for side in mine])
                    there += _evenly(placed)
    if not own:
        return None
    p, q = np.concatenate(own), np.concatenate(there)
    flat = np.column_stack([p, np.zeros(len(p))])
    middle, target = flat.mean(axis=0), q.mean(axis=0)
    u, _, vt = np.linalg.svd((flat - middle).T @ (q - target))
    turn = vt.T @ np.diag([1.0, 1.0, np.sign(np.linalg.det(vt.T @ u.T))]) @ u.T
    up = parts[index].up
    across = turn @ np.array([up[1], -up[0], 0.0])
    return flat_wrap(up, middle[:2], target, across, turn @ np.array([*up, 0.0]))


def _evenly(run: Sequence[Sequence[Floats]]) -> list[Floats]:
    """Points along the edges of a run, and beside them, as many on a run of any number of edges; shape [9, n] each."""
    along, beside = (np.concatenate([each[k] for each in run]) for k in (0, 1))
    reach = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(along, axis=0), axis=1))])
    shares = np.linspace(0.0, reach[-1], 9)
    return [np.column_stack([np.interp(shares, reach, axis) for axis in each.T]) for each in (along, beside)]


def _beside(parts: Sequence[Part], side: Side, against: bool, inward: float) -> tuple[Floats, Floats]:
    """Points along an edge, and beside it, inside the part or beyond it; shape [9, 2] each."""
    edge = parts[side.panel].edges[side.edge]
    shares = np.linspace(0.0, 1.0, 9)
    points = edge.at(shares[::-1] if against else shares)
    along = edge.end - edge.start
    left = np.array([-along[1], along[0]]) / max(float(np.hypot(*along)), 1e-9)
    return points, points + inward * REACH * left


def _aside(part: Part, figure: Figure, index: int) -> Wrap:
    """A part that nothing places: in front of the figure."""
    low, high = part.shape.box
    x, y = 0.5 * (low + high)
    place = np.array([part.up[1], -part.up[0]]) * x + part.up * y
    origin = figure.middle + (figure.front + 0.1 + 0.02 * index) * figure.forward
    return flat_wrap(part.up, place, origin, figure.left, UP)

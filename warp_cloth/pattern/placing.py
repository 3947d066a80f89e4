"""Each part laid round what it covers: trunk, arm, leg, neck or head; others where their seams lead."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from warp_cloth.base.curves import arc_lengths
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.figure import UP, Figure
from warp_cloth.pattern.joints import Joint
from warp_cloth.pattern.kinds import BOTH, LEFT, RIGHT
from warp_cloth.pattern.runs import faces_of, role_of
from warp_cloth.pattern.sleeves import sleeve_side, under_sleeve_of
from warp_cloth.pattern.specification import Side
from warp_cloth.pattern.wrap import Wrap, flat_wrap

LEVELS = 33
MOST_ROLLED = 0.6 * np.pi  # a half of the trunk's cover on either side of its middle
GAP = 0.005  # [m] between a part and the body's middle
WHOLE_TURN = 0.97 * 2.0 * np.pi  # of a sleeve or band
FROM_ARMPIT = 0.015  # [m] from where the arm leaves the trunk to a sleeve's underarm point
ABOVE_CROTCH = 0.06  # [m] over which a leg widens to the trunk
BESIDE_HEAD = 0.02  # [m]
BESIDE_FOOT = 0.2  # [m] from the toes to a cuff of trousers
REACH = 0.05  # [m] that a part beyond a seam is taken to go on as the one before


def wraps_of(parts: Sequence[Part], joints: Sequence[Joint], figure: Figure) -> tuple[Wrap, ...]:
    """Where each part starts."""
    found: list[Wrap | None] = [_by_kind(parts, index, figure) for index in range(len(parts))]
    for _ in range(len(parts)):
        missing = [index for index, wrap in enumerate(found) if wrap is None]
        if not missing:
            break
        led = {index: _led(parts, joints, found, index) for index in missing}
        if not any(led.values()):
            break
        for index, wrap in led.items():
            found[index] = wrap
    return tuple(wrap or _aside(parts[index], figure, index) for index, wrap in enumerate(found))


def _by_kind(parts: Sequence[Part], index: int, figure: Figure) -> Wrap | None:
    part = parts[index]
    by_kind: dict[str, Callable[[], Wrap | None]] = {
        "front": lambda: _trunk(part, figure, True, _side_panel_width(parts, index)),
        "back": lambda: _trunk(part, figure, False, _side_panel_width(parts, index)),
        "side_front": lambda: _side_panel(parts, index, figure, True),
        "side_back": lambda: _side_panel(parts, index, figure, False),
        "skirt_front": lambda: _trunk(part, figure, True),
        "skirt_back": lambda: _trunk(part, figure, False),
        "leg_front": lambda: _leg(part, figure, True),
        "leg_back": lambda: _leg(part, figure, False),
        "leg": lambda: _whole_leg(part, figure),
        "sleeve": lambda: _sleeve(parts, index, figure),
        "under_sleeve": lambda: _under_sleeve(parts, index, figure),
        "hood": lambda: _hood(part, figure),
        "collar": lambda: _band(parts, index, figure),
        "waistband": lambda: _band(parts, index, figure),
        "hem_band": lambda: _band(parts, index, figure),
        "cuff": lambda: _band(parts, index, figure),
    }
    return by_kind[part.kind]() if part.kind in by_kind else None


def _frame(figure: Figure, is_front: bool) -> tuple[Floats, Floats, float]:
    """The directions of a piece's +x and outer side, and how far from the trunk's middle it lies."""
    sign = 1.0 if is_front else -1.0
    return sign * figure.left, sign * figure.forward, figure.front if is_front else figure.back


def _spans(part: Part, at: float | None = None) -> tuple[Floats, Floats, Floats]:
    """Levels of a part, lowest to highest [m], one of them at ``at``, and its least and largest x at each."""
    points = np.concatenate([edge.at(np.linspace(0.0, 1.0, 129)) for edge in part.shape.turned])
    low, high = float(points[:, 1].min()), float(points[:, 1].max())
    levels = np.linspace(low, high, LEVELS)
    if at is not None:
        levels[1 + int(np.abs(levels[1:-1] - at).argmin())] = at
    near = np.abs(points[:, 1][None] - levels[:, None]) <= (high - low) / (LEVELS - 1)
    least = np.array([points[own, 0].min() for own in near])
    most = np.array([points[own, 0].max() for own in near])
    return levels, least, most


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


def _trunk(part: Part, figure: Figure, is_front: bool, side_panels: float = 0.0) -> Wrap:
    levels, least, most = _spans(part)
    top = float(figure.middle[1]) if part.kind.startswith("skirt") else float(figure.neck[1])
    centre = np.full(LEVELS, _middle_of(part, is_front, least, most))
    half = np.maximum(most - centre, centre - least) + side_panels
    return _round_trunk(part, figure, is_front, levels, centre, half, top + levels - levels[-1])


def _round_trunk(
    part: Part, figure: Figure, is_front: bool, levels: Floats, centre: Floats, half: Floats, height: Floats
) -> Wrap:
    """Levels at these heights, the trunk's middle at ``centre``, each bent as what covers ``half`` of it is."""
    across, outward, depth = _frame(figure, is_front)
    chest = np.maximum(half, 0.5 * half.max())
    origin = np.stack([figure.at_height(y) + depth * outward for y in height])
    return Wrap(part.up, levels, centre, _lens(depth, chest), origin, *_repeated(across, outward))


def _side_panel(parts: Sequence[Part], index: int, figure: Figure, is_front: bool) -> Wrap | None:
    """As the middle panel goes on: the princess seams of both at one place, from their tops down."""
    part = parts[index]
    face = "front" if is_front else "back"
    middle = next((each[0] for each in faces_of(parts, face) if index in each), None)
    own = part.roles.get("princess", ())
    there = () if middle is None or part.side == BOTH else role_of(parts, middle, "princess", part.side)
    if middle is None or not own or not there:
        return None
    seam, other = _run_points(part, own), _run_points(parts[middle], there)
    levels, least, most = _spans(part)
    high, its_least, its_most = _spans(parts[middle])
    up = levels + float(other[:, 1].max() - seam[:, 1].max())
    reach = np.interp(up, other[:, 1], other[:, 0]) - _middle_of(parts[middle], is_front, its_least, its_most)
    centre = np.interp(levels, seam[:, 1], seam[:, 0]) - reach - GAP * np.sign(reach)
    half = np.maximum(most - centre, centre - least)
    return _round_trunk(part, figure, is_front, levels, centre, half, float(figure.neck[1]) + up - high[-1])


def _run_points(part: Part, run: Sequence[int]) -> Floats:
    """Points along edges [m], from the lowest to the highest, shape [N, 2]."""
    points = np.concatenate([part.shape.turned[k].at(np.linspace(0.0, 1.0, 65)) for k in run])
    return np.asarray(points[points[:, 1].argsort(kind="stable")])


def _repeated(across: Floats, outward: Floats, count: int = LEVELS) -> tuple[Floats, Floats]:
    return np.tile(across, (count, 1)), np.tile(outward, (count, 1))


def _leg(part: Part, figure: Figure, is_front: bool) -> Wrap | None:
    """Half a tube round the leg up to the crotch, and round the trunk above."""
    if part.side == BOTH or "crotch" not in part.roles:
        return _trunk(part, figure, is_front)
    across, outward, depth = _frame(figure, is_front)
    crotch = part.roles["crotch"]
    shape = part.shape
    tips = np.array([point for k in crotch for point in (shape.turned[k].start, shape.turned[k].end)])
    fork = float(tips[:, 1].min())
    levels, least, most = _spans(part, fork)
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
    frames = _repeated(across, outward, int(kept.sum()))
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
    levels, least, most = _spans(part, fork)
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
    frames = _repeated(across, outward, int(kept.sum()))
    return Wrap(part.up, levels[kept], centre[kept], bend[kept], origin[kept], *frames)


def _underarm(part: Part) -> float:
    """The level of a sleeve's underarm point."""
    cap, turned = part.roles.get("cap", ()), part.shape.turned
    return float(min(turned[cap[0]].start[1], turned[cap[-1]].end[1]) if cap else part.shape.box[1][1])


def _shortened(parts: Sequence[Part], figure: Figure) -> float:
    """How much shorter sleeves and cuffs start than they are, so that they end above the hand."""
    long = max((_underarm(each) - float(each.shape.box[0][1]) for each in parts if each.kind == "sleeve"), default=0.0)
    cuff = max(
        (float(min(each.shape.box[1] - each.shape.box[0])) for each in parts if each.kind == "cuff"), default=0.0
    )
    return min(1.0, (figure.to_wrist - FROM_ARMPIT) / max(long + cuff, 1e-3))


def _sleeve(parts: Sequence[Part], index: int, figure: Figure) -> Wrap:
    under = under_sleeve_of(parts, index)
    share = 1.0 if under is None else _share(parts[index], parts[under[0]])
    return _round_arm(parts, index, figure, sleeve_side(parts, index), share, 1.0)


def _under_sleeve(parts: Sequence[Part], index: int, figure: Figure) -> Wrap | None:
    for sleeve in (each for each, part in enumerate(parts) if part.kind == "sleeve"):
        under = under_sleeve_of(parts, sleeve)
        if under is not None and under[0] == index:
            share = 1.0 - _share(parts[sleeve], parts[index])
            return _round_arm(parts, index, figure, sleeve_side(parts, sleeve), share, -1.0)
    return None


def _share(upper: Part, under: Part) -> float:
    """How much of the arm an upper sleeve covers."""
    widths = [part.shape.width(0.5) for part in (upper, under)]
    return float(np.clip(widths[0] / max(sum(widths), 1e-6), 0.2, 0.8))


def _round_arm(parts: Sequence[Part], index: int, figure: Figure, side: int, share: float, facing: float) -> Wrap:
    """Round a share of the arm, from its top (``facing`` 1) or from below (-1)."""
    part = parts[index]
    under = _underarm(part)
    levels, least, most = _spans(part, under)
    below = levels <= under
    at_armpit = max(int(below.sum()) - 1, 0)
    width = np.where(below, most - least, (most - least)[at_armpit])
    centre = np.where(below, 0.5 * (least + most), 0.5 * (least + most)[at_armpit])
    distance = (under - levels) * np.where(levels < under, _shortened(parts, figure), 1.0)
    origin, toward = _along_limb(figure.arms[1 if side == LEFT else 0], distance + FROM_ARMPIT)
    across, outward = (facing * each for each in _around_arm(figure, toward, side))
    bend = share * WHOLE_TURN / np.maximum(width, 0.04)
    return Wrap(part.up, levels, centre, bend, origin + outward / bend[:, None], across, outward)


def _around_arm(figure: Figure, toward: Floats, side: int) -> tuple[Floats, Floats]:
    """Directions across a sleeve, seen from outside, and outwards, at the top of the arm; shape [L, 3] each."""
    top = UP + side * figure.left
    outward = top - toward * (toward @ top)[:, None]
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    return np.cross(-toward, outward), outward


def _along_limb(curve: Floats, distance: Floats) -> tuple[Floats, Floats]:
    """Points of a limb at distances from where it begins [m], and its direction there; straight on beyond its ends."""
    reached = arc_lengths(curve)
    ends = [0.0, *np.unique(np.clip(np.arange(0.05, reached[-1], 0.05), 0.0, reached[-1])), reached[-1]]
    spots = np.stack([np.interp(ends, reached, curve[:, axis]) for axis in range(3)], axis=1)
    near = spots[min(3, len(spots) - 1)]
    first = (near - spots[0]) / max(float(np.linalg.norm(near - spots[0])), 1e-9)
    last = (spots[-1] - spots[-2]) / max(float(np.linalg.norm(spots[-1] - spots[-2])), 1e-9)
    points = np.stack([np.interp(distance, ends, spots[:, axis]) for axis in range(3)], axis=1)
    points += np.minimum(distance, 0.0)[:, None] * first + np.maximum(distance - reached[-1], 0.0)[:, None] * last
    straight = (spots[-1] - spots[0]) / max(float(np.linalg.norm(spots[-1] - spots[0])), 1e-9)
    return points, np.tile(straight, (len(distance), 1))


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


def _band(parts: Sequence[Part], index: int, figure: Figure) -> Wrap | None:
    """A band as a ring, its ends where its joint begins."""
    part = parts[index]
    low, high = part.shape.box
    size = high - low
    lengthwise = np.array([part.up[1], -part.up[0]]) if size[0] > size[1] else part.up
    length, width = float(size.max()), float(size.min())
    points = np.concatenate([edge.points for edge in part.edges])
    # +x of the ring along the band, so that "up" is to its left
    along = np.array([-lengthwise[1], lengthwise[0]])
    bend = WHOLE_TURN / length
    spots = points @ along
    levels = np.array([spots.min(), spots.max()])
    x = points @ np.array([along[1], -along[0]])
    centre = np.full(2, 0.5 * (x.min() + x.max()))
    if part.kind == "cuff":
        return _cuff(parts, index, figure, along, levels, centre, bend)
    # a ring begins at the back for a collar, at the right side round a waist, at the left below a hem; see proposal.py
    lower = any(each.kind.startswith(("leg", "skirt")) for each in parts)
    below_hem = part.kind == "hem_band" or (part.kind == "waistband" and not lower)
    from_back = part.kind == "collar" or any(each.kind == "leg" for each in parts)
    outward = figure.forward if from_back else -figure.left if below_hem else figure.left
    bottom = float(figure.neck[1] if part.kind == "collar" else figure.middle[1])
    if below_hem:
        fronts = [each for each in parts if each.kind == "front"]
        tall = max((float(np.ptp(each.shape.box, axis=0)[1]) for each in fronts), default=0.6)
        bottom = float(figure.neck[1]) - tall - width
    middle = np.stack([figure.at_height(bottom), figure.at_height(bottom + width)])
    across, out = _repeated(np.cross(UP, outward), outward, 2)
    if part.kind == "collar":
        middle[:, [0, 2]] = figure.neck[[0, 2]]
    else:  # an ellipse outside the hips, however tight the band is
        middle += 0.5 * (figure.front - figure.back) * figure.forward
        out = out * max(1.0, figure.half_width * bend)
        across = across * max(1.0, 0.5 * (figure.front + figure.back) * bend)
    return Wrap(along, levels, centre, np.full(2, bend), middle + out / bend, across, out)


def _cuff(
    parts: Sequence[Part], index: int, figure: Figure, along: Floats, levels: Floats, centre: Floats, bend: float
) -> Wrap:
    """At the end of the sleeve, or of the leg where there are no sleeves."""
    part = parts[index]
    side = part.side or (RIGHT if part.twin is not None and part.twin < index else LEFT)
    sleeves = [each for each in parts if each.kind == "sleeve"]
    curve = (figure.arms if sleeves else figure.legs)[1 if side == LEFT else 0]
    width = float(levels[1] - levels[0])
    share = _shortened(parts, figure) if sleeves else 1.0
    reach = float(arc_lengths(curve)[-1]) - BESIDE_FOOT - width
    long = share * max(_underarm(each) - float(each.shape.box[0][1]) for each in sleeves) if sleeves else reach
    origin, toward = _along_limb(curve, np.array([long + share * width, long]) + FROM_ARMPIT)
    across, outward = _around_arm(figure, toward, side)
    return Wrap(along, levels, centre, np.full(2, bend), origin + outward / bend, across, outward)


def _led(parts: Sequence[Part], joints: Sequence[Joint], found: Sequence[Wrap | None], index: int) -> Wrap | None:
    """A part laid flat where it fits best to what it is sewn to: Kabsch's rotation of its seams onto the others'.

    Points inside the part are matched with those that the other part has if it goes on beyond the seam, so that a
    single straight seam is enough.
    """
    own: list[Floats] = []
    there: list[Floats] = []
    for joint in joints:
        for mine, theirs in ((joint.one, joint.other), (joint.other, joint.one)):
            if len(mine) == len(theirs):
                for a, b in zip(mine, theirs, strict=True):
                    wrap = found[b.panel]
                    if a.panel == index and b.panel != index and wrap is not None:
                        own.append(np.concatenate(_beside(parts, a, False, 1.0)))
                        there.append(wrap.placed(np.concatenate(_beside(parts, b, True, -1.0))))
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

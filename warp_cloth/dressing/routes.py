"""Where each limb goes in a garment as it starts: from the trunk through its opening, and out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from warp_cloth.anatomy.linking import Wearing, curve_crossings, misplaced_openings
from warp_cloth.anatomy.openings import ARMS, LEGS, Opening
from warp_cloth.anatomy.raising import raised_limb
from warp_cloth.anatomy.skeleton import LIMBS, Skeleton, outward_of
from warp_cloth.base.curves import arc_lengths, points_along, resampled
from warp_cloth.base.mesh import Points
from warp_cloth.dressing.free_space import FreeSpace

OUT = 0.12  # [m] that a limb reaches out of its opening at least, stretched if need be
INSIDE, ACROSS = 0.06, 0.03  # [m] from the trunk's middle, and an opening's, where a way may begin and end
CLEAR = 0.12  # [m] between an arm out of its sleeve and other cloth, if it can be had by turning it up
TURNS = np.radians(np.arange(0.0, 181.0, 10.0))
UPRIGHT = np.radians(90.0)  # from the side, that an arm is turned up at most: beyond, it crosses its own strap
SIDEWAYS = 0.3  # least sideways part of the direction in which an arm leaves its sleeve
STRAIGHT = 0.5  # least cosine between down and the end of a way, at which a leg goes on along it
DOWN = 0.93  # least cosine between down and a leg of who stands: 18 degrees with their toes ahead; 34 in who walks
SPACING = 0.02  # [m] between points of a curve
SMOOTHING = 6  # times that a way over cells is smoothed
ARMHOLE = 0.15  # [m] from the shoulder, within which the opening of an arm without a sleeve begins
ARMHOLE_OUT = 0.03  # [m] out from the shoulder, within which an armhole begins, however far out a wide one reaches
TAIL = 0.1  # [m] of a way's end that tells where it points


@dataclass(frozen=True, eq=False)
class Route:
    """A limb's curve in a garment, as the skeleton has it at home."""

    curve: Points  # from the trunk to the tip [m], shape [N, 3]
    turned: float  # how far an arm had to be turned up to keep clear of cloth [degrees]
    armhole: float | None = None  # along the curve, where it passes an armhole without a sleeve [m]
    is_raised: bool = False  # an arm that hangs, only raised to be in its sleeve


def limb_routes(wearing: Wearing, points: Points) -> list[Route | None]:
    """A route for each limb in a garment that starts at ``points`` [m]; None: the limb stays as it is.

    A limb with an opening of its own goes through it, by the way that keeps clearest of cloth, but an arm that hangs
    and that only need be raised to be in its sleeve is raised; an arm without an opening is turned up until it is clear
    of all cloth.
    """
    skeleton = wearing.skeleton
    space = FreeSpace.around(points, wearing.triangles)
    routes: list[Route | None] = [None] * len(LIMBS)
    for limbs, middle in ((ARMS, skeleton.shoulders), (LEGS, skeleton.middle)):
        pairs = zip(wearing.openings, wearing.limbs, strict=True)
        own = [(each[0], opening) for opening, each in pairs if len(each) == 1 and each[0] in limbs]
        if not own:
            continue
        ends = [space.clearest(points[opening.loop].mean(axis=0), ACROSS) for _, opening in own]
        ways = space.paths(space.clearest(middle, INSIDE), ends)
        for (limb, opening), way in zip(own, ways, strict=True):
            if limb in ARMS:
                routes[limb] = _in_sleeve(limb, opening, wearing, points)
            if way is not None and routes[limb] is None:
                route = _through(way, limb, points[opening.loop], skeleton, space)
                # out by the neck, the hem or an open front, a way round a narrow sleeve may come in at its end
                fault = partial(_fault, limb=limb, opening=opening, wearing=wearing, points=points)
                if any(fault(route)):
                    others = (Route(skeleton.curves[limb], 0.0), _straight(limb, opening, points, skeleton, space))
                    route = min((route, *others), key=fault)
                routes[limb] = route
    for arm in ARMS:
        if routes[arm] is None:
            routes[arm] = _raised(arm, skeleton, space)
    if LEGS in wearing.limbs and (_legs_apart(skeleton) or set(LEGS) & set(wearing.pierced(points))):
        for leg in LEGS:
            if routes[leg] is None:
                routes[leg] = _lowered(leg, skeleton)
    return routes


def _in_sleeve(arm: int, opening: Opening, wearing: Wearing, points: Points) -> Route | None:
    """An arm that hangs, raised; None: it is not in its sleeve so, or runs through cloth.

    A way over the cells of free space would lead round a sleeve that is narrower than these.
    """
    skeleton = wearing.skeleton
    curve = raised_limb(skeleton, arm)
    if curve is None or _is_armhole(points[opening.loop], arm, skeleton):
        return None
    raised = Route(curve, 0.0, is_raised=True)
    return None if any(_fault(raised, arm, opening, wearing, points)) else raised


def _fault(route: Route, limb: int, opening: Opening, wearing: Wearing, points: Points) -> tuple[bool, int]:
    """Whether a limb misses its opening by a route or ends on the other side of cloth, and how often it crosses some.

    Cloth that is crossed there and back only touches the thin limb, as a low shoulder does.
    """
    skeleton = wearing.skeleton
    curves = tuple(route.curve if each == limb else curve for each, curve in enumerate(skeleton.curves))
    misses = misplaced_openings([opening], [(limb,)], points, wearing.triangles, replace(skeleton, curves=curves))
    crossings = curve_crossings(points, wearing.triangles, route.curve)
    return bool(misses) or crossings % 2 > 0, crossings


def _through(way: Points, limb: int, loop: Points, skeleton: Skeleton, space: FreeSpace) -> Route:
    """The way to an opening, and straight on; ``loop``: its vertices [m]."""
    way = smoothed(way, SMOOTHING)
    if limb in ARMS:  # their ways begin where they leave the spine
        way = np.vstack([skeleton.curves[limb][: skeleton.joints[limb]], way])
    lengths = arc_lengths(way)
    direction = way[-1] - way[np.searchsorted(lengths, max(lengths[-1] - TAIL, 0.0))]
    direction = direction / max(float(np.linalg.norm(direction)), 1e-9)
    remains = max(float(arc_lengths(skeleton.curves[limb])[-1] - lengths[-1]), OUT)
    turned, armhole = 0.0, None
    if limb in ARMS:
        armhole = float(lengths[-1]) if _is_armhole(loop, limb, skeleton) else None
        direction, turned = _turned_up(way[-1], direction, remains, limb, skeleton, space)
    elif direction @ -skeleton.up < STRAIGHT:
        direction = -skeleton.up
    return Route(smoothed(_onward(way, direction, remains), SMOOTHING), turned, armhole)


def _straight(limb: int, opening: Opening, points: Points, skeleton: Skeleton, space: FreeSpace) -> Route:
    """From where the limb leaves the trunk straight to the middle of its opening, and on."""
    begin, end = skeleton.curves[limb][skeleton.joints[limb]], points[opening.loop].mean(axis=0)
    count = max(int(float(np.linalg.norm(end - begin)) / SPACING), 2)
    return _through(np.linspace(begin, end, count + 1), limb, points[opening.loop], skeleton, space)


def _is_armhole(loop: Points, arm: int, skeleton: Skeleton) -> bool:
    """Whether an arm's opening, its vertices at ``loop`` [m], has no sleeve: it begins at the shoulder."""
    joint = skeleton.curves[arm][skeleton.joints[arm]]
    is_near = float(np.linalg.norm(loop - joint, axis=1).min()) < ARMHOLE
    return is_near and float(((loop - joint) @ outward_of(skeleton, arm)).min()) < ARMHOLE_OUT


def _raised(arm: int, skeleton: Skeleton, space: FreeSpace) -> Route | None:
    """An arm without a sleeve, turned up at the shoulder; None: it is clear of cloth as it is."""
    curve, joint = skeleton.curves[arm], skeleton.joints[arm]
    if space.clearances(curve[joint:]).min() > CLEAR:
        return None
    length = float(arc_lengths(curve[joint:])[-1])
    direction, turned = _turned_up(curve[joint], curve[-1] - curve[joint], length, arm, skeleton, space)
    return Route(smoothed(_onward(curve[: joint + 1], direction, length), SMOOTHING), turned)


def _legs_apart(skeleton: Skeleton) -> bool:
    """Whether a leg does not hang straight down, as one that walks or sits."""
    legs_down = [skeleton.curves[each][-1] - skeleton.curves[each][skeleton.joints[each]] for each in LEGS]
    return min(float(way @ -skeleton.up) / max(float(np.linalg.norm(way)), 1e-9) for way in legs_down) <= DOWN


def _lowered(leg: int, skeleton: Skeleton) -> Route:
    """A leg in a skirt, straight down to its toes, since panels before and behind it are sewn there."""
    curve, joint = skeleton.curves[leg], skeleton.joints[leg]
    length = float(arc_lengths(curve[joint:])[-1])
    return Route(smoothed(_onward(curve[: joint + 1], -skeleton.up, length), SMOOTHING), 0.0)


def _onward(curve: Points, direction: Points, length: float) -> Points:
    steps = np.linspace(0.0, length, max(int(length / SPACING), 2) + 1)[1:]
    return np.vstack([curve, curve[-1] + steps[:, None] * direction])


def _turned_up(
    start: Points, direction: Points, length: float, arm: int, skeleton: Skeleton, space: FreeSpace
) -> tuple[Points, float]:
    """A direction for an arm from ``start``, turned up as little as keeps it clear of cloth, and that angle [degrees].

    The arm stays in the body's own plane, and as little as can be between layers of cloth that would fall on it; where
    no angle keeps it CLEAR, the clearest is taken.
    """
    outward = outward_of(skeleton, arm)
    flat = direction - skeleton.forward * (direction @ skeleton.forward)
    flat = flat / max(float(np.linalg.norm(flat)), 1e-9)
    flat = flat + outward * max(SIDEWAYS - float(flat @ outward), 0.0)
    begin = float(np.arctan2(flat @ skeleton.up, flat @ outward))
    steps = np.arange(SPACING, length, SPACING)[:, None]
    best, score, turned = flat, (-np.inf, 0.0), 0.0
    for turn in TURNS[begin + TURNS <= UPRIGHT]:
        angle = begin + turn
        each = np.cos(angle) * outward + np.sin(angle) * skeleton.up
        along = (start + steps * each)[2:]
        between = float(space.between_layers(along, skeleton.forward).sum())
        clearance = float(space.clearances(along).min(initial=np.inf))
        if (-between, min(clearance, CLEAR)) > score:
            best, score, turned = each, (-between, min(clearance, CLEAR)), float(np.degrees(turn))
    return best, turned


def smoothed(curve: Points, times: int) -> Points:
    """A curve, shape [N, 3], each of whose points goes half-way to the mean of its neighbours, ``times`` times."""
    curve = curve.copy()
    for _ in range(times):
        curve[1:-1] = 0.25 * curve[:-2] + 0.5 * curve[1:-1] + 0.25 * curve[2:]
    return curve


def curves_of(routes: Sequence[Route | None], skeleton: Skeleton, count: int) -> list[Points]:
    """The curve of each limb, along its route or at home [m], each shape [count, 3].

    Evenly spaced, but an armhole without a sleeve is where the shoulder is at home: its way leads lower, and is longer.
    """
    curves = []
    for route, home, joint in zip(routes, skeleton.curves, skeleton.joints, strict=True):
        if route is None or route.armhole is None:
            curves.append(resampled(home if route is None else route.curve, count))
            continue
        at_home, length = arc_lengths(home), float(arc_lengths(route.curve)[-1])
        to_shoulder = float(at_home[joint] / at_home[-1])
        along = np.interp(np.linspace(0.0, 1.0, count), [0.0, to_shoulder, 1.0], [0.0, route.armhole, length])
        curves.append(points_along(route.curve, along))
    return curves

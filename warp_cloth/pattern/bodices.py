"""What the edges of a bodice's front or back are by its shape: neck, shoulder, armhole, side, hem, and centre."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from warp_cloth.pattern.roles import BENT, Roles, Shape, ends_of

SLEEVE_OUT = 0.05  # [m] that the underarm of a sleeve cut in one with a bodice runs outwards at least
AS_HIGH = 1e-3  # [m]
RAGLAN = 0.1  # [m] that an edge to the neck rises which is no shoulder
POINTED, POINT_UP_TO = 0.5, 0.25  # |dx| over |dy| of an edge up from a pointed hem, and of the height, how far up


def bodice_roles(shape: Shape, whole: bool, side_roles: Callable[[Shape, Sequence[int], str], Roles]) -> Roles:
    """neck, hem; shoulder, armhole and side at +x and -x, as "shoulder+"; of a half also centre, with one side.

    ``side_roles`` tells the roles of the edges from the hem up to the neck: ``arm_side``, or of a middle panel
    ``panel_roles.middle_side``.
    """
    order = shape.order
    (hem_first, hem_end), _ = ends_of(shape)
    starts = np.array([shape.turned[k].start for k in order])
    low, high = shape.box
    middle = 0.5 * (low[0] + high[0])
    roles: Roles = {"hem": shape.run(hem_first, hem_end)}
    if whole:
        tips = []
        for side in (1.0, -1.0):
            mine = np.flatnonzero(side * (starts[:, 0] - middle) > 0.02 * (high[0] - low[0]))
            if not len(mine):
                return roles
            highest = mine[starts[mine, 1] > starts[mine, 1].max() - AS_HIGH]
            tips.append(int(highest[np.abs(starts[highest, 0] - middle).argmin()]))  # of a level shoulder its inner end
        roles["neck"] = shape.run(tips[0], tips[1])
        roles |= side_roles(shape, shape.run(hem_end, tips[0]), "+")
        roles |= side_roles(shape, shape.run(tips[1], hem_first)[::-1], "-")
        return roles
    found = [_half_roles(shape, roles, centre, at_right, side_roles)
             for centre, at_right in _centre_runs(shape, hem_first, hem_end)]  # fmt: skip
    # a side may be longer than the centre below a deep neck; beyond it the neck would be the armhole, with no shoulder
    found.sort(key=lambda each: not any(role.startswith("shoulder") for role in each))
    hollow = [each for each in found if _has_hollow_armhole(shape, each)]
    return next(iter([*hollow, *found]), roles)


def _half_roles(
    shape: Shape,
    roles: Roles,
    centre: tuple[int, ...],
    at_right: bool,
    side_roles: Callable[[Shape, Sequence[int], str], Roles],
) -> Roles:
    """The roles of half a front or back whose centre is known."""
    order, count = shape.order, len(shape.order)
    tip = int(np.argmax([float(shape.turned[k].start[1]) for k in order]))
    if at_right:  # hem, centre, neck, shoulder, armhole, side
        first, end = order.index(roles["hem"][0]), order.index(centre[0])
        neck_from = (order.index(centre[-1]) + 1) % count
        outer = side_roles(shape, shape.run(tip, first)[::-1], "-")
        return {"hem": shape.run(first, end), "centre": centre, "neck": shape.run(neck_from, tip)} | outer
    first, end = (order.index(centre[-1]) + 1) % count, (order.index(roles["hem"][-1]) + 1) % count
    outer = side_roles(shape, shape.run(end, tip), "+")
    return {"hem": shape.run(first, end), "centre": centre, "neck": shape.run(tip, order.index(centre[0]))} | outer


def _has_hollow_armhole(shape: Shape, roles: Roles) -> bool:
    return any(shape.is_concave(k) for role, run in roles.items() if role.startswith("armhole") for k in run)


def _centre_runs(shape: Shape, hem_first: int, hem_end: int) -> list[tuple[tuple[int, ...], bool]]:
    """The straight runs up from the hem that may be the centre of a half piece, and whether each is at +x.

    The longer one first. What leads up to it from the lowest corner of a pointed hem is of the hem.
    """
    order, count = shape.order, len(shape.order)
    found = []
    for at_right in (True, False):
        run: list[int] = []
        step = 1 if at_right else -1
        place = hem_end if at_right else (hem_first - 1) % count
        if _is_of_hem(shape, order[place]):
            place = (place + step) % count
        while len(run) < count and shape.is_straight(order[place]) and not shape.runs_across(order[place]):
            run.append(order[place])
            place = (place + step) % count
            if abs(shape.turn_after(run[-1] if at_right else order[place])) > 0.5 * BENT:
                break
        rise = sum(abs(float(shape.chord(k)[1])) for k in run)
        sway = sum(abs(float(shape.chord(k)[0])) for k in run)
        found.append((rise - 3.0 * sway, tuple(run if at_right else run[::-1]), at_right))
    found.sort(key=lambda each: -each[0])
    return [(run, at_right) for score, run, at_right in found if run and score > 0.0]


def _is_of_hem(shape: Shape, k: int) -> bool:
    """Whether an edge next to the hem slopes up from the point of it, as a waistcoat's front has one."""
    x, y = np.abs(shape.chord(k))
    low, high = shape.box
    top = float(max(shape.turned[k].start[1], shape.turned[k].end[1]) - low[1])
    return bool(x > POINTED * y and top < POINT_UP_TO * float(high[1] - low[1]))


def arm_side(shape: Shape, up: Sequence[int], mark: str) -> Roles:
    """Shoulder, armhole and side of the edges from the hem up to the neck, in that order; runs as the loop runs."""
    if len(up) < 2:
        return {f"side{mark}": tuple(up)}
    as_loop = slice(None, None, 1 if mark == "+" else -1)
    wrist = _wrist(shape, up, mark)
    if wrist is not None:
        parts = {"side": up[:wrist], "wrist": up[wrist : wrist + 1], "shoulder": up[wrist + 1 :]}
        return {f"{role}{mark}": tuple(run)[as_loop] for role, run in parts.items()}
    x, y = np.abs(shape.chord(up[-1]))
    if y > RAGLAN and y > 0.5 * x:  # a raglan's seam, which runs up to the neck
        raglan = len(up) - 1
        while raglan > 1 and abs(shape.turn_after(up[raglan - 1] if mark == "+" else up[raglan])) < 0.5 * BENT:
            raglan -= 1
        return {f"side{mark}": tuple(up[:raglan])[as_loop], f"armhole{mark}": tuple(up[raglan:])[as_loop]}
    hollow = [k for k in range(len(up) - 1) if shape.is_concave(up[k])]
    if not hollow:
        return {f"side{mark}": tuple(up[:-1])[as_loop], f"shoulder{mark}": (up[-1],)}
    # an armhole is hollow for its length; a side may be at the waist
    deepest = min(hollow, key=lambda k: shape.bow(up[k]) / max(shape.turned[up[k]].chord, 1e-9))
    low, high = deepest, deepest + 1

    def smooth(k: int) -> bool:
        """Whether the path runs on smoothly from its edge k to the next."""
        return abs(shape.turn_after(up[k] if mark == "+" else up[k + 1])) < 0.5 * BENT

    while low > 0 and smooth(low - 1):
        low -= 1
    while high < len(up) - 1 and smooth(high - 1):
        high += 1
    parts = {"side": up[:low], "armhole": up[low:high], "shoulder": up[high:]}
    return {f"{role}{mark}": tuple(run)[as_loop] for role, run in parts.items() if len(run)}


def _wrist(shape: Shape, up: Sequence[int], mark: str) -> int | None:
    """The place in a path from the hem up to the neck of the end of a sleeve that is cut in one; None: there is none.

    It is farther out than all else, between an underarm seam that runs outwards and a shoulder that runs back.
    """
    sign, step = (1.0, 1) if mark == "+" else (-1.0, -1)
    paths = [shape.turned[k].points[::step] * [sign, 1.0] for k in up]
    outs = [float(path[0, 0]) for path in paths] + [float(paths[-1][-1, 0])]
    for place in range(1, len(up) - 1):
        farthest = min(outs[place], outs[place + 1])
        others = outs[:place] + outs[place + 2 :]
        before, after = paths[place - 1][-1] - paths[place - 1][0], paths[place + 1][-1] - paths[place + 1][0]
        runs_out = before[0] > max(SLEEVE_OUT, 0.5 * abs(before[1]))
        runs_back = -after[0] > max(SLEEVE_OUT, abs(after[1])) and not shape.is_concave(up[place + 1])
        if farthest > max(others) and runs_out and runs_back and shape.is_straight(up[place]):
            return place
    return None

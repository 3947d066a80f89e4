"""What the edges of a piece are by its shape: neck, shoulder, armhole, side, hem, crotch, inseam and so on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.curve import Floats

LEVEL = 1.2  # |dx| over |dy| above which an edge runs across
CONCAVE = (4e-3, 0.04)  # [m] and of the chord: how far an edge bows inwards that is cut out for neck, arm or crotch
STRAIGHT = 0.03  # of the chord, that a straight edge bows at most
BENT = np.radians(40.0)  # turn of a corner at which another edge begins
DART = np.radians(110.0)  # how far the outline turns back at a dart's tip
DART_ALIKE = 0.05  # relative difference of a dart's legs
STRIP = 2.5  # length over width
STEEP = 0.75  # |dy| of an underarm edge, per length
BOWED_END = 0.08  # of the chord, that the top of a sleeve bows, and its hem does not
SLEEVE_OUT = 0.05  # [m] that the underarm of a sleeve cut in one with a bodice runs outwards at least
RAGLAN = 0.1  # [m] that an edge to the neck rises which is no shoulder

Roles = dict[str, tuple[int, ...]]


@dataclass(frozen=True, eq=False)
class Shape:
    """A piece's outline, counter-clockwise, as it hangs: ``up`` is a unit vector of the piece."""

    edges: tuple[Chain, ...]
    up: Floats

    @cached_property
    def turned(self) -> tuple[Chain, ...]:
        """The edges with up along +y."""
        x, y = self.up
        return tuple(edge.turned(np.array([[y, -x], [x, y]]), np.zeros(2)) for edge in self.edges)

    @cached_property
    def order(self) -> tuple[int, ...]:
        """The edges that are not of darts, in order."""
        gone = {edge for dart in self.darts for edge in dart}
        return tuple(k for k in range(len(self.edges)) if k not in gone)

    @cached_property
    def darts(self) -> tuple[tuple[int, int], ...]:
        """Pairs of edges that are the legs of a dart."""
        count = len(self.edges)
        found = []
        for k in range(count):
            one, other = self.edges[k], self.edges[(k + 1) % count]
            alike = abs(one.length - other.length) <= DART_ALIKE * max(one.length, other.length)
            if count > 4 and alike and self.turn_after(k) < -DART:
                found.append((k, (k + 1) % count))
        return tuple(found)

    def turn_after(self, k: int) -> float:
        """The angle by which the outline turns at an edge's end [rad], positive to the left."""
        one, other = self.edges[k].points, self.edges[(k + 1) % len(self.edges)].points
        a, b = one[-1] - one[-2], other[1] - other[0]
        return float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b))

    @cached_property
    def box(self) -> tuple[Floats, Floats]:
        points = np.concatenate([edge.points for edge in self.turned])
        return points.min(axis=0), points.max(axis=0)

    def chord(self, k: int) -> Floats:
        return np.asarray(self.turned[k].end - self.turned[k].start)

    def runs_across(self, k: int) -> bool:
        x, y = np.abs(self.chord(k))
        return bool(x > LEVEL * y)

    def bow(self, k: int) -> float:
        """The farthest that an edge is from its chord [m]: positive outwards."""
        edge = self.turned[k]
        x, y = self.chord(k) / max(edge.chord, 1e-9)
        aside = (edge.points - edge.start) @ np.array([y, -x])
        return float(aside[np.abs(aside).argmax()])

    def is_concave(self, k: int) -> bool:
        return -self.bow(k) > max(CONCAVE[0], CONCAVE[1] * self.turned[k].chord)

    def is_straight(self, k: int) -> bool:
        return abs(self.bow(k)) <= STRAIGHT * self.turned[k].chord

    def length(self, run: Sequence[int]) -> float:
        return sum(self.edges[k].length for k in run)

    def middle(self, k: int) -> Floats:
        return np.asarray(self.turned[k].at(np.array([0.5]))[0])

    def run(self, first: int, end: int) -> tuple[int, ...]:
        """The places of ``order`` from ``first`` up to, not with, ``end``, as edges."""
        count = len(self.order)
        return tuple(self.order[(first + k) % count] for k in range((end - first) % count))

    def width(self, share: float) -> float:
        """Width at this share of the height, from the bottom [m]."""
        points = np.concatenate([edge.at(np.linspace(0.0, 1.0, 33)) for edge in self.turned])
        low, high = self.box
        near = np.abs(points[:, 1] - low[1] - share * (high[1] - low[1])) < 0.03 * (high[1] - low[1])
        return float(np.ptp(points[near, 0])) if near.any() else 0.0


def concave_count(shape: Shape) -> int:
    return sum(shape.is_concave(k) for k in shape.order)


def is_strip(shape: Shape) -> bool:
    """Whether a piece is a band: long, with two ends."""
    size = shape.box[1] - shape.box[0]
    return bool(max(size) > STRIP * min(size)) and 4 <= len(shape.order) <= 12 and not concave_count(shape)


def upright(edges: tuple[Chain, ...], kind: str) -> Floats:
    """Which way along the grain is up as worn: +y, as drawn, where the shape does not tell."""
    shape = Shape(edges, np.array([0.0, 1.0]))
    low, high = shape.box
    height = float(high[1] - low[1])
    if kind in ("front", "back", "side_front", "side_back", "leg_front", "leg_back", "leg", "yoke"):
        hollow = [k for k in shape.order if shape.is_concave(k)]
        weights = [-shape.bow(k) / max(shape.edges[k].chord, 1e-9) for k in hollow]  # a waist is long, and less hollow
        rise = sum(w * (shape.middle(k)[1] - low[1]) for w, k in zip(weights, hollow, strict=True))
        above = rise / sum(weights) / height - 0.5 if hollow else 0.0
    elif kind == "hood":
        most = max(shape.order, key=shape.bow)
        above = float(shape.middle(most)[1] - low[1]) / height - 0.5
    elif kind in ("sleeve", "under_sleeve") and (ends := [k for k in shape.order if _is_bowed_end(shape, k)]):
        most = max(ends, key=lambda k: abs(shape.bow(k)))  # the cap, or the top of an under sleeve
        above = float(shape.middle(most)[1] - low[1]) / height - 0.5
    elif kind in ("sleeve", "under_sleeve", "skirt") or kind.endswith(("skirt_front", "skirt_back", "gore")):
        above = (shape.width(0.04) - shape.width(0.96)) / max(shape.width(0.5), 1e-6)
    else:
        above = 0.0
    return np.array([0.0, -1.0 if above < -0.02 else 1.0])


def _is_bowed_end(shape: Shape, k: int) -> bool:
    return shape.runs_across(k) and abs(shape.bow(k)) > BOWED_END * shape.turned[k].chord


def ends_of(shape: Shape) -> tuple[tuple[int, int], tuple[int, int]]:
    """Places in ``order`` of the bottom and of the top: first edge, and the one after the last."""
    order, count = shape.order, len(shape.order)

    def grown(seed: int, rightwards: bool) -> tuple[int, int]:
        first, end = seed, seed + 1
        while end - first < count - 2 and shape.runs_across(order[end % count]):
            if (shape.chord(order[end % count])[0] > 0) != rightwards:
                break
            end += 1
        while end - first < count - 2 and shape.runs_across(order[(first - 1) % count]):
            if (shape.chord(order[(first - 1) % count])[0] > 0) != rightwards:
                break
            first -= 1
        return first % count, end % count

    low = [k for k in range(count) if shape.chord(order[k])[0] > 0 and shape.runs_across(order[k])]
    high = [k for k in range(count) if shape.chord(order[k])[0] < 0 and shape.runs_across(order[k])]
    every = range(count)
    bottom = min(low or every, key=lambda k: float(shape.middle(order[k])[1]))
    top = max(high or every, key=lambda k: float(shape.middle(order[k])[1]))
    return grown(bottom, True), grown(top, False)


def bodice_roles(shape: Shape, whole: bool, side_roles: Callable[[Shape, Sequence[int], str], Roles]) -> Roles:
    """neck, hem; shoulder, armhole and side at +x and -x, as "shoulder+"; of a half also centre, with one side.

    ``side_roles`` tells the roles of the edges from the hem up to the neck: ``arm_side``, or of a middle panel
    ``panel_roles.middle_side``.
    """
    order, count = shape.order, len(shape.order)
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
            tips.append(int(mine[starts[mine, 1].argmax()]))
        roles["neck"] = shape.run(tips[0], tips[1])
        roles |= side_roles(shape, shape.run(hem_end, tips[0]), "+")
        roles |= side_roles(shape, shape.run(tips[1], hem_first)[::-1], "-")
        return roles
    tallest = _centre_run(shape, hem_first, hem_end)
    if tallest is None:
        return roles
    centre, at_right = tallest
    tip = int(starts[:, 1].argmax())
    roles["centre"] = centre
    if at_right:  # hem, centre, neck, shoulder, armhole, side
        neck_from = (order.index(centre[-1]) + 1) % count
        roles["neck"] = shape.run(neck_from, tip)
        roles |= side_roles(shape, shape.run(tip, hem_first)[::-1], "-")
    else:
        roles["neck"] = shape.run(tip, order.index(centre[0]))
        roles |= side_roles(shape, shape.run(hem_end, tip), "+")
    return roles


def _centre_run(shape: Shape, hem_first: int, hem_end: int) -> tuple[tuple[int, ...], bool] | None:
    """The straight run up from the hem that is the centre of a half piece, and whether it is at +x."""
    order, count = shape.order, len(shape.order)
    found = []
    for at_right in (True, False):
        run: list[int] = []
        place = hem_end if at_right else (hem_first - 1) % count
        while len(run) < count and shape.is_straight(order[place]) and not shape.runs_across(order[place]):
            run.append(order[place])
            place = (place + (1 if at_right else -1)) % count
            if abs(shape.turn_after(run[-1] if at_right else order[place])) > 0.5 * BENT:
                break
        rise = sum(abs(float(shape.chord(k)[1])) for k in run)
        sway = sum(abs(float(shape.chord(k)[0])) for k in run)
        found.append((rise - 3.0 * sway, tuple(run if at_right else run[::-1]), at_right))
    best = max(found, key=lambda each: each[0])
    return (best[1], best[2]) if best[1] and best[0] > 0.0 else None


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


def leg_roles(shape: Shape) -> Roles:
    """waist, hem, outseam, inseam, crotch; "inner+" or "inner-" tells on which side the crotch is."""
    (hem_first, hem_end), (waist_first, waist_end) = ends_of(shape)
    roles: Roles = {"hem": shape.run(hem_first, hem_end), "waist": shape.run(waist_first, waist_end)}
    right, left = shape.run(hem_end, waist_first), shape.run(waist_end, hem_first)
    if not right or not left:
        return roles
    hollow = [min((shape.bow(k) for k in path), default=0.0) for path in (right, left)]
    inner_right = hollow[0] < hollow[1]
    inner, outer = (right, left) if inner_right else (left, right)
    roles["outseam"] = outer
    corners = [float(shape.turned[k].start[0]) for k in inner[1:]]
    if not corners:
        return roles
    tip = 1 + int(np.argmax(corners) if inner_right else np.argmin(corners))
    below, above = (inner[:tip], inner[tip:]) if inner_right else (inner[tip:], inner[:tip])
    return roles | {"inseam": below, "crotch": above, "inner+" if inner_right else "inner-": ()}


def sleeve_roles(shape: Shape) -> Roles:
    """hem, cap, and the underarm seams at +x and -x."""
    order, count = shape.order, len(shape.order)
    (hem_first, hem_end), _ = ends_of(shape)

    def climbed(place: int, step: int) -> int:
        taken = 0
        while taken < count - 2:
            k = order[place % count]
            steep = abs(shape.chord(k)[1]) / max(shape.turned[k].chord, 1e-9)
            if steep < STEEP or (taken and abs(shape.turn_after(k if step < 0 else order[(place - 1) % count])) > BENT):
                break
            taken += 1
            place += step
        return taken

    right = climbed(hem_end, 1)
    left = climbed(hem_first - 1, -1)
    roles: Roles = {"hem": shape.run(hem_first, hem_end)}
    if not right or not left:
        return roles
    cap_first, cap_end = (hem_end + right) % count, (hem_first - left) % count
    roles["under+"] = shape.run(hem_end, cap_first)
    roles["under-"] = shape.run(cap_end, hem_first)
    roles["cap"] = shape.run(cap_first, cap_end)
    return roles | _raglan_roles(shape, roles["cap"])


def _raglan_roles(shape: Shape, cap: tuple[int, ...]) -> Roles:
    """Of a cap that ends at the neck: its neck, and its seams at +x and -x; it is a raglan's if bodices have none."""
    steep = [abs(float(shape.chord(k)[1])) > 0.5 * abs(float(shape.chord(k)[0])) for k in cap]
    level = [n for n, is_steep in enumerate(steep) if not is_steep]
    up, down = (level[0], level[-1] + 1) if level else (0, 0)
    if not 0 < up < down < len(cap):
        return {}
    return {"raglan+": cap[:up], "neck": cap[up:down], "raglan-": cap[down:]}


def pants_roles(shape: Shape) -> Roles:
    """waist and hem of a whole leg; inseam and crotch at +x and -x."""
    (hem_first, hem_end), (waist_first, waist_end) = ends_of(shape)
    roles: Roles = {"hem": shape.run(hem_first, hem_end), "waist": shape.run(waist_first, waist_end)}
    for mark, run in (("+", shape.run(hem_end, waist_first)), ("-", shape.run(waist_end, hem_first))):
        corners = [float(shape.turned[k].start[0]) for k in run[1:]]
        if not corners:
            return roles
        tip = 1 + int(np.argmax(corners) if mark == "+" else np.argmin(corners))
        below, above = (run[:tip], run[tip:]) if mark == "+" else (run[tip:], run[:tip])
        roles |= {f"inseam{mark}": below, f"crotch{mark}": above}
    return roles


def hood_roles(shape: Shape) -> Roles:
    """neck, face and centre of half a hood; "face+" or "face-" tells on which side the face is."""
    order, count = shape.order, len(shape.order)
    starts = np.array([shape.turned[k].start for k in order])
    low, high = shape.box
    reach = high - low

    def squareness(place: int) -> float:
        k = order[place]
        x, y = np.abs(shape.chord(k))
        if not shape.is_straight(k) or y < 1.5 * x or y < 0.4 * reach[1]:
            return -1.0
        return min(shape.turn_after(order[(place - 1) % count]), shape.turn_after(k))

    face = max(range(count), key=squareness)
    if squareness(face) < 0.0:
        return {}
    face_right = bool(shape.chord(order[face])[1] > 0.0)  # counter-clockwise, +x sides run up
    # the neck lies at the bottom, between the face and the farther of the low corners
    low_corners = [k for k in range(count) if starts[k, 1] < low[1] + 0.35 * reach[1]]
    back = min(low_corners, key=lambda k: starts[k, 0] if face_right else -starts[k, 0], default=face)
    if face_right:
        neck, centre = shape.run(back, face), shape.run(face + 1, back)
    else:
        neck, centre = shape.run(face + 1, back), shape.run(back, face)
    mark = "face+" if face_right else "face-"
    return {"neck": neck, "face": (order[face],), "centre": centre, mark: ()}


def skirt_roles(shape: Shape) -> Roles:
    """waist, hem, and the sides at +x and -x."""
    (hem_first, hem_end), (waist_first, waist_end) = ends_of(shape)
    return {
        "hem": shape.run(hem_first, hem_end),
        "waist": shape.run(waist_first, waist_end),
        "side+": shape.run(hem_end, waist_first),
        "side-": shape.run(waist_end, hem_first),
    }


def strip_roles(shape: Shape) -> Roles:
    """The two long sides and the two ends of a band; the longer side first."""
    size = shape.box[1] - shape.box[0]
    axis = int(size.argmax())
    order, count = shape.order, len(shape.order)
    lengthwise = [bool(abs(shape.chord(k)[axis]) > 2.0 * abs(shape.chord(k)[1 - axis])) for k in order]
    firsts = [k for k in range(count) if lengthwise[k] != lengthwise[k - 1]]
    if len(firsts) != 4:
        return {}
    runs = [shape.run(first, firsts[(n + 1) % 4]) for n, first in enumerate(firsts)]
    if not lengthwise[firsts[0]]:
        runs = [*runs[1:], runs[0]]
    longs = sorted((runs[0], runs[2]), key=shape.length, reverse=True)
    return {"long": longs[0], "long2": longs[1], "end": runs[1], "end2": runs[3]}


def collar_roles(shape: Shape) -> Roles:
    """The two long edges of a curved collar, the longer one first: the longest runs between its corners."""
    order = shape.order
    firsts = [place for place in range(len(order)) if abs(shape.turn_after(order[place - 1])) > 0.5 * BENT]
    if len(firsts) < 2:
        return {}
    runs = [shape.run(first, firsts[(n + 1) % len(firsts)]) for n, first in enumerate(firsts)]
    longs = sorted(runs, key=shape.length, reverse=True)[:2]
    size = shape.box[1] - shape.box[0]
    return {"long": longs[0], "long2": longs[1]} if shape.length(longs[1]) > 0.5 * float(max(size)) else {}

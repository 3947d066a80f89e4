"""What the edges of a piece are by its shape: neck, shoulder, armhole, side, hem, crotch, inseam and so on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.kinds import YOKES

LEVEL = 1.2  # |dx| over |dy| above which an edge runs across
CONCAVE = (4e-3, 0.04)  # [m] and of the chord: how far an edge bows inwards that is cut out for neck, arm or crotch
STRAIGHT = 0.03  # of the chord, that a straight edge bows at most
BENT = np.radians(40.0)  # turn of a corner at which another edge begins
DART = np.radians(110.0)  # how far the outline turns back at a dart's tip
DART_ALIKE = 0.05  # relative difference of a dart's legs
WIDEST_DART = 0.11  # [m] between their ends; what opens wider is a pointed neckline
SHOULDER_FALL = 0.14  # height over width, of a shoulder at least
STRIP, NAMED_STRIP = 2.5, 1.15  # length over width; of a straight piece that its name makes a band, as a deep cuff
STEEP = 0.75  # |dy| of an underarm edge, per length
BOWED_END = 0.08  # of the chord, that the top of a sleeve bows, and its hem does not

UPWARDS = np.array([0.0, 1.0])  # of a piece that is drawn as it hangs

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
            is_narrow = float(np.hypot(*(other.end - one.start))) <= WIDEST_DART
            is_dart = count > 4 and alike and is_narrow and self.turn_after(k) < -DART
            if is_dart and not self._is_between_shoulders(k):
                found.append((k, (k + 1) % count))
        return tuple(found)

    def _is_between_shoulders(self, k: int) -> bool:
        """Whether two legs from this edge on are a pointed neckline: straight edges fall away from both their ends."""
        outer = ((k - 1) % len(self.edges), (k + 2) % len(self.edges))
        falls = (self.chord(outer[0])[1], -self.chord(outer[1])[1])
        return all(
            self.is_straight(edge) and fall > SHOULDER_FALL * abs(self.chord(edge)[0]) and self.chord(edge)[0] < 0.0
            for edge, fall in zip(outer, falls, strict=True)
        )

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


def is_strip(shape: Shape, is_named: bool = False) -> bool:
    """Whether a piece is a band: long, with two ends; ``is_named``: its name says so, and it may be shorter."""
    size = shape.box[1] - shape.box[0]
    is_short = is_named and all(shape.is_straight(k) for k in shape.order)
    least = NAMED_STRIP if is_short else STRIP
    return bool(max(size) > least * min(size)) and 4 <= len(shape.order) <= 12 and not concave_count(shape)


def upright(edges: tuple[Chain, ...], kind: str) -> Floats:
    """Which way along the grain is up as worn: +y, as drawn, where the shape does not tell."""
    shape = Shape(edges, UPWARDS)
    low, high = shape.box
    height = float(high[1] - low[1])
    if kind in ("front", "back", "side_front", "side_back", "leg_front", "leg_back", "leg"):
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
    elif kind == "sleeve" and all(_is_flat(shape, shape.run(*end)) for end in ends_of(shape)):
        above = (shape.width(0.96) - shape.width(0.04)) / max(shape.width(0.5), 1e-6)  # a straight cap is the wider end
    elif kind in ("skirt", *YOKES) or kind.endswith(("sleeve", "skirt_front", "skirt_back", "gore")):
        above = (shape.width(0.04) - shape.width(0.96)) / max(shape.width(0.5), 1e-6)
    else:
        above = 0.0
    return np.array([0.0, -1.0 if above < -0.02 else 1.0])


def _is_flat(shape: Shape, run: Sequence[int]) -> bool:
    """Whether a run of edges lies level, within a little of its length."""
    points = np.concatenate([shape.turned[k].points for k in run])
    return bool(np.ptp(points[:, 1]) < STRAIGHT * shape.length(run))


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

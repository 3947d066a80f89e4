"""Darts that a piece shows as inner lines: a V from its outline, or a diamond within it (a fish-eye).

Legs are found from corner to corner of the lines, whether a dart is one polyline, two, or single lines; a line between
the legs, where it is folded, is none of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.lattice import inside
from warp_cloth.pattern.loops import area_of
from warp_cloth.pattern.specification import Dart

TIP = np.radians(110.0)  # how far a line turns back at a dart's tip, as in an outline (roles.DART)
ALIKE = 0.05  # relative difference of a dart's legs, as in an outline
JOINED = 1e-3  # [m] between ends that are one
AT_OUTLINE = 5e-3  # [m] from a leg's end to the outline that it is led on to
SHORTEST = 0.02  # [m] of a leg
NARROWEST, WIDEST = 3e-3, 0.15  # [m] between legs: at the outline, or in the mean half of a diamond
MOST_LEGS, MOST_LINES = 200, 800  # of a piece: more are no darts, but a drawing


_Mouth = tuple[float, float, Floats]  # where along the outline a V starts and ends [m], and its line, shape [n, 2]


@dataclass(frozen=True, eq=False)
class Cut:
    """An outline with the darts that open at it, and those within it."""

    outline: Floats  # counter-clockwise, shape [n, 2]
    corners: Floats  # where legs of those begin and end, shape [m, 2]
    removed: tuple[Floats, ...]  # what was outline between their legs
    inner: tuple[Dart, ...]


def with_darts(outline: Floats, lines: Sequence[Floats]) -> Cut:
    """An outline [m], shape [n, 2], counter-clockwise, cut by the darts that inner lines show."""
    legs = _legs(lines)
    if len(legs) > MOST_LEGS:
        return Cut(outline, np.zeros((0, 2)), (), ())
    mouths = sorted(_vs(outline, legs), key=lambda mouth: mouth[0])
    made, removed = _opened(outline, mouths)
    if mouths and _crosses(made, [line for _, _, line in mouths]):  # lines of a drawing
        mouths, made, removed = [], outline, []
    corners = [line[[0, _tip(line), -1]] for _, _, line in mouths]
    inner: list[Dart] = []
    for dart in _fish_eyes(legs):
        fine = _fine(dart)
        if inside(made, fine).all() and not any(_meet(fine, _fine(other)) for other in inner):
            inner.append(dart)
    return Cut(made, np.concatenate(corners) if corners else np.zeros((0, 2)), tuple(removed), tuple(inner))


def _opened(outline: Floats, mouths: Sequence[_Mouth]) -> tuple[Floats, list[Floats]]:
    """The outline with the legs of Vs, sorted along it, instead of what lies between them, which is returned, too."""
    if not mouths:
        return outline, []
    reach = _reach(outline)
    kept: list[Floats] = []
    removed = []
    for (start, end, line), (following, _, _) in zip(mouths, [*mouths[1:], mouths[0]], strict=True):
        kept += [line, _between(outline, reach, end, following)]
        removed.append(np.concatenate([line[:1], _between(outline, reach, start, end), line[-1:]]))
    return np.concatenate(kept), removed


def _crosses(loop: Floats, lines: Sequence[Floats]) -> bool:
    """Whether sides of a polygon are crossed by lines that are parts of it."""
    start, step = loop, np.roll(loop, -1, axis=0) - loop
    own = np.concatenate([line[:-1] for line in lines])
    way = np.concatenate([np.diff(line, axis=0) for line in lines])
    away = start[None] - own[:, None]
    across = way[:, None, 0] * step[None, :, 1] - way[:, None, 1] * step[None, :, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        here = (away[..., 0] * step[None, :, 1] - away[..., 1] * step[None, :, 0]) / across
        there = (away[..., 0] * way[:, None, 1] - away[..., 1] * way[:, None, 0]) / across
    inner = (here > 1e-9) & (here < 1.0 - 1e-9) & (there > 1e-9) & (there < 1.0 - 1e-9)
    return bool((inner & np.isfinite(across)).any())


def _fine(dart: Dart) -> Floats:
    """Points along a dart's legs but for its tips, shape [n, 2]."""
    return np.concatenate([leg.at(np.linspace(0.02, 0.98, 25)) for leg in dart.loop])


def _meet(one: Floats, other: Floats) -> bool:
    return bool(inside(one, other).any() or inside(other, one).any())


def turned(dart: Dart, matrix: Floats, shift: Floats) -> Dart:
    """The dart with every point p moved to ``matrix @ p + shift``, counter-clockwise again where that mirrors it."""
    one, other = (tuple(Chain(leg.points).turned(matrix, shift) for leg in side) for side in (dart.one, dart.other))
    if np.linalg.det(matrix) > 0.0:
        return Dart(one, other)
    one, other = (tuple(leg.reversed for leg in side[::-1]) for side in (other, one))
    return Dart(one, other)


def _legs(lines: Sequence[Floats]) -> list[Floats]:
    """Lines from tip to tip, or to their ends, shape [n, 2] each."""
    parts = [part for line in lines for part in _at_tips(line)]
    parts = [part for part in parts if float(np.hypot(*np.diff(part, axis=0).T).sum()) > JOINED]
    if len(parts) <= MOST_LINES:
        parts = _joined(parts)
    return [part for part in parts if float(np.hypot(*(part[-1] - part[0]))) >= SHORTEST]


def _at_tips(line: Floats) -> list[Floats]:
    """A polyline parted at its tips; a closed one without tips is none."""
    line = line[np.concatenate([[True], np.hypot(*np.diff(line, axis=0).T) > 1e-9])]
    closed = len(line) > 3 and float(np.hypot(*(line[-1] - line[0]))) <= JOINED
    if closed:
        step = np.diff(np.vstack([line[:-1], line[0]]), axis=0)
        tips = np.flatnonzero(np.abs(_turn(np.roll(step, 1, axis=0), step)) > TIP)
        if not len(tips):
            return []
        ring = np.roll(line[:-1], -tips[0], axis=0)
        line = np.vstack([ring, ring[0]])
    step = np.diff(line, axis=0)
    cuts = 1 + np.flatnonzero(np.abs(_turn(step[:-1], step[1:])) > TIP)
    return [line[a : b + 1] for a, b in zip([0, *cuts], [*cuts, len(line) - 1], strict=True) if b > a]


def _turn(before: Floats, after: Floats) -> Floats:
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.asarray(np.arctan2(cross, (before * after).sum(axis=1)))


def _joined(parts: Sequence[Floats]) -> list[Floats]:
    """Lines, each joined to the one that leads on from it, where no third one ends."""
    parts = list(parts)
    ends = np.array([end for part in parts for end in (part[0], part[-1])]).reshape(-1, 2)
    k = 0
    while k < len(ends):
        near = np.flatnonzero(np.hypot(*(ends - ends[k]).T) <= JOINED).tolist()
        i, j = (near[0] // 2, near[1] // 2) if len(near) == 2 else (0, 0)
        if i == j or near[0] != k:
            k += 1
            continue
        one = parts[i] if near[0] % 2 else parts[i][::-1]
        other = parts[j][::-1] if near[1] % 2 else parts[j]
        if abs(float(_turn(one[-1:] - one[-2:-1], other[1:2] - other[:1])[0])) > TIP:
            k += 1
            continue
        parts[i] = np.concatenate([one, other[1:]])
        del parts[j]
        ends[2 * i], ends[2 * i + 1] = parts[i][0], parts[i][-1]
        ends = np.delete(ends, (2 * j, 2 * j + 1), axis=0)
        k = 2 * i
    return parts


def _fish_eyes(legs: Sequence[Floats]) -> Iterable[Dart]:
    """Darts of two legs between the same two tips."""
    groups: list[list[Floats]] = []
    firsts = np.zeros((len(legs), 2, 2))  # ends of the first leg of each group
    for leg in legs:
        for way in (leg, leg[::-1]):
            apart = np.hypot(*np.moveaxis(firsts[: len(groups)] - way[[0, -1]], 2, 0)).max(axis=1)
            there = np.flatnonzero(apart <= JOINED)
            if len(there):
                first = groups[there[0]][0]
                groups[there[0]].append(np.vstack([first[0], way[1:-1], first[-1]]))
                break
        else:
            firsts[len(groups)] = leg[[0, -1]]
            groups.append([leg])
    for group in groups:
        bulge = [area_of(leg) if len(leg) > 2 else 0.0 for leg in group]
        right, left = group[int(np.argmax(bulge))], group[int(np.argmin(bulge))]
        wide = (max(bulge) - min(bulge)) / float(np.hypot(*(right[-1] - right[0])))
        if len(group) < 2 or not max(bulge) > 0.0 > min(bulge) or wide < NARROWEST or not _alike(right, left):
            continue
        ends = [(right[1] - right[0], left[1] - left[0]), (right[-2] - right[-1], left[-2] - left[-1])]
        sharp = all(abs(float(_turn(-a[None], b[None])[0])) > TIP for a, b in ends)
        if sharp:
            sides = _parted(Chain(right)), _parted(Chain(left[::-1]))
            if len(sides[0]) != len(sides[1]):
                sides = (Chain(right),), (Chain(left[::-1]),)
            yield Dart(*sides)


def _parted(leg: Chain) -> tuple[Chain, ...]:
    """A leg parted at its corners, if it is of straight lines."""
    return tuple(Chain(leg.points[k : k + 2]) for k in range(len(leg.points) - 1)) if len(leg.points) <= 3 else (leg,)


def _vs(outline: Floats, legs: Sequence[Floats]) -> list[_Mouth]:
    """Darts of two legs from one tip to the outline: where on it they begin and end, and their line."""
    ways = [(leg, leg[::-1]) for leg in legs]
    led = [tuple(_to_outline(outline, way) if inside(outline, way[:1]).all() else None for way in two) for two in ways]
    found = [
        mouth
        for i, j in _touching(legs)
        for a in (0, 1)
        for b in (0, 1)
        for mouth in _v(outline, (ways[i][a], ways[j][b]), (led[i][a], led[j][b]))
    ]
    # of a tip's legs and the fold between them, the outer two are the dart; no dart begins within another
    found.sort(key=lambda mouth: (-float(np.hypot(*(mouth[2][-1] - mouth[2][0]))), mouth[0]))
    whole = float(_reach(outline)[-1])
    kept: list[_Mouth] = []
    for start, end, line in found:
        tip = line[_tip(line)]
        if all(
            float(np.hypot(*(other[_tip(other)] - tip))) > JOINED
            and (start - low) % whole >= (high - low) % whole
            and (low - start) % whole >= (end - start) % whole
            for low, high, other in kept
        ):
            kept.append((start, end, line))
    return kept


def _touching(legs: Sequence[Floats]) -> Iterable[tuple[int, int]]:
    """Pairs of legs that have an end at one place, sharply enough for a tip."""
    ends = np.array([end for leg in legs for end in (leg[0], leg[-1])]).reshape(-1, 2)
    ways = np.array([way for leg in legs for way in (leg[1] - leg[0], leg[-2] - leg[-1])]).reshape(-1, 2)
    ways /= np.maximum(np.hypot(*ways.T), 1e-300)[:, None]
    near = np.hypot(*np.moveaxis(ends[:, None] - ends[None], 2, 0)) <= JOINED
    near &= ways @ ways.T > -np.cos(TIP) - 1e-6  # they leave it side by side
    meet = near.reshape(len(legs), 2, len(legs), 2).any(axis=(1, 3))
    return ((i, j) for i, j in np.argwhere(np.triu(meet, 1)).tolist())


def _v(
    outline: Floats, legs: tuple[Floats, Floats], mouth: tuple[tuple[Floats, float] | None, ...]
) -> Iterable[_Mouth]:
    """The dart that two legs from one tip are, ``mouth``: where each meets the outline; none if they are none."""
    (one, other), (first, second) = legs, mouth
    sharp = abs(float(_turn(one[:1] - one[1:2], other[1:2] - other[:1])[0])) > TIP
    if np.hypot(*(one[0] - other[0])) > JOINED or not sharp or first is None or second is None:
        return
    (leg, at), (back, there) = first, second
    if not _alike(leg, back) or not NARROWEST <= np.hypot(*(leg[-1] - back[-1])) <= WIDEST:
        return
    if (there - at) % 1.0 > 0.5:
        (leg, at), (back, there) = (back, there), (leg, at)
    whole = float(_reach(outline)[-1])
    yield at * whole, there * whole, np.concatenate([leg[::-1], back[1:]])


def _to_outline(outline: Floats, leg: Floats) -> tuple[Floats, float] | None:
    """A leg from its tip to where it meets the outline, and that place as a share of it; None: it ends within it."""
    reach = _reach(outline)
    ahead = np.roll(outline, -1, axis=0) - outline
    last = leg[-1] + (leg[-1] - leg[-2]) * AT_OUTLINE / np.hypot(*(leg[-1] - leg[-2]))
    led = np.vstack([leg[:-1], last])
    for k in range(len(led) - 1):
        step = led[k + 1] - led[k]
        across = step[0] * ahead[:, 1] - step[1] * ahead[:, 0]
        away = outline - led[k]
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (away[:, 0] * ahead[:, 1] - away[:, 1] * ahead[:, 0]) / across
            share = (away[:, 0] * step[1] - away[:, 1] * step[0]) / across
        hit = (along > 1e-9) & (along <= 1.0 + 1e-9) & (share >= 0.0) & (share < 1.0) & np.isfinite(along)
        if hit.any():
            side = int(np.flatnonzero(hit)[along[hit].argmin()])
            at = reach[side] + share[side] * (reach[side + 1] - reach[side])
            return np.vstack([led[: k + 1], led[k] + along[side] * step]), float(at / reach[-1])
    return None


def _alike(one: Floats, other: Floats) -> bool:
    short, long = sorted(float(np.hypot(*np.diff(leg, axis=0).T).sum()) for leg in (one, other))
    return long - short <= ALIKE * long


def _tip(line: Floats) -> int:
    step = np.diff(line, axis=0)
    return 1 + int(np.abs(_turn(step[:-1], step[1:])).argmax())


def _reach(outline: Floats) -> Floats:
    """Lengths along an outline to each of its points, and all round, shape [n + 1]."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*(np.roll(outline, -1, axis=0) - outline).T))])


def _between(outline: Floats, reach: Floats, start: float, end: float) -> Floats:
    """Points of an outline after one place and before another, which may lie round its first point."""
    if end < start:
        end += reach[-1]
    at = np.concatenate([reach[:-1], reach[:-1] + reach[-1]])
    return np.tile(outline, (2, 1))[(at > start + JOINED) & (at < end - JOINED)]

"""Loops from loose lines: polylines joined end to end, cleaned, and moved inwards by a seam allowance."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from warp_cloth.pattern.curve import Floats

JOINED = 1e-3  # of the extent, within which two ends are one point
WIDEST_GAP = 0.05  # of the extent, over which ends are joined; what is left open wider stays open
MOST_LINES = 20_000
MISSED = 0.3  # of a side, that its middle is from any line where none draws it
MITRE = 4.0  # allowances, that a corner may be cut back at most


def chained(lines: Sequence[Floats]) -> list[Floats]:
    """Closed loops, each without its first point again, shape [n, 2]; lines [m, 2] are joined at their nearest ends."""
    lines = _distinct(lines)
    loops = [line[:-1] for line in lines if len(line) > 3 and is_closed(line)]
    rest = [line for line in lines if len(line) > 1 and not is_closed(line)][:MOST_LINES]
    ends = np.array([(line[0], line[-1]) for line in rest]) if rest else np.zeros((0, 2, 2))
    free = np.ones(len(rest), dtype=bool)
    whole = float(np.ptp(np.concatenate(rest), axis=0).max()) if rest else 0.0
    reach = WIDEST_GAP * whole
    while free.any():
        first = int(np.flatnonzero(free)[0])
        free[first] = False
        chain = [rest[first]]
        while True:
            tip, start = chain[-1][-1], chain[0][0]
            gaps = np.where(free[:, None], np.hypot(*np.moveaxis(ends - tip, 2, 0)), np.inf)
            index, side = divmod(int(gaps.argmin()), 2) if gaps.size else (0, 0)
            nearest = float(gaps[index, side]) if gaps.size else np.inf
            long_enough = sum(map(len, chain)) > 2
            if nearest > reach or (long_enough and float(np.hypot(*(start - tip))) <= nearest):
                break
            free[index] = False
            turned = rest[index][:: -1 if side else 1]
            chain.append(turned[1:] if nearest <= JOINED * whole else turned)
        loop = np.concatenate(chain)
        extent = float(np.ptp(loop, axis=0).max())
        gap = float(np.hypot(*(loop[0] - loop[-1])))
        if len(loop) > 2 and gap <= 0.5 * extent:
            loops.append(loop[:-1] if len(loop) > 3 and gap <= JOINED * extent else loop)
    return loops


def _distinct(lines: Sequence[Floats]) -> list[Floats]:
    """Lines that no other repeats, in either direction; lines without length are none."""
    moving = [line for line in lines if len(line) > 1 and float(np.ptp(line, axis=0).max()) > 0.0]
    if not moving:
        return []
    step = max(1e-7 * float(np.ptp(np.concatenate(moving), axis=0).max()), 1e-300)
    seen: set[bytes] = set()
    out = []
    for line in moving:
        with np.errstate(invalid="ignore"):  # what is not finite is refused by its piece's name
            steps = np.round(line / step)
        key = min(steps.tobytes(), np.ascontiguousarray(steps[::-1]).tobytes())
        if key not in seen:
            seen.add(key)
            out.append(line)
    return out


def gaps_of(lines: Sequence[Floats], loops: Sequence[Floats]) -> list[float]:
    """The longest side of each loop that no line draws; 0: they draw all of it."""
    drawn = {(a.tobytes(), b.tobytes()) for line in lines for a, b in pairwise(line)}
    drawn |= {(b, a) for a, b in drawn}
    starts = np.concatenate([line[:-1] for line in lines]) if lines else np.zeros((0, 2))
    along = np.concatenate([np.diff(line, axis=0) for line in lines]) if lines else np.zeros((0, 2))
    return [_gap_of(loop, drawn, starts, along) for loop in loops]


def _gap_of(loop: Floats, drawn: set[tuple[bytes, bytes]], starts: Floats, along: Floats) -> float:
    ahead = np.roll(loop, -1, axis=0)
    bare = [k for k in range(len(loop)) if (loop[k].tobytes(), ahead[k].tobytes()) not in drawn]
    square = np.maximum((along**2).sum(axis=1), 1e-300) if bare else np.zeros(0)
    widest = 0.0
    for k in bare:  # a side may be drawn by several lines, or by one of whose points some were left out
        side = float(np.hypot(*(ahead[k] - loop[k])))
        away = 0.5 * (loop[k] + ahead[k]) - starts
        away -= np.clip((away * along).sum(axis=1) / square, 0.0, 1.0)[:, None] * along
        if side > widest and float(np.hypot(*away.T).min(initial=np.inf)) > MISSED * side:
            widest = side
    return widest


def is_closed(line: Floats) -> bool:
    """Whether a line ends where it begins."""
    extent = float(np.ptp(line, axis=0).max())
    return float(np.hypot(*(line[0] - line[-1]))) <= 1e-6 * extent


def cleaned(loop: Floats, least: float) -> Floats:
    """A loop counter-clockwise, without points nearer than ``least`` to the one before, and without spikes."""
    points = loop
    for _ in range(len(loop)):
        step = np.hypot(*(points - np.roll(points, 1, axis=0)).T)
        kept = points[step > least]
        if len(kept) < 3:
            return kept
        back, ahead = np.roll(kept, 1, axis=0) - kept, np.roll(kept, -1, axis=0) - kept
        cross = back[:, 0] * ahead[:, 1] - back[:, 1] * ahead[:, 0]
        spike = (np.abs(cross) <= 1e-9 * np.hypot(*back.T) * np.hypot(*ahead.T)) & ((back * ahead).sum(axis=1) > 0)
        if not spike.any() and len(kept) == len(points):
            break
        points = kept[~spike]
        if len(points) < 3:
            return points
    return points if area_of(points) > 0.0 else points[::-1]


def area_of(loop: Floats) -> float:
    """Signed area of a loop, positive counter-clockwise."""
    x, y = loop.T
    with np.errstate(invalid="ignore"):
        return 0.5 * float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())


def inset(loop: Floats, width: float) -> Floats:
    """A counter-clockwise loop with every side moved inwards by ``width``; corners where the moved sides meet."""
    along = np.roll(loop, -1, axis=0) - loop
    along /= np.maximum(np.hypot(*along.T), 1e-300)[:, None]
    inward = np.column_stack([-along[:, 1], along[:, 0]])
    before = np.roll(inward, 1, axis=0)
    middle = inward + before
    square = np.maximum((middle**2).sum(axis=1), 4.0 / MITRE**2)
    return np.asarray(loop + 2.0 * width * middle / square[:, None])


def turns_of(loop: Floats) -> Floats:
    """The angle by which a loop turns at each point [rad], positive to the left."""
    ahead, back = np.roll(loop, -1, axis=0) - loop, loop - np.roll(loop, 1, axis=0)
    cross = back[:, 0] * ahead[:, 1] - back[:, 1] * ahead[:, 0]
    return np.asarray(np.arctan2(cross, (back * ahead).sum(axis=1)))


def smoothed(points: Floats, closest: float) -> Floats:
    """A polyline with its bent spans that are longer than ``closest`` divided along a curve through its points.

    Spans are cubics with the slopes of the parabola through three points (Bessel, Overhauser). A span over twice as
    long as one beside it is straight: what is drafted with a ruler has only its ends.
    """
    if len(points) < 3:
        return points
    step = np.diff(points, axis=0)
    length = np.hypot(*step.T)
    slope = step / length[:, None]
    middle = (length[1:, None] * slope[:-1] + length[:-1, None] * slope[1:]) / (length[:-1] + length[1:])[:, None]
    tangent = np.vstack([2.0 * slope[0] - middle[0], middle, 2.0 * slope[-1] - middle[-1]])
    out = [points[:1]]
    for k in range(len(step)):
        beside = [length[j] for j in (k - 1, k + 1) if 0 <= j < len(step)]
        count = int(np.ceil(length[k] / closest))
        if count > 1 and length[k] < 2.0 * min(beside):
            t = (np.arange(1, count) / count)[:, None]
            a, b, u, v = points[k], points[k + 1], length[k] * tangent[k], length[k] * tangent[k + 1]
            bend = (2 * t**3 - 3 * t**2 + 1) * a + (t**3 - 2 * t**2 + t) * u
            out.append(bend + (3 * t**2 - 2 * t**3) * b + (t**3 - t**2) * v)
        out.append(points[k + 1 : k + 2])
    return np.concatenate(out)

"""Loops from loose lines: polylines joined end to end, cleaned, and moved inwards by a seam allowance."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from warp_cloth.pattern.curve import Floats

WIDEST_GAP = 0.05  # of the extent, over which ends are joined; what is left open wider stays open
MOST_LINES = 20_000
MITRE = 4.0  # allowances, that a corner may be cut back at most


def chained(lines: Sequence[Floats]) -> list[Floats]:
    """Closed loops, each without its first point again, shape [n, 2]; lines [m, 2] are joined at their nearest ends."""
    loops = [line[:-1] for line in lines if len(line) > 3 and _closed(line)]
    rest = [line for line in lines if len(line) > 1 and not _closed(line)][:MOST_LINES]
    ends = np.array([(line[0], line[-1]) for line in rest]) if rest else np.zeros((0, 2, 2))
    free = np.ones(len(rest), dtype=bool)
    reach = WIDEST_GAP * float(np.ptp(np.concatenate(rest), axis=0).max()) if rest else 0.0
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
            chain.append(rest[index][:: -1 if side else 1])
        loop = np.concatenate(chain)
        extent = float(np.ptp(loop, axis=0).max())
        if len(loop) > 2 and float(np.hypot(*(loop[0] - loop[-1]))) <= 0.5 * extent:
            loops.append(loop)
    return loops


def gap_of(lines: Sequence[Floats], loop: Floats) -> float:
    """The longest side of a loop that no line draws."""
    drawn = {(a.tobytes(), b.tobytes()) for line in lines for a, b in pairwise(line)}
    drawn |= {(b, a) for a, b in drawn}
    ahead = np.roll(loop, -1, axis=0)
    bare = [k for k in range(len(loop)) if (loop[k].tobytes(), ahead[k].tobytes()) not in drawn]
    return max((float(np.hypot(*(ahead[k] - loop[k]))) for k in bare), default=0.0)


def _closed(line: Floats) -> bool:
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

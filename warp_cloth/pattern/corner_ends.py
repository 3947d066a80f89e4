"""Lines drawn edge by edge that miss each other at corners: cut where they cross, led on to where they would."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warp_cloth.pattern.curve import Floats

OVERRUN = 0.25  # of a line, that may lie beyond its corner at either end
MISSING = 0.06  # of the extent of all lines, by which a line may be led on
MET = 1e-3  # of the extent, within which ends meet
MOST_LINES, MOST_SIDES = 60, 6_000


def mitred(lines: Sequence[Floats]) -> list[Floats]:
    """Open polylines, shape [n, 2], whose ends meet at corners; closed ones, and those that meet, as they are."""
    lines = [line for line in lines if len(line) > 1]
    if not 1 < len(lines) <= MOST_LINES or sum(map(len, lines)) > MOST_SIDES:
        return list(lines)
    whole = float(np.ptp(np.concatenate(lines), axis=0).max())
    near = MET * whole
    out = [_trimmed(line, lines[:k] + lines[k + 1 :], near) for k, line in enumerate(lines)]
    ends = [(k, end) for k, line in enumerate(out) if _apart(line[0], line[-1]) > near for end in (0, -1)]
    tips = [out[k][end] for k, end in ends]
    free = [n for n, tip in enumerate(tips) if sum(_apart(tip, other) <= near for other in tips) < 2]
    gaps = sorted(
        (_apart(tips[a], tips[b]), a, b) for n, a in enumerate(free) for b in free[n + 1 :] if ends[a][0] != ends[b][0]
    )
    taken: set[int] = set()
    for gap, a, b in gaps:
        if gap > 2.0 * MISSING * whole:
            break
        if a in taken or b in taken:
            continue
        corner = _corner(out[ends[a][0]], ends[a][1], out[ends[b][0]], ends[b][1], MISSING * whole)
        if corner is not None:
            taken |= {a, b}
            for n in (a, b):
                k, end = ends[n]
                out[k] = np.concatenate([corner[None], out[k]] if end == 0 else [out[k], corner[None]])
    return out


def _apart(a: Floats, b: Floats) -> float:
    return float(np.hypot(*(a - b)))


def _trimmed(line: Floats, others: Sequence[Floats], near: float) -> Floats:
    """A line without what runs on beyond the first and the last line that it crosses near its ends."""
    if _apart(line[0], line[-1]) <= near:
        return line
    tips = np.array([other[end] for other in others for end in (0, -1)])
    reach = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    places = np.sort(np.concatenate([_crossings(line, reach, other) for other in others]))
    low, high = 0.0, float(reach[-1])
    before, after = places[places <= OVERRUN * high], places[places >= (1.0 - OVERRUN) * high]
    if len(before) and np.hypot(*(tips - line[0]).T).min() > near:
        low = float(before[0])
    if len(after) and np.hypot(*(tips - line[-1]).T).min() > near:
        high = float(after[-1])
    inner = (reach > low) & (reach < high)
    ends = [np.array([np.interp(s, reach, line[:, axis]) for axis in range(2)]) for s in (low, high)]
    return np.concatenate([ends[0][None], line[inner], ends[1][None]])


def _crossings(line: Floats, reach: Floats, other: Floats) -> Floats:
    """How far along a line it crosses another one."""
    p, u = line[:-1, None], np.diff(line, axis=0)[:, None]
    q, v = other[None, :-1], np.diff(other, axis=0)[None]
    cross = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    safe = np.where(
        np.abs(cross) > 1e-12 * np.hypot(*np.moveaxis(u, 2, 0)) * np.hypot(*np.moveaxis(v, 2, 0)), cross, np.inf
    )
    d = q - p
    s = (d[..., 0] * v[..., 1] - d[..., 1] * v[..., 0]) / safe
    t = (d[..., 0] * u[..., 1] - d[..., 1] * u[..., 0]) / safe
    met = np.isfinite(safe) & (s >= 0.0) & (s <= 1.0) & (t >= 0.0) & (t <= 1.0)
    side = np.nonzero(met)[0]
    return np.asarray(reach[side] + s[met] * np.diff(reach)[side])


def _corner(one: Floats, end: int, other: Floats, other_end: int, reach: float) -> Floats | None:
    """Where two lines would meet if both were led on straight; None if they would not, or too far away."""
    tips, ways = [], []
    for line, tip in ((one, end), (other, other_end)):
        way = line[0] - line[1] if tip == 0 else line[-1] - line[-2]
        tips.append(line[tip])
        ways.append(way / max(float(np.hypot(*way)), 1e-300))
    (u, v), d = ways, tips[1] - tips[0]
    cross = u[0] * v[1] - u[1] * v[0]
    if abs(cross) < 0.05:  # of one direction: joined by a straight line
        return None
    along = [(d[0] * v[1] - d[1] * v[0]) / cross, (d[0] * u[1] - d[1] * u[0]) / cross]
    if min(along) < 0.0 or max(along) > reach:
        return None
    return np.asarray(tips[0] + along[0] * u)

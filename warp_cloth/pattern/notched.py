"""Notches that are cut into an outline: found by their size, marked, and closed again."""

from __future__ import annotations

import numpy as np

from warp_cloth.pattern.curve import Floats

WIDEST, DEEPEST, SHALLOWEST = 0.013, 0.014, 0.0015  # [m] of a notch; no dart is so small
MOST_SHARP = 5_000  # corners of an outline: with more it is a scribble
MOST_CORNERS = 6  # within a notch: one of a V, four of a T
ONWARD = np.radians(40.0)  # by which an outline may turn from before to after a notch
SIDE_TURN = np.radians(35.0)  # by which a notch leaves the outline at least
NO_NOTCHES = np.zeros((0, 2))


def unnotched(loop: Floats) -> tuple[Floats, Floats]:
    """A closed loop [m], shape [n, 2], without the notches cut into or out of it, and where these were, shape [N, 2].

    A notch is a detour of up to six corners that leaves the outline sharply, comes back to it within 13 mm, goes no
    farther away than 14 mm, and does not change its direction.
    """
    count = len(loop)
    step = np.roll(loop, -1, axis=0) - loop
    length = np.hypot(*step.T)
    angle = np.arctan2(step[:, 1], step[:, 0])
    dropped = np.zeros(count, dtype=bool)
    found = []
    sharp = np.flatnonzero(np.abs(_turn(angle - np.roll(angle, 1))) > SIDE_TURN)
    for first in sharp.tolist() if len(sharp) <= MOST_SHARP else ():
        if dropped[first]:
            continue
        for corners in range(1, MOST_CORNERS + 1):
            if corners + 4 > count:
                break
            inner = (first + 1 + np.arange(corners)) % count
            last = (first + corners + 1) % count
            if dropped[inner].any() or dropped[last]:
                break
            if _is_notch(loop, length, angle, first, last, inner):
                dropped[inner] = True
                found.append(0.5 * (loop[first] + loop[last]))
                break
    if not found or count - dropped.sum() < 3:
        return loop, NO_NOTCHES
    return loop[~dropped], np.array(found)


def _is_notch(loop: Floats, length: Floats, angle: Floats, first: int, last: int, inner: Floats) -> bool:
    a, b = loop[first], loop[last]
    mouth = float(np.hypot(*(b - a)))
    before, after = angle[first - 1], angle[last]
    if mouth > WIDEST or abs(_turn(after - before)) > ONWARD:
        return False
    if abs(_turn(angle[first] - before)) < SIDE_TURN or abs(_turn(after - angle[last - 1])) < SIDE_TURN:
        return False
    middle = np.angle(np.exp(1j * before) + np.exp(1j * after))
    across = np.array([-np.sin(middle), np.cos(middle)])
    along = np.array([np.cos(middle), np.sin(middle)])
    depth = (loop[inner] - a) @ across
    one_sided = bool((depth > 0.0).all() or (depth < 0.0).all())
    deep = float(np.abs(depth).max())
    onward = float((b - a) @ along) >= -1e-4 and abs(float((b - a) @ across)) <= 0.5 * max(mouth, 1e-3)
    long_enough = min(length[first - 1], length[last]) > 0.0
    return one_sided and SHALLOWEST <= deep <= DEEPEST and onward and long_enough


def _turn(angle: Floats) -> Floats:
    """Angles brought into -pi to pi."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)

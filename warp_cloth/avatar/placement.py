"""Placement of a box mesh: one that was made for another body is moved out of this one before it is sewn."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import warp as wp

from warp_cloth.avatar.exact import build_exact_collider
from warp_cloth.base.mesh import Mesh, Points, face_normals

DEEP = 0.02  # [m]; vertices that start less deep come out by themselves
SHIFTS_UP = np.arange(-0.04, 0.161, 0.01)  # [m]; a head taller or shorter is 0.2, its shoulders less
ROUNDING = 1e-9  # [m]; these are not exact
SHIFTS_FORWARD = np.array([0.0, -0.02, 0.02, -0.04, 0.04])  # [m]
# [m]; a shift farther up must leave less than WORTH of what the best shorter one leaves, unless that one clears
FAR = 0.085
WORTH = 0.5  # a shift must leave less than this fraction of the depth, or it is not made
CLEARS = 0.1  # less than this clears. A shift down must clear: trousers would hang lower for inseams drawn in a leg


def clear_shift(
    points: Points,
    avatar: Mesh,
    device: wp.DeviceLike = None,
    *,
    may_be_elsewhere: bool = False,
    highest: float = np.inf,
) -> Points | None:
    """The shift [m] up and forward that brings a garment's vertices out of the avatar best; None: leave it there.

    ``points`` [m], shape [V, 3]. Measured by the summed depths of all vertices inside; of equal shifts the shortest.
    A dress form has no limbs that tell where it stands: it ``may_be_elsewhere``, and where no such shift clears, the
    garment is moved onto its middle first. ``highest``: how far up it may be moved [m].
    """
    exact = build_exact_collider(avatar, device)

    def depths(shift: Points) -> Points:
        return np.maximum(-exact.sample(points + shift)[:, 3].astype(np.float64), 0.0)

    start = depths(np.zeros(3))
    if start.max() <= DEEP:
        return None

    def remaining(shifts: Sequence[Points]) -> Points:
        return np.array([depths(shift).sum() for shift in shifts]) / start.sum()  # fraction of the depth

    shift, least = _upwards(remaining, np.zeros(3), highest)
    if not may_be_elsewhere or least < CLEARS:
        return shift
    level = _onto_middle(points, avatar)
    if remaining([level])[0] > WORTH:
        return shift
    further = _upwards(remaining, level, highest)[0] if depths(level).max() > DEEP else None
    return level if further is None else further


def _upwards(
    remaining: Callable[[Sequence[Points]], Points], base: Points, highest: float
) -> tuple[Points | None, float]:
    """The best shift up and forward from another [m], None: none is worth it; and what it leaves."""
    ups = SHIFTS_UP[max(highest, 0.0) + ROUNDING >= SHIFTS_UP]
    shifts = [np.array([0.0, up, forward]) for up in ups for forward in SHIFTS_FORWARD]
    shifts.sort(key=lambda shift: float(np.linalg.norm(shift)))
    left = remaining([base + shift for shift in shifts]) / remaining([base])
    up = np.array(shifts)[:, 1]
    worth = left < np.where(up < 0.0, CLEARS, WORTH)
    near = worth & (up < FAR)
    least = left[near].min(initial=1.0)
    if least < CLEARS or left.min() > WORTH * least:  # tight cloth is in the body wherever it starts
        worth = near
    if not worth.any():
        return None, 1.0
    best = int(np.argmin(np.where(worth, left, np.inf)))
    return base + shifts[best], float(left[best])


def _onto_middle(points: Points, avatar: Mesh) -> Points:
    """The level shift [m] of a garment's middle onto that of the avatar's surface at its height."""
    low, high = points.min(axis=0), points.max(axis=0)
    corners = avatar.points[avatar.triangles]
    middles = corners.mean(axis=1)
    area = np.linalg.norm(face_normals(corners), axis=1)
    area = np.where((middles[:, 1] >= low[1]) & (middles[:, 1] <= high[1]), area, 0.0)
    if not area.any():
        return np.zeros(3)
    shift: Points = (np.average(middles, axis=0, weights=area) - 0.5 * (low + high)) * [1.0, 0.0, 1.0]
    return shift.round(2)


def shift_text(shift: Points) -> str:
    """A shift [m] for people: "40 mm up and 20 mm back"; left and right are the wearer's."""
    parts = ((shift[1], "up", "down"), (shift[2], "forward", "back"), (shift[0], "to the left", "to the right"))
    return " and ".join(
        f"{abs(1e3 * by):.0f} mm {positive if by > 0.0 else negative}"
        for by, positive, negative in parts
        if round(1e3 * by)
    )

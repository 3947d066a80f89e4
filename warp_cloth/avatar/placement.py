"""Placement of a box mesh: one that was made for another body is moved out of this one before it is sewn."""

from __future__ import annotations

import numpy as np
import warp as wp

from warp_cloth.avatar.exact import build_exact_collider
from warp_cloth.base.mesh import Mesh, Points

DEEP = 0.02  # [m]; vertices that start less deep come out by themselves
SHIFTS_UP = np.arange(-0.04, 0.161, 0.01)  # [m]; a head taller or shorter is 0.2, its shoulders less
SHIFTS_FORWARD = np.array([0.0, -0.02, 0.02, -0.04, 0.04])  # [m]
# [m]; a shift farther up must leave less than WORTH of what the best shorter one leaves, unless that one clears
FAR = 0.085
WORTH = 0.5  # a shift must leave less than this fraction of the depth, or it is not made
CLEARS = 0.1  # less than this clears. A shift down must clear: trousers would hang lower for inseams drawn in a leg


def clear_shift(points: Points, avatar: Mesh, device: wp.DeviceLike = None) -> Points | None:
    """The shift [m] up and forward that brings a garment's vertices out of the avatar best; None: leave it there.

    ``points`` [m], shape [V, 3]. Measured by the summed depths of all vertices inside; of equal shifts the shortest.
    """
    exact = build_exact_collider(avatar, device)

    def depths(shift: Points) -> Points:
        return np.maximum(-exact.sample(points + shift)[:, 3].astype(np.float64), 0.0)

    start = depths(np.zeros(3))
    if start.max() <= DEEP:
        return None
    shifts = [np.array([0.0, up, forward]) for up in SHIFTS_UP for forward in SHIFTS_FORWARD]
    shifts.sort(key=lambda shift: float(np.linalg.norm(shift)))
    remaining = np.array([depths(shift).sum() for shift in shifts]) / start.sum()  # fraction of the depth
    up = np.array(shifts)[:, 1]
    worth = remaining < np.where(up < 0.0, CLEARS, WORTH)
    near = worth & (up < FAR)
    least = remaining[near].min(initial=1.0)
    if least < CLEARS or remaining.min() > WORTH * least:  # tight cloth is in the body wherever it starts
        worth = near
    return shifts[int(np.argmin(np.where(worth, remaining, np.inf)))] if worth.any() else None


def shift_text(shift: Points) -> str:
    """A shift [m] for people: "40 mm up and 20 mm back"."""
    parts = ((shift[1], "up", "down"), (shift[2], "forward", "back"))
    return " and ".join(
        f"{abs(1e3 * by):.0f} mm {positive if by > 0.0 else negative}"
        for by, positive, negative in parts
        if round(1e3 * by)
    )

"""Placement of a garment by hand: scaled, turned and moved as it is loaded, before anything else sees it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from warp_cloth.loading.raw import Floats

Triple = tuple[float, float, float]
QUARTER = 90.0  # [degrees]; turns by these are exact


@dataclass(frozen=True)
class Placement:
    """Where a garment is put: its lengths times ``scale``, then turned about the origin, then moved."""

    translate: Triple = (0.0, 0.0, 0.0)  # [m]
    rotate: Triple = (0.0, 0.0, 0.0)  # [degrees] about the fixed axes x, then y, then z
    scale: float = 1.0  # of the mesh and of its rest shape

    def moved(self, points: Floats) -> Floats:
        """Points [m], scaled already, where they are put; shape [V, 3], the same bits where nothing moves them."""
        if any(self.rotate):
            points = points @ self._rotation().T
        return points + np.array(self.translate) if any(self.translate) else points

    def _rotation(self) -> Floats:
        """R_z R_y R_x, shape [3, 3]."""
        whole = np.eye(3)
        for axis, degrees in enumerate(self.rotate):
            one, other = (axis + 1) % 3, (axis + 2) % 3
            turn = np.eye(3)
            cosine, sine = _cosine_and_sine(degrees)
            turn[one, one] = turn[other, other] = cosine
            turn[other, one], turn[one, other] = sine, -sine
            whole = turn @ whole
        return whole


AS_LOADED = Placement()


def _cosine_and_sine(degrees: float) -> tuple[float, float]:
    """Of an angle [degrees]; a quarter turn gives whole numbers, so that points keep their digits."""
    quarters, rest = divmod(degrees, QUARTER)
    cosine, sine = math.cos(math.radians(rest)), math.sin(math.radians(rest))
    for _ in range(int(quarters) % 4):
        cosine, sine = -sine, cosine
    return cosine, sine

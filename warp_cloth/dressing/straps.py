"""Straps laid on the shoulders again, which the growing body took outwards: as a wearer tugs them inwards."""

from __future__ import annotations

import numpy as np

from warp_cloth.anatomy.shoulders import Shoulders
from warp_cloth.base.mesh import Indices, Points

TUG = 0.01  # [m] in a step at most; cloth that moves by more passes through the body
NEAR = 0.005  # [m] from where they are to lie
FULL, FREE = 0.08, 0.25  # [m] from the strap's highest place: cloth up to there moves along, and from there not at all


def tugged(shoulders: Shoulders, points: Points, triangles: Indices) -> Points | None:
    """The garment at ``points`` [m] with cloth at the shoulders moved a step inwards, shape [V, 3]; None: it lies well.

    Up and towards the neck, along the shoulder, where it lies farther out than it was placed.
    """
    straps = [strap for strap in shoulders.straps(points, triangles) if strap.off > NEAR]
    if not straps:
        return None
    move = np.zeros_like(points)
    for strap in straps:
        near = np.clip((FREE - np.linalg.norm(points - strap.place, axis=1)) / (FREE - FULL), 0.0, 1.0)
        move += (near * near * (3.0 - 2.0 * near))[:, None] * (min(strap.off, TUG) * strap.inwards)
    length = np.linalg.norm(move, axis=1, keepdims=True)
    moved: Points = points + move * np.minimum(1.0, TUG / np.maximum(length, 1e-9))
    return moved

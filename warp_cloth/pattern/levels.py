"""Levels of a part across its grain: how wide it is at each, where its armpits are, and directions alike at all."""

from __future__ import annotations

import numpy as np

from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.draft import Part

LEVELS = 33
WHOLE_TURN = 0.97 * 2.0 * np.pi  # that a sleeve, whole leg or band is bent to


def spans(part: Part, at: float | None = None) -> tuple[Floats, Floats, Floats]:
    """Levels of a part, lowest to highest [m], one of them at ``at``, and its least and largest x at each."""
    points = np.concatenate([edge.at(np.linspace(0.0, 1.0, 129)) for edge in part.shape.turned])
    low, high = float(points[:, 1].min()), float(points[:, 1].max())
    levels = np.linspace(low, high, LEVELS)
    if at is not None and low < at < high:
        levels[1 + int(np.abs(levels[1:-1] - at).argmin())] = at
    near = np.abs(points[:, 1][None] - levels[:, None]) <= (high - low) / (LEVELS - 1)
    least = np.array([points[own, 0].min() for own in near])
    most = np.array([points[own, 0].max() for own in near])
    return levels, least, most


def repeated(across: Floats, outward: Floats, count: int = LEVELS) -> tuple[Floats, Floats]:
    return np.tile(across, (count, 1)), np.tile(outward, (count, 1))


def armpit_of(part: Part) -> float:
    """How far below its top the sides of a front or back end [m]."""
    sides = [k for role, run in part.roles.items() if role.startswith("side") for k in run]
    highest = max((float(part.shape.turned[k].points[:, 1].max()) for k in sides), default=float(part.shape.box[1][1]))
    return float(part.shape.box[1][1]) - highest

"""The outline of a draped disc seen from above, in support radii, and what is read off it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Mesh, Points

Floats = NDArray[np.float64]

ANGLES = 360  # of an outline: a fold in fifty
SMOOTHING = 24  # harmonics that count as folds; finer ones are pixels and threads
SHALLOWEST_FOLD = 0.02  # of the support's radius; shallower waves are no folds


@dataclass(frozen=True, eq=False)
class Outline:
    """Radius of the silhouette over the angle, shape [ANGLES], in support radii.

    Angle 0 is along the weft, 90 degrees along the warp, seen from above.
    """

    radius: Floats

    @property
    def smooth(self) -> Floats:
        """The radius without what is finer than folds."""
        waves = np.fft.rfft(self.radius)
        waves[SMOOTHING + 1 :] = 0.0
        return np.fft.irfft(waves, ANGLES)

    def coefficient(self, ratio: float) -> float:
        """Drape coefficient [%] of a disc of ``ratio`` support radii: the part of the free ring that is covered."""
        return 100.0 * (float(np.mean(self.radius**2)) - 1.0) / (ratio**2 - 1.0)

    @property
    def length(self) -> float:
        """Of the rim as seen from above [support radii]; folds that hang over others are cut short."""
        along = np.exp(2.0j * np.pi * np.arange(ANGLES) / ANGLES) * self.radius
        return float(np.abs(along - np.roll(along, 1)).sum())

    @property
    def reach(self) -> float:
        """Radius of the farthest tip."""
        return float(self.smooth.max())

    @property
    def tips(self) -> tuple[int, ...]:
        """Angles [degrees] of the folds' tips: maxima with a trough on both sides."""
        return _prominent_maxima(self.smooth, SHALLOWEST_FOLD)

    @property
    def folds(self) -> int:
        return len(self.tips)

    @property
    def depths(self) -> tuple[float, ...]:
        """Of each fold, from its tip to the mean of the troughs beside it, in support radii."""
        smooth, tips = self.smooth, self.tips
        if len(tips) < 2:
            return tuple(float(np.ptp(smooth)) for _ in tips)
        ends = [*tips, tips[0] + ANGLES]
        troughs = [float(smooth[np.arange(a, b) % ANGLES].min()) for a, b in pairwise(ends)]
        return tuple(float(smooth[tip]) - 0.5 * (troughs[i] + troughs[i - 1]) for i, tip in enumerate(tips))

    @property
    def elongation(self) -> float:
        """How much farther the cloth stands out along its warp than its weft: second harmonic of the squared radius."""
        turn = 2.0 * np.pi * np.arange(ANGLES) / ANGLES
        square = self.radius**2
        return float(-2.0 * np.mean(square * np.cos(2.0 * turn)) / np.mean(square))


def outline_of_points(x: Floats, y: Floats) -> Outline:
    """The outline of a closed curve of points about the origin, in support radii, shape [N] each.

    Where a fold hangs over, a ray meets the curve several times: the farthest counts, as in a shadow.
    """
    ray = 2.0 * np.pi / ANGLES
    angle = np.arctan2(y, x)
    turn = (np.roll(angle, -1) - angle + np.pi) % (2.0 * np.pi) - np.pi
    low, high = np.minimum(angle, angle + turn) / ray, np.maximum(angle, angle + turn) / ray
    first = np.ceil(low).astype(np.int64)
    count = np.maximum(np.floor(high).astype(np.int64) - first + 1, 0)  # rays that each side crosses
    side = np.repeat(np.arange(len(x)), count)
    crossed = np.arange(len(side)) - np.repeat(np.cumsum(count) - count, count) + first[side]
    ahead = np.stack([np.cos(crossed * ray), np.sin(crossed * ray)])
    start, way = np.stack([x, y])[:, side], np.stack([np.roll(x, -1) - x, np.roll(y, -1) - y])[:, side]
    # r ahead = start + t way
    across = ahead[0] * way[1] - ahead[1] * way[0]
    over = start[0] * way[1] - start[1] * way[0]
    sure = np.abs(across) > 1e-12
    radius = np.where(sure, over / np.where(sure, across, 1.0), np.hypot(*start))
    farthest = np.zeros(ANGLES)
    np.maximum.at(farthest, crossed % ANGLES, radius)
    hit = np.flatnonzero(farthest)
    return Outline(np.interp(np.arange(ANGLES), hit, farthest[hit], period=ANGLES))


def outline_of_drape(mesh: Mesh, points: Points, support: float) -> Outline:
    """The outline of a simulated disc from its rim; ``mesh`` as it was cut, ``points`` at rest, ``support`` [m]."""
    flat = np.hypot(mesh.points[:, 0], mesh.points[:, 2])
    rim = np.flatnonzero(flat > flat.max() * (1.0 - 1e-6))
    rim = rim[np.argsort(np.arctan2(-mesh.points[rim, 2], mesh.points[rim, 0]))]
    return outline_of_points(points[rim, 0] / support, -points[rim, 2] / support)


def _prominent_maxima(wave: Floats, least: float) -> tuple[int, ...]:
    """Indices of the maxima of a periodic wave that stand out by at least this much on both sides."""
    start = int(np.argmin(wave))
    turned = np.roll(wave, -start)
    tips: list[int] = []
    low, high, at, rising = float(turned[0]), -math.inf, 0, True
    for index, value in enumerate([*turned.tolist(), float(turned[0])]):
        if rising:
            low = min(low, value)
            if value > high:
                high, at = value, index
            if high - low >= least and high - value >= least:
                tips.append((at + start) % len(wave))
                rising, low = False, value
            elif value <= low:
                high, at = value, index
        else:
            if value < low:
                low = value
            if value - low >= least:
                rising, high, at = True, value, index
    return tuple(sorted(tips))

"""An edge of an outline that is stated by many points: a polyline, with the curvature of the curve it stands for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warp_cloth.pattern.curve import Curve, Floats

WINDOW = 4e-3  # [m] on either side, over which the curvature is taken


@dataclass(frozen=True, eq=False)
class Chain(Curve):
    """The polyline through ``points`` [m], shape [n, 2], n >= 2, none like the one before it."""

    @property
    def is_line(self) -> bool:
        return len(self.points) == 2

    @cached_property
    def _reached(self) -> Floats:
        """Lengths from the start to each point [m], shape [n]."""
        return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(self.points, axis=0).T))])

    @cached_property
    def length(self) -> float:
        return float(self._reached[-1])

    @cached_property
    def area(self) -> float:
        (x, y), (u, v) = self.points[:-1].T, self.points[1:].T
        return 0.5 * float((x * v - y * u).sum())

    def at(self, fractions: Floats) -> Floats:
        wanted = np.clip(np.asarray(fractions), 0.0, 1.0) * self.length
        return np.column_stack([np.interp(wanted, self._reached, self.points[:, axis]) for axis in range(2)])

    def bends(self, fractions: Floats) -> Floats:
        if self.is_line:
            return np.zeros((len(fractions), 2))
        step = min(WINDOW / self.length, 0.25)
        middle = np.clip(np.asarray(fractions), step, 1.0 - step)
        second = self.at(middle + step) - 2.0 * self.at(middle) + self.at(middle - step)
        return np.asarray(second / (step * self.length) ** 2)

    def with_bends(self, fractions: Floats) -> tuple[Floats, Floats]:
        return self.at(fractions), self.bends(fractions)

    def part(self, low: float, high: float) -> Chain:
        """The chain between two fractions of its length."""
        inner = self.points[(self._reached > low * self.length + 1e-7) & (self._reached < high * self.length - 1e-7)]
        ends = self.at(np.array([low, high]))
        start = self.start if low <= 0.0 else ends[0]
        end = self.end if high >= 1.0 else ends[1]
        return Chain(np.vstack([start, inner, end]))

    def turned(self, matrix: Floats, shift: Floats) -> Chain:
        """The chain with every point p moved to ``matrix @ p + shift``."""
        return Chain(self.points @ matrix.T + shift)

    @property
    def reversed(self) -> Chain:
        return Chain(self.points[::-1])

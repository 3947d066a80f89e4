"""Intermediate shapes of a relaxation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.solver.relax import Relaxation


class FrameRecorder:
    """Records shapes at iteration counts that grow geometrically: cloth moves most at the start."""

    def __init__(self, count: int, first: int, last: int) -> None:
        """``count``: of shapes at least, from the ``first`` iteration to the ``last``; 0: none."""
        wanted = np.geomspace(first, max(last, first), 4 * count) if count else np.zeros(0)
        self._due = sorted({round(number / first) * first for number in wanted})
        self.frames: list[tuple[int, NDArray[np.float32]]] = []

    def offer(self, iteration: int, relaxation: Relaxation) -> None:
        """Records the shape after this iteration if it is due."""
        if self._due and iteration >= self._due[0]:
            self._due = [due for due in self._due if due > iteration]
            relaxation.update_model()
            self.frames.append((iteration, relaxation.model.points().astype(np.float32)))

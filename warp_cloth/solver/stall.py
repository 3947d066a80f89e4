"""Stalled fits: does a relaxation still come nearer to rest?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from warp_cloth.garment.rest import Floats
from warp_cloth.model.attempt import Patience
from warp_cloth.solver.certificate.certifier import Measurement, Tolerance

# A figure has stalled where it has not fallen by a twentieth in as many iterations, and in half of all so far. Of 81
# random designs that came to rest with cloth on cloth, the worst figure of 50 never stalled.
LEAST_GAIN = 0.05
STALL = 5000  # iterations
STALL_FRACTION = 0.5  # of the iterations so far


class StallWatch:
    """The best figures of the items of a relaxation, and when they were reached.

    Figures are the residual and the rest error, each over its limit. Short patience ends with the worst of the two,
    long patience when neither falls any more.
    """

    def __init__(self, tolerances: Sequence[Tolerance], patience: Sequence[Patience]) -> None:
        self._limits = np.array([(each.relative_rms, each.rest_error) for each in tolerances])
        self._short = np.array([each is Patience.SHORT for each in patience])
        self._ends = np.array([each is not Patience.NONE for each in patience])
        self._best = np.full((len(tolerances), 2), np.inf)
        self._best_at = np.zeros((len(tolerances), 2), dtype=np.int64)

    def stalled(self, measured: Measurement) -> NDArray[np.bool_]:
        """Whether each item has stalled, by a measurement of all items and those before it, shape [items]."""
        if not self._ends.any():
            return self._ends
        figures: Floats = np.stack([measured.relative_rms, measured.rest_error], axis=1) / self._limits
        figures = np.maximum(figures, 1.0)
        figures[self._short] = figures[self._short].max(axis=1, keepdims=True)
        gained = figures < (1.0 - LEAST_GAIN) * self._best
        self._best = np.where(gained, figures, self._best)
        self._best_at = np.where(gained, measured.iteration, self._best_at)
        since = measured.iteration - self._best_at.max(axis=1)
        return np.asarray(self._ends & (since > max(STALL, STALL_FRACTION * measured.iteration)))

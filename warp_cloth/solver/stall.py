"""Stalled fits: does a relaxation still come nearer to rest?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from warp_cloth.garment.rest import Floats
from warp_cloth.model.attempt import Patience
from warp_cloth.solver.certificate.certifier import Measurement

# A fit has stalled where neither of its figures has fallen by a twentieth in this many iterations, and this fraction
# of all so far. Of 81 random designs that came to rest with cloth on cloth, short patience would have ended 6, loose
# skirts all of them, and 14 of the 15 others.
LEAST_GAIN = 0.05
STALL = {Patience.SHORT: (5000, 0.5), Patience.LONG: (20_000, 0.85)}


class StallWatch:
    """The best figures of the items of a relaxation, and when they were reached.

    Figures are the residual and the rest error.
    """

    def __init__(self, patience: Sequence[Patience]) -> None:
        stalls = [STALL.get(each, (np.inf, 1.0)) for each in patience]
        self._iterations, self._fraction = np.array(stalls).T
        self._best = np.full((len(patience), 2), np.inf)
        self._best_at = np.zeros((len(patience), 2), dtype=np.int64)

    def stalled(self, measured: Measurement) -> NDArray[np.bool_]:
        """Whether each item has stalled, by a measurement of all items and those before it, shape [items]."""
        figures: Floats = np.stack([measured.relative_rms, measured.rest_error], axis=1)
        gained = figures < (1.0 - LEAST_GAIN) * self._best
        self._best = np.where(gained, figures, self._best)
        self._best_at = np.where(gained, measured.iteration, self._best_at)
        since = measured.iteration - self._best_at.max(axis=1)
        return np.asarray(since > np.maximum(self._iterations, self._fraction * measured.iteration))

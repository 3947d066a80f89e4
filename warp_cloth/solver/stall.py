"""Stalled fits: does a relaxation still come nearer to rest?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from warp_cloth.garment.rest import Floats
from warp_cloth.model.attempt import Patience
from warp_cloth.solver.certificate.certifier import Measurement, Tolerance

# A fit has stalled where neither of its figures has fallen by a twentieth in this many iterations, and this fraction
# of all so far. Of 81 random designs that came to rest with cloth on cloth, short patience would have ended 6, loose
# skirts all of them, and 14 of the 15 others.
LEAST_GAIN = 0.05
STALL = {Patience.SHORT: (5000, 0.5), Patience.LONG: (20_000, 0.85)}


class StallWatch:
    """The best figures of the items of a relaxation, and when they were reached.

    Figures are the residual and the rest error. What is jammed, moving less than its tolerance while its forces do not
    balance, gains nothing by moving less still, and another attempt may do better whatever its patience.
    """

    def __init__(self, patience: Sequence[Patience], tolerances: Sequence[Tolerance]) -> None:
        stalls = [STALL.get(each, (np.inf, 1.0)) for each in patience]
        self._iterations, self._fraction = np.array(stalls).T
        self._limits = np.array([(each.relative_rms, each.rest_error) for each in tolerances])
        self._best = np.full((len(patience), 2), np.inf)
        self._best_at = np.zeros((len(patience), 2), dtype=np.int64)

    def stalled(self, measured: Measurement) -> NDArray[np.bool_]:
        """Whether each item has stalled, by a measurement of all items and those before it, shape [items]."""
        figures: Floats = np.stack([measured.relative_rms, measured.rest_error], axis=1)
        within = figures <= self._limits
        jammed = within[:, 1] & ~within[:, 0] & np.isfinite(self._iterations)
        gained = figures < (1.0 - LEAST_GAIN) * self._best
        gained[:, 1] &= ~jammed
        self._best = np.where(gained, figures, self._best)
        self._best_at = np.where(gained, measured.iteration, self._best_at)
        since = measured.iteration - self._best_at.max(axis=1)
        iterations, fraction = (
            np.where(jammed, short, own)
            for short, own in zip(STALL[Patience.SHORT], (self._iterations, self._fraction), strict=True)
        )
        return np.asarray(since > np.maximum(iterations, fraction * measured.iteration))

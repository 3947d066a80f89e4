"""Rest error: estimate of the distance to the rest shape, extrapolated from the decay of past displacements."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Chosen on 33 relaxations of small sheets, a sewn T-shirt and cloth over a ball (K = 2 to 400 kN/m, up to 9,409
# vertices), SAFETY and FASTEST later on some 30 more (sheets, discs and T-shirts of limp fabrics), in whose balanced
# checks the estimate was no less than the true distance in 97 %; with a FASTEST of 0.6 in 92 %.
# `tests/benchmarks/methods.py` tests it on others. What stands near a saddle for thousands of iterations, until
# rounding lets it snap into another fold, cannot be seen from what moves.
SPAN = 0.15  # fraction of the iterations so far in each of the three spans that are compared
LEAST_SPAN = 300  # iterations; momentum needs hundreds to set soft folds moving; until then all seems still
SLOWEST = 0.98  # largest fraction of a span's distance that the next one is taken to cover: more is creep
FASTEST = 0.75  # smallest such fraction: a span that happens to be quiet promises too much
SAFETY = 3.0  # what is left of soft modes shrinks more slowly than what has been seen
GROWTH = 1.03  # factor of the iterations from one snapshot to the next
# Longest growing displacement of a vertex from one measurement to the next (kernels.certificate.summary) [m]. A fold
# about to snap moves slowly first, then ever faster, and so is no rest shape, though it hardly moves. Of 118 worn
# T-shirts five moved by more than 0.1 mm at the shoulders in the 1,000 iterations after a certificate without this, one
# after one with it; it costs 4 % of the iterations. Half as much costs 8 % and does not see the last one either.
GROWING = 2e-5


@dataclass(frozen=True)
class Snapshot:
    """The shape of all items after an iteration."""

    iteration: int
    shape: Any  # float32 [m], shape [V]


class Snapshots:
    """The snapshots that the rest error compares: which are taken, stored and dropped."""

    def __init__(self) -> None:
        self._stored: list[Snapshot] = []

    @property
    def shapes(self) -> list[Any]:
        """Shapes of the stored snapshots."""
        return [snapshot.shape for snapshot in self._stored]

    def at_spans(self, iteration: int) -> list[Snapshot]:
        """The three stored snapshots nearest to one, two and three spans ago; none while these are not known."""
        span = _span(iteration)
        if not self._stored or self._stored[0].iteration > iteration - 3.0 * span:
            return []
        found = []
        for number in (1, 2, 3):
            wanted = iteration - number * span
            found.append(min(self._stored, key=lambda snapshot: abs(snapshot.iteration - wanted)))
        late = [iteration, *(snapshot.iteration for snapshot in found)]
        # measurements too far apart do not separate the spans
        return found if all(now > before for now, before in itertools.pairwise(late)) else []

    def due(self, iteration: int) -> bool:
        """Whether a snapshot is to be taken after this iteration."""
        return not self._stored or iteration >= GROWTH * self._stored[-1].iteration

    @staticmethod
    def most() -> int:
        """Largest number of snapshots stored at a time, if measurements are 100 iterations or more apart."""
        return math.ceil(-math.log(1.0 - 3.0 * SPAN) / math.log(GROWTH)) + 2

    def store(self, snapshot: Snapshot) -> None:
        self._stored.append(snapshot)

    def drop(self, iteration: int) -> list[Any]:
        """Drops snapshots that no later estimate needs; returns their shapes."""
        dropped = []
        while len(self._stored) > 1 and self._stored[1].iteration <= iteration - 3.0 * _span(iteration):
            dropped.append(self._stored.pop(0).shape)
        return dropped


def _span(iteration: int) -> float:
    return max(SPAN * iteration, float(LEAST_SPAN))


def rest_error(iteration: int, snapshots: Sequence[Snapshot], distances: NDArray[np.float64]) -> NDArray[np.float64]:
    """The rms distance of N items' vertices from rest [m], no less than it 19 times in 20; inf while unknown.

    The last three spans of SPAN of the iterations covered d2, d1, d0 [m, rms]. With q = max(d0 / d1, sqrt(d0 / d2))
    every span to come covers at most q of the one before, and all of them d0 q / (1 - q).

    Args:
        iteration: iterations done since the relaxation began.
        snapshots: of ``Snapshots.at_spans``.
        distances: rms distance of each item from its shape now to the first snapshot, from that to the second, to the
            third [m], shape [N, 3].
    """
    if not snapshots:
        return np.full(len(distances), np.inf)
    late = [iteration, *(snapshot.iteration for snapshot in snapshots)]
    d0, d1, d2 = (distances * _span(iteration) / -np.diff(late)).T
    smallest = float(np.finfo(np.float32).tiny)
    ratio = np.maximum(d0 / np.maximum(d1, smallest), np.sqrt(d0 / np.maximum(d2, smallest)))
    q = np.clip(ratio, FASTEST, SLOWEST)
    estimate: NDArray[np.float64] = SAFETY * d0 * q / (1.0 - q)
    return estimate

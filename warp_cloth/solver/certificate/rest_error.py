"""How far a relaxing shape still is from its rest shape, judged by how the way that it covers shrinks."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Chosen on 33 relaxations of small sheets, a sewn T-shirt and cloth over a ball (K = 2 to 400 kN/m, up to 9,409
# vertices), SAFETY and FASTEST later on some 30 more (sheets, discs and T-shirts of limp fabrics), at whose balanced
# checks the estimate was no less than the true distance at 97 %; with a FASTEST of 0.6 at 92 %. `warp-cloth methods`
# tests it on others. What stands near a saddle for thousands of iterations, till rounding lets it snap into another
# fold, cannot be seen from what moves.
SPAN = 0.15  # share of the iterations so far in each of the three spans that are compared
LEAST_SPAN = 300  # iterations; momentum needs hundreds to set soft folds moving, and till then all seems still
SLOWEST = 0.98  # largest share of a span's way that the next one is taken to cover: more is creep, not shrinking
FASTEST = 0.75  # smallest such share: a span that happens to be quiet promises too much
SAFETY = 3.0  # what is left of soft modes shrinks more slowly than what has been seen
GROWTH = 1.03  # shapes are kept when the iterations have grown by this factor
# Longest way of a vertex from one look to the next that may grow, by the summary [m]. A fold about to snap
# goes slowly first, ever faster, and so is no rest shape, though its way is short. Of 118 worn T-shirts five moved by
# more than 0.1 mm at the shoulders in the 1,000 iterations after a certificate without this, one after one with it;
# it costs 4 % of the iterations. Half as much costs 8 and does not see the last one coming, either.
GROWING = 2e-5


@dataclass(frozen=True)
class Mark:
    """A shape on the way, of all items: which iteration left it."""

    iteration: int
    shape: Any  # float32 [m], shape [V]


class RestError:
    """Estimates the distance from rest out of the way between shapes that it has chosen to keep."""

    def __init__(self) -> None:
        self._kept: list[Mark] = []

    @property
    def shapes(self) -> list[Any]:
        """Those that are kept."""
        return [mark.shape for mark in self._kept]

    def marks(self, iteration: int) -> list[Mark]:
        """The three kept shapes that are nearest to one, two and three spans ago; none while these are not known."""
        span = _span(iteration)
        if not self._kept or self._kept[0].iteration > iteration - 3.0 * span:
            return []
        found = []
        for number in (1, 2, 3):
            wanted = iteration - number * span
            found.append(min(self._kept, key=lambda mark: abs(mark.iteration - wanted)))
        late = [iteration, *(mark.iteration for mark in found)]
        # checks too far apart do not tell the spans from one another
        return found if all(now > before for now, before in itertools.pairwise(late)) else []

    def due(self, iteration: int) -> bool:
        """Whether the shape after this iteration is to be kept."""
        return not self._kept or iteration >= GROWTH * self._kept[-1].iteration

    @staticmethod
    def most_kept() -> int:
        """How many shapes are kept at a time, at most, where a hundred iterations or more lie between two looks."""
        return math.ceil(-math.log(1.0 - 3.0 * SPAN) / math.log(GROWTH)) + 2

    def keep(self, mark: Mark) -> None:
        self._kept.append(mark)

    def dropped(self, iteration: int) -> list[Any]:
        """Shapes that no later estimate can ask for; they are kept no longer."""
        gone = []
        while len(self._kept) > 1 and self._kept[1].iteration <= iteration - 3.0 * _span(iteration):
            gone.append(self._kept.pop(0).shape)
        return gone


def _span(iteration: int) -> float:
    return max(SPAN * iteration, float(LEAST_SPAN))


def rest_error(iteration: int, marks: Sequence[Mark], ways: NDArray[np.float64]) -> NDArray[np.float64]:
    """The rms distance of N items' vertices from rest [m], no less than it 19 times in 20; inf while unknown.

    The last three spans of SPAN of the iterations covered d2, d1, d0 [m, rms]. With q = max(d0 / d1, sqrt(d0 / d2))
    every span to come covers at most q of the one before, and all of them d0 q / (1 - q).

    Args:
        iteration: iterations done since the relaxation began.
        marks: of RestError.
        ways: rms distance of each item from its shape now to the first mark, from that to the second, to the third
            [m], shape [N, 3].
    """
    if not marks:
        return np.full(len(ways), np.inf)
    late = [iteration, *(mark.iteration for mark in marks)]
    d0, d1, d2 = (ways * _span(iteration) / -np.diff(late)).T
    smallest = float(np.finfo(np.float32).tiny)
    ratio = np.maximum(d0 / np.maximum(d1, smallest), np.sqrt(d0 / np.maximum(d2, smallest)))
    shrinking = np.clip(ratio, FASTEST, SLOWEST)
    estimate: NDArray[np.float64] = SAFETY * d0 * shrinking / (1.0 - shrinking)
    return estimate

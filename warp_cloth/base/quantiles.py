"""Quantiles of many numbers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray


def median(values: NDArray[np.floating[Any]]) -> float:
    """``numpy.median`` of numbers, shape [N], to the last bit; that imports masked arrays, which takes 0.03 s."""
    middle = len(values) // 2
    if np.isnan(values).any():
        return math.nan
    if len(values) % 2:
        return float(np.partition(values, middle)[middle])
    ordered = np.partition(values, [middle - 1, middle])
    return float(ordered[middle - 1 : middle + 1].mean())


def quantiles(values: NDArray[Any], *fractions: float) -> list[float]:
    """Quantiles of ``values``, shape [N], at fractions from 0 to 1, interpolated linearly.

    Equal to ``np.quantile(values.astype(np.float64), fractions)`` to the last bit, in less time, which counts as
    certificates need it often: 0.04 ms against 0.17 for 7,000 values, 0.6 against 0.9 for 66,000.
    """
    last = len(values) - 1
    around = [(math.floor(fraction * last), min(math.floor(fraction * last) + 1, last)) for fraction in fractions]
    ordered = np.partition(values, sorted({place for both in around for place in both}))
    found = []
    for fraction, (first, second) in zip(fractions, around, strict=True):
        low, high, weight = float(ordered[first]), float(ordered[second]), fraction * last - first
        found.append(high - (high - low) * (1.0 - weight) if weight >= 0.5 else low + (high - low) * weight)
    return found

"""Percentiles of many figures."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray


def percentiles(figures: NDArray[Any], *shares: float) -> list[float]:
    """What such shares of the figures are below, between two as ``np.quantile`` of float64 has it, in less time."""
    last = len(figures) - 1
    around = [(math.floor(share * last), min(math.floor(share * last) + 1, last)) for share in shares]
    some = np.partition(figures, sorted({place for both in around for place in both}))
    found = []
    for share, (first, second) in zip(shares, around, strict=True):
        low, high, way = float(some[first]), float(some[second]), share * last - first
        found.append(high - (high - low) * (1.0 - way) if way >= 0.5 else low + (high - low) * way)
    return found

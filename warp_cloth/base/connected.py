"""Connected parts of a graph."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def lowest_connected(count: int, a: NDArray[Any], b: NDArray[Any]) -> NDArray[np.int64]:
    """Lowest node that each of ``count`` nodes is connected with by the pairs (a, b), itself where none is lower."""
    label = np.arange(count)
    while True:
        low = np.minimum(label[a], label[b])
        lower = label.copy()
        np.minimum.at(lower, a, low)
        np.minimum.at(lower, b, low)
        np.minimum.at(lower, label, lower)  # carry to the old representative, so that long strips take few rounds
        lower = lower[lower]
        if np.array_equal(lower, label):
            return label
        label = lower

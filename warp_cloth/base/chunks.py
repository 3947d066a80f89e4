"""Cache blocking: work on large arrays chunk by chunk, so that intermediate arrays stay in a processor's caches.

In one thread: several would wait for Python's lock longer than NumPy works on a chunk.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

R = TypeVar("R")

CHUNK_ROWS = 1 << 15  # rows of several arrays that fit a processor's caches together


def map_chunks(work: Callable[[slice], R], count: int) -> list[R]:
    """Results of ``work`` for consecutive slices of ``count`` rows, in order; one empty slice if there are none."""
    return [work(slice(first, min(first + CHUNK_ROWS, count))) for first in range(0, max(count, 1), CHUNK_ROWS)]


def map_rows(
    function: Callable[..., NDArray[Any]], *arrays: NDArray[Any], out: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """``function(*arrays)``, which gives one number per row, computed chunk by chunk, float64, shape [rows]."""
    result = np.empty(len(arrays[0])) if out is None else out

    def put(chunk: slice) -> None:
        result[chunk] = function(*(array[chunk] for array in arrays))

    map_chunks(put, len(result))
    return result

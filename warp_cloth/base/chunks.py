"""Work on large arrays part by part, so that what is worked out on the way stays in a processor's caches.

By one thread: several would wait for Python's lock for longer than NumPy works on a part.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

R = TypeVar("R")

AT_ONCE = 1 << 15  # rows of some arrays that fit a processor's caches together


def in_parts(work: Callable[[slice], R], count: int) -> list[R]:
    """``work`` of so many things part by part, in their order."""
    return [work(slice(first, min(first + AT_ONCE, count))) for first in range(0, max(count, 1), AT_ONCE)]


def by_parts(
    function: Callable[..., NDArray[Any]], *arrays: NDArray[Any], out: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """A function of arrays that gives a number for each of their rows, part by part, shape [rows]."""
    made = np.empty(len(arrays[0])) if out is None else out

    def put(part: slice) -> None:
        made[part] = function(*(array[part] for array in arrays))

    in_parts(put, len(made))
    return made

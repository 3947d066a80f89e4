"""Several threads for work on large arrays: NumPy lets go of Python's lock while it sorts, gathers and adds.

What launches kernels takes turns instead.
"""

from __future__ import annotations

import functools
import os
import threading
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")
R = TypeVar("R")
P = ParamSpec("P")

MOST_THREADS = 16  # memory gives no more
ALONE = "WARP_CLOTH_ONE_THREAD"  # is set in the environment of a process among as many as there are cores
WORTH_THREADS = 1 << 23  # [bytes] that take longer to copy than threads to start
NAME = "warp_cloth_part"  # with which those threads' names begin
LAUNCHES = threading.RLock()  # on the CPU Warp records in a graph whatever a process launches, whichever thread does


def core_count() -> int:
    """How many cores this process may take."""
    if ALONE in os.environ:
        return 1
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_turn(work: Callable[P, R]) -> Callable[P, R]:
    """The same work, which waits until no other thread of this process is at such work."""

    @functools.wraps(work)
    def waiting(*args: P.args, **named: P.kwargs) -> R:
        with LAUNCHES:
            return work(*args, **named)

    return waiting


def map_in_threads(work: Callable[[T], R], parts: Iterable[T]) -> list[R]:
    """``work`` of every part, in the parts' order; one part, or one core, needs no threads."""
    parts = list(parts)
    count = min(core_count(), MOST_THREADS)
    if min(count, len(parts)) <= 1 or threading.current_thread().name.startswith(NAME):
        return [work(part) for part in parts]  # one of those threads that waited for others of them would wait for ever
    return list(_threads(os.getpid(), count).map(work, parts))


@functools.cache
def _threads(process: int, count: int) -> ThreadPoolExecutor:
    """So many threads of this ``process``, which wait for work: to start one takes as long as some work."""
    return ThreadPoolExecutor(count, thread_name_prefix=NAME)


def end_to_end(arrays: Sequence[NDArray[Any]], starts: Sequence[int] | None = None) -> NDArray[Any]:
    """Arrays of one kind one after another, as numpy.concatenate; ``starts`` are added to each one's numbers."""
    ends = np.cumsum([len(array) for array in arrays])
    joined = np.empty((int(ends[-1]), *arrays[0].shape[1:]), dtype=arrays[0].dtype)

    def put(indices: range) -> None:
        for index in indices:
            array = arrays[index]
            place = joined[ends[index] - len(array) : ends[index]]
            if starts is None:
                place[...] = array
            else:
                np.add(array, starts[index], out=place, casting="unsafe")

    count = MOST_THREADS if joined.nbytes >= WORTH_THREADS else 1
    map_in_threads(put, [range(first, len(arrays), count) for first in range(min(count, len(arrays)))])
    return joined

"""Thread pools for work on large arrays (NumPy releases Python's lock), and one lock for launches of kernels."""

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

MAX_THREADS = 16  # memory bandwidth serves no more
ONE_THREAD = "WARP_CLOTH_ONE_THREAD"  # environment variable, set in each process of a batch with one process a core
MIN_THREADED_BYTES = 1 << 23  # [bytes] copying less takes less time than starting threads
THREAD_NAME = "warp_cloth_part"  # prefix of the pool's thread names
LAUNCH_LOCK = threading.RLock()  # while Warp captures a graph on the CPU, it records launches of every thread


def core_count() -> int:
    """Number of CPU cores that this process may use."""
    if ONE_THREAD in os.environ:
        return 1
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def one_thread_at_a_time(work: Callable[P, R]) -> Callable[P, R]:
    """Decorator: ``work``, which launches kernels, waits for other threads of this process that do."""

    @functools.wraps(work)
    def waiting(*args: P.args, **named: P.kwargs) -> R:
        with LAUNCH_LOCK:
            return work(*args, **named)

    return waiting


def map_in_threads(work: Callable[[T], R], items: Iterable[T]) -> list[R]:
    """``work`` of every item, in the items' order; without threads for one item, on one core, and in a pool's thread.

    (A pool's thread that waited for others of the same pool could wait for ever.)
    """
    items = list(items)
    count = min(core_count(), MAX_THREADS)
    if min(count, len(items)) <= 1 or threading.current_thread().name.startswith(THREAD_NAME):
        return [work(item) for item in items]
    return list(_pool(os.getpid(), count).map(work, items))


@functools.cache
def _pool(process: int, count: int) -> ThreadPoolExecutor:
    """The thread pool of this process: starting a thread takes as long as some of the work."""
    return ThreadPoolExecutor(count, thread_name_prefix=THREAD_NAME)


def concatenate(arrays: Sequence[NDArray[Any]], offsets: Sequence[int] | None = None) -> NDArray[Any]:
    """``numpy.concatenate`` along the first axis, large arrays in threads; ``offsets[n]`` is added to ``arrays[n]``."""
    ends = np.cumsum([len(array) for array in arrays])
    joined = np.empty((int(ends[-1]), *arrays[0].shape[1:]), dtype=arrays[0].dtype)

    def put(indices: range) -> None:
        for index in indices:
            array = arrays[index]
            place = joined[ends[index] - len(array) : ends[index]]
            if offsets is None:
                place[...] = array
            else:
                np.add(array, offsets[index], out=place, casting="unsafe")

    count = MAX_THREADS if joined.nbytes >= MIN_THREADED_BYTES else 1
    map_in_threads(put, [range(first, len(arrays), count) for first in range(min(count, len(arrays)))])
    return joined

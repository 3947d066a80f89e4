"""Several threads for work on large arrays: NumPy lets go of Python's lock while it sorts, gathers and adds."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")

MOST_THREADS = 16  # memory gives no more


def map_in_threads(work: Callable[[T], R], parts: Iterable[T]) -> list[R]:
    """``work`` of every part, in the parts' order; one part, or one core, needs no threads."""
    parts = list(parts)
    there = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    count = min(len(parts), there, MOST_THREADS)
    if count <= 1:
        return [work(part) for part in parts]
    with ThreadPoolExecutor(count) as pool:
        return list(pool.map(work, parts))

"""Keeps Python's garbage collector off while it would do harm, or traverse what lives as long as the process."""

from __future__ import annotations

import gc
import time
from collections.abc import Iterator
from contextlib import contextmanager

GLANCE, GLANCES = 1e-4, 10_000  # [s] between two looks at a collection that is running, and how many at most


@contextmanager
def no_collection() -> Iterator[None]:
    """While a graph is captured: in whatever thread the collector ran, it would free a GPU's arrays, and break that."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        if was_enabled:
            _await_running()
        yield
    finally:
        if was_enabled:
            gc.enable()


def _await_running() -> None:
    """Waits for a collection that another thread has begun: it lets threads run while it frees a GPU's arrays."""
    for _ in range(GLANCES):  # not for ever: what a collection frees could get here itself
        before = _youngest_collections()
        gc.collect(0)  # which does nothing as long as one is running
        if _youngest_collections() > before:
            return
        time.sleep(GLANCE)


def _youngest_collections() -> int:
    return int(gc.get_stats()[0]["collections"])


@contextmanager
def collector_paused() -> Iterator[None]:
    """For imports: the collector does not run meanwhile, nor later traverse what exists at their end.

    It would traverse a million objects again and again and free none.
    """
    with no_collection():
        try:
            yield
        finally:
            gc.freeze()

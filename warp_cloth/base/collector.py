"""Keeps Python's garbage collector off while it would do harm, or traverse what lives as long as the process."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def no_collection() -> Iterator[None]:
    """While a graph is captured: in whatever thread the collector ran, it would free a GPU's arrays, and break that."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


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

"""Processes end with the one that started them, however that ends."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from multiprocessing import resource_tracker


def end_with_parent() -> None:
    """Lets this process end as soon as its parent has."""
    threading.Thread(target=_wait, daemon=True).start()


def begin_alone() -> None:
    """Likewise, and keeps to one thread: there are as many such processes as cores."""
    end_with_parent()
    from warp_cloth.base.threads import ONE_THREAD  # and NumPy, for which who starts processes does not wait

    os.environ[ONE_THREAD] = "1"


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """What is started meanwhile hears of no Ctrl-C, from its first moment on: who starts it ends it."""
    resource_tracker.ensure_running()  # which would let them through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _wait() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)

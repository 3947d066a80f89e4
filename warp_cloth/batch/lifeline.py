"""Child processes end with their parent, however that ends, and ignore Ctrl-C from their first moment."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import shutil
import signal
import threading
from collections.abc import Iterator
from multiprocessing import resource_tracker
from pathlib import Path


def end_with_parent(scratch: Path | None = None) -> None:
    """Ends this process as soon as its parent has ended, and removes the folder ``scratch`` first."""
    threading.Thread(target=_wait, args=(scratch,), daemon=True).start()


def start_single_threaded(scratch: Path | None = None) -> None:
    """Likewise, and keeps to one thread: there are as many such processes as cores."""
    end_with_parent(scratch)
    from warp_cloth.base.threads import ONE_THREAD  # imports NumPy, for which the parent need not wait

    os.environ[ONE_THREAD] = "1"


@contextlib.contextmanager
def sigint_blocked() -> Iterator[None]:
    """Processes started in this block never receive Ctrl-C: the process that started them ends them."""
    resource_tracker.ensure_running()  # starting it inside would unblock the signal
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _wait(scratch: Path | None) -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        if scratch is not None:
            shutil.rmtree(scratch, ignore_errors=True)
        os._exit(1)

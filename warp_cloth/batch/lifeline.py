"""Processes end with the one that started them, however that ends."""

from __future__ import annotations

import multiprocessing
import os
import threading

from warp_cloth.threads import ALONE


def end_with_parent() -> None:
    """Lets this process end as soon as its parent has."""
    threading.Thread(target=_wait, daemon=True).start()


def begin_alone() -> None:
    """Likewise, and keeps to one thread: there are as many such processes as cores."""
    end_with_parent()
    os.environ[ALONE] = "1"


def _wait() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)

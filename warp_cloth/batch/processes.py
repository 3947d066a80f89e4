"""Processes that are there at once: forked from one that has imported what they need, and nothing else."""

from __future__ import annotations

import multiprocessing
import os
from multiprocessing import forkserver
from multiprocessing.context import ForkServerContext

IMPORTED = ("__main__", "warp_cloth.batch.many", "warp_cloth.batch.work")  # before any process is forked
ONE_THREAD = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")  # in each: there are many of them


def context() -> ForkServerContext:
    """What starts processes. Warp, which may not be forked, starts in each by itself."""
    made = multiprocessing.get_context("forkserver")
    made.set_forkserver_preload(list(IMPORTED))
    return made


def get_ready() -> None:
    """Starts the process that others are forked from; it imports while this one goes on."""
    context()
    added = [name for name in ONE_THREAD if name not in os.environ]
    os.environ.update(dict.fromkeys(added, "1"))
    try:
        forkserver.ensure_running()
    finally:
        for name in added:
            del os.environ[name]

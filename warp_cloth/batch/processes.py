"""Processes that are there at once: forked from one that has imported what they need, and nothing else."""

from __future__ import annotations

import multiprocessing
import os
import threading
from multiprocessing import forkserver
from multiprocessing.context import ForkServerContext
from pathlib import Path

from warp_cloth.base.device import gpu_count
from warp_cloth.batch.lifeline import uninterrupted

LOADING = ("__main__", "warp_cloth.batch.preload")  # before any process is forked
FITTING = ("warp_cloth.batch.many",)  # likewise, where all fit
GPU_FILES = ("/dev/nvidiactl", "/dev/dxg")  # of the driver, under Linux and its Windows subsystem
ONE_THREAD = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")  # in each: there are many of them


def context() -> ForkServerContext:
    """What starts processes. Warp, which may not be forked, starts in each by itself."""
    return multiprocessing.get_context("forkserver")


def get_ready(device: str | None = None) -> None:
    """Starts the process that others are forked from; it imports while this one goes on.

    Where a GPU is likely to be used, what loads garments is ready first: who fits imports the rest meanwhile.
    """
    gpu = device != "cpu" and any(Path(file).exists() for file in GPU_FILES)
    context().set_forkserver_preload([*LOADING, *(() if gpu else FITTING)])
    added = [name for name in ONE_THREAD if name not in os.environ]
    os.environ.update(dict.fromkeys(added, "1"))
    try:
        with uninterrupted():
            forkserver.ensure_running()
    finally:
        for name in added:
            del os.environ[name]
    if gpu:
        threading.Thread(target=gpu_count, daemon=True).start()  # which is asked for soon

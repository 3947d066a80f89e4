"""Starts worker processes: by forkserver, forked from one process that has imported what workers need, or otherwise.

The environment variable WARP_CLOTH_START_METHOD chooses "forkserver" (the default), "spawn" (slower to start), or
"fork" (on the CPU only: neither Warp's devices nor CUDA survive a fork).
"""

from __future__ import annotations

import multiprocessing
import os
import sys
import threading
from multiprocessing import forkserver
from multiprocessing.context import BaseContext
from pathlib import Path

from warp_cloth.base.device import gpu_count
from warp_cloth.base.errors import InputError
from warp_cloth.base.first_run import GPU_FILES
from warp_cloth.batch.lifeline import sigint_blocked

START_METHOD = "WARP_CLOTH_START_METHOD"
METHODS = ("forkserver", "spawn", "fork")
LOADING = ("__main__", "warp_cloth.batch.preload")  # imported before any process is forked
FITTING = ("warp_cloth.batch.many",)  # likewise, where every process fits
BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")  # per process: there are many processes


def start_method() -> str:
    """How worker processes are started.

    Raises:
        InputError: the environment names an unknown method.
    """
    method = os.environ.get(START_METHOD, METHODS[0])
    if method not in METHODS:
        raise InputError(START_METHOD, f'"{method}" is not a start method', f"use one of {', '.join(METHODS)}")
    return method


def process_context() -> BaseContext:
    """The multiprocessing context of worker processes."""
    return multiprocessing.get_context(start_method())


def start_forkserver(device: str | None = None) -> None:
    """Starts the process from which workers are forked; it imports in parallel to this one.

    Where a GPU is likely to be used it imports only what loads garments: processes that fit import the rest themselves.
    """
    method = start_method()
    gpu = device != "cpu" and any(Path(file).exists() for file in GPU_FILES)
    if method == "forkserver":
        multiprocessing.get_context("forkserver").set_forkserver_preload([*LOADING, *(() if gpu else FITTING)])
        # the package that this process imported, not one in the current folder
        added = {"PYTHONSAFEPATH": "1", "PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)}
        added |= {name: "1" for name in BLAS_THREADS if name not in os.environ}
        before = {name: os.environ.get(name) for name in added}
        os.environ.update(added)
        try:
            with sigint_blocked():
                forkserver.ensure_running()
        finally:
            for name, value in before.items():
                os.environ.pop(name, None)
                if value is not None:
                    os.environ[name] = value
    if gpu and method != "fork":
        threading.Thread(target=gpu_count, daemon=True).start()  # in advance: it takes part of a second

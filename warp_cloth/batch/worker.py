"""A worker process: says that it has started, then takes tasks from a pipe and sends back what came of each.

Only the standard library is imported before a worker has started, so that whatever keeps the package from being
imported is reported to the process that asked rather than printed as a traceback.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import shutil
import signal
import sys
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

SWITCH_INTERVAL = 1e-4  # [s] after which a worker's thread lets another one run, which exchanges data with its loaders


@dataclass(frozen=True)
class Started:
    """What a worker sends first."""


@dataclass(frozen=True)
class StartFailed:
    """What a worker sends instead, before it ends."""

    reason: str


@dataclass(frozen=True)
class Duty:
    """What a worker does with a task: a function of the task and the worker's LoadCache, by its names."""

    module: str = "warp_cloth.batch.task"
    function: str = "do_task"
    scratch: Path | None = None  # a folder that nothing is left of, even where the process that asked is killed
    threads: bool = False  # whether it may use several, although no processes load for it


SHARDS = Duty()  # of a batch


def serve(
    connection: Connection,
    device: str,
    loader_count: int,
    rank: int,
    duty: Duty = SHARDS,
    environment: Sequence[tuple[str, str | None]] = (),
) -> None:
    """A worker's main function: receives tasks until None or the end of the pipe, and sends what came of each.

    ``loader_count``, ``rank``: see LoadCache; ``environment``: see GpuSharing.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process that started the workers ends them,
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # at once, also where they were forked from a command
    for name, value in environment:
        os.environ.pop(name, None)
        if value is not None:
            os.environ[name] = value
    try:
        load_cache = _start(device, loader_count, rank, duty)
        connection.send(Started())
        _work(connection, load_cache, duty)
    except ImportError as error:
        connection.send(StartFailed(f"{type(error).__name__}: {error}"))
    except (EOFError, BrokenPipeError):  # the parent has ended, or needs no workers after all
        if duty.scratch is not None:
            shutil.rmtree(duty.scratch, ignore_errors=True)
        _end()


def _start(device: str, loader_count: int, rank: int, duty: Duty) -> Any:
    from warp_cloth.base.device import wake_gpu
    from warp_cloth.batch.lifeline import end_with_parent, start_single_threaded
    from warp_cloth.batch.loading import LoadCache

    import_module(duty.module)  # what fails is reported
    load_cache = LoadCache(loader_count, fork=True, rank=rank)  # before this process has threads and a device
    (end_with_parent if loader_count or duty.threads else start_single_threaded)(duty.scratch)
    sys.setswitchinterval(SWITCH_INTERVAL)
    gc.disable()  # until the first imports and loads are done: none of that is garbage
    if device != "cpu":
        threading.Thread(target=wake_gpu, args=(device,), daemon=True).start()  # while this thread reads and imports
    return load_cache


def _work(connection: Connection, load_cache: Any, duty: Duty) -> None:
    from warp_cloth.batch.task import DeviceLostError

    do_task = getattr(import_module(duty.module), duty.function)
    while True:
        task = connection.recv()
        if task is None:
            _end()
        try:
            connection.send(do_task(task, load_cache.trimmed()))
        except DeviceLostError as error:
            connection.send(str(error))  # another process may find its device well again
            return
        gc.enable()


def _end() -> None:
    """Ends this process and its loaders at once: nobody waits for an orderly exit."""
    for loader in multiprocessing.active_children():
        loader.terminate()
    os._exit(0)

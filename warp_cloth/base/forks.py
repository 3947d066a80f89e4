"""Work on many items in copies of this process, where threads would wait for Python's lock.

A copy has all that this process has in memory, without sending it, and sends back what comes of its items. It must not
use a GPU: CUDA does not survive a fork.
"""

from __future__ import annotations

import gc
import itertools
import logging
import os
import pickle
import signal
import time
import warnings
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection, Pipe
from typing import Any, TypeVar

from warp_cloth.base.threads import ONE_THREAD

T = TypeVar("T")
R = TypeVar("R")

LEAST_ITEMS = 4  # a copy: making one takes as long as measuring a few garments
PATIENCE = 300.0  # [s] for the results of all copies, after which those left hang, and their items are done here

log = logging.getLogger(__name__)


def map_in_forks(work: Callable[[T], R], items: Sequence[T], copies: int) -> list[R]:
    """``work`` of every item, in the items' order, each copy of this process doing neighbouring items.

    What ``work`` changes stays in the copy: only what it returns, which can be pickled, is seen here. Items of a copy
    that fails or dies are done here. ``copies``: at most; 0 or 1, or where the system knows no fork: done here.
    """
    copies = min(copies, len(items) // LEAST_ITEMS) if hasattr(os, "fork") else 0
    if copies <= 1:
        return [work(item) for item in items]
    ends = [len(items) * number // copies for number in range(copies + 1)]
    parts = [items[first:end] for first, end in itertools.pairwise(ends)]
    started: list[tuple[int, Connection]] = []
    try:
        for part in parts:
            started.append(_start(work, part, [connection for _, connection in started]))
    except OSError as error:  # no memory or no process for another copy: the items of those missing are done here
        log.warning("a process could not be copied: %s", error)
    deadline = time.monotonic() + PATIENCE
    try:
        received = [_receive(connection, deadline) for _, connection in started]
    finally:
        for process, connection in started:
            connection.close()
            os.kill(process, signal.SIGKILL)  # which has ended, or hangs
            os.waitpid(process, 0)
    results: list[R] = []
    for part, done in itertools.zip_longest(parts, received):
        results += [work(item) for item in part] if done is None else done
    return results


def _start(work: Callable[[T], R], items: Sequence[T], others: Sequence[Connection]) -> tuple[int, Connection]:
    """Forks a copy that does these items; its process and where it sends its results. ``others``: of earlier ones."""
    here, there = Pipe(duplex=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads: those of this process are idle
        process = os.fork()
    if process:
        there.close()
        return process, here
    try:
        for connection in (here, *others):
            connection.close()  # else nobody would see that this process's parent has ended
        gc.disable()  # freeing what this process was copied with would touch the GPU
        os.environ[ONE_THREAD] = "1"
        there.send_bytes(pickle.dumps([work(item) for item in items], protocol=pickle.HIGHEST_PROTOCOL))
    finally:
        os._exit(0)


def _receive(connection: Connection, deadline: float) -> list[Any] | None:
    """What a copy has sent before a moment [s, of ``time.monotonic``]; None: it has failed, died or hangs."""
    try:
        if connection.poll(max(deadline - time.monotonic(), 0.0)):
            results: list[Any] = pickle.loads(connection.recv_bytes())
            return results
        log.warning("a copy of this process hangs; what it did is done here")
    except (EOFError, OSError, pickle.UnpicklingError):
        log.warning("a copy of this process has failed; what it did is done here")
    return None

"""Runs independent jobs in separate processes, so that one that crashes or hangs is reported and ends no other."""

from __future__ import annotations

import contextlib
import math
import multiprocessing
import time
from collections.abc import Iterator, Sequence
from multiprocessing.connection import Connection, wait
from typing import Any, Generic, Protocol, TypeVar

from warp_cloth.base.warp_setup import start_warp
from warp_cloth.batch.lifeline import sigint_blocked, start_single_threaded
from warp_cloth.batch.pool import exit_reason

STARTED = "started"  # what a worker sends before it runs a job
GRACE = 4.0  # [s] for a worker to end

R = TypeVar("R")
R_co = TypeVar("R_co", covariant=True)


class Job(Protocol[R_co]):
    """Something to run in another process."""

    def run(self, device: str) -> R_co: ...

    def lost(self, verdict: str, message: str) -> R_co:
        """The result of a job whose process "crashed" or "hung"."""


def run_jobs(jobs: Sequence[Job[R]], device: str, *, workers: int, deadline: float) -> Iterator[tuple[int, R]]:
    """Runs jobs, ``workers`` at a time; yields the index and result of each as it ends. ``deadline``: of a job [s]."""
    pool: list[_Worker[R]] = [_Worker(device) for _ in range(min(workers, len(jobs)))]
    waiting = list(range(len(jobs)))[::-1]
    try:
        while True:
            for worker in pool:
                if worker.number is None and waiting:
                    worker.assign(waiting.pop(), jobs)
            busy = [worker for worker in pool if worker.number is not None]
            if not busy:
                return
            left = min(worker.since for worker in busy) + deadline - time.monotonic()
            ready = wait([worker.connection for worker in busy], None if left == math.inf else max(left, 0.0))
            for worker in busy:
                overdue = time.monotonic() - worker.since > deadline
                if worker.connection in ready and worker.started():
                    continue
                if worker.connection in ready or overdue:
                    yield worker.receive(jobs, overdue=worker.connection not in ready)
    finally:
        for worker in pool:
            worker.end()


def _serve(connection: Connection, device: str) -> None:
    """A worker's main function: receives jobs and sends their results, until the pipe is closed."""
    start_single_threaded()
    start_warp()
    while True:
        try:
            job: Job[Any] = connection.recv()
        except EOFError:
            return
        connection.send(STARTED)
        connection.send(job.run(device))


class _Worker(Generic[R]):
    """A process, its current job, and when that began."""

    def __init__(self, device: str) -> None:
        self._device = device
        self.number: int | None = None
        self.since = math.inf
        self._start()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, self._device), daemon=True)
        with sigint_blocked():
            self._process.start()
        theirs.close()

    def assign(self, number: int, jobs: Sequence[Job[R]]) -> None:
        self.number, self.since = number, math.inf
        with contextlib.suppress(OSError):  # it has died, which receive finds
            self.connection.send(jobs[number])

    def started(self) -> bool:
        """Whether its message only says that its job has begun, whose time runs from now on."""
        if self.since < math.inf:
            return False
        self.since = time.monotonic()
        with contextlib.suppress(EOFError, OSError):
            self.connection.recv()
            return True
        return False

    def receive(self, jobs: Sequence[Job[R]], *, overdue: bool) -> tuple[int, R]:
        """The result of its job; a worker that died or hangs is replaced."""
        number, self.number = self.number, None
        if number is None:
            raise RuntimeError("an idle worker has no result")
        try:
            if not overdue:
                result: R = self.connection.recv()
                return number, result
            lost = jobs[number].lost("hung", f"no end after {time.monotonic() - self.since:.0f} s")
        except (EOFError, OSError):
            self._process.join(GRACE)
            lost = jobs[number].lost("crashed", exit_reason(self._process.exitcode))
        self.end()
        self._start()
        return number, lost

    def end(self) -> None:
        self.connection.close()
        self._process.kill()
        self._process.join(GRACE)

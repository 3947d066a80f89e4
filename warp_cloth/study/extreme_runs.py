"""Runs extremes in processes of their own: one that crashes or hangs takes nothing along, and is told as what it is."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection, wait

from warp_cloth.batch.lifeline import end_with_parent
from warp_cloth.batch.pool import ended
from warp_cloth.quiet import start_warp
from warp_cloth.study.extremes import GROUPS, Job, Outcome, jobs_of

DEADLINE = 300.0  # [s] of a run, compiling included; the slowest known takes 3 s
MOST_ON_GPU = 4  # processes that share one
STARTED = "started"  # what a worker says first
GRACE = 4.0  # [s] that a worker gets to end


def run_extremes(
    device: str, tell: Callable[[str], None], groups: Sequence[str] = GROUPS, *, deadline: float = DEADLINE
) -> list[Outcome]:
    """Runs every case of the groups, on all cores, or a few at a time on a GPU."""
    jobs = jobs_of(groups)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    workers = [_Worker(device) for _ in range(min(cores if device == "cpu" else MOST_ON_GPU, len(jobs)))]
    found: dict[int, Outcome] = {}
    waiting = list(range(len(jobs)))[::-1]
    try:
        while len(found) < len(jobs):
            for worker in workers:
                if worker.number is None and waiting:
                    worker.give(waiting.pop(), jobs)
            busy = [worker for worker in workers if worker.number is not None]
            first = min(worker.since for worker in busy) + deadline
            ready = wait([worker.connection for worker in busy], timeout=max(first - time.monotonic(), 0.0))
            for worker in busy:
                overdue = time.monotonic() - worker.since > deadline
                if worker.connection in ready and worker.started():
                    continue
                if worker.connection in ready or overdue:
                    number, outcome = worker.receive(jobs, overdue=worker.connection not in ready)
                    found[number] = outcome
                    told = f"{outcome.name}, {outcome.method}, {outcome.precision}: {outcome.verdict}"
                    tell(f"{len(found)}/{len(jobs)} {told}")
    finally:
        for worker in workers:
            worker.end()
    return [found[number] for number in range(len(jobs))]


def _serve(connection: Connection, device: str) -> None:
    """A worker's life: a run in, its outcome out, until nobody asks any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the asker ends its workers
    end_with_parent()
    start_warp()
    connection.send(STARTED)
    while True:
        try:
            job: Job = connection.recv()
        except EOFError:
            return
        connection.send(job.run(device))


class _Worker:
    """A process, and which run it has had since when."""

    def __init__(self, device: str) -> None:
        self._device = device
        self.number: int | None = None
        self.since = 0.0
        self._start()

    def _start(self) -> None:
        self._told = False
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, self._device), daemon=True)
        self._process.start()
        theirs.close()

    def give(self, number: int, jobs: Sequence[Job]) -> None:
        self.number, self.since = number, time.monotonic()
        with contextlib.suppress(OSError):  # it died meanwhile, which receive finds
            self.connection.send(jobs[number])

    def started(self) -> bool:
        """Whether what it says is only that it has started: the time of its first run begins now."""
        if self._told:
            return False
        self._told = True
        with contextlib.suppress(EOFError, OSError):
            self.connection.recv()
            self.since = time.monotonic()
            return True
        return False

    def receive(self, jobs: Sequence[Job], *, overdue: bool) -> tuple[int, Outcome]:
        """What came of its run; a worker that died or does not end is replaced."""
        number, self.number = self.number, None
        if number is None:
            raise RuntimeError("an idle worker was asked")
        try:
            if not overdue:
                outcome: Outcome = self.connection.recv()
                return number, outcome
            lost = jobs[number].lost("hung", f"no end after {time.monotonic() - self.since:.0f} s")
        except (EOFError, OSError):
            self._process.join(GRACE)
            lost = jobs[number].lost("crashed", ended(self._process.exitcode))
        self.end()
        self._start()
        return number, lost

    def end(self) -> None:
        self.connection.close()
        self._process.kill()
        self._process.join(GRACE)

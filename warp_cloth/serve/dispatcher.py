"""The queue of a service: a thread that hands waiting orders to worker processes, and sees to it that each is answered.

An order has one future, and a worker one task at a time, whose replies come in the order of its orders; a worker that
dies takes its pipe with it. So no order gets a reply that was made for another.
"""

from __future__ import annotations

import logging
import multiprocessing
import threading
import time
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from http import HTTPStatus
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

from warp_cloth.base.errors import InputError
from warp_cloth.batch.gpu_sharing import ALONE, GpuSharing
from warp_cloth.batch.pool import Lost, WorkerSlot
from warp_cloth.batch.worker import Duty
from warp_cloth.serve.answering import OrderTask, Reply, refused
from warp_cloth.serve.limits import Limits
from warp_cloth.serve.orders import Order

log = logging.getLogger(__name__)

MOST_TRIES = 2  # of an order whose worker died: the second alone
LONGEST_WAIT = 1.0  # [s] between two looks at the clock
TOGETHER_ON_CPU = 8  # orders for one body in a task; they are fitted one after another, and answered together


@dataclass(eq=False)
class Waiting:
    """An order in the queue."""

    order: Order
    deadline: float  # by time.monotonic [s]
    future: Future[Reply] = field(default_factory=Future)
    tries: int = 0
    abandoned: bool = False  # whoever asked has gone

    def answer(self, reply: Reply) -> None:
        """Answers it, unless it has been; its files are gone by then, whoever wrote them."""
        if not self.future.done():
            self.order.remove()
            self.future.set_result(reply)


@dataclass(frozen=True)
class Counts:
    """How a dispatcher is doing."""

    workers: int
    waiting: int
    fitting: int
    restarts: int
    started: bool  # whether a worker has fitted something


class Dispatcher:
    """Worker processes on these devices (one entry for each), and the orders that wait for them.

    ``scratch`` is an empty folder in which orders have theirs; ``sharing``: how workers share GPUs.
    """

    def __init__(self, devices: list[str], limits: Limits, scratch: Path, sharing: GpuSharing = ALONE) -> None:
        self._limits, self._scratch = limits, scratch
        self._slots = []
        for number, device in enumerate(devices):
            count = devices.count(device)
            # one of several workers on the CPU has one core; nobody loads for it, whose memory could not be emptied
            threads = device != "cpu" or count == 1
            duty = Duty("warp_cloth.serve.answering", "answer", scratch, threads)
            self._slots.append(WorkerSlot(device, 1.0 / count, 0, devices[:number].count(device), duty, sharing))
        self._queue: list[Waiting] = []
        self._fitting: dict[int, list[Waiting]] = {}  # by the slot's index
        self._lock = threading.Lock()
        self._wake_reader, self._wake_writer = multiprocessing.get_context().Pipe(duplex=False)
        self._ending = self._started = self._woken = False
        self._restarts = 0
        self._thread = threading.Thread(target=self._run, name="dispatcher", daemon=True)

    def start(self) -> None:
        """Starts the workers, and the thread.

        Raises:
            InputError: workers cannot start.
        """
        for slot in self._slots:
            slot.start()
        self._thread.start()

    def close(self) -> None:
        """Refuses what waits, and ends the workers."""
        with self._lock:
            self._ending = True
        self._wake()
        self._thread.join()

    def submit(self, order: Order, *, seconds: float | None = None) -> Waiting | None:
        """Queues an order, to be answered within so many seconds (None: the limit); None where the queue is full."""
        waiting = Waiting(order, time.monotonic() + (self._limits.seconds if seconds is None else seconds))
        with self._lock:
            count = len(self._queue) + sum(map(len, self._fitting.values()))
            if self._ending or count >= self._limits.queue:
                return None
            self._queue.append(waiting)
        self._wake()
        return waiting

    def abandon(self, waiting: Waiting) -> None:
        """Whoever asked for this has gone: it is not begun, if it has not been yet."""
        waiting.abandoned = True
        self._wake()

    def counts(self) -> Counts:
        """How it is doing."""
        with self._lock:
            fitting = sum(map(len, self._fitting.values()))
            workers = sum(slot.process is not None for slot in self._slots)
            return Counts(workers, len(self._queue), fitting, self._restarts, self._started)

    def _wake(self) -> None:
        with self._lock:
            if not self._woken:  # once is enough, and a pipe can be full
                self._woken = True
                self._wake_writer.send_bytes(b"\0")

    def _run(self) -> None:
        try:
            while not self._ending:
                self._refuse_late()
                self._assign()
                self._receive()
        except Exception:
            log.exception("the queue has ended")
        finally:
            with self._lock:
                self._ending = True
                left = [*self._queue, *(each for task in self._fitting.values() for each in task)]
                self._queue.clear()
                self._fitting.clear()
            for waiting in left:
                waiting.answer(refused(HTTPStatus.SERVICE_UNAVAILABLE, "the service is ending; ask again later"))
            for slot in self._slots:
                slot.dismiss()
            for slot in self._slots:
                slot.stop()

    def _refuse_late(self) -> None:
        """Refuses orders whose time is up; a worker that has no others is ended."""
        now = time.monotonic()
        late = refused(HTTPStatus.GATEWAY_TIMEOUT, f"not done within {self._limits.seconds:g} s; ask again later")
        with self._lock:
            ended = [each for each in self._queue if each.deadline <= now or each.abandoned]
            self._queue = [each for each in self._queue if each not in ended]
            tasks = list(self._fitting.items())
        for waiting in ended:
            waiting.answer(late)
        for index, task in tasks:
            for waiting in task:
                if waiting.deadline <= now:
                    waiting.answer(late)
            if all(waiting.future.done() for waiting in task):
                self._kill(index)

    def _kill(self, index: int) -> None:
        """Ends a worker whose answers come too late; the next task starts another."""
        slot = self._slots[index]
        slot.task = None
        if slot.process is not None:
            slot.process.kill()
        slot.stop()
        with self._lock:
            self._restarts += 1
            task = self._fitting.pop(index)
        for waiting in task:
            waiting.order.remove()  # what it wrote since it was answered

    def _assign(self) -> None:
        """Gives every idle worker a task, while there are orders."""
        if not any(slot.usable for slot in self._slots):
            with self._lock:
                left, self._queue = self._queue, []
            for waiting in left:
                waiting.answer(refused(HTTPStatus.SERVICE_UNAVAILABLE, "no device is left; start the service again"))
        usable = sum(slot.usable for slot in self._slots)
        for index, slot in enumerate(self._slots):
            if slot.task is not None or not slot.usable:
                continue
            with self._lock:
                chosen = next_task(self._queue, slot.device, usable, self._limits.together)
                if not chosen:
                    return
                self._queue = [each for each in self._queue if each not in chosen]
                self._fitting[index] = chosen
            try:
                orders = tuple(each.order.written() for each in chosen)
                lease = self._scratch / f"{slot.device.replace(':', '_')}.lease"
                slot.assign(OrderTask(orders, slot.device, slot.fraction, lease if slot.takes_turns else None))
            except OSError as error:
                self._refuse(index, f"no room for files ({error.strerror}); ask again later")
            except InputError as error:
                self._cannot_start(index, str(error))

    def _receive(self) -> None:
        """Waits until a worker or a caller has something."""
        sources: dict[Any, int] = {
            slot.connection: index for index, slot in enumerate(self._slots) if slot.process is not None
        }
        with self._lock:
            every = [*self._queue, *(each for task in self._fitting.values() for each in task)]
        first = min((each.deadline for each in every if not each.future.done()), default=float("inf"))
        patience = min(max(first - time.monotonic(), 0.0), LONGEST_WAIT)
        for source in wait([self._wake_reader, *sources], patience):
            if source is self._wake_reader:
                with self._lock:
                    self._woken = False
                    self._wake_reader.recv_bytes()
            else:
                self._take(sources[source])

    def _take(self, index: int) -> None:
        """Takes what a worker has sent, or finds that it has died."""
        slot = self._slots[index]
        try:
            received = slot.receive()
        except InputError as error:
            self._cannot_start(index, str(error))
            return
        if slot.process is None or isinstance(received, Lost):
            with self._lock:
                self._restarts += 1
        if received is None:
            return
        with self._lock:
            task = self._fitting.pop(index, [])
        if isinstance(received, Lost):
            self._again(task, received.reason)
            return
        self._started = True
        for waiting, reply in zip(task, received, strict=True):
            waiting.answer(reply)

    def _again(self, task: Sequence[Waiting], reason: str) -> None:
        """Puts orders whose worker died back to the front, each to be tried alone; refuses those tried twice."""
        left = []
        for waiting in task:
            waiting.tries += 1
            if waiting.tries < MOST_TRIES:
                left.append(waiting)
            else:
                waiting.answer(refused(HTTPStatus.SERVICE_UNAVAILABLE, f"{reason}, twice; ask again later"))
        with self._lock:
            self._queue = [*(each for each in left if not each.future.done()), *self._queue]

    def _cannot_start(self, index: int, reason: str) -> None:
        """Refuses a task for which no worker can be started."""
        log.error(reason)
        slot = self._slots[index]
        slot.task = None
        slot.stop()
        self._refuse(index, "no worker can start; ask again later")

    def _refuse(self, index: int, reason: str) -> None:
        """Refuses the orders of a task that is not begun."""
        with self._lock:
            task = self._fitting.pop(index, [])
        for waiting in task:
            waiting.answer(refused(HTTPStatus.SERVICE_UNAVAILABLE, reason))


def next_task(waiting: Sequence[Waiting], device: str, workers: int, together: int) -> list[Waiting]:
    """The orders of the next task: the oldest, others for its body, and on a GPU a fair share of the rest.

    What is derived from a body is derived once for all orders of a task, and no worker is to be idle meanwhile. An
    order whose worker has died goes alone: it may be what killed it.

    Args:
        waiting: all orders in the queue, the oldest first.
        device: that fits them.
        workers: that share the queue.
        together: orders of a task at most.
    """
    if not waiting or waiting[0].tries:
        return list(waiting[:1])
    untried = [each for each in waiting if not each.tries]
    bodies: dict[str, list[Waiting]] = {}
    for each in untried:
        bodies.setdefault(each.order.body, []).append(each)
    chosen, *others = bodies.values()
    if device == "cpu":
        return chosen[:TOGETHER_ON_CPU]
    for own in others:
        if len(chosen) + len(own) > -(-len(untried) // workers):
            break
        chosen += own
    return chosen[:together]

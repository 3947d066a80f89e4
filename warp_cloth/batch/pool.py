"""Worker processes on this machine: one per CPU core, or one per GPU. A dead one is replaced, its task is told lost."""

from __future__ import annotations

import collections
import contextlib
import gc
import logging
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from types import TracebackType
from typing import Protocol

from warp_cloth.base.device import wake_gpu
from warp_cloth.base.threads import core_count
from warp_cloth.batch.lifeline import begin_alone, end_with_parent
from warp_cloth.batch.processes import context
from warp_cloth.batch.work import DeviceLostError, Done, Task, do_task

log = logging.getLogger(__name__)

MOST_LOSSES = 2  # of its device in a row, after which a worker's place is given up
MOST_HELPERS = 12  # of a worker: those of four that share 64 cores hold one another up where there are more
LOOKED_AT = 64  # tasks that wait, for one that shares meshes with what the worker had
SWITCH = 1e-4  # [s] after which a worker's thread lets another go on, which hands work to its helpers and takes it in
GRACE = 4.0  # [s] between asking a worker to end and ending it


@dataclass(frozen=True)
class Lost:
    """A task whose worker died."""

    task: Task
    reason: str
    hopeless: bool = False  # no worker is left that could try again


class Pool(Protocol):
    """Does tasks somewhere else, several at a time."""

    @property
    def devices(self) -> Sequence[str]:
        """The device of each worker."""

    @property
    def patient(self) -> bool:
        """Whether a lost task has been tried again already."""

    def submit(self, task: Task) -> None: ...

    def finished(self) -> Iterator[Done | Lost]:
        """What has come of tasks, as it comes; ends when no task is left, and more may be submitted meanwhile."""

    def close(self) -> None: ...


def _serve(connection: Connection, device: str, helpers: int, rank: int) -> None:
    """A worker's life: a task in, what came of it out, until nobody asks any more. ``rank`` as of Loaders."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the asker ends its workers
    from warp_cloth.batch.loading import Shelf

    shelf = Shelf(helpers, fork=True, rank=rank)  # before this process has threads and a device
    (end_with_parent if helpers else begin_alone)()
    sys.setswitchinterval(SWITCH)
    gc.disable()  # until what it imports and loads at first is there: nothing of that is garbage
    if device != "cpu":
        threading.Thread(target=wake_gpu, args=(device,), daemon=True).start()  # while this one reads and imports
    while True:
        try:
            task: Task = connection.recv()
        except EOFError:
            for helper in multiprocessing.active_children():
                helper.terminate()
            os._exit(0)  # nobody waits for what this process would tidy up
        try:
            connection.send(do_task(task, shelf.tidied()))
        except DeviceLostError as error:
            connection.send(str(error))  # its device may be well again in another process
            return
        gc.enable()


class _Slot:
    """One place where a worker works, the task that it has, its device and its share of that, its helpers and rank."""

    def __init__(self, device: str, share: float, helpers: int, rank: int) -> None:
        self.device, self.share, self.helpers, self.rank = device, share, helpers, rank
        self.task: Task | None = None
        self.had: Task | None = None  # the last one, whose meshes the worker has
        self.losses = 0  # of the device, one after another
        self.process: BaseProcess | None = None
        self._ending: list[BaseProcess] = []  # that were dismissed

    def start(self) -> None:
        starting = context()
        self.connection, theirs = starting.Pipe()
        # no daemon, as these may have no helpers; it ends with this process all the same
        self.process = starting.Process(target=_serve, args=(theirs, self.device, self.helpers, self.rank))
        self.process.start()
        self.had = None
        theirs.close()

    @property
    def usable(self) -> bool:
        return self.losses < MOST_LOSSES

    def give(self, task: Task) -> None:
        if self.process is None:
            self.start()
        self.task = self.had = task
        with contextlib.suppress(OSError):  # it died meanwhile, which receive finds
            self.connection.send(task)

    def receive(self) -> Done | Lost:
        """What came of the task, once the worker said something or died; a dead worker is replaced."""
        task, self.task = self.task, None
        if task is None:
            raise RuntimeError("an idle worker was asked")
        try:
            told = self.connection.recv()
            if isinstance(told, Done):
                self.losses = 0
                return told
            self.losses += 1
            reason = str(told)
        except (EOFError, OSError):
            if self.process is None:
                raise RuntimeError("nobody was asked") from None
            self.process.join(GRACE)
            reason = ended(self.process.exitcode)
        self.stop()
        if self.losses < MOST_LOSSES:
            log.warning("a worker is replaced: %s", reason)
            self.start()
        return Lost(task, reason)

    def dismiss(self) -> None:
        """Asks the worker to end, if there is one: an idle one ends by itself, with its helpers."""
        if self.process is None:
            return
        self.connection.close()
        if self.task is not None:
            self.process.terminate()
        self._ending.append(self.process)
        self.process = None

    def stop(self) -> None:
        self.dismiss()
        for process in self._ending:
            process.join(GRACE)
            process.terminate()
            process.join(GRACE)
            if process.is_alive():
                process.kill()
                process.join()
        self._ending.clear()


def ended(code: int | None) -> str:
    """How a process ended, in words."""
    if code is None:
        return "the worker stopped answering"
    if code < 0:
        name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
        hint = ", perhaps for lack of memory" if name == "SIGKILL" else ""
        return f"the worker was ended by {name}{hint}"
    return f"the worker ended with status {code}"


def helpers(device: str, workers: int) -> int:
    """Processes that load for each of so many workers: cores that only wait for a GPU; on the CPU all have work.

    Those of two workers share the cores, and leave some to those who fit.
    """
    count = min(3 * core_count() // max(workers, 4), MOST_HELPERS)
    return count if device != "cpu" and count > 1 else 0


def best_shared(waiting: Sequence[frozenset[str]], own: frozenset[str], others: Sequence[frozenset[str]]) -> int:
    """Which task has most in common with a worker's last, and least with another one's; of equal ones the first.

    Each is told by what its items ask for.
    """
    gains = [len(asks & own) - max((len(asks & theirs) for theirs in others), default=0) for asks in waiting]
    return gains.index(max(gains))


class LocalPool:
    """Worker processes, one for each device named; all but a GPU's first begin when they are given something.

    ``check`` tells the devices that are really there, which takes a while: it is asked once a worker has none.
    """

    patient = False

    def __init__(self, devices: Sequence[str], check: Callable[[], Sequence[str]] | None = None) -> None:
        self._check = check
        self._waiting: list[Task] = []
        self._open(devices)

    def _open(self, devices: Sequence[str]) -> None:
        self.devices = tuple(devices)
        at, count = collections.Counter(self.devices), len(self.devices)
        ranks = [self.devices[:number].count(device) for number, device in enumerate(self.devices)]
        self._slots = [
            _Slot(device, 1.0 / at[device], helpers(device, count), rank)
            for device, rank in zip(self.devices, ranks, strict=True)
        ]
        for slot in self._slots:
            if slot.device == "cpu" or slot.rank == 0:
                slot.start()

    def __enter__(self) -> LocalPool:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def submit(self, task: Task) -> None:
        self._waiting.append(task)

    def finished(self) -> Iterator[Done | Lost]:
        while True:
            usable = [slot for slot in self._slots if slot.usable]
            while self._waiting and not usable:
                yield Lost(self._waiting.pop(0), "no device is left", hopeless=True)
            for slot in usable:
                if slot.task is None and self._waiting:
                    slot.give(self._task_for(slot))
            busy = {slot.connection: slot for slot in self._slots if slot.task is not None}
            for slot in self._slots:
                if slot.task is None:
                    slot.dismiss()  # which takes a while; whatever else is to be done wakes it again
            if not busy:
                return
            for connection in wait(list(busy)):
                slot = busy[connection]  # type: ignore[index]
                came = slot.receive()
                if isinstance(came, Lost) and slot.losses and self._checked_anew(came.task):
                    break
                yield came

    def _checked_anew(self, lost: Task) -> bool:
        """Checks the devices, once; whether they are others, so that tasks are to be given anew, the lost one too."""
        check, self._check = self._check, None
        devices = self.devices if check is None else tuple(check())
        if devices == self.devices:
            return False
        self._waiting += [lost, *(slot.task for slot in self._slots if slot.task is not None)]
        self.close()
        self._open(devices)
        return True

    def _task_for(self, slot: _Slot) -> Task:
        own = slot.had.shard.asks if slot.had is not None else frozenset()
        others = [each.had.shard.asks for each in self._slots if each is not slot and each.had is not None]
        some = self._waiting[: LOOKED_AT if slot.device == "cpu" else 1]  # a GPU's shards have their order
        at = best_shared([task.shard.asks for task in some], own, others)
        task = self._waiting.pop(at)
        turn = task.store.turn_file(slot.device) if slot.share < 1.0 and slot.device != "cpu" else None
        common = task.common if slot.helpers and len(self._slots) > 1 else None
        return replace(task, device=slot.device, share=slot.share, turn=turn, common=common)

    def close(self) -> None:
        for slot in self._slots:
            slot.dismiss()
        for slot in self._slots:
            slot.stop()
        self._slots.clear()

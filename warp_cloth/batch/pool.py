"""Worker processes on this machine: one per CPU core, or several per GPU. A worker that dies is replaced."""

from __future__ import annotations

import collections
import contextlib
import logging
import signal
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from types import TracebackType
from typing import Any, Protocol

from warp_cloth.base.errors import InputError
from warp_cloth.base.threads import core_count
from warp_cloth.batch.gpu_sharing import ALONE, GpuSharing
from warp_cloth.batch.lifeline import sigint_blocked
from warp_cloth.batch.processes import START_METHOD, process_context, start_method
from warp_cloth.batch.task import Done, Task
from warp_cloth.batch.worker import SHARDS, Duty, Started, StartFailed, serve

log = logging.getLogger(__name__)

MOST_LOSSES = 2  # of its device in a row, after which a worker is not replaced
MOST_LOADERS = 12  # per worker: more slow each other down where four workers share 64 cores
TASKS_COMPARED = 64  # waiting tasks among which one that shares meshes with the worker's last is chosen
GRACE = 4.0  # [s] between asking a worker to end and killing it


@dataclass(frozen=True)
class Lost:
    """A task whose worker died."""

    task: Any
    reason: str
    final: bool = False  # no worker is left to try again


class Pool(Protocol):
    """Does tasks in other processes, several at a time."""

    @property
    def devices(self) -> Sequence[str]:
        """The device of each worker."""

    @property
    def retries(self) -> bool:
        """Whether the pool retries lost tasks by itself."""

    def submit(self, task: Task) -> None: ...

    def finished(self) -> Iterator[Done | Lost]:
        """Results of tasks as they come; ends when no task is left. More tasks may be submitted meanwhile."""

    def close(self) -> None: ...


class WorkerSlot:
    """A place for a worker: its device, its fraction of that, how many processes load for it, its current task."""

    def __init__(
        self,
        device: str,
        fraction: float,
        loader_count: int,
        rank: int,
        duty: Duty = SHARDS,
        sharing: GpuSharing = ALONE,
    ) -> None:
        self.device, self.fraction, self.loader_count, self.rank = device, fraction, loader_count, rank
        self.duty, self.sharing = duty, sharing
        self.task: Any = None  # what the duty's function takes
        self.last_task: Any = None  # whose meshes the worker has loaded
        self.losses = 0  # of the device, in a row
        self.process: BaseProcess | None = None
        self._started = False
        self._ending: list[BaseProcess] = []

    def start(self) -> None:
        """Starts a worker.

        Raises:
            InputError: processes cannot be started.
        """
        context = process_context()
        self.connection, theirs = context.Pipe()
        arguments = (theirs, self.device, self.loader_count, self.rank, self.duty, self.sharing.environment)
        # not a daemon, which could have no loaders; it ends with this process all the same
        self.process = context.Process(target=serve, args=arguments)  # type: ignore[attr-defined]
        try:
            with sigint_blocked():
                self.process.start()
        except (OSError, EOFError) as error:
            self.process = None
            raise cannot_start(str(error) or "the process that starts workers has ended") from None
        self.last_task, self._started = None, False
        theirs.close()

    @property
    def usable(self) -> bool:
        return self.losses < MOST_LOSSES

    @property
    def takes_turns(self) -> bool:
        """Whether workers relax one after another on its device."""
        return self.fraction < 1.0 and self.device != "cpu" and not self.sharing.active

    def assign(self, task: Any) -> None:
        if self.process is None:
            self.start()
        self.task = self.last_task = task
        with contextlib.suppress(OSError):  # the worker has died, which receive finds
            self.connection.send(task)

    def receive(self) -> Any:
        """What came of the task, once the worker sent something or died: a Lost, or what the duty's function returned.

        None: it has only started, or died without a task. A worker that dies of a task is replaced.

        Raises:
            InputError: the worker could not start, and so no other can.
        """
        try:
            received = self.connection.recv()
        except (EOFError, OSError):
            return self._lost(self._exit_reason())
        if isinstance(received, Started):
            self._started = True
            return None
        if isinstance(received, StartFailed):
            raise cannot_start(received.reason)
        if isinstance(received, str):  # why its device is lost
            self.losses += 1
            self.sharing = ALONE  # the next worker does without: it may be the service that is lost
            return self._lost(received)
        self.task, self.losses = None, 0
        return received

    def _exit_reason(self) -> str:
        """Why the worker ended; InputError where it ended by itself before it had started."""
        if self.process is None:
            raise RuntimeError("there is no worker to receive from")
        self.process.join(GRACE)
        code = self.process.exitcode
        if not self._started and code is not None and code >= 0:
            raise cannot_start(exit_reason(code))
        return exit_reason(code)

    def _lost(self, reason: str) -> Lost | None:
        task, self.task = self.task, None
        self.stop()
        if task is None:
            return None  # the next task starts a worker
        if self.usable:
            log.warning("a worker is replaced: %s", reason)
            self.start()
        return Lost(task, reason)

    def dismiss(self) -> None:
        """Tells the worker, if there is one, to end: an idle one ends by itself, with its loaders."""
        if self.process is None:
            return
        with contextlib.suppress(OSError):  # after a fork other workers hold this end open, too
            self.connection.send(None)
        self.connection.close()
        if self.task is not None:
            self.process.terminate()
        self._ending.append(self.process)
        self.process = None

    def stop(self) -> None:
        """Dismisses the worker, and waits until it has ended."""
        self.dismiss()
        for process in self._ending:
            process.join(GRACE)
            process.terminate()
            process.join(GRACE)
            if process.is_alive():
                process.kill()
                process.join()
        self._ending.clear()


def cannot_start(reason: str) -> InputError:
    """The error that ends a batch whose workers cannot start."""
    return InputError("batch", f"worker processes cannot start ({reason})", "install warp-cloth again")


def exit_reason(code: int | None) -> str:
    """How a process ended, as text."""
    if code is None:
        return "the worker stopped answering"
    if code < 0:
        name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
        hint = ", perhaps for lack of memory" if name == "SIGKILL" else ""
        return f"the worker was ended by {name}{hint}"
    return f"the worker ended with status {code}"


def loader_count(device: str, workers: int) -> int:
    """Processes that load for each of so many workers: on cores that would wait for a GPU; none on the CPU.

    The loaders of two workers share the cores, and leave some to the workers.
    """
    count = min(3 * core_count() // max(workers, 4), MOST_LOADERS)
    return count if device != "cpu" and count > 1 else 0


def best_shared(waiting: Sequence[frozenset[str]], own: frozenset[str], others: Sequence[frozenset[str]]) -> int:
    """Index of the task that shares most with a worker's last, and least with another worker's; of equals the first.

    Each task is given by the inputs of its items.
    """
    gains = [len(inputs & own) - max((len(inputs & theirs) for theirs in others), default=0) for inputs in waiting]
    return gains.index(max(gains))


class LocalPool:
    """Worker processes, one for each device named; on a GPU all but the first start when they get a task.

    ``check`` returns the devices that really exist, which takes a while: it is called when a worker has lost its own.
    ``sharing``: how several workers share a GPU.
    """

    retries = False

    def __init__(
        self,
        devices: Sequence[str],
        check: Callable[[], Sequence[str]] | None = None,
        sharing: GpuSharing = ALONE,
    ) -> None:
        self._check, self._sharing = check, sharing
        self._waiting: list[Task] = []
        self._slots: list[WorkerSlot] = []
        self._open(devices)

    def _open(self, devices: Sequence[str]) -> None:
        self.devices = tuple(devices)
        if start_method() == "fork" and set(self.devices) != {"cpu"}:
            raise InputError(START_METHOD, "a GPU cannot be used after a fork", "use spawn, or --device cpu")
        workers, count = collections.Counter(self.devices), len(self.devices)
        ranks = [self.devices[:number].count(device) for number, device in enumerate(self.devices)]
        self._slots = [
            WorkerSlot(device, 1.0 / workers[device], loader_count(device, count), rank, sharing=self._sharing)
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
                yield Lost(self._waiting.pop(0), "no device is left", final=True)
            for slot in usable:
                if slot.task is None and self._waiting:
                    slot.assign(self._task_for(slot))
            busy: dict[Any, WorkerSlot] = {slot.connection: slot for slot in self._slots if slot.task is not None}
            for slot in self._slots:
                if slot.task is None:
                    slot.dismiss()  # it ends in parallel; another task would start a new worker
            if not busy:
                return
            for connection in wait(list(busy)):
                slot = busy[connection]
                received = slot.receive()
                if isinstance(received, Lost) and slot.losses and self._reopened(received.task):
                    break
                if received is not None:
                    yield received

    def _reopened(self, lost: Task) -> bool:
        """Checks the devices, once; where they differ the pool starts again, with all tasks that were assigned."""
        check, self._check = self._check, None
        devices = self.devices if check is None else tuple(check())
        if devices == self.devices:
            return False
        self._waiting += [lost, *(slot.task for slot in self._slots if slot.task is not None)]
        self.close()
        self._open(devices)
        return True

    def _task_for(self, slot: WorkerSlot) -> Task:
        own = slot.last_task.shard.inputs if slot.last_task is not None else frozenset()
        others = [
            each.last_task.shard.inputs for each in self._slots if each is not slot and each.last_task is not None
        ]
        some = self._waiting[: TASKS_COMPARED if slot.device == "cpu" else 1]  # a GPU's shards have their order
        task = self._waiting.pop(best_shared([task.shard.inputs for task in some], own, others))
        lease = task.store.lease_file(slot.device) if slot.takes_turns else None
        shared = task.shared if slot.loader_count and len(self._slots) > 1 else None
        return replace(task, device=slot.device, fraction=slot.fraction, lease=lease, shared=shared)

    def close(self) -> None:
        for slot in self._slots:
            slot.dismiss()
        for slot in self._slots:
            slot.stop()
        self._slots.clear()

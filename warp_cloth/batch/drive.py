"""A whole batch: cuts the items into shards, has them done, retries what was lost, and puts the results together."""

from __future__ import annotations

import collections
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from warp_cloth.base import arguments
from warp_cloth.base.device import device_named, likely_gpus
from warp_cloth.base.errors import InputError
from warp_cloth.base.threads import core_count
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.batch.jobs import Item, given_items, read_jobs
from warp_cloth.batch.pool import LocalPool, Lost, Pool
from warp_cloth.batch.processes import get_ready
from warp_cloth.batch.rows import FAILED, ItemResult, empty_row
from warp_cloth.batch.store import Keep, Shard, Store, cut
from warp_cloth.batch.work import Done, Task

if TYPE_CHECKING:
    import pyarrow

CPU_SHARD = 8  # items to a shard at most: what a killed run does again on each core
GPU_SHARD = 1024  # a GPU has little to do while the last of a shard come to rest, and a killed run does four again
WORKERS_PER_GPU = 4  # while one's garments relax, others load, or measure what they have fitted
# At least so many, where there are items enough, as the last worker to end is waited for: half a shard in the mean.
SHARDS_PER_CORE = 16
SHARDS_PER_GPU_WORKER = 1  # a GPU that one worker leaves is the others', and many garments together go faster
TRIES = 2  # of a task whose worker dies


@dataclass(frozen=True)
class Standing:
    """How far a batch has come."""

    items: int
    done: int  # now and in earlier runs
    before: int  # of these, in earlier runs
    problems: int  # of these, without a worn garment
    seconds: float

    @property
    def items_per_second(self) -> float | None:
        fresh = self.done - self.before
        return fresh / self.seconds if fresh and self.seconds > 0.0 else None


@dataclass(frozen=True)
class BatchReport:
    """How a batch ended."""

    folder: Path
    statuses: dict[str, int]  # items by status
    unwritten: dict[str, int]  # items whose results could not be written, by reason; started again, they are done
    standing: Standing
    reasons: dict[str, int]  # why items have no worn garment, and how many each, the commonest first

    @property
    def whole(self) -> bool:
        return not self.unwritten


def run_batch(
    jobs: str | Path | Sequence[Item],
    out: str | Path = "out",
    *,
    device: str | None = None,
    workers: int | None = None,
    ray: str | None = None,
    keep: Keep = "arrays",
    shard: int | None = None,
    progress: Callable[[Standing], None] | None = None,
) -> BatchReport:
    """Fits every item of a job file, and goes on where an earlier run of the same batch stood.

    Args:
        jobs: a job file, or items.
        out: folder for results.parquet, results.csv and the shapes.
        device: "cpu", "cuda" (all GPUs) or "cuda:N"; None: all GPUs, or the CPU where there is none.
        workers: processes; None: one for each core, or WORKERS_PER_GPU for each GPU.
        ray: address of a Ray cluster that does the work ("auto": the one that runs here); None: this machine.
        keep: "arrays", a packed file per shard, "stages", a USD stage per item, or "none".
        shard: items to a task and its file, up to a quarter more where they meet the same avatar; None: by device and
            number of items, or as the folder has it.
        progress: told how far the batch has come.

    Raises:
        InputError: the job file, the folder or the device cannot be used, or the folder holds another batch.
    """
    if ray is None:
        get_ready(device)
    if keep not in get_args(Keep):
        raise InputError("--keep", f'"{keep}" is not known', f"use one of {', '.join(get_args(Keep))}")
    if workers is not None and arguments.integer(workers, "--workers") < 1:
        raise InputError("--workers", f"{workers} processes cannot do anything", "give 1 or more")
    if shard is not None and arguments.integer(shard, "--shard") < 1:
        raise InputError("--shard", f"{shard} items make no shard", "give 1 or more")
    began = time.perf_counter()
    pool = _pool(device, workers, ray)  # whose processes begin while the jobs are read
    try:
        items = read_jobs(jobs) if isinstance(jobs, (str, Path)) else given_items(jobs)
        store = Store(arguments.path(out, "--out").absolute(), keep)
        store.open()
        with store.held():
            store.check_batch(items)
            size = store.shard_size(shard or _shard_size(len(items), pool.devices), shard is not None)
            with store.common() as common:
                return _Drive(store, cut(items, size), pool, progress or (lambda _: None), began, common).run()
    finally:
        pool.close()


def _pool(device: str | None, workers: int | None, ray: str | None) -> Pool:
    if ray is not None:
        from warp_cloth.batch.cluster import RayPool

        return RayPool(ray, device, workers)
    if device == "cpu":
        return LocalPool(_places([], workers))
    likely = likely_gpus(device)
    if device is not None and not likely:
        return LocalPool(_places(_gpus(device), workers))
    return LocalPool(_places(likely, workers), lambda: _places(_gpus(device), workers))


def _places(gpus: Sequence[str], workers: int | None) -> list[str]:
    """The device of each worker."""
    if not gpus:
        return ["cpu"] * (workers or core_count())
    return [gpus[number % len(gpus)] for number in range(workers or WORKERS_PER_GPU * len(gpus))]


def _gpus(device: str | None) -> list[str]:
    """The GPUs that are meant; none where that is the CPU.

    Raises:
        InputError: there is no such device.
    """
    if "warp" not in sys.modules:  # who has it running keeps its messages
        start_warp()
    import warp as wp

    gpus = [str(each.alias) for each in wp.get_cuda_devices()]
    if device is None or (device == "cuda" and gpus):
        return gpus
    named = device_named(device)
    return [named] if wp.get_device(named).is_cuda else []


def _shard_size(items: int, devices: Sequence[str]) -> int:
    most, each = (CPU_SHARD, SHARDS_PER_CORE) if devices[0] == "cpu" else (GPU_SHARD, SHARDS_PER_GPU_WORKER)
    return min(max(items // (each * len(devices)), 1), most)


class _Drive:
    """Has the shards of one batch done."""

    def __init__(
        self,
        store: Store,
        shards: list[Shard],
        pool: Pool,
        tell: Callable[[Standing], None],
        began: float,
        common: Path | None = None,
    ) -> None:
        self._store, self._shards, self._pool, self._tell, self._common = store, shards, pool, tell, common
        self._began = began
        self._tries: collections.Counter[tuple[int, str]] = collections.Counter()
        self._parts: dict[int, dict[str, ItemResult]] = {}  # of shards that are done item by item
        self._inputs: dict[int, dict[str, list[int]]] = {}
        self._problems: dict[int, str] = {}  # why a shard is not written
        self._done = self._before = self._failed = 0

    def run(self) -> BatchReport:
        left = [shard for shard in self._shards if not self._store.done(shard)]
        items = sum(len(shard.items) for shard in self._shards)
        self._before = self._done = items - sum(len(shard.items) for shard in left)
        self._report()
        for shard in left:
            self._pool.submit(Task(self._store, shard, "", common=self._common))
        threading.Thread(target=self._store.get_ready, daemon=True).start()
        for came in self._pool.finished():
            if isinstance(came, Lost):
                self._lost(came)
            elif came.shard.number in self._parts:
                self._part(came)
            else:
                self._finish(came)
        table = self._store.merge(self._shards, self._problems)
        return self._ended(table)

    def _finish(self, done: Done) -> None:
        """A shard is written, or cannot be."""
        if done.problem:
            self._problems[done.shard.number] = done.problem
            self._failed += len(done.shard.items)
        self._done += len(done.shard.items)
        self._failed += sum(result.row["digest"] is None for result in done.results)
        self._report()

    def _lost(self, lost: Lost) -> None:
        """Tries a lost task again; then its items one by one; then gives the one up that ends its workers."""
        task, shard = lost.task, lost.task.shard
        key = shard.number, "" if task.write else shard.items[0].name
        self._tries[key] += 1
        if lost.hopeless:
            self._give_up(task, lost.reason)
        elif self._tries[key] < TRIES and not self._pool.patient:
            self._pool.submit(task)
        elif task.write:
            self._parts[shard.number] = {}
            for item in shard.items:
                self._pool.submit(replace(task, shard=Shard(shard.number, (item,)), write=False))
        else:
            failed = ItemResult(empty_row(shard.items[0].name, FAILED, lost.reason))
            self._part(Done(shard, (failed,)))

    def _give_up(self, task: Task, reason: str) -> None:
        """No worker is left: the shard stays undone, to be done by the next run."""
        number = task.shard.number
        if number not in self._problems:
            self._finish(Done(self._shards[number], (), problem=reason))

    def _part(self, part: Done) -> None:
        """One item of a shard that is done item by item; the last one completes it."""
        number = part.shard.number
        parts = self._parts[number]
        parts.update({result.row["name"]: result for result in part.results})
        self._inputs.setdefault(number, {}).update(part.inputs)
        shard = self._shards[number]
        if len(parts) < len(shard.items):
            return
        results = tuple(parts[item.name] for item in shard.items)
        del self._parts[number]
        try:
            self._store.write(shard, results, self._inputs[number])
        except InputError as error:
            self._finish(Done(shard, (), problem=str(error)))
        else:
            self._finish(Done(shard, results))

    def _report(self) -> None:
        items = sum(len(shard.items) for shard in self._shards)
        self._standing = Standing(items, self._done, self._before, self._failed, time.perf_counter() - self._began)
        self._tell(self._standing)

    def _ended(self, table: pyarrow.Table) -> BatchReport:
        statuses = collections.Counter(str(status) for status in table["status"].to_pylist())
        unwritten: collections.Counter[str] = collections.Counter()
        for number, reason in self._problems.items():
            unwritten[reason] += len(self._shards[number].items)
        told = zip(table["digest"].to_pylist(), table["message"].to_pylist(), strict=True)
        bare = [str(reason) for digest, reason in told if digest is None]
        reasons = collections.Counter(reason for reason in bare if reason not in unwritten)
        return BatchReport(
            self._store.folder, dict(statuses), dict(unwritten), self._standing, dict(reasons.most_common())
        )

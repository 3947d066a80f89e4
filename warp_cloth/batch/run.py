"""A whole batch: splits the items into shards, distributes them, retries lost ones, and merges the results."""

from __future__ import annotations

import collections
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from warp_cloth.base import arguments
from warp_cloth.base.device import device_named, likely_gpus
from warp_cloth.base.errors import InputError
from warp_cloth.base.threads import core_count
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.batch.gpu_sharing import ALONE, GpuSharing, shared_gpus
from warp_cloth.batch.jobs import Item, checked_items, read_jobs
from warp_cloth.batch.pool import LocalPool, Lost, Pool
from warp_cloth.batch.processes import start_forkserver
from warp_cloth.batch.rows import FAILED, ItemResult, empty_row
from warp_cloth.batch.store import Keep, Shard, Store, split
from warp_cloth.batch.task import Done, Task

if TYPE_CHECKING:
    import pyarrow

CPU_SHARD = 8  # items per shard at most: a killed run repeats one shard on each core
GPU_SHARD = 1024  # a GPU has little to do while the last items of a shard come to rest; a killed run repeats four
SHARED_GPU_SHARD = 64  # where other shards run on the GPU at the same time: 2,048 T-shirts 102 a second, with 32 66
FEW = 8  # items for each worker that shares a GPU, below which each is a shard: 96 designs in 61 s, six a shard in 77
# At least so many, given enough items: the last worker to end is waited for, half a shard in the mean.
SHARDS_PER_CORE = 16
SHARDS_PER_GPU_WORKER = 1  # other workers use the GPU that one leaves, and larger shards are faster
TRIES = 2  # of a task whose worker dies


@dataclass(frozen=True)
class BatchProgress:
    """How many items of a batch are done."""

    items: int
    done: int  # in this run and earlier ones
    before: int  # of these, in earlier runs
    problems: int  # of these, without a worn garment
    seconds: float

    @property
    def items_per_second(self) -> float | None:
        new = self.done - self.before
        return new / self.seconds if new and self.seconds > 0.0 else None


@dataclass(frozen=True)
class BatchReport:
    """How a batch ended."""

    folder: Path
    statuses: dict[str, int]  # items by status
    unwritten: dict[str, int]  # items whose results could not be written, by reason; the next run does them
    progress: BatchProgress
    reasons: dict[str, tuple[str, ...]]  # why items have no worn garment, and their names, the most frequent first
    worn: int = 0  # items that are worn
    problems: dict[str, int] = field(default_factory=dict)  # items by code of their problems, the most frequent first
    sheet: Path | None = None  # the contact sheet, if there is one

    @property
    def complete(self) -> bool:
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
    sheet: int = 0,
    ease: bool = True,
    progress: Callable[[BatchProgress], None] | None = None,
) -> BatchReport:
    """Fits every item of a job file, and continues an earlier run of the same batch.

    Args:
        jobs: a job file, or items.
        out: folder for results.parquet, results.csv and the shapes.
        device: "cpu", "cuda" (all GPUs) or "cuda:N"; None: all GPUs, or the CPU where there is none.
        workers: processes; None: one per core, or several per GPU.
        ray: address of a Ray cluster to run on ("auto": the one that runs here); None: this machine.
        keep: "arrays", a packed file per shard, "stages", a USD stage per item, or "none".
        shard: items per task and file, up to a quarter more where they have the same avatar; None: by device and
            number of items, or as in the folder's earlier run.
        sheet: number of thumbnails on contact_sheet.html, the worst items first; needs ``keep="arrays"``.
        ease: whether the ease at chest, waist and hip is measured, which takes 0.02 s of a core for each item.
        progress: called with the number of items done.

    Raises:
        InputError: the job file, the folder or the device cannot be used, the folder holds another batch, or workers
            cannot start.
    """
    if keep not in get_args(Keep):
        raise InputError("keep", f'"{keep}" is not known', f"use one of {', '.join(get_args(Keep))}")
    if workers is not None and arguments.integer(workers, "workers") < 1:
        raise InputError("workers", f"a batch needs at least 1 process, not {workers}", "give 1 or more")
    if shard is not None and arguments.integer(shard, "shard") < 1:
        raise InputError("shard", f"a shard needs at least 1 item, not {shard}", "give 1 or more")
    if arguments.integer(sheet, "sheet") < 0 or (sheet and keep != "arrays"):
        raise InputError("sheet", f"{sheet} thumbnails cannot be drawn", 'give 0 or more, and keep "arrays"')
    began = time.perf_counter()
    if ray is None:
        start_forkserver(device)
    with shared_gpus(ray is None and device != "cpu" and workers != 1) as sharing:
        pool = _pool(device, workers, ray, sharing)  # its processes start while the jobs are read
        try:
            items = read_jobs(jobs) if isinstance(jobs, (str, Path)) else checked_items(jobs)
            store = Store(arguments.path(out, "out").absolute(), keep, ease)
            store.open()
            with store.locked():
                store.check_batch(items)
                most = _shard_size(len(items), pool.devices, sharing)
                size = store.shard_size(shard or most, shard is not None)
                with store.shared_folder() as shared:
                    report = Batch(store, split(items, size), pool, progress or (lambda _: None), began, shared).run()
                if sheet:
                    report = replace(report, sheet=_sheet(store.folder, items, sheet))
                return report
        finally:
            pool.close()


def _sheet(folder: Path, items: Sequence[Item], count: int) -> Path:
    import pyarrow.parquet

    from warp_cloth.batch.contact_sheet import write_contact_sheet

    start_warp()
    table = pyarrow.parquet.read_table(folder / "results.parquet")
    return write_contact_sheet(folder, items, table.to_pylist(), count)


def _pool(device: str | None, workers: int | None, ray: str | None, sharing: GpuSharing) -> Pool:
    if ray is not None:
        from warp_cloth.batch.cluster import RayPool

        return RayPool(ray, device, workers)
    likely = device != "cpu" and (device is None or bool(likely_gpus(device)))
    check = (lambda: _worker_devices(_gpus(device), workers, sharing)) if likely else None
    return LocalPool(worker_devices(device, workers, sharing), check, sharing)


def worker_devices(device: str | None, workers: int | None, sharing: GpuSharing = ALONE) -> list[str]:
    """The device of each of so many workers (None: one per core, or several per GPU), as ``run_batch`` has it.

    Raises:
        InputError: there is no such device.
    """
    gpus = [] if device == "cpu" else likely_gpus(device)
    return _worker_devices(gpus if gpus or device in (None, "cpu") else _gpus(device), workers, sharing)


def _worker_devices(gpus: Sequence[str], workers: int | None, sharing: GpuSharing) -> list[str]:
    """The device of each worker."""
    if not gpus:
        return ["cpu"] * (workers or core_count())
    return [gpus[number % len(gpus)] for number in range(workers or sharing.workers_on(gpus))]


def _gpus(device: str | None) -> list[str]:
    """The GPUs that a device option means; none for the CPU.

    Raises:
        InputError: there is no such device.
    """
    if "warp" not in sys.modules:  # a caller that has started Warp keeps its messages
        start_warp()
    import warp as wp

    gpus = [str(each.alias) for each in wp.get_cuda_devices()]
    if device is None or (device == "cuda" and gpus):
        return gpus
    named = device_named(device)
    return [named] if wp.get_device(named).is_cuda else []


def _shard_size(items: int, devices: Sequence[str], sharing: GpuSharing) -> int:
    gpu_shard = SHARED_GPU_SHARD if sharing.active else GPU_SHARD
    most, each = (CPU_SHARD, SHARDS_PER_CORE) if devices[0] == "cpu" else (gpu_shard, SHARDS_PER_GPU_WORKER)
    size = min(max(items // (each * len(devices)), 1), most)
    return 1 if sharing.active and size < FEW else size


class Batch:
    """Runs the shards of one batch in a pool."""

    def __init__(
        self,
        store: Store,
        shards: list[Shard],
        pool: Pool,
        on_progress: Callable[[BatchProgress], None],
        began: float,
        shared: Path | None = None,
    ) -> None:
        self._store, self._shards, self._pool, self._on_progress, self._shared = (
            store,
            shards,
            pool,
            on_progress,
            shared,
        )
        self._began = began
        self._tries: collections.Counter[tuple[int, str]] = collections.Counter()
        self._split: dict[int, dict[str, ItemResult]] = {}  # results of shards that are done item by item
        self._inputs: dict[int, dict[str, list[int]]] = {}
        self._problems: dict[int, str] = {}  # why a shard is not written
        self._done = self._before = self._failed = 0

    def run(self) -> BatchReport:
        left = [shard for shard in self._shards if not self._store.done(shard)]
        items = sum(len(shard.items) for shard in self._shards)
        self._before = self._done = items - sum(len(shard.items) for shard in left)
        self._report()
        for shard in left:
            self._pool.submit(Task(self._store, shard, "", shared=self._shared))
        # no daemon: an exit in the midst of its import of pyarrow hangs or aborts the process
        threading.Thread(target=self._store.preload_tables).start()
        for result in self._pool.finished():
            if isinstance(result, Lost):
                self._retry(result)
            elif result.shard.number in self._split:
                self._add_item(result)
            else:
                self._finish(result)
        table = self._store.merge(self._shards, self._problems)
        return self._batch_report(table)

    def _finish(self, done: Done) -> None:
        """Counts a shard that is written, or cannot be."""
        if done.problem:
            self._problems[done.shard.number] = done.problem
            self._failed += len(done.shard.items)
        self._done += len(done.shard.items)
        self._failed += sum(result.row["digest"] is None for result in done.results)
        self._report()

    def _retry(self, lost: Lost) -> None:
        """Retries a lost task; then its items one by one; then fails the item whose workers die."""
        task, shard = lost.task, lost.task.shard
        key = shard.number, "" if task.write else shard.items[0].name
        self._tries[key] += 1
        if lost.final:
            self._give_up(task, lost.reason)
        elif self._tries[key] < TRIES and not self._pool.retries:
            self._pool.submit(task)
        elif task.write:
            self._split[shard.number] = {}
            for item in shard.items:
                self._pool.submit(replace(task, shard=Shard(shard.number, (item,)), write=False))
        else:
            failed = ItemResult(empty_row(shard.items[0].name, FAILED, lost.reason))
            self._add_item(Done(shard, (failed,)))

    def _give_up(self, task: Task, reason: str) -> None:
        """No worker is left: the shard is left to the next run."""
        number = task.shard.number
        if number not in self._problems:
            self._finish(Done(self._shards[number], (), problem=reason))

    def _add_item(self, done: Done) -> None:
        """Adds an item of a shard that is done item by item; the last one completes it."""
        number = done.shard.number
        items = self._split[number]
        items.update({result.row["name"]: result for result in done.results})
        self._inputs.setdefault(number, {}).update(done.inputs)
        shard = self._shards[number]
        if len(items) < len(shard.items):
            return
        results = tuple(items[item.name] for item in shard.items)
        del self._split[number]
        try:
            self._store.write(shard, results, self._inputs[number])
        except InputError as error:
            self._finish(Done(shard, (), problem=str(error)))
        else:
            self._finish(Done(shard, results))

    def _report(self) -> None:
        items = sum(len(shard.items) for shard in self._shards)
        seconds = time.perf_counter() - self._began
        self._progress = BatchProgress(items, self._done, self._before, self._failed, seconds)
        self._on_progress(self._progress)

    def _batch_report(self, table: pyarrow.Table) -> BatchReport:
        statuses = collections.Counter(str(status) for status in table["status"].to_pylist())
        unwritten: collections.Counter[str] = collections.Counter()
        for number, reason in self._problems.items():
            unwritten[reason] += len(self._shards[number].items)
        reasons: dict[str, list[str]] = {}
        rows = zip(*(table[column].to_pylist() for column in ("name", "digest", "message")), strict=True)
        for name, digest, message in rows:
            if digest is None and message not in unwritten:
                reasons.setdefault(str(message), []).append(str(name))
        problems = collections.Counter(code for codes in table["problems"].to_pylist() for code in codes)
        return BatchReport(
            self._store.folder,
            dict(statuses),
            dict(unwritten),
            self._progress,
            {reason: tuple(names) for reason, names in sorted(reasons.items(), key=lambda each: -len(each[1]))},
            sum(table["worn"].to_pylist()),
            dict(problems.most_common()),
        )

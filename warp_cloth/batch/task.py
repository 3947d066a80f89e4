"""A worker's task: fits a shard's items, even where single ones fail, and writes the shard's file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warp_cloth.base.errors import OVERRIDE, InputError, OutputError
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.batch.rows import FAILED, ItemResult, WornPoints, empty_row, row_of
from warp_cloth.batch.store import Shard, Store, file_marks
from warp_cloth.model.result import Status

if TYPE_CHECKING:
    from warp_cloth.base.mesh import Mesh
    from warp_cloth.batch.jobs import Item
    from warp_cloth.batch.loading import LoadCache
    from warp_cloth.fitting.fit import Fit
    from warp_cloth.maps.measure import MeasuredBody
    from warp_cloth.scene import Scene

SMALLER = "use fewer vertices, or a device with more memory"


class DeviceLostError(RuntimeError):
    """The device no longer responds: this process cannot continue, another one may."""


@dataclass(frozen=True)
class Task:
    """A shard, or some of its items, for a worker."""

    store: Store
    shard: Shard
    device: str
    write: bool = True  # whether the worker writes the shard's file; otherwise it returns the results
    fraction: float = 1.0  # of a GPU's memory, where other workers use it, too
    lease: Path | None = None  # file of the GPU's lease, see fit_many
    shared: Path | None = None  # folder of results that loaders of all workers share


@dataclass(frozen=True)
class Done:
    """Results of a task: rows only, where the worker has written the file."""

    shard: Shard
    results: tuple[ItemResult, ...]
    inputs: dict[str, list[int]] = field(default_factory=dict)
    problem: str = ""  # why the shard's file could not be written


def do_task(task: Task, load_cache: LoadCache | None = None) -> Done:
    """Fits a task's items, with what is loaded already.

    Raises:
        DeviceLostError: the device does not respond; nothing was written.
    """
    run = _TaskRun(task, load_cache)
    try:
        results = run.results()
    except OutputError as error:  # the kernel cache cannot be written
        return Done(task.shard, (), run.inputs, str(error))
    done = Done(task.shard, tuple(results), run.inputs)
    if not task.write:
        return done
    try:
        task.store.write(task.shard, results, run.inputs)
    except InputError as error:
        return Done(task.shard, (), run.inputs, str(error))
    return Done(task.shard, tuple(ItemResult(result.row) for result in results), run.inputs)


class _TaskRun:
    """Fits the items of one task."""

    def __init__(self, task: Task, load_cache: LoadCache | None) -> None:
        self._task, self._load_cache = task, load_cache
        self._files: set[Path] = set()
        self._body: MeasuredBody | None = None  # of the last item: those of a shard mostly have one

    @property
    def inputs(self) -> dict[str, list[int]]:
        """Size and modification time of every file that the task's scenes name."""
        return file_marks(list(self._files))

    def results(self) -> list[ItemResult]:
        items = self._task.shard.items
        found: dict[str, ItemResult] = {}
        scenes: list[tuple[Item, Scene]] = []
        for item in items:
            scene = self._scene(item)
            if isinstance(scene, ItemResult):
                found[item.name] = scene
            else:
                scenes.append((item, scene))
        if self._load_cache is not None:  # loads while this process starts Warp and its device
            self._load_cache.idle_work = self._task.store.preload_tables
            patches, shared = self._task.device != "cpu", self._task.shared
            self._load_cache.begin([scene for _, scene in scenes], patches=patches, shared=shared)
        import warp_cloth.batch.many  # noqa: F401 - while the driver initialises the device, for which Warp would wait

        start_warp()
        if not device_answers(self._task.device):
            raise DeviceLostError(f"{self._task.device} does not respond")
        for (item, _), result in zip(scenes, self._fitted(scenes), strict=True):
            found[item.name] = result
        return [found[item.name] for item in items]

    def _scene(self, item: Item) -> Scene | ItemResult:
        from warp_cloth.base.toml_file import toml_text
        from warp_cloth.scene import load_scene

        try:
            if item.problem:
                raise InputError(item.name, item.problem)
            scene = load_scene(item.source, (*item.changes, f"name={toml_text(item.name)}"))
        except InputError as error:
            return ItemResult(empty_row(item.name, Status.INVALID.value, _in_columns(error, item)))
        sources = [scene.avatar.mesh] if scene.avatar is not None else []
        for garment in scene.garments:
            sources += [garment.file, garment.grade_table, garment.grain_texture]
        self._files.update(path for path in sources if path is not None)
        return scene

    def _fitted(self, scenes: Sequence[tuple[Item, Scene]]) -> list[ItemResult]:
        from warp_cloth.base.forks import map_in_forks
        from warp_cloth.batch.many import fit_many
        from warp_cloth.batch.memory import available_bytes
        from warp_cloth.fitting.fit import Fit

        device = self._task.device
        budget = available_bytes(device, self._task.fraction)
        every = [scene for _, scene in scenes]
        fits = fit_many(every, device, budget=budget, load_cache=self._load_cache, lease=self._task.lease)
        if self._task.store.ease:
            copies = 0 if self._load_cache is None else self._load_cache.spare_cores
            for fit, girths in zip(fits, map_in_forks(self._girths, fits, copies), strict=True):
                if isinstance(fit, Fit):
                    fit.report.update(girths)
        return [self._result(item, fit) for (item, _), fit in zip(scenes, fits, strict=True)]

    def _girths(self, fit: Fit | Exception) -> dict[str, Any]:
        """What a fit's report is to say of girths; nothing where they cannot be measured."""
        from warp_cloth.maps.measure import girth_report

        if isinstance(fit, Exception) or fit.avatar is None:
            return {}
        try:
            return girth_report(fit, self._body_of(fit.avatar))
        except Exception:
            return {}  # storing the fit measures again, and says why

    def _body_of(self, avatar: Mesh) -> MeasuredBody:
        from warp_cloth.maps.measure import MeasuredBody

        if self._body is None or self._body.avatar is not avatar:
            self._body = MeasuredBody.of(avatar)
        return self._body

    def _result(self, item: Item, fit: Fit | Exception) -> ItemResult:
        try:
            if isinstance(fit, Exception):
                raise fit
            return self._stored(item, fit)
        except Exception as error:
            return ItemResult(self._failure(item, error))

    def _stored(self, item: Item, fit: Fit) -> ItemResult:
        """Writes an item's stage, or returns its points to be packed."""
        from warp_cloth.maps.measure import add_girths

        store = self._task.store
        if store.ease and fit.avatar is not None and "girths_mm" not in fit.report:
            add_girths(fit, self._body_of(fit.avatar))
        if store.keep == "stages":
            from warp_cloth.export.stage import write_stage

            path = store.stages / f"{item.name}.usdc"
            write_stage(path, garments=fit.garments, avatar=fit.avatar, name=item.name)
            return ItemResult(row_of(item.name, fit, f"stages/{path.name}", ease=store.ease))
        if store.keep == "none":
            return ItemResult(row_of(item.name, fit, "", ease=store.ease))
        worn = tuple(
            WornPoints(each.name, each.points, each.mesh.triangles, each.mesh.vertex_map) for each in fit.garments
        )
        file = f"shards/{self._task.shard.label}.npz"
        return ItemResult(row_of(item.name, fit, file, ease=store.ease), worn)

    def _failure(self, item: Item, error: Exception) -> dict[str, object]:
        """The row of an item that raised; DeviceLostError where no other item can be fitted here either."""
        if isinstance(error, InputError):
            status = FAILED if isinstance(error, OutputError) else Status.INVALID.value  # not the item's fault
            return empty_row(item.name, status, _in_columns(error, item))
        if out_of_memory(error):
            return empty_row(item.name, FAILED, f"out of memory on {self._task.device}; {SMALLER}")
        if not device_answers(self._task.device):
            raise DeviceLostError(f"{self._task.device} stopped responding: {error}") from error
        return empty_row(item.name, FAILED, f"{type(error).__name__}: {' '.join(str(error).split())}")


def _in_columns(error: InputError, item: Item) -> str:
    """The error in a job file's words: the column of the cell that is wrong, or that names the file that is."""
    if error.place.startswith(OVERRIDE):
        column = error.place.removeprefix(OVERRIDE).partition("=")[0]
        return str(InputError(f"column {column}", error.problem, error.remedy))
    cells = [(name, cell) for name, cell in item.columns.items() if isinstance(cell, str) and cell]
    # the end of a file's path, then a line number or a piece where known
    column = next((name for name, cell in cells if re.search(rf"(?:^|[/\\]){re.escape(cell)}(?:$|:)", error.place)), "")
    return f"column {column}: {error}" if column else str(error)


def out_of_memory(error: BaseException) -> bool:
    """Whether an error says that memory ran out, on the host or on a device."""
    if isinstance(error, MemoryError):
        return True
    text = str(error).lower()
    return isinstance(error, RuntimeError) and ("out of memory" in text or "failed to allocate" in text)


def device_answers(name: str) -> bool:
    """Whether a device still computes; after some errors CUDA refuses all work in the same process."""
    import warp as wp

    try:
        device = wp.get_device(name)
        if device.is_cuda:
            wp.synchronize_device(device)
            wp.zeros(1, dtype=wp.int32, device=device).numpy()
    except Exception:
        return False
    return True

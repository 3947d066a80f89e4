"""What a worker does: fits a shard's items, whatever befalls one of them, and writes the shard's file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from warp_cloth.base.errors import InputError, OutputError
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.batch.rows import FAILED, ItemResult, WornPoints, empty_row, row_of
from warp_cloth.batch.store import Shard, Store, file_marks
from warp_cloth.model.result import Status

if TYPE_CHECKING:
    from warp_cloth.batch.jobs import Item
    from warp_cloth.batch.loading import Shelf
    from warp_cloth.fitting.fit import Fit
    from warp_cloth.scene import Scene

SMALLER = "use fewer vertices, or a device with more memory"


class DeviceLostError(RuntimeError):
    """The device answers nothing any more: this process cannot go on, another may."""


@dataclass(frozen=True)
class Task:
    """A shard, or some of its items, for a worker."""

    store: Store
    shard: Shard
    device: str
    write: bool = True  # whether the worker writes the shard's file; otherwise its results go back to the asker
    share: float = 1.0  # of a GPU's memory, where other workers use it, too
    turn: Path | None = None  # by which they take turns there, as of fit_many
    common: Path | None = None  # the folder by which their helpers share what they work out


@dataclass(frozen=True)
class Done:
    """What came of a task. Rows only, where the worker has written the file."""

    shard: Shard
    results: tuple[ItemResult, ...]
    inputs: dict[str, list[int]] = field(default_factory=dict)
    problem: str = ""  # why the shard's file could not be written


def do_task(task: Task, shelf: Shelf | None = None) -> Done:
    """Fits a task's items; what a shelf has is taken from there.

    Raises:
        DeviceLostError: the device is gone; nothing was written.
    """
    worker = _Worker(task, shelf)
    try:
        results = worker.results()
    except OutputError as error:  # kernels cannot be kept
        return Done(task.shard, (), worker.inputs, str(error))
    done = Done(task.shard, tuple(results), worker.inputs)
    if not task.write:
        return done
    try:
        task.store.write(task.shard, results, worker.inputs)
    except InputError as error:
        return Done(task.shard, (), worker.inputs, str(error))
    return Done(task.shard, tuple(ItemResult(result.row) for result in results), worker.inputs)


class _Worker:
    """Carries out one task; item by item where a whole launch fails, so that only what is bad is lost."""

    def __init__(self, task: Task, shelf: Shelf | None) -> None:
        self._task, self._shelf = task, shelf
        self._files: set[Path] = set()

    @property
    def inputs(self) -> dict[str, list[int]]:
        """Size and time of every file that the task's scenes name."""
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
        if self._shelf is not None:  # while this process starts Warp and its device
            self._shelf.spare = self._task.store.get_ready
            patches, common = self._task.device != "cpu", self._task.common
            self._shelf.begin([scene for _, scene in scenes], patches=patches, common=common)
        import warp_cloth.batch.many  # noqa: F401, while the driver begins with the device: Warp would wait for that

        start_warp()
        if not device_answers(self._task.device):
            raise DeviceLostError(f"{self._task.device} does not answer")
        for (item, _), result in zip(scenes, self._fitted(scenes), strict=True):
            found[item.name] = result
        return [found[item.name] for item in items]

    def _scene(self, item: Item) -> Scene | ItemResult:
        from warp_cloth.batch.jobs import toml_text
        from warp_cloth.scene import load_scene

        try:
            if item.problem:
                raise InputError(item.name, item.problem)
            scene = load_scene(item.scene, (*item.changes, f"name={toml_text(item.name)}"))
        except InputError as error:
            return ItemResult(empty_row(item.name, Status.INVALID.value, str(error)))
        sources = [scene.avatar.mesh] if scene.avatar is not None else []
        for garment in scene.garments:
            sources += [garment.mesh, garment.grain_texture]
        self._files.update(path for path in sources if path is not None)
        return scene

    def _fitted(self, scenes: Sequence[tuple[Item, Scene]]) -> list[ItemResult]:
        from warp_cloth.batch.many import fit_many
        from warp_cloth.batch.memory import available_bytes

        device = self._task.device
        budget = available_bytes(device, self._task.share)
        fits = fit_many([scene for _, scene in scenes], device, budget=budget, shelf=self._shelf, turn=self._task.turn)
        return [self._result(item, fit) for (item, _), fit in zip(scenes, fits, strict=True)]

    def _result(self, item: Item, fit: Fit | Exception) -> ItemResult:
        try:
            if isinstance(fit, Exception):
                raise fit
            return self._kept(item, fit)
        except Exception as error:
            return ItemResult(self._failure(item, error))

    def _kept(self, item: Item, fit: Fit) -> ItemResult:
        """Writes an item's stage, or hands on its points to be packed."""
        store = self._task.store
        if store.keep == "stages":
            from warp_cloth.export.stage import write_stage

            path = store.stages / f"{item.name}.usdc"
            write_stage(path, garments=fit.garments, avatar=fit.avatar, name=item.name)
            return ItemResult(row_of(item.name, fit, f"stages/{path.name}"))
        if store.keep == "none":
            return ItemResult(row_of(item.name, fit, ""))
        worn = tuple(WornPoints(each.name, each.points, each.mesh.triangles) for each in fit.garments)
        return ItemResult(row_of(item.name, fit, f"shards/{self._task.shard.label}.npz"), worn)

    def _failure(self, item: Item, error: Exception) -> dict[str, object]:
        """The row of an item that raised; DeviceLostError where no other item can be done here either."""
        if isinstance(error, InputError):
            fault = FAILED if isinstance(error, OutputError) else Status.INVALID.value  # no fault of the item's
            return empty_row(item.name, fault, str(error))
        if out_of_memory(error):
            return empty_row(item.name, FAILED, f"out of memory on {self._task.device}; {SMALLER}")
        if not device_answers(self._task.device):
            raise DeviceLostError(f"{self._task.device} stopped answering: {error}") from error
        return empty_row(item.name, FAILED, f"{type(error).__name__}: {' '.join(str(error).split())}")


def out_of_memory(error: BaseException) -> bool:
    """Whether an error says that memory ran out, on the host or on a device."""
    if isinstance(error, MemoryError):
        return True
    told = str(error).lower()
    return isinstance(error, RuntimeError) and ("out of memory" in told or "failed to allocate" in told)


def device_answers(name: str) -> bool:
    """Whether a device still computes; after some errors CUDA refuses everything in the same process."""
    import warp as wp

    try:
        device = wp.get_device(name)
        if device.is_cuda:
            wp.synchronize_device(device)
            wp.zeros(1, dtype=wp.int32, device=device).numpy()
    except Exception:
        return False
    return True

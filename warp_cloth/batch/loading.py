"""Loader processes: they load meshes and compute rest shapes and patches in parallel with a worker."""

from __future__ import annotations

import contextlib
import logging
import multiprocessing
import os
import threading
from collections.abc import Callable, Hashable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from warp_cloth.base.cache import Cache
from warp_cloth.base.mesh import Indices
from warp_cloth.batch.arena import Arena
from warp_cloth.batch.lifeline import start_single_threaded
from warp_cloth.batch.loader_tasks import (
    Order,
    begin_loader,
    bundles,
    constants_file,
    cut_patches,
    load_meshes,
    make_rest_shape,
    orders_of,
    received,
)
from warp_cloth.batch.processes import process_context, start_forkserver
from warp_cloth.garment.outfit import Key, MeshCache
from warp_cloth.garment.rest import RestGeometry, in_geometry
from warp_cloth.scene import Scene

log = logging.getLogger(__name__)

LEAST_WORK = 8  # things to make for which loaders are started: starting takes as long as making a few
# Nice values of the loaders of workers 0, 1, ...: the garments of the second wait for the GPU anyway, and where cores
# are few a small difference would still give its loaders a third of their time.
NICENESS = (1, 6, 14, 19)
ARENA = 1 << 32  # [bytes] that a worker shares with its loaders at most: rest shapes of MOST_CACHED vertices
MOST_CACHED = 4_000_000  # vertices of the meshes kept from task to task; with rest shapes about 4 GB


@dataclass(frozen=True, eq=False)
class _RestOrder:
    """A garment's rest shape in a fabric, for loaders to make."""

    key: Key  # in a MeshCache
    geometry: RestGeometry
    panels: Hashable  # equal for garments of the same constants
    arguments: tuple[Scene, int, dict[Key, Any], Any]  # scene, index in it, cached meshes, own mesh as sent
    patches: bool  # whether to cut patches, too
    shared: Path | None  # file of the constants, shared with other workers


class LoadCache:
    """What a worker keeps from task to task: meshes and rest shapes that scenes share, and the loader processes."""

    def __init__(self, loader_count: int, *, fork: bool = False, rank: int = 0) -> None:
        """``fork`` and ``rank``: see Loaders."""
        self.loaders = Loaders(loader_count, fork=fork, rank=rank)
        self.idle_work: Callable[[], None] = lambda: None  # called once if there is time while loaders work
        self.mesh_cache, self.cache = MeshCache(), Cache()
        self.fresh = True  # nothing has been fitted in this process

    @property
    def spare_cores(self) -> int:
        """Cores that this worker's loaders leave idle once all is loaded."""
        return self.loaders.count

    def begin(self, scenes: Sequence[Scene], *, patches: bool, shared: Path | None = None) -> None:
        """Starts loading what scenes need (see Loaders.begin); tasks are submitted before this process imports more."""
        self.loaders.begin(self.mesh_cache, scenes, patches=patches, shared=shared).join()

    def trimmed(self) -> LoadCache:
        """This cache, emptied where it holds too much."""
        if self.mesh_cache.vertex_count > MOST_CACHED:
            self.mesh_cache, self.cache = MeshCache(), Cache()
        return self


class Loaders:
    """Fills mesh caches with what scenes need, each thing made once; ``count`` processes are started when first needed.

    A garment's mesh is one task, and each of its rest shapes another, as the finest garment would be waited for.

    ``fork``: started at once, as copies of this process, which must have neither threads nor a device yet. Loaders of
    the worker of ``rank`` 0 have priority over those of rank 1 and so on: one worker begins early, not all late.
    """

    def __init__(self, count: int, *, fork: bool = False, rank: int = 0) -> None:
        self.count = count
        self._pool: ProcessPoolExecutor | None = None
        self._changed = threading.Condition()
        self._open = 0  # tasks submitted whose results are not yet taken
        self._submitting: threading.Thread | None = None
        self._loaded: dict[Key, Any] = {}
        self._patches: dict[Hashable, Any] = {}
        self._waiting: dict[Hashable, list[_RestOrder]] = {}  # for constants being made for another body
        self._constants: dict[Hashable, tuple[Any, dict[str, Any], Indices]] = {}  # as sent, and as received
        self._broken: BrokenProcessPool | None = None
        self._arena: Arena | None = None
        if count and fork:
            with contextlib.suppress(OSError):  # a machine that does not overcommit memory
                self._arena = Arena(ARENA)
            begin = partial(begin_loader, self._arena, NICENESS[min(rank, len(NICENESS) - 1)])
            self._pool = ProcessPoolExecutor(count, multiprocessing.get_context("fork"), initializer=begin)
            self._pool.submit(os.getpid)  # forks all of them
        elif count:
            start_forkserver()

    def fill(
        self,
        mesh_cache: MeshCache,
        scenes: Sequence[Scene],
        cache: Cache | None = None,
        meanwhile: Callable[[], None] = lambda: None,
        idle_work: Callable[[], None] = lambda: None,
    ) -> None:
        """Makes what the scenes' outfits need and the cache lacks; ``load_outfit`` reports what fails.

        ``cache``, if given, receives the garments' patches. ``meanwhile`` runs here while loaders work, and
        ``idle_work`` if they still do afterwards.
        """
        if not self.count:
            return
        submitting = self._submitting or self.begin(mesh_cache, scenes, patches=cache is not None)
        self._submitting = None
        meanwhile()
        submitting.join()
        if self._open:
            idle_work()
        with self._changed:
            self._changed.wait_for(lambda: not self._open)
        mesh_cache.add_entries(self._loaded)
        if cache is not None:
            cache.add_entries(self._patches)
        self._loaded, self._patches, self._constants = {}, {}, {}
        self._waiting.clear()
        if self._broken is not None:
            log.warning("loader processes have died: %s", self._broken)
            self.count, self._pool, self._broken = 0, None, None

    def begin(
        self, mesh_cache: MeshCache, scenes: Sequence[Scene], *, patches: bool, shared: Path | None = None
    ) -> threading.Thread:
        """Starts loading; ``fill`` of the same scenes then waits for it.

        ``shared``: a folder of garments' constants, shared with the loaders of other workers.
        """
        self._submitting = threading.Thread(
            target=self._submit_orders, args=(mesh_cache, scenes, patches, shared), daemon=True
        )
        self._submitting.start()
        return self._submitting

    def _submit_orders(
        self, mesh_cache: MeshCache, scenes: Sequence[Scene], patches: bool, shared: Path | None
    ) -> None:
        """Submits what the cache lacks, each thing once."""
        if not self.count:
            return
        orders = orders_of(mesh_cache, scenes, patches)
        if not orders or (self._pool is None and sum(order.count for order in orders) < LEAST_WORK):
            return
        for bundle in bundles(orders, self.count):
            self._submit(load_meshes, bundle, shared, then=partial(self._submit_rest_shapes, bundle, shared))

    def close(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
            self._pool = None

    def _submit(self, work: Callable[..., Any], *arguments: Any, then: Callable[[Any], None]) -> None:
        """Submits work to a loader; ``then`` receives its result, in a thread of the pool."""
        with self._changed:
            self._open += 1
        try:
            self._started().submit(work, *arguments).add_done_callback(partial(self._receive, then))
        except (BrokenProcessPool, RuntimeError) as error:  # RuntimeError: it is shut down
            self._close_task(error)

    def _receive(self, then: Callable[[Any], None], future: Future[Any]) -> None:
        error = None if future.cancelled() else future.exception()
        try:
            if error is None and not future.cancelled():
                then(future.result())
        finally:
            self._close_task(error)

    def _close_task(self, error: BaseException | None) -> None:
        with self._changed:
            if isinstance(error, BrokenProcessPool):
                self._broken = error
            self._open -= 1
            self._changed.notify_all()

    def _submit_rest_shapes(self, bundle: Sequence[Order], shared: Path | None, results: Sequence[Any]) -> None:
        """Submits the rest shapes of meshes that are loaded.

        Patches are cut once for all woven fabrics and once for all others. The same panels on several bodies have the
        same constants, which are computed once.
        """
        for order, (sent, digest) in zip(bundle, results, strict=True):
            loaded = received(sent, self._arena)
            self._loaded.update(loaded)
            known = {**order.cached, **loaded}
            if order.geometry not in known:
                continue
            geometry = known[order.geometry]
            patched: set[bool] = set()
            for key, (scene, index) in order.garments.items():
                spec = scene.garments[index]
                patches = order.patches and spec.fabric.woven not in patched
                patched.add(spec.fabric.woven)
                panels = (digest, spec.fabric) if not spec.pin else key
                file = None if shared is None or spec.pin else shared / constants_file(digest, spec.fabric)
                arguments = scene, index, order.cached, sent
                self._submit_rest_shape(_RestOrder(key, geometry, panels, arguments, patches, file))

    def _submit_rest_shape(self, order: _RestOrder) -> None:
        """Submits a rest shape, unless its constants are known or being made for the same panels on another body."""
        with self._changed:
            known, waiting = self._constants.get(order.panels), self._waiting.get(order.panels)
            if known is None and waiting is not None:
                waiting.append(order)
                return
            if known is None:
                self._waiting[order.panels] = []
        if known is not None:
            self._reuse_constants(order, *known)
        else:
            then = partial(self._receive_constants, order)
            self._submit(make_rest_shape, *order.arguments, order.patches, order.shared, then=then)

    def _receive_constants(self, order: _RestOrder, sent: Any) -> None:
        """Stores a garment's rest shape, in the geometry that all its fabrics share, and those waiting for it."""
        constants, pins, patches = received(sent, self._arena)
        self._loaded[order.key] = in_geometry(constants, order.geometry), pins
        self._patches.update(patches)
        with self._changed:
            self._constants[order.panels] = sent, constants, pins
            waiting = self._waiting.pop(order.panels)
        for other in waiting:
            self._reuse_constants(other, sent, constants, pins)

    def _reuse_constants(self, order: _RestOrder, sent: Any, constants: dict[str, Any], pins: Indices) -> None:
        """Stores a garment's rest shape of the constants of the same panels on another body."""
        self._loaded[order.key] = in_geometry(constants, order.geometry), pins
        if order.patches:
            self._submit(cut_patches, *order.arguments, sent, then=self._receive_patches)

    def _receive_patches(self, sent: Any) -> None:
        self._patches.update(received(sent, self._arena))

    def _started(self) -> ProcessPoolExecutor:
        if self._pool is None:
            self._pool = ProcessPoolExecutor(self.count, process_context(), initializer=start_single_threaded)
        return self._pool

"""Helper processes that load meshes and work out rest shapes while the device, or nobody, waits for them."""

from __future__ import annotations

import contextlib
import hashlib
import logging
import multiprocessing
import os
import threading
from collections.abc import Callable, Hashable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warp_cloth.base.cache import Cache
from warp_cloth.base.mesh import Indices, Mesh
from warp_cloth.batch.arena import Arena, Parcel
from warp_cloth.batch.lifeline import begin_alone
from warp_cloth.batch.processes import context, get_ready
from warp_cloth.batch.shared_results import Drafts, once_for_all
from warp_cloth.garment.elements import garment_elements
from warp_cloth.garment.outfit import (
    GarmentKeys,
    Key,
    MeshCache,
    Recipe,
    avatar_recipe,
    garment_keys,
    generated_body,
    geometry_of,
    rest_of,
)
from warp_cloth.garment.part import GarmentPart, terms_of
from warp_cloth.garment.rest import RestGeometry, RestShape, in_geometry, own_constants, sheet_digest
from warp_cloth.kernels.base.options import block_for
from warp_cloth.model.patches.cutting import garment_patches, takes_pairs
from warp_cloth.scene import Scene
from warp_cloth.scene.predrape import dressing_of

if TYPE_CHECKING:
    from warp_cloth.material.fabric import Fabric

log = logging.getLogger(__name__)

WORTH = 8  # things to make that helpers are started for: that takes as long as making a few
# Steps of priority from each worker's helpers to those who fit: the garments of the second wait for the first one's
# anyway, and where cores are few a few steps would still give it a third of their time.
NICER = (1, 6, 14, 19)
ARENA = 1 << 32  # [bytes] that a worker shares with its helpers at most: rest shapes of MOST_KEPT vertices
MOST_KEPT = 4_000_000  # vertices of the meshes that a shelf keeps from task to task; with rest shapes about 4 GB


Dressed = tuple[dict[str, Any], Indices, dict[Hashable, Any]]  # constants of a garment in its fabric, pins, patches

_ARENA: ContextVar[Arena | None] = ContextVar("arena", default=None)  # where a helper puts what it makes


@dataclass(frozen=True, eq=False)
class Order:
    """What is made of one file or shape: an avatar, or a garment's mesh and its rest shapes in several fabrics."""

    avatar: Recipe | None = None
    garments: dict[Key, tuple[Scene, int]] = field(default_factory=dict)  # scene and number in it, by the rest shape
    geometry: Key = ()  # that these have in common
    known: dict[Key, Any] = field(default_factory=dict)  # of that and the mesh
    body: str = ""  # that is generated for it
    patches: bool = False  # whether to cut them, too

    @property
    def count(self) -> int:
        """Things to make."""
        return 1 if self.avatar is not None else len(self.garments) + 1

    @property
    def first(self) -> tuple[Scene, int]:
        """Scene and number in it of a garment of this mesh."""
        return next(iter(self.garments.values()))


@dataclass(frozen=True, eq=False)
class _Wanted:
    """A garment's rest shape in a fabric that helpers are to make."""

    key: Key  # in a MeshCache
    geometry: RestGeometry
    like: Hashable  # what has the same constants
    given: tuple[Scene, int, dict[Key, Any], Any]  # its scene and number there, what is known of it, its mesh as sent
    patches: bool  # whether to cut them, too
    common: Path | None  # the file by which other workers have its constants, too


class Shelf:
    """What a worker keeps from one task to the next: what scenes share, and who loads it."""

    def __init__(self, helpers: int, *, fork: bool = False, rank: int = 0) -> None:
        """``fork`` and ``rank`` as of Loaders."""
        self.loaders = Loaders(helpers, fork=fork, rank=rank)
        self.spare: Callable[[], None] = lambda: None  # what to do where there is time, while helpers work
        self.mesh_cache, self.cache = MeshCache(), Cache()
        self.fresh = True  # whether its process has fitted nothing yet

    def begin(self, scenes: Sequence[Scene], *, patches: bool, common: Path | None = None) -> None:
        """Has its loaders begin with what scenes need, as of Loaders; they are asked before this process imports."""
        self.loaders.begin(self.mesh_cache, scenes, patches=patches, common=common).join()

    def tidied(self) -> Shelf:
        """The shelf, emptied where it holds too much."""
        if self.mesh_cache.vertex_count > MOST_KEPT:
            self.mesh_cache, self.cache = MeshCache(), Cache()
        return self


class Loaders:
    """Fills mesh caches with what scenes need, each thing once; ``count`` helpers are started when first needed.

    A garment's mesh comes first, then its rest shapes, each a task of its own, as the finest garment is waited for.

    ``fork``: at once, as copies of this process. That must have neither threads nor a device yet. Those of the worker
    of ``rank`` 0 have the cores first, then those of rank 1, so that one begins early rather than all late.
    """

    def __init__(self, count: int, *, fork: bool = False, rank: int = 0) -> None:
        self._count = count
        self._pool: ProcessPoolExecutor | None = None
        self._changed = threading.Condition()
        self._open = 0  # tasks that helpers have, and what is made of these
        self._beginning: threading.Thread | None = None  # that asks for them
        self._made: dict[Key, Any] = {}
        self._patches: dict[Hashable, Any] = {}
        self._waiting: dict[Hashable, list[_Wanted]] = {}  # for constants that a helper works out for another body
        self._constants: dict[Hashable, tuple[Any, dict[str, Any], Indices]] = {}  # as they were sent, and taken
        self._broken: BrokenProcessPool | None = None
        self._arena: Arena | None = None
        if count and fork:
            with contextlib.suppress(OSError):  # a machine that promises no memory which is not used
                self._arena = Arena(ARENA)
            begin = partial(_begin, self._arena, NICER[min(rank, len(NICER) - 1)])
            self._pool = ProcessPoolExecutor(count, multiprocessing.get_context("fork"), initializer=begin)
            self._pool.submit(os.getpid)  # forks all of them
        elif count:
            get_ready()

    def fill(
        self,
        mesh_cache: MeshCache,
        scenes: Sequence[Scene],
        cache: Cache | None = None,
        meanwhile: Callable[[], None] = lambda: None,
        spare: Callable[[], None] = lambda: None,
    ) -> None:
        """Makes what the scenes' outfits are made of and the cache lacks; ``load_outfit`` reports what fails.

        ``cache``, where there is one, gets the garments' patches, too. ``meanwhile`` is done here while helpers work,
        and ``spare`` if they still do then.
        """
        if not self._count:
            return
        beginning = self._beginning or self.begin(mesh_cache, scenes, patches=cache is not None)
        self._beginning = None
        meanwhile()
        beginning.join()
        if self._open:
            spare()
        with self._changed:
            self._changed.wait_for(lambda: not self._open)
        mesh_cache.add_entries(self._made)
        if cache is not None:
            cache.add_entries(self._patches)
        self._made, self._patches, self._constants = {}, {}, {}
        self._waiting.clear()
        if self._broken is not None:
            log.warning("helpers that load are gone: %s", self._broken)
            self._count, self._pool, self._broken = 0, None, None

    def begin(
        self, mesh_cache: MeshCache, scenes: Sequence[Scene], *, patches: bool, common: Path | None = None
    ) -> threading.Thread:
        """Has helpers begin with what ``fill`` of the same scenes then waits for.

        ``common`` is a folder in which constants of garments are kept for other workers' helpers, and found.
        """
        self._beginning = threading.Thread(target=self._ask, args=(mesh_cache, scenes, patches, common), daemon=True)
        self._beginning.start()
        return self._beginning

    def _ask(self, mesh_cache: MeshCache, scenes: Sequence[Scene], patches: bool, common: Path | None) -> None:
        """Asks helpers for what the cache lacks, each thing once."""
        if not self._count:
            return
        orders: dict[Key, Order] = {}
        dressed: set[Key] = set()  # what garments are dressed in is asked for, too, once for all fabrics

        def ask(scene: Scene, index: int, keys: GarmentKeys) -> None:
            mesh, geometry, rest = keys
            if rest not in mesh_cache:
                known = mesh_cache.subset((mesh, geometry))
                order = Order(geometry=geometry, known=known, body=generated_body(scene), patches=patches)
                orders.setdefault(geometry, order).garments[rest] = scene, index

        for scene in scenes:
            for recipe in avatar_recipe(scene):
                if recipe.key not in mesh_cache:
                    orders[recipe.key] = Order(recipe, body=generated_body(scene))
            for index in range(len(scene.garments)):
                keys = garment_keys(scene, index)
                if keys.geometry not in dressed and (dressing := dressing_of(scene)) is not None:
                    dressed.add(keys.geometry)
                    ask(dressing, index, garment_keys(dressing, index))
                ask(scene, index, keys)
        if not orders or (self._pool is None and sum(order.count for order in orders.values()) < WORTH):
            return
        for bundle in bundles(list(orders.values()), self._count):
            self._submit(_meshes, bundle, common, then=partial(self._dress, bundle, common))

    def close(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
            self._pool = None

    def _submit(self, work: Callable[..., Any], *given: Any, then: Callable[[Any], None]) -> None:
        """Has a helper work; ``then`` takes what came of it, in a thread of the pool's."""
        with self._changed:
            self._open += 1
        try:
            self._started().submit(work, *given).add_done_callback(partial(self._came, then))
        except (BrokenProcessPool, RuntimeError) as error:  # RuntimeError: it is shut down
            self._end(error)

    def _came(self, then: Callable[[Any], None], future: Future[Any]) -> None:
        error = None if future.cancelled() else future.exception()
        try:
            if error is None and not future.cancelled():
                then(future.result())
        finally:
            self._end(error)

    def _end(self, error: BaseException | None) -> None:
        """Counts a task that has ended."""
        with self._changed:
            if isinstance(error, BrokenProcessPool):
                self._broken = error
            self._open -= 1
            self._changed.notify_all()

    def _dress(self, bundle: Sequence[Order], common: Path | None, found: Sequence[Any]) -> None:
        """Goes on from meshes to rest shapes; one that is woven, and one that is not, cut the patches for all such.

        The same panels on several bodies have the same constants, which are worked out once.
        """
        for order, (sent, digest) in zip(bundle, found, strict=True):
            made = _taken(sent, self._arena)
            self._made.update(made)
            known = {**order.known, **made}
            if order.geometry not in known:
                continue
            geometry = known[order.geometry]
            cut: set[bool] = set()
            for key, (scene, index) in order.garments.items():
                spec = scene.garments[index]
                patches = order.patches and spec.fabric.woven not in cut
                cut.add(spec.fabric.woven)
                like = (digest, spec.fabric) if not spec.pin else key
                file = None if common is None or spec.pin else common / _named(digest, spec.fabric)
                wanted = _Wanted(key, geometry, like, (scene, index, order.known, sent), patches, file)
                with self._changed:
                    there, waiting = self._constants.get(like), self._waiting.get(like)
                    if there is None and waiting is not None:
                        waiting.append(wanted)
                        continue
                    if there is None:
                        self._waiting[like] = []
                if there is not None:
                    self._share(wanted, *there)
                else:
                    self._submit(_dressed, *wanted.given, patches, file, then=partial(self._take, wanted))

    def _take(self, wanted: _Wanted, found: Any) -> None:
        """Keeps a garment's rest shape, in the geometry that all its fabrics have; others may be waiting for it."""
        constants, pins, patches = _taken(found, self._arena)
        self._made[wanted.key] = in_geometry(constants, wanted.geometry), pins
        self._patches.update(patches)
        with self._changed:
            self._constants[wanted.like] = found, constants, pins
            waiting = self._waiting.pop(wanted.like)
        for other in waiting:
            self._share(other, found, constants, pins)

    def _share(self, wanted: _Wanted, found: Any, constants: dict[str, Any], pins: Indices) -> None:
        """Keeps a garment's rest shape of the constants of the same panels on another body."""
        self._made[wanted.key] = in_geometry(constants, wanted.geometry), pins
        if wanted.patches:
            self._submit(_cut, *wanted.given, found, then=self._take_patches)

    def _take_patches(self, found: Any) -> None:
        self._patches.update(_taken(found, self._arena))

    def _started(self) -> ProcessPoolExecutor:
        if self._pool is None:
            self._pool = ProcessPoolExecutor(self._count, context(), initializer=begin_alone)
        return self._pool


def _named(digest: bytes, fabric: Fabric) -> str:
    """A file's name for the constants of panels of this fingerprint in a fabric."""
    return hashlib.sha256(digest + repr(fabric).encode()).hexdigest()


def _begin(arena: Arena | None, nicer: int) -> None:
    """A helper's beginning: what is large it puts into the arena of the worker that it was forked from."""
    _ARENA.set(arena)
    begin_alone()
    os.nice(nicer)


def _sent(thing: Any) -> Any:
    """What a helper sends instead of something large."""
    arena = _ARENA.get()
    return thing if arena is None else arena.put(thing)


def _taken(sent: Any, arena: Arena | None) -> Any:
    """What was meant by it."""
    return arena.take(sent) if isinstance(sent, Parcel) and arena is not None else sent


def bundles(orders: Sequence[Order], count: int) -> list[list[Order]]:
    """Orders as each of ``count`` helpers takes them: those with a generated body, which takes time, together."""
    each: dict[str, list[Order]] = {}
    for number, order in enumerate(orders):
        each.setdefault(order.body or f"{number}", []).append(order)
    most = -(-len(orders) // count)
    return [some[first : first + most] for some in each.values() for first in range(0, len(some), most)]


def _meshes(orders: Sequence[Order], common: Path | None) -> list[Any]:
    """The meshes that were ordered and the garments' geometries, as MeshCache entries; nothing of one that fails.

    Each as it is sent, with a fingerprint of the garment's panels. ``common`` is the folder of what others drafted.
    """
    found, drafts = [], Drafts(common)
    for order in orders:
        mesh_cache, digest = MeshCache(drafts), b""
        mesh_cache.add_entries(order.known)
        with contextlib.suppress(Exception):  # load_outfit reports why
            if order.avatar is not None:
                mesh_cache.make(order.avatar)
            else:
                mesh, geometry = geometry_of(*order.first, mesh_cache)
                digest = sheet_digest(geometry, mesh.vertex_count)
        found.append((_sent(mesh_cache.without(order.known)), digest))
    return found


def _dressed(scene: Scene, index: int, known: dict[Key, Any], made: Any, patches: bool, common: Path | None) -> Any:
    """A garment's constants in its fabric and its pins, and patches as a model of many garments asks for them.

    ``made`` is what ``_meshes`` sent of it, ``common`` the file that has the constants, or gets them. Returns Dressed,
    as it is sent.
    """
    mesh_cache = MeshCache()
    mesh_cache.add_entries({**known, **_taken(made, _ARENA.get())})

    def own() -> tuple[dict[str, Any], Indices]:
        rest, pins = rest_of(scene, index, mesh_cache)
        return own_constants(rest), pins

    constants, pins = own() if common is None else once_for_all(common, own)
    cut: dict[Hashable, Any] = {}
    if patches:
        mesh, geometry = geometry_of(scene, index, mesh_cache)
        cut = _patches_of(scene, mesh, in_geometry(constants, geometry), pins)
    dressed: Dressed = constants, pins, cut
    return _sent(dressed)


def _cut(scene: Scene, index: int, known: dict[Key, Any], made: Any, dressed: Any) -> Any:
    """The patches of a garment whose constants and pins were ``dressed`` on another body, as they are sent."""
    mesh_cache = MeshCache()
    mesh_cache.add_entries({**known, **_taken(made, _ARENA.get())})
    mesh, geometry = geometry_of(scene, index, mesh_cache)
    constants, pins, _ = _taken(dressed, _ARENA.get())
    return _sent(_patches_of(scene, mesh, in_geometry(constants, geometry), pins))


def _patches_of(scene: Scene, mesh: Mesh, rest: RestShape, pins: Indices) -> dict[Hashable, Any]:
    """A garment's patches as a model of many garments asks for them."""
    cache = Cache()
    part = GarmentPart(mesh.points, mesh.triangles, rest, pins)
    elements, terms = garment_elements(part.triangles, rest), terms_of([part])
    paired = takes_pairs(terms)
    how: dict[str, Any] = {"precision": scene.solver.precision, "size": block_for(paired).vertices, "paired": paired}
    garment_patches([elements], [part.points], terms, cache=cache, **how)
    return cache.portable_entries()

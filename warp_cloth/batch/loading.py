"""Helper processes that load meshes and work out rest shapes while the device, or nobody, waits for them."""

from __future__ import annotations

import contextlib
import logging
import multiprocessing
import os
from collections.abc import Callable, Hashable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from typing import Any

from warp_cloth.batch.lifeline import begin_alone
from warp_cloth.batch.processes import context, get_ready
from warp_cloth.elements import garment_elements
from warp_cloth.garment_part import GarmentPart, terms_of
from warp_cloth.kept import Kept
from warp_cloth.patches import LARGEST, garment_patches
from warp_cloth.scene import Scene
from warp_cloth.wardrobe import Key, Rack, Recipe, avatar_recipe, garment_keys, generated_body, mesh_recipes, rest_of

log = logging.getLogger(__name__)

WORTH = 8  # things to make that helpers are started for: that takes as long as making a few
MOST_KEPT = 4_000_000  # vertices of the meshes that a shelf keeps from task to task; with rest shapes about 4 GB


@dataclass(frozen=True, eq=False)
class Order:
    """What one helper makes: an avatar, or a garment's mesh and its rest shapes in several fabrics."""

    avatar: Recipe | None = None
    garments: dict[Key, tuple[Scene, int]] = field(default_factory=dict)  # scene and number in it, by the rest shape
    known: dict[Key, Any] = field(default_factory=dict)  # of the mesh and what is made of it
    body: str = ""  # that is generated for it
    patches: bool = False  # whether to cut them, too

    @property
    def count(self) -> int:
        """Things to make."""
        return 1 if self.avatar is not None else len(self.garments) + 1


class Shelf:
    """What a worker keeps from one task to the next: what scenes share, and who loads it."""

    def __init__(self, helpers: int, *, fork: bool = False) -> None:
        """``fork`` as of Loaders."""
        self.loaders = Loaders(helpers, fork=fork)
        self.rack, self.kept = Rack(), Kept()
        self.fresh = True  # whether its process has fitted nothing yet

    def tidied(self) -> Shelf:
        """The shelf, emptied where it holds too much."""
        if self.rack.vertex_count > MOST_KEPT:
            self.rack, self.kept = Rack(), Kept()
        return self


class Loaders:
    """Fills racks with what scenes need, each thing once; ``count`` helpers are started when first needed.

    ``fork``: at once, as copies of this process. That must have neither threads nor a device yet.
    """

    def __init__(self, count: int, *, fork: bool = False) -> None:
        self._count = count
        self._pool: ProcessPoolExecutor | None = None
        if count and fork:
            self._pool = ProcessPoolExecutor(count, multiprocessing.get_context("fork"), initializer=begin_alone)
            self._pool.submit(os.getpid)  # forks all of them
        elif count:
            get_ready()

    def fill(
        self,
        rack: Rack,
        scenes: Sequence[Scene],
        kept: Kept | None = None,
        meanwhile: Callable[[], None] = lambda: None,
    ) -> None:
        """Makes what the scenes' wardrobes are opened from and the rack has not; what fails is left to who opens.

        ``kept``, where there is one, gets the garments' patches, too. ``meanwhile`` is done here while helpers work.
        """
        orders: dict[Key, Order] = {}
        for scene in scenes:
            for recipe in avatar_recipe(scene):
                if recipe.key not in rack:
                    orders[recipe.key] = Order(recipe, body=generated_body(scene))
            for index in range(len(scene.garments)):
                mesh, geometry, rest = garment_keys(scene, index)
                if rest not in rack:
                    known = rack.some((mesh, geometry))
                    order = Order(known=known, body=generated_body(scene), patches=kept is not None)
                    orders.setdefault(mesh, order).garments[rest] = scene, index
        self._make(rack, kept, list(orders.values()), meanwhile)

    def close(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
            self._pool = None

    def _make(self, rack: Rack, kept: Kept | None, orders: Sequence[Order], meanwhile: Callable[[], None]) -> None:
        if self._count < 1 or (self._pool is None and sum(order.count for order in orders) < WORTH):
            return
        try:
            found = self._started().map(_made, bundles(orders, self._count))
            meanwhile()
            for made, patches in found:
                rack.put(made)
                if kept is not None:
                    kept.put(patches)
        except BrokenProcessPool as error:
            log.warning("helpers that load are gone: %s", error)
            self._count, self._pool = 0, None

    def _started(self) -> ProcessPoolExecutor:
        if self._pool is None:
            self._pool = ProcessPoolExecutor(self._count, context(), initializer=begin_alone)
        return self._pool


def bundles(orders: Sequence[Order], count: int) -> list[list[Order]]:
    """Orders as each of ``count`` helpers takes them: those with a generated body, which takes time, together."""
    each: dict[str, list[Order]] = {}
    for number, order in enumerate(orders):
        each.setdefault(order.body or f"{number}", []).append(order)
    most = -(-len(orders) // count)
    return [some[first : first + most] for some in each.values() for first in range(0, len(some), most)]


def _made(orders: Sequence[Order]) -> tuple[dict[Key, Any], dict[Hashable, Any]]:
    """What was ordered, as a rack keeps it, and patches; what fails is missing: who opens the wardrobe tells why."""
    rack, kept = Rack(), Kept()
    known: dict[Key, Any] = {}
    for order in orders:
        known.update(order.known)
        rack.put(order.known)
        if order.avatar is not None:
            with contextlib.suppress(Exception):
                rack.made(order.avatar)
        for scene, index in order.garments.values():
            with contextlib.suppress(Exception):
                rest, pins = rest_of(scene, index, rack)
                if order.patches:
                    mesh = rack.made(mesh_recipes(scene)[index])
                    _cut(GarmentPart(mesh.points, mesh.triangles, rest, pins), scene.solver.precision, kept)
    return rack.without(known), kept.of_values()


def _cut(part: GarmentPart, precision: str, kept: Kept) -> None:
    """Cuts a garment's patches as a model of many garments asks for them."""
    elements = garment_elements(part.triangles, part.rest)
    garment_patches([elements], [part.points], terms_of([part]), precision=precision, kept=kept, size=LARGEST)

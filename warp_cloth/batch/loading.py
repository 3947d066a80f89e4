"""Helper processes that load meshes and work out rest shapes while the device, or nobody, waits for them."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from warp_cloth.batch.lifeline import end_with_parent
from warp_cloth.batch.processes import context, get_ready
from warp_cloth.kept import Kept
from warp_cloth.scene import Scene
from warp_cloth.wardrobe import Rack, Recipe, mesh_recipes, rest_recipes

log = logging.getLogger(__name__)

WORTH = 8  # things to make that helpers are started for: that takes as long as making a few
MOST_KEPT = 4_000_000  # vertices of the meshes that a shelf keeps from task to task; with rest shapes about 4 GB
ONE_THREAD = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")


class Shelf:
    """What a worker keeps from one task to the next: what scenes share, and who loads it."""

    def __init__(self, helpers: int) -> None:
        self.loaders = Loaders(helpers)
        self.rack, self.kept = Rack(), Kept()

    def tidied(self) -> Shelf:
        """The shelf, emptied where it holds too much."""
        if self.rack.vertex_count > MOST_KEPT:
            self.rack, self.kept = Rack(), Kept()
        return self


class Loaders:
    """Fills racks with what scenes need, each thing once; ``count`` helpers are started when first needed."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._pool: ProcessPoolExecutor | None = None
        if count:
            os.environ.update(dict.fromkeys(ONE_THREAD, "1"))  # in helpers; here the libraries are loaded already
            get_ready()

    def fill(self, rack: Rack, scenes: Sequence[Scene]) -> None:
        """Makes what the scenes' wardrobes are opened from and the rack has not; what fails is left to who opens."""
        self._make(rack, (recipe for scene in scenes for recipe in mesh_recipes(scene)))
        ready = [scene for scene in scenes if all(recipe.key in rack for recipe in mesh_recipes(scene))]
        self._make(rack, (recipe for scene in ready for recipe in _rests(rack, scene)))

    def close(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
            self._pool = None

    def _make(self, rack: Rack, recipes: Iterable[Recipe]) -> None:
        wanted = {recipe.key: recipe for recipe in recipes if recipe.key not in rack}
        if self._count < 1 or (self._pool is None and len(wanted) < WORTH):
            return
        try:
            for key, made in zip(wanted, self._started().map(_made, wanted.values()), strict=True):
                if made is not None:
                    rack.put(key, made)
        except BrokenProcessPool as error:
            log.warning("helpers that load are gone: %s", error)
            self._count, self._pool = 0, None

    def _started(self) -> ProcessPoolExecutor:
        if self._pool is None:
            self._pool = ProcessPoolExecutor(self._count, context(), initializer=end_with_parent)
        return self._pool


def _rests(rack: Rack, scene: Scene) -> list[Recipe]:
    meshes = [rack.made(recipe) for recipe in mesh_recipes(scene)]
    return rest_recipes(scene, meshes[: len(scene.garments)])


def _made(recipe: Recipe) -> Any:
    try:
        return recipe.make()
    except Exception:
        return None  # who opens the wardrobe comes upon it, and tells

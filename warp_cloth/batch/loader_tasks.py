"""Tasks of loader processes: load meshes, compute rest shapes, cut patches; large results go into shared memory."""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Hashable, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warp_cloth.base.cache import Cache
from warp_cloth.base.mesh import Indices, Mesh
from warp_cloth.batch.arena import Arena, Parcel
from warp_cloth.batch.lifeline import start_single_threaded
from warp_cloth.batch.shared_results import SharedCache, get_or_make_shared
from warp_cloth.garment.elements import garment_elements
from warp_cloth.garment.garment import Garment, terms_of
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
from warp_cloth.garment.rest import RestShape, in_geometry, own_constants, sheet_digest
from warp_cloth.kernels.base.options import block_for
from warp_cloth.model.patches.cutting import garment_patches, takes_pairs
from warp_cloth.scene import Scene
from warp_cloth.scene.predrape import predrape_scene_of

if TYPE_CHECKING:
    from warp_cloth.material.fabric import Fabric

Dressed = tuple[dict[str, Any], Indices, dict[Hashable, Any]]  # constants of a garment in its fabric, pins, patches

_ARENA: ContextVar[Arena | None] = ContextVar("arena", default=None)  # where a loader puts its results


@dataclass(frozen=True, eq=False)
class Order:
    """What is made from one file or shape: an avatar, or a garment's mesh and its rest shapes in several fabrics."""

    avatar: Recipe | None = None
    garments: dict[Key, tuple[Scene, int]] = field(default_factory=dict)  # scene and index in it, by the rest shape
    geometry: Key = ()  # common to these
    cached: dict[Key, Any] = field(default_factory=dict)  # mesh and geometry, if made already
    body: str = ""  # generated for it
    patches: bool = False  # whether to cut patches, too

    @property
    def count(self) -> int:
        """Number of things to make."""
        return 1 if self.avatar is not None else len(self.garments) + 1

    @property
    def first(self) -> tuple[Scene, int]:
        """Scene, and index in it, of a garment of this mesh."""
        return next(iter(self.garments.values()))


def constants_file(digest: bytes, fabric: Fabric) -> str:
    """Name of the file of the constants of panels in a fabric."""
    return hashlib.sha256(digest + repr(fabric).encode()).hexdigest()


def begin_loader(arena: Arena | None, niceness: int) -> None:
    """Initialises a loader; large results go into the arena of the worker that it was forked from."""
    _ARENA.set(arena)
    start_single_threaded()
    os.nice(niceness)


def sent_form(result: Any) -> Any:
    """What a loader sends for a result: a parcel in the arena, if there is one."""
    arena = _ARENA.get()
    return result if arena is None else arena.put(result)


def received(sent: Any, arena: Arena | None) -> Any:
    """The result that was sent."""
    return arena.take(sent) if isinstance(sent, Parcel) and arena is not None else sent


def orders_of(mesh_cache: MeshCache, scenes: Sequence[Scene], patches: bool) -> list[Order]:
    """What the cache lacks of the scenes' avatars and garments."""
    orders: dict[Key, Order] = {}
    predraped: set[Key] = set()  # rest shapes for the predrape are needed once for all fabrics

    def add(scene: Scene, index: int, keys: GarmentKeys) -> None:
        mesh, geometry, rest = keys
        if rest not in mesh_cache:
            cached = mesh_cache.subset((mesh, geometry))
            order = Order(geometry=geometry, cached=cached, body=generated_body(scene), patches=patches)
            orders.setdefault(geometry, order).garments[rest] = scene, index

    for scene in scenes:
        for recipe in avatar_recipe(scene):
            if recipe.key not in mesh_cache:
                orders[recipe.key] = Order(recipe, body=generated_body(scene))
        for index in range(len(scene.garments)):
            keys = garment_keys(scene, index)
            if keys.geometry not in predraped and (predrape_scene := predrape_scene_of(scene)) is not None:
                predraped.add(keys.geometry)
                add(predrape_scene, index, garment_keys(predrape_scene, index))
            add(scene, index, keys)
    return list(orders.values())


def bundles(orders: Sequence[Order], count: int) -> list[list[Order]]:
    """Orders as tasks of ``count`` loaders: those of the same generated body, which takes time, together."""
    each: dict[str, list[Order]] = {}
    for number, order in enumerate(orders):
        each.setdefault(order.body or f"{number}", []).append(order)
    most = -(-len(orders) // count)
    return [some[first : first + most] for some in each.values() for first in range(0, len(some), most)]


def load_meshes(orders: Sequence[Order], shared: Path | None) -> list[Any]:
    """The meshes of orders and the garments' geometries, as MeshCache entries; none of an order that fails.

    Each as it is sent, with a digest of the garment's panels. ``shared``: the folder shared with other workers.
    """
    found, drafts = [], SharedCache(shared)
    for order in orders:
        mesh_cache, digest = MeshCache(drafts), b""
        mesh_cache.add_entries(order.cached)
        with contextlib.suppress(Exception):  # load_outfit reports why
            if order.avatar is not None:
                mesh_cache.make(order.avatar)
            else:
                mesh, geometry = geometry_of(*order.first, mesh_cache)
                digest = sheet_digest(geometry, mesh.vertex_count)
        found.append((sent_form(mesh_cache.without(order.cached)), digest))
    return found


def make_rest_shape(
    scene: Scene, index: int, cached: dict[Key, Any], sent: Any, patches: bool, shared: Path | None
) -> Any:
    """A garment's constants in its fabric, its pins, and its patches as a model of many garments needs them.

    ``sent``: its mesh, as ``load_meshes`` sent it. ``shared``: file of the constants. Returns Dressed, as it is sent.
    """
    mesh_cache = MeshCache()
    mesh_cache.add_entries({**cached, **received(sent, _ARENA.get())})

    def own() -> tuple[dict[str, Any], Indices]:
        rest, pins = rest_of(scene, index, mesh_cache)
        return own_constants(rest), pins

    constants, pins = own() if shared is None else get_or_make_shared(shared, own)
    cut: dict[Hashable, Any] = {}
    if patches:
        mesh, geometry = geometry_of(scene, index, mesh_cache)
        cut = _patches_of(scene, mesh, in_geometry(constants, geometry), pins)
    dressed: Dressed = constants, pins, cut
    return sent_form(dressed)


def cut_patches(scene: Scene, index: int, cached: dict[Key, Any], sent: Any, dressed: Any) -> Any:
    """The patches of a garment whose constants and pins were ``dressed`` on another body, as they are sent."""
    mesh_cache = MeshCache()
    mesh_cache.add_entries({**cached, **received(sent, _ARENA.get())})
    mesh, geometry = geometry_of(scene, index, mesh_cache)
    constants, pins, _ = received(dressed, _ARENA.get())
    return sent_form(_patches_of(scene, mesh, in_geometry(constants, geometry), pins))


def _patches_of(scene: Scene, mesh: Mesh, rest: RestShape, pins: Indices) -> dict[Hashable, Any]:
    """A garment's patches as a model of many garments needs them."""
    cache = Cache()
    garment = Garment(mesh.points, mesh.triangles, rest, pins)
    elements, terms = garment_elements(garment.triangles, rest), terms_of([garment])
    paired = takes_pairs(terms)
    options: dict[str, Any] = {
        "precision": scene.solver.precision,
        "size": block_for(paired).vertices,
        "paired": paired,
    }
    garment_patches([elements], [garment.points], terms, cache=cache, **options)
    return cache.portable_entries()

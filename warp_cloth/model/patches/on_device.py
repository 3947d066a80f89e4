"""Patches of the cloth on a device: their tables, and the permutation of vertices into the patches' order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.base.cache import Cache
from warp_cloth.base.mesh import Points
from warp_cloth.base.threads import concatenate
from warp_cloth.garment.elements import Elements
from warp_cloth.kernels.base.options import FEW, Terms, block_for
from warp_cloth.kernels.base.types import Patch
from warp_cloth.model.patches.block_memory import beyond_bits
from warp_cloth.model.patches.cutting import even_size, garment_patches, joined_rows, takes_pairs
from warp_cloth.model.patches.tables import PatchTables
from warp_cloth.model.patches.tiles import with_constants
from warp_cloth.model.permutation import Permutation
from warp_cloth.model.upload import upload_concatenated

PER_CORE_LAYERED = 1  # patches on each core of a large GPU, at least, where layered garments are in contact
AT_REST_FRACTION = 0.125  # of the launched patches that may belong to finished items: their blocks end at once


@dataclass(eq=False)
class Patches:
    """The cloth cut into patches, one thread block each. The first ``count`` are launched."""

    rows: NDArray[np.int32]  # kernels.base.types.Patch of each patch, shape [P, 16]
    item: NDArray[np.int32]  # that each belongs to, shape [P]
    tables: Any  # kernels.base.types Patches
    packed_tables: tuple[Any, Any]  # for vertices in the patches' order: forwards, and last patch first
    permutation: Permutation  # of the vertices into the patches' order, on the host
    order: wp.array  # vertices that the patches own, one patch after another
    rank: wp.array  # position of each vertex in ``order``
    overflow: wp.array  # memory of patches that are too large for a block's shared memory
    few: bool  # whether each core runs few of them at a time
    count: int = field(init=False)
    fits: bool = field(init=False)  # whether none is too large for shared memory
    paired: bool = field(init=False)  # whether threads work on pairs

    def __post_init__(self) -> None:
        self.count = len(self.rows)
        self.fits = wp.get_device(self.overflow.device).is_cuda and not len(self.overflow)
        self.paired = bool(self.rows[:, list(Patch.vars).index("tile_count")].any())

    def work_on(self, active: NDArray[np.bool_]) -> bool:
        """Launches the patches of active items only; returns whether their number has changed.

        Where few others are launched nothing changes, as a patch at rest takes little time.
        """
        chosen = np.flatnonzero(active[self.item])
        wanted = len(chosen)
        if not wanted or wanted <= self.count <= wanted + AT_REST_FRACTION * wanted:
            return False
        rows = self.rows[chosen].reshape(wanted, -1, 4)
        for tables, some in ((self.tables, rows), (self.packed_tables[1], rows[::-1])):
            tables.patch[: 4 * wanted].assign(np.ascontiguousarray(some).reshape(-1, 4))
        self.count = wanted
        return True


@dataclass(frozen=True)
class CutOptions:
    """How cloth is cut into patches; its results do not depend on that."""

    layered: bool = False  # whether garments lie on each other in contact: blocks that compute it share the cores
    like: int | None = None  # vertex count of the model as whose patches these are cut; None: as many as there are


@dataclass(frozen=True, eq=False)
class PatchSource:
    """What ``device_patches`` cuts into patches."""

    garments: Sequence[Elements]
    rounded: Sequence[Elements]  # the same in the device's precision
    points: Sequence[Points]  # of each garment's vertices as loaded [m]
    terms: Terms  # that act in the cloth
    item_start: tuple[int, ...]  # first vertex of each item, and the number of all
    cut: CutOptions


def device_patches(source: PatchSource, types: Any, device: str, cache: Cache) -> Patches:
    """Cuts the cloth into patches of vertices that are near as loaded, and uploads them.

    ``types`` are kernels.base.types of a precision; ``cache`` has what garments share with earlier models.
    """
    terms, gpu = source.terms, wp.get_device(device).is_cuda
    each = _cut(source, types.name, cache)
    patch, overflowing = joined_rows(each, terms, precision=types.name, own_memory=gpu)
    constants = cache.get_or_make_each(
        "constants", list(zip(source.rounded, each, strict=True)), partial(_patch_constants, terms=terms), terms
    )
    rows = _patch_rows(source, each, patch, constants)
    packings = cache.get_or_make_each("packing", [(own,) for own in each], _packing)
    start: list[int] = np.cumsum([0, *(len(part) for part in source.points)]).tolist()  # of each garment's vertices
    paired = bool(rows["tile_count"].any())

    def packing(name: str) -> wp.array:
        """Numbers of vertices, of all garments' patches."""
        return upload_concatenated([getattr(own, name) for own in packings], wp.int32, device=device, starts=start)

    tables = _tables(types, terms, device, each, constants, paired=paired)
    wide = np.zeros((len(rows), 16), dtype=np.int32)
    wide[:, : rows.dtype.itemsize // 4] = rows.view(np.int32).reshape(len(rows), -1)
    tables.patch = wp.array(wide.reshape(-1, 4), dtype=wp.vec4i, device=device)
    tables.vertex = packing("vertex")
    block = block_for(paired)
    tables.ahead = wp.get_device(device).sm_count * block.per_core if gpu else 0
    packed, back = types.Patches(), types.Patches()
    for name in types.Patches.vars:
        if getattr(tables, name) is not None:
            setattr(packed, name, getattr(tables, name))
            setattr(back, name, getattr(tables, name))
    packed.vertex = back.vertex = packing("packed_vertex")
    back.patch = wp.array(_last_first(wide, len(wide)).reshape(-1, 4), dtype=wp.vec4i, device=device)
    overflow = wp.empty(overflowing, dtype=wp.uint8, device=device)
    few = max(len(rows), 0 if source.cut.like is None else source.cut.like // block.vertices) <= FEW
    permutation = Permutation(concatenate([own.order for own in packings], start))
    places = packing("order"), packing("rank")
    return Patches(wide, rows["item"], tables, (packed, back), permutation, *places, overflow, few)


def _cut(source: PatchSource, precision: str, cache: Cache) -> list[PatchTables]:
    """Each garment's patches; with pairs of triangles where these are faster and can be numbered (``beyond_bits``)."""
    vertices = sum(len(part) for part in source.points) if source.cut.like is None else source.cut.like

    def cut_as(paired: bool) -> list[PatchTables]:
        block = block_for(paired)
        size = even_size(vertices, block, PER_CORE_LAYERED) if source.cut.layered else even_size(vertices, block)
        return garment_patches(
            source.garments,
            source.points,
            source.terms,
            precision=precision,
            cache=cache,
            size=size,
            paired=paired,
        )

    each = cut_as(takes_pairs(source.terms, vertices))
    return cut_as(False) if any(beyond_bits(own.patch).any() for own in each) else each


def _patch_rows(
    source: PatchSource,
    each: Sequence[PatchTables],
    patch: dict[str, NDArray[Any]],
    constants: Sequence[dict[str, NDArray[Any]]],
) -> NDArray[Any]:
    """Rows of kernels.base.types.Patch of all garments."""
    rows = np.zeros(len(patch["vertex_start"]), dtype=Patch.numpy_dtype())
    for name, numbers in patch.items():
        rows[name] = numbers
    table = "edge_constants" if source.terms.edges else "hinge_stiffness"
    if table in constants[0]:
        begin = [int(end) for end in np.cumsum([0, *(len(own[table]) for own in constants[:-1])])]
        rows["constants_start"] = concatenate([own["constants_start"] for own in constants], begin)
        rows["constants_count"] = concatenate([own["constants_count"] for own in constants])
    first = np.cumsum([0, *(len(part) for part in source.points[:-1])])  # vertex of each garment
    of_garment = np.searchsorted(source.item_start, first, side="right") - 1
    rows["item"] = np.repeat(of_garment, [len(own.patch["vertex_start"]) for own in each])
    owned = rows["owned_count"]
    rows["place"] = np.cumsum(owned, dtype=np.int32) - owned
    return rows


def _tables(
    types: Any,
    terms: Terms,
    device: str,
    each: Sequence[PatchTables],
    constants: Sequence[dict[str, NDArray[Any]]],
    *,
    paired: bool,
) -> Any:
    """Tables of the terms in use; idle threads load, and discard, the row ``more`` at the end."""

    def laid(name: str, dtype: Any, *, more: int = 0) -> wp.array:
        """A table of all garments' patches."""
        return upload_concatenated([getattr(own, name) for own in each], dtype, device=device, more=more)

    def constant(name: str, dtype: Any, *, more: int = 0) -> wp.array:
        """Likewise of their constants."""
        return upload_concatenated([own[name] for own in constants], dtype, device=device, more=more)

    tables = types.Patches()
    if terms.edges or terms.folds:
        tables.ends = constant("ends", wp.uint64, more=1)
    if terms.edges:
        tables.edge_constants = constant("edge_constants", types.vec4, more=1)
        tables.edge_slot = laid("edge_slot", wp.vec4i)
    if terms.folds and not paired:
        tables.sides = laid("sides", wp.uint64, more=1)
    if terms.folds and not terms.edges:
        tables.hinge_stiffness = constant("hinge_stiffness", types.real, more=1)
    if terms.angles:
        tables.rest = constant("rest", types.vec2)
    if terms.hysteresis:
        tables.hysteresis = constant("hysteresis", types.vec4)
    if terms.folds or terms.yarns:
        tables.corners = laid("corners", wp.uint64, more=1)
        tables.slot = laid("slot", wp.vec4i)
    if terms.yarns:
        tables.slope = constant("slope", types.vec4)
        tables.yarns = constant("yarns", types.vec4)
    if terms.shear_hysteresis:
        tables.shear_hysteresis = constant("shear_hysteresis", types.vec3)
    return tables


def _last_first(rows: NDArray[np.int32], count: int) -> NDArray[np.int32]:
    """Rows, the first ``count`` of them in the opposite order."""
    return np.concatenate([rows[:count][::-1], rows[count:]])


def _patch_constants(elements: Elements, tables: PatchTables, terms: Terms) -> dict[str, NDArray[Any]]:
    """Constants of a garment's patches in the patches' order, and the words of their edges, of the terms in use."""
    found: dict[str, NDArray[Any]] = {}
    if terms.edges or terms.folds:
        table = "edge_constants" if terms.edges else "hinge_stiffness"
        stiffness = elements.hinge_stiffness[tables.edge]
        own = np.column_stack([elements.spring[tables.edge], stiffness]) if terms.edges else stiffness[:, None]
        ends, start, count = tables.ends, tables.patch["edge_start"], tables.patch["edge_count"]
        if tables.patch["tile_count"].any():
            ends, own, start, count = with_constants(ends, tables.patch, own)
        found = {"ends": ends, table: own if terms.edges else own[:, 0]}
        found["constants_start"], found["constants_count"] = start, count
    if terms.angles:
        found["rest"] = elements.rest[tables.edge]
    if terms.hysteresis:
        found["hysteresis"] = elements.hysteresis[tables.edge]
    if terms.yarns:
        found["slope"], found["yarns"] = elements.slope[tables.triangle], elements.yarns[tables.triangle]
    if terms.shear_hysteresis:
        found["shear_hysteresis"] = elements.shear_hysteresis[tables.triangle]
    return found


@dataclass(frozen=True, eq=False)
class _Packing:
    """Vertex numbers of a garment's patches, from its first vertex on."""

    vertex: NDArray[np.int32]  # of every patch, one after another
    packed_vertex: NDArray[np.int32]  # the same in the patches' order
    order: NDArray[np.int32]  # vertices that the patches own, one patch after another, shape [V]
    rank: NDArray[np.int32]  # position of each vertex in ``order``, shape [V]


def _packing(tables: PatchTables) -> _Packing:
    """The packing of a garment's patches, which own its vertices and no others."""
    owned, vertex = tables.patch["owned_count"], tables.vertex.astype(np.int32)
    lane = np.arange(owned.sum(), dtype=np.int64) - np.repeat(np.cumsum(owned) - owned, owned)
    order = vertex[np.repeat(tables.patch["vertex_start"], owned) + lane]
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order), dtype=order.dtype)
    return _Packing(vertex, rank[vertex], order, rank)

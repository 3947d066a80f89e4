"""The cloth cut into patches, as it lies on a device."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
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
from warp_cloth.model.patches.cutting import (
    PatchTables,
    beyond_words,
    even_size,
    garment_patches,
    joined_rows,
    takes_pairs,
)
from warp_cloth.model.patches.triangle_pairs import with_laws
from warp_cloth.model.permutation import Permutation
from warp_cloth.model.upload import joined

PER_CORE_LAYERED = 1  # patches on each core of a large GPU, at least, where garments that meet lie on each other
SHARE_AT_REST = 0.125  # of the patches at work, those of items that have ended: their blocks start, and end at once


class Patches:
    """The cloth cut into patches, each of which a thread block works out. The first ``count`` are worked on."""

    def __init__(
        self,
        rows: NDArray[np.int32],
        item: NDArray[np.int32],
        tables: Any,
        packed_tables: tuple[Any, Any],
        permutation: Permutation,
        order: wp.array,
        rank: wp.array,
        overflow: wp.array,
        few: bool,
    ) -> None:
        """``rows`` are kernels.base.types Patch, each of an ``item``, shape [P, 16]; the rest as of the attributes."""
        self._rows, self._item = rows, item
        self.tables = tables  # kernels.base.types Patches
        self.packed_tables = packed_tables  # the same for vertices in the patches' order; and last patches first
        self.permutation = permutation  # of the vertices in that order, on the host
        self.order = order  # that order: of each patch the vertices that it owns
        self.rank = rank  # where each vertex is in it
        self.overflow = overflow  # memory of patches that are too large for a block's own
        self.fits = wp.get_device(overflow.device).is_cuda and not len(overflow)  # whether none is
        self.paired = bool(rows[:, list(Patch.vars).index("item_count")].any())  # whether threads work on pairs
        self.few = few  # so that cores have few of them at a time
        self.count = len(rows)

    def work_on(self, active: NDArray[np.bool_]) -> bool:
        """Puts the patches of active items first, the others out of work; whether their number has changed.

        Where few of those at work are of other items that is not worth it, as a patch at rest takes little time.
        """
        chosen = np.flatnonzero(active[self._item])
        wanted = len(chosen)
        if not wanted or wanted <= self.count <= wanted + SHARE_AT_REST * wanted:
            return False
        rows = self._rows[chosen].reshape(wanted, -1, 4)
        for tables, some in ((self.tables, rows), (self.packed_tables[1], rows[::-1])):
            tables.patch[: 4 * wanted].assign(np.ascontiguousarray(some).reshape(-1, 4))
        self.count = wanted
        return True


@dataclass(frozen=True, eq=False)
class PatchSource:
    """What a model cuts into patches.

    garments: the elements of each garment; ``rounded``: in the device's precision.
    points: where each garment's vertices lie as loaded [m].
    terms: what acts in the cloth.
    item_start: first vertex of each item, and the number of all.
    layered: whether garments lie on each other and meet: while patches are computed, a core's other blocks press.
    like: vertices of a model that they are cut, and computed, as if they were of; None: as many as there are.
    """

    garments: Sequence[Elements]
    rounded: Sequence[Elements]
    points: Sequence[Points]
    terms: Terms
    item_start: tuple[int, ...]
    layered: bool = False
    like: int | None = None


def device_patches(source: PatchSource, types: Any, device: str, cache: Cache) -> Patches:
    """The cloth cut into patches of vertices that lie together as loaded, on a device.

    ``types`` are kernels.base.types of a precision; ``cache`` has what garments share with earlier models.
    """
    terms, gpu = source.terms, wp.get_device(device).is_cuda
    each = _cut(source, types.name, cache)
    patch, overflowing = joined_rows(each, terms, precision=types.name, own_memory=gpu)
    laws = cache.get_or_make_each(
        "laws", list(zip(source.rounded, each, strict=True)), partial(_patch_laws, terms=terms), terms
    )
    rows = _patch_rows(source, each, patch, laws)
    packings = cache.get_or_make_each("packing", [(own,) for own in each], _packing)
    start: list[int] = np.cumsum([0, *(len(part) for part in source.points)]).tolist()  # of each garment's vertices
    paired = bool(rows["item_count"].any())

    def packing(name: str) -> wp.array:
        """Numbers of vertices, of all garments' patches."""
        return joined([getattr(own, name) for own in packings], wp.int32, device=device, starts=start)

    tables = _tables(types, terms, device, each, laws, paired=paired)
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
    few = max(len(rows), 0 if source.like is None else source.like // block.vertices) <= FEW
    permutation = Permutation(concatenate([own.order for own in packings], start))
    places = packing("order"), packing("rank")
    return Patches(wide, rows["item"], tables, (packed, back), permutation, *places, overflow, few)


def _cut(source: PatchSource, precision: str, cache: Cache) -> list[PatchTables]:
    """Each garment's patches; of pairs of triangles where those serve, and their words have room."""
    vertices = sum(len(part) for part in source.points) if source.like is None else source.like

    def cut_as(paired: bool) -> list[PatchTables]:
        block = block_for(paired)
        size = even_size(vertices, block, PER_CORE_LAYERED) if source.layered else even_size(vertices, block)
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
    return cut_as(False) if any(beyond_words(own.patch).any() for own in each) else each


def _patch_rows(
    source: PatchSource,
    each: Sequence[PatchTables],
    patch: dict[str, NDArray[Any]],
    laws: Sequence[dict[str, NDArray[Any]]],
) -> NDArray[Any]:
    """The rows of kernels.base.types Patch, of all garments."""
    rows = np.zeros(len(patch["vertex_start"]), dtype=Patch.numpy_dtype())
    for name, numbers in patch.items():
        rows[name] = numbers
    table = "law" if source.terms.edges else "hinge_stiffness"
    if table in laws[0]:
        begin = [int(end) for end in np.cumsum([0, *(len(own[table]) for own in laws[:-1])])]
        rows["law_start"] = concatenate([own["law_start"] for own in laws], begin)
        rows["law_count"] = concatenate([own["law_count"] for own in laws])
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
    laws: Sequence[dict[str, NDArray[Any]]],
    *,
    paired: bool,
) -> Any:
    """The tables of the terms that there are; threads that find nothing left load one row ``more``, and discard it."""

    def laid(name: str, dtype: Any, *, more: int = 0) -> wp.array:
        """A table of all garments' patches."""
        return joined([getattr(own, name) for own in each], dtype, device=device, more=more)

    def law(name: str, dtype: Any, *, more: int = 0) -> wp.array:
        """Likewise of what acts in them."""
        return joined([own[name] for own in laws], dtype, device=device, more=more)

    tables = types.Patches()
    if terms.edges or terms.folds:
        tables.ends = law("ends", wp.uint64, more=1)
    if terms.edges:
        tables.law = law("law", types.vec4, more=1)
        tables.edge_slot = laid("edge_slot", wp.vec4i)
    if terms.folds and not paired:
        tables.sides = laid("sides", wp.uint64, more=1)
    if terms.folds and not terms.edges:
        tables.hinge_stiffness = law("hinge_stiffness", types.real, more=1)
    if terms.angles:
        tables.rest = law("rest", types.vec2)
    if terms.folds or terms.yarns:
        tables.corners = laid("corners", wp.uint64, more=1)
        tables.slot = laid("slot", wp.vec4i)
    if terms.yarns:
        tables.slope = law("slope", types.vec4)
        tables.yarns = law("yarns", types.vec4)
    return tables


def _last_first(rows: NDArray[np.int32], count: int) -> NDArray[np.int32]:
    """Rows, the first ``count`` of them in the opposite order."""
    return np.concatenate([rows[:count][::-1], rows[count:]])


def _patch_laws(elements: Elements, tables: PatchTables, terms: Terms) -> dict[str, NDArray[Any]]:
    """What acts in a garment's patches, in their order, and their edges' words; nothing of terms that there are not."""
    laws: dict[str, NDArray[Any]] = {}
    if terms.edges or terms.folds:
        table = "law" if terms.edges else "hinge_stiffness"
        stiffness = elements.hinge_stiffness[tables.edge]
        law = np.column_stack([elements.law[tables.edge], stiffness]) if terms.edges else stiffness[:, None]
        ends, start, count = tables.ends, tables.patch["edge_start"], tables.patch["edge_count"]
        if tables.patch["item_count"].any():
            ends, law, start, count = with_laws(ends, tables.patch, law)
        laws = {"ends": ends, table: law if terms.edges else law[:, 0], "law_start": start, "law_count": count}
    if terms.angles:
        laws["rest"] = elements.rest[tables.edge]
    if terms.yarns:
        laws["slope"], laws["yarns"] = elements.slope[tables.triangle], elements.yarns[tables.triangle]
    return laws


@dataclass(frozen=True, eq=False)
class _Packing:
    """Numbers of a garment's vertices, from its first one on."""

    vertex: NDArray[np.int32]  # of each patch, one after another
    packed_vertex: NDArray[np.int32]  # the same in the patches' order
    order: NDArray[np.int32]  # that order: of each patch the vertices that it owns, shape [V]
    rank: NDArray[np.int32]  # where each vertex is in it, shape [V]


def _packing(tables: PatchTables) -> _Packing:
    """That of a garment's patches, which own its vertices and no others."""
    owned, vertex = tables.patch["owned_count"], tables.vertex.astype(np.int32)
    lane = np.arange(owned.sum(), dtype=np.int64) - np.repeat(np.cumsum(owned) - owned, owned)
    order = vertex[np.repeat(tables.patch["vertex_start"], owned) + lane]
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order), dtype=order.dtype)
    return _Packing(vertex, rank[vertex], order, rank)

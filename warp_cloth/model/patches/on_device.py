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
from warp_cloth.model.permutation import Numbering

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
        numbering: Numbering,
        order: wp.array,
        rank: wp.array,
        overflow: wp.array,
        few: bool,
    ) -> None:
        """``rows`` are kernels.base.types Patch, each of an ``item``, shape [P, 16]; the rest as of the attributes."""
        self._rows, self._item = rows, item
        self.tables = tables  # kernels.base.types Patches
        self.packed_tables = packed_tables  # the same for vertices in the patches' order; and last patches first
        self.numbering = numbering  # of the vertices in that order, on the host
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


def device_patches(
    types: Any,
    lay: Any,
    garments: Sequence[Elements],
    given: Sequence[Elements],
    points: Sequence[Points],
    terms: Terms,
    item_start: tuple[int, ...],
    device: str,
    cache: Cache,
    *,
    layered: bool = False,
    like: int | None = None,
) -> Patches:
    """The cloth cut into patches of vertices that lie together as loaded.

    Args:
        types: kernels.base.types types of a precision.
        lay: puts the garments' arrays end to end on the device, as ``joined``.
        garments: the elements of each garment.
        given: the same in the device's precision.
        points: where each garment's vertices lie as loaded [m].
        terms: what there is to work out.
        item_start: first vertex of each item, and the number of all.
        device: Warp's name of it.
        cache: what garments share with earlier models.
        layered: whether garments lie on each other and meet: while patches are worked out, a core's other blocks press.
        like: vertices of a model that they are cut, and worked out, as if they were of; None: as many as there are.
    """
    own_memory = wp.get_device(device).is_cuda
    vertices = sum(len(part) for part in points) if like is None else like

    def cut_as(paired: bool) -> list[PatchTables]:
        block = block_for(paired)
        size = even_size(vertices, block, PER_CORE_LAYERED) if layered else even_size(vertices, block)
        return garment_patches(garments, points, terms, precision=types.name, cache=cache, size=size, paired=paired)

    each = cut_as(takes_pairs(terms, vertices))
    if any(beyond_words(own.patch).any() for own in each):
        each = cut_as(False)
    patch, overflowing = joined_rows(each, terms, precision=types.name, own_memory=own_memory)
    laws = cache.get_or_make_each("laws", list(zip(given, each, strict=True)), partial(_patch_laws, terms=terms), terms)
    table = "law" if terms.edges else "hinge_stiffness"
    rows = np.zeros(len(patch["vertex_start"]), dtype=Patch.numpy_dtype())
    for name, numbers in patch.items():
        rows[name] = numbers
    if table in laws[0]:
        begin = [int(end) for end in np.cumsum([0, *(len(own[table]) for own in laws[:-1])])]
        rows["law_start"] = concatenate([own["law_start"] for own in laws], begin)
        rows["law_count"] = concatenate([own["law_count"] for own in laws])
    start: list[int] = np.cumsum([0, *(len(part) for part in points)]).tolist()  # of each garment's vertices
    of_garment = np.searchsorted(item_start, start[:-1], side="right") - 1
    rows["item"] = np.repeat(of_garment, [len(own.patch["vertex_start"]) for own in each])
    owned = rows["owned_count"]
    rows["place"] = np.cumsum(owned, dtype=np.int32) - owned
    packings = cache.get_or_make_each("packing", [(own,) for own in each], _packing)

    def laid(name: str, dtype: Any, *, more: int = 0) -> wp.array:
        """A table of all garments' patches; threads that find nothing left ask for ``more``, and do not use it."""
        return lay([getattr(own, name) for own in each], dtype, more=more)

    def law(name: str, dtype: Any, *, more: int = 0) -> wp.array:
        """Likewise of what acts in them."""
        return lay([own[name] for own in laws], dtype, more=more)

    def packing(name: str) -> wp.array:
        """Numbers of vertices, likewise."""
        return lay([getattr(own, name) for own in packings], wp.int32, starts=start)

    tables = types.Patches()
    wide = np.zeros((len(rows), 16), dtype=np.int32)
    wide[:, : rows.dtype.itemsize // 4] = rows.view(np.int32).reshape(len(rows), -1)
    tables.patch = wp.array(wide.reshape(-1, 4), dtype=wp.vec4i, device=device)
    tables.vertex = packing("vertex")
    if terms.edges or terms.folds:
        tables.ends = law("ends", wp.uint64, more=1)
    if terms.edges:
        tables.law = law("law", types.vec4, more=1)
        tables.edge_slot = laid("edge_slot", wp.vec4i)
    if terms.folds and not rows["item_count"].any():
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
    block = block_for(bool(rows["item_count"].any()))
    tables.ahead = wp.get_device(device).sm_count * block.per_core if own_memory else 0
    packed, back = types.Patches(), types.Patches()
    for name in types.Patches.vars:
        if getattr(tables, name) is not None:
            setattr(packed, name, getattr(tables, name))
            setattr(back, name, getattr(tables, name))
    packed.vertex = back.vertex = packing("packed_vertex")
    back.patch = wp.array(_last_first(wide, len(wide)).reshape(-1, 4), dtype=wp.vec4i, device=device)
    overflow = wp.empty(overflowing, dtype=wp.uint8, device=device)
    few = max(len(rows), 0 if like is None else like // block.vertices) <= FEW
    numbering = Numbering(concatenate([own.order for own in packings], start))
    places = packing("order"), packing("rank")
    return Patches(wide, rows["item"], tables, (packed, back), numbering, *places, overflow, few)


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

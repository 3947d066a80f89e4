"""Cuts the cloth into patches that a thread block each works out (kernels.gather), on the host."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.elements import Elements
from warp_cloth.errors import InputError
from warp_cloth.kernels.cloth import Terms
from warp_cloth.kernels.gather import BLOCK_MEMORY, NO_SLOT
from warp_cloth.mesh import Indices, Points
from warp_cloth.topology import ragged_rows

LARGEST = 128  # vertices that a patch owns: with what is around them as much as a block's memory holds
SMALLEST = 16  # below, far more is worked out around a patch than in it
BLOCKS = 264  # patches that a large GPU works on at a time, so that small garments are cut smaller

Keys = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class PatchTables:
    """What kernels.cloth's Patches hold, P patches; elements repeat in every patch that needs them."""

    patch: dict[str, Keys]  # fields of kernels.cloth's Patch, shape [P] each
    vertex: Keys
    ends: NDArray[np.uint64]
    edge: Keys  # of the elements' edges, in the patches' order
    corners: NDArray[np.uint64]
    sides: NDArray[np.uint64]
    triangle: Keys  # of the elements' triangles, in the patches' order
    edge_slot: NDArray[np.uint16]
    slot: NDArray[np.uint16]
    overflow: int  # bytes that patches need which are too large for a block's own memory


def cut_patches(
    garments: Sequence[Elements], points: Sequence[Points], terms: Terms, *, precision: str, own_memory: bool
) -> PatchTables:
    """Patches of neighbouring vertices, none larger than a block's memory holds, if it need not be.

    ``own_memory``: whether blocks have any; on the CPU they take turns at the same.

    Raises:
        InputError: more meets at one vertex than a patch can count.
    """
    size = int(np.clip(sum(len(part) for part in points) // BLOCKS, SMALLEST, LARGEST))
    made: dict[int, PatchTables] = {}  # of each garment once, however often it is there
    for elements, part in zip(garments, points, strict=True):
        if id(elements) not in made:
            made[id(elements)] = _garment_tables(elements, part, size, terms, precision)
    tables = _joined([made[id(elements)] for elements in garments], garments, points)
    memory = _memory(tables.patch, terms, precision)
    if not own_memory:
        tables.patch["overflow"] = np.zeros_like(memory)
        return replace(tables, overflow=int(memory.max(initial=0)))
    over = memory > BLOCK_MEMORY
    place = np.cumsum(np.where(over, memory, 0)) - np.where(over, memory, 0)
    tables.patch["overflow"] = np.where(over, place, -1)
    return replace(tables, overflow=int(memory[over].sum()))


def _garment_tables(elements: Elements, points: Points, size: int, terms: Terms, precision: str) -> PatchTables:
    """A garment's patches of ``size`` vertices, halved where they would not fit."""
    groups = _near_groups(points, np.arange(len(points), dtype=np.int32), size)
    while True:
        tables = _tables(elements, groups, terms)
        large = (_memory(tables.patch, terms, precision) > BLOCK_MEMORY) & (tables.patch["owned_count"] > 1)
        if not large.any():
            break
        groups = [
            part
            for group, halved in zip(groups, large, strict=True)
            for part in (_near_groups(points, group, -(-len(group) // 2)) if halved else [group])
        ]
    counts = ("vertex_count", "normal_count", "triangle_count", "edge_count")
    if max(int(tables.patch[count].max(initial=0)) for count in counts) * 4 >= NO_SLOT:
        raise InputError("garment", "more than 10,000 triangles meet at a vertex", "divide the mesh differently")
    return tables


def _joined(tables: Sequence[PatchTables], garments: Sequence[Elements], points: Sequence[Points]) -> PatchTables:
    """Patches of all garments as one's."""
    starts = {"vertex_start": "vertex", "edge_start": "ends", "triangle_start": "corners",
              "edge_slot_start": "edge_slot", "slot_start": "slot"}  # fmt: skip
    first = {"vertex": points, "edge": [part.ends for part in garments], "triangle": [g.corners for g in garments]}

    def offsets(arrays: Sequence[Any]) -> Keys:
        return np.cumsum([0, *(len(array) for array in arrays)])

    def joined(name: str) -> Any:
        arrays = [getattr(table, name) for table in tables]
        if name in first:
            arrays = [array + start for array, start in zip(arrays, offsets(first[name]), strict=False)]
        return np.concatenate(arrays)

    patch = {}
    for name in tables[0].patch:
        numbers = [table.patch[name] for table in tables]
        if name in starts:
            begin = offsets([getattr(table, starts[name]) for table in tables])
            numbers = [number + start for number, start in zip(numbers, begin, strict=False)]
        patch[name] = np.concatenate(numbers)
    names = [name for name in PatchTables.__dataclass_fields__ if name not in ("patch", "overflow")]
    return PatchTables(patch=patch, overflow=0, **{name: joined(name) for name in names})


def _near_groups(points: Points, vertices: Indices, size: int) -> list[Indices]:
    """Vertices in groups of at most ``size`` that lie together, halved across the longer way again and again."""
    groups: list[Indices] = []
    waiting = [(vertices, -(-len(vertices) // size))]
    while waiting:
        group, parts = waiting.pop()
        if parts <= 1:
            groups.append(np.sort(group))
            continue
        half = parts // 2
        count = -(-len(group) * half // parts)
        place = points[group]
        axis = int(np.argmax(np.ptp(place, axis=0)))
        order = np.argpartition(place[:, axis], count - 1)
        waiting += [(group[order[count:]], parts - half), (group[order[:count]], half)]
    return groups


class _Members:
    """Which of some elements each patch has, and as which it counts them: those that are not ``last`` come first."""

    def __init__(self, patch: Keys, element: Keys, total: int, patch_count: int) -> None:
        self._total = total
        self._keys = np.unique(patch.astype(np.int64) * total + element)
        self.patch, self.element = self._keys // total, self._keys % total
        self.count = np.bincount(self.patch, minlength=patch_count)
        self.start = np.cumsum(self.count) - self.count
        self._order(np.zeros(len(self._keys), dtype=bool))

    def _order(self, last: NDArray[np.bool_]) -> None:
        order = np.lexsort((last, self.patch))
        place = np.empty(len(order), dtype=np.int64)
        place[order] = np.arange(len(order))
        self._number = place - self.start[self.patch]
        self.listed = self.element[order]
        self.listed_patch = self.patch[order]

    def put_last(self, last: NDArray[np.bool_]) -> None:
        """Counts these after the others, which keep their order."""
        self._order(last)

    def find(self, patch: Keys, element: Keys) -> Keys:
        """Numbers of elements in their patches, whatever the shape; 0 where the patch has no such element."""
        wanted = patch * self._total + element
        at = np.minimum(np.searchsorted(self._keys, wanted), len(self._keys) - 1)
        return np.where(self._keys[at] == wanted, self._number[at], 0) if len(self._keys) else 0 * wanted

    def has(self, patch: Keys, element: Keys) -> NDArray[np.bool_]:
        """Whether each patch has that element."""
        return np.isin(patch * self._total + element, self._keys)


def _tables(elements: Elements, groups: list[Indices], terms: Terms) -> PatchTables:
    """Tables of given patches, their memory not yet placed."""
    count = len(groups)
    owned = np.array([len(group) for group in groups])
    vertex_count, edge_count = int(owned.sum()), len(elements.ends)
    owner, lane = np.empty(vertex_count, dtype=np.int64), np.empty(vertex_count, dtype=np.int64)
    joined = np.concatenate(groups)
    owner[joined] = np.repeat(np.arange(count), owned)
    lane[joined] = np.arange(vertex_count) - np.repeat(np.cumsum(owned) - owned, owned)
    corners, ends = elements.corners.astype(np.int64), elements.ends.astype(np.int64)
    edges = np.where(elements.edges < 0, -1 - elements.edges, elements.edges).astype(np.int64)

    own = _Members(owner[corners].ravel(), np.repeat(np.arange(len(corners)), 3), max(len(corners), 1), count)
    edge_patch, edge = owner[ends].ravel(), np.repeat(np.arange(edge_count), 2)
    if terms.folds:
        edge_patch = np.concatenate([edge_patch, np.repeat(own.patch, 3)])
        edge = np.concatenate([edge, edges[own.element].ravel()])
    mine = _Members(edge_patch, edge, edge_count, count)
    folded = elements.fold[mine.listed] != 0.0
    beyond = np.repeat(mine.listed_patch[folded], 2), elements.beside[mine.listed[folded]].astype(np.int64).ravel()
    normal = _Members(
        np.concatenate([own.patch, beyond[0]]), np.concatenate([own.element, beyond[1]]), max(len(corners), 1), count
    )
    normal.put_last(~own.has(normal.patch, normal.element))
    vertex = _Members(
        np.concatenate([owner, np.repeat(normal.patch, 3), np.repeat(mine.patch, 2)]),
        np.concatenate([np.arange(vertex_count), corners[normal.element].ravel(), ends[mine.element].ravel()]),
        vertex_count,
        count,
    )
    vertex.put_last(owner[vertex.element] != vertex.patch)

    at = mine.listed_patch[:, None]
    word = np.concatenate(
        [vertex.find(at, ends[mine.listed]), normal.find(at, elements.beside[mine.listed].astype(np.int64))], axis=1
    )
    at = normal.listed_patch[:, None]
    turned = ((elements.edges[normal.listed] < 0) * np.array([1, 2, 4])).sum(axis=1, keepdims=True)
    sides = np.concatenate([mine.find(at, edges[normal.listed]), turned], axis=1)

    edge_entry = 2 * mine.find(owner[ends], np.arange(edge_count)[:, None]) + np.array([0, 1])
    number = normal.find(owner[corners], np.arange(len(corners))[:, None])
    entry = 4 * number + np.arange(3)
    edge_slot, edge_slot_start, edge_ranks = _ranked(ends, edge_entry, owner, lane, owned)
    slot, slot_start, ranks = _ranked(corners, entry, owner, lane, owned)
    patch = {
        "vertex_start": vertex.start, "vertex_count": vertex.count, "owned_count": owned,
        "edge_start": mine.start, "edge_count": mine.count,
        "triangle_start": normal.start, "triangle_count": own.count, "normal_count": normal.count,
        "edge_slot_start": edge_slot_start, "edge_rank_count": edge_ranks, "slot_start": slot_start,
        "rank_count": ranks,
    }  # fmt: skip
    return PatchTables(
        patch=patch,
        vertex=vertex.listed,
        ends=_words(word),
        edge=mine.listed,
        corners=_words(vertex.find(at, corners[normal.listed])),
        sides=_words(sides),
        triangle=normal.listed,
        edge_slot=edge_slot,
        slot=slot,
        overflow=0,
    )


def _ranked(
    vertices: Keys, entries: Keys, owner: Keys, lane: Keys, owned: Keys
) -> tuple[NDArray[np.uint16], Keys, Keys]:
    """Entries of each vertex rank by rank within its patch, where each patch's start, and how many ranks it has."""
    start, order = ragged_rows(vertices.ravel(), len(owner))
    of = vertices.ravel()[order]
    rank = np.arange(len(of)) - start[of]
    most = np.zeros(len(owned), dtype=np.int64)
    np.maximum.at(most, owner, np.diff(start))
    begin = np.cumsum(most * owned) - most * owned
    ranked = np.full(int((most * owned).sum()), NO_SLOT, dtype=np.uint16)
    ranked[begin[owner[of]] + rank * owned[owner[of]] + lane[of]] = entries.ravel()[order].astype(np.uint16)
    return ranked, begin, most


def _words(numbers: Keys) -> NDArray[np.uint64]:
    """Up to four numbers packed in a word, shape [N, 2..4] to [N]."""
    shifts = (16 * np.arange(numbers.shape[1])).astype(np.uint64)
    return np.bitwise_or.reduce(numbers.astype(np.uint64) << shifts, axis=1)


def _memory(patch: dict[str, Keys], terms: Terms, precision: str) -> Keys:
    """Bytes that each patch's block needs, as kernels.gather lays them out, shape [P]."""
    real, point = (8 if precision == "float64" else 4), (12 if precision == "float32" else 24)
    triangles, edges, vertices = patch["triangle_count"], patch["edge_count"], patch["vertex_count"]
    needed = 4 * real * (terms.folds * patch["normal_count"] + terms.edges * edges + 3 * terms.threads * triangles)
    needed = needed + -(-3 * real * terms.folds * edges // 8) * 8
    early, late = (point + 3 * real) * vertices, 6 * real * terms.folds * triangles
    needed = needed + (early + late if terms.threads else np.maximum(early, late))
    return np.asarray(-(-needed // 16) * 16)

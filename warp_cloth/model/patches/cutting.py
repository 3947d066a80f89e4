"""Cuts the cloth into patches that a thread block each works out (kernels.passes.gather), on the host."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.cache import Cache
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Indices, Points
from warp_cloth.base.threads import concatenate, map_in_threads
from warp_cloth.garment.elements import Elements
from warp_cloth.garment.rest import Floats
from warp_cloth.kernels.base.options import (
    FEW,
    NUMBER_BITS,
    PAIRS,
    SINGLE,
    Block,
    Terms,
    block_for,
    fold_numbers,
    point_size,
    real_size,
)
from warp_cloth.model.patches.members import Members, Part, edge_numbers, words, words_of
from warp_cloth.model.patches.spread import spread_places
from warp_cloth.model.patches.triangle_pairs import Items

SMALLEST = 16  # vertices that a patch owns; below, far more is worked out around a patch than in it

MOST_HALVED, FEWER, PROBED = 0.125, 8, 64  # share of patches; vertices that all get fewer then; patches looked at
CHUNK = 512  # patches that are cut at a time: their tables fit a processor's caches
MOST_PATCHES = 1 << 24  # of a chunk, whose patches are numbered from a multiple of this

Keys = NDArray[np.int64]
Numbers = NDArray[np.integer[Any]]  # of elements, of either width
QUARTER_BITS = 16  # of a word


@dataclass(frozen=True, eq=False)
class PatchTables:
    """What kernels.base.types's Patches hold, P patches; elements repeat in every patch that needs them."""

    patch: dict[str, Keys]  # fields of kernels.base.types's Patch, shape [P] each
    vertex: Keys
    ends: NDArray[np.uint64]
    edge: Keys  # of the elements' edges, in the patches' order
    corners: NDArray[np.uint64]
    sides: NDArray[np.uint64]
    triangle: Keys  # of the elements' triangles, in the patches' order
    edge_slot: NDArray[np.int32]
    slot: NDArray[np.int32]
    overflow: int  # bytes that patches need which are too large for a block's own memory


def cut_patches(
    garments: Sequence[Elements],
    points: Sequence[Points],
    terms: Terms,
    *,
    precision: str,
    own_memory: bool,
    paired: bool = False,
) -> PatchTables:
    """The patches of several garments; ``own_memory`` as of ``joined_patches``, the rest as of ``garment_patches``."""
    each = garment_patches(garments, points, terms, precision=precision, cache=Cache(), paired=paired)
    return joined_patches(each, garments, points, terms, precision=precision, own_memory=own_memory)


def garment_patches(
    garments: Sequence[Elements],
    points: Sequence[Points],
    terms: Terms,
    *,
    precision: str,
    cache: Cache,
    size: int | None = None,
    paired: bool = False,
) -> list[PatchTables]:
    """Each garment's patches of neighbouring vertices, none larger than a block's memory holds, if it need not be.

    ``cache`` has earlier ones. ``size``: vertices that a patch owns; None: as keeps a large GPU busy. ``paired``:
    whether threads work on pairs of triangles (triangle_pairs).

    Raises:
        InputError: more meets at one vertex than a patch can count.
    """
    size = size or even_size(sum(len(part) for part in points), block_for(paired))
    shapes = cache.get_or_make_each("shape", list(zip(garments, points, strict=True)), _shape)
    distinct = dict(zip(shapes, zip(garments, points, strict=True), strict=True))
    how = size, terms, precision, paired

    def tables_of(shape: bytes) -> PatchTables:
        return _garment_tables(*distinct[shape], size, terms, precision, paired)

    missing = [shape for shape in distinct if cache.key("patches", (), shape, *how) not in cache]
    small = [shape for shape in missing if len(distinct[shape][1]) <= CHUNK * size]
    cut = dict(zip(small, map_in_threads(tables_of, small), strict=True))
    cut |= {shape: tables_of(shape) for shape in missing if shape not in cut}  # each in threads of its own
    made = {shape: cache.get_or_make("patches", (), partial(cut.__getitem__, shape), shape, *how) for shape in distinct}
    return [made[shape] for shape in shapes]


def even_size(vertices: int, block: Block = SINGLE, least: int = 2) -> int:
    """Vertices that a patch owns. A large GPU that has all patches at work at once has as many on each core, or more.

    ``least``: how many on each core, at least.
    """
    each, most = max(least, -(-2 * vertices // (block.vertices * FEW))), block.vertices
    return int(np.clip(-(-2 * vertices // (FEW * each)), SMALLEST, most)) if each <= block.per_core else most


def joined_patches(
    each: Sequence[PatchTables],
    garments: Sequence[Elements],
    points: Sequence[Points],
    terms: Terms,
    *,
    precision: str,
    own_memory: bool,
) -> PatchTables:
    """The garments' patches as of one.

    ``own_memory``: whether blocks have any; on the CPU they take turns at the same.
    """
    first = {"vertex": points, "edge": [part.ends for part in garments], "triangle": [g.corners for g in garments]}
    patch, overflow = joined_rows(each, terms, precision=precision, own_memory=own_memory)
    tables = _end_to_end(each, {name: _starts(of) for name, of in first.items()})
    return replace(tables, patch=patch, overflow=overflow)


def joined_rows(
    each: Sequence[PatchTables], terms: Terms, *, precision: str, own_memory: bool
) -> tuple[dict[str, Keys], int]:
    """Fields of the garments' patches as of one, with their "overflow", and the bytes of all that; else likewise."""
    patch = _rows_end_to_end(each)
    memory = _memory(patch, terms, precision)
    if not own_memory:
        return {**patch, "overflow": np.zeros_like(memory)}, int(memory.max(initial=0))
    over = _too_large(patch, terms, precision)
    place = np.cumsum(np.where(over, memory, 0)) - np.where(over, memory, 0)
    return {**patch, "overflow": np.where(over, place, -1)}, int(memory[over].sum())


def _shape(elements: Elements, points: Points) -> bytes:
    """What a garment's patches depend on: the same in every fabric."""
    told = hashlib.sha256()
    for array in (
        points,
        elements.ends,
        elements.adjacent_triangles,
        elements.hinge_stiffness != 0.0,
        elements.corners,
        elements.edges,
    ):
        told.update(str((array.shape, array.dtype)).encode() + np.ascontiguousarray(array).tobytes())
    return told.digest()


def _garment_tables(
    elements: Elements, points: Points, size: int, terms: Terms, precision: str, paired: bool
) -> PatchTables:
    """A garment's patches of ``size`` vertices, halved where they would not fit; of fewer where many would not."""
    places = spread_places(elements.ends, points) if len(points) > size else points
    groups = _near_groups(places, size)
    while paired and size > SMALLEST and _share_too_large(elements, places, groups, terms, precision) > MOST_HALVED:
        size = max(size - FEWER, SMALLEST)
        groups = _near_groups(places, size)
    kind = np.bincount(elements.ends.ravel()[: None if paired else 0], minlength=len(points))
    order = _in_rows(groups, places, kind)
    rank = np.empty(len(points), dtype=np.int32)
    rank[order] = np.arange(len(points), dtype=np.int32)
    # from here on vertices are counted in that order
    elements = replace(elements, ends=rank[elements.ends], corners=rank[elements.corners])
    groups, places = [np.sort(rank[group]) for group in groups], places[order]
    chunks = [groups[first : first + CHUNK] for first in range(0, len(groups), CHUNK)]
    owner = np.empty(len(points), dtype=np.int64)
    for index, chunk in enumerate(chunks):
        owner[np.concatenate(chunk)] = index
    ends, corners = (_by_chunk(table, owner, len(chunks)) for table in (elements.ends, elements.corners))
    owner *= MOST_PATCHES
    lane = np.zeros(len(points), dtype=np.int64)

    def cut(index: int) -> PatchTables:
        own = chunks[index]
        while True:
            part = Part(own, index * MOST_PATCHES, owner, lane, ends[index], corners[index])
            tables = _tables(elements, places, terms, part, paired)
            large = _too_large(tables.patch, terms, precision) & (tables.patch["owned_count"] > 1)
            if not large.any():
                return tables
            own = [
                half
                for group, halved in zip(own, large, strict=True)
                for half in (_near_groups(places, -(-len(group) // 2), group) if halved else [group])
            ]

    tables = _end_to_end(map_in_threads(cut, range(len(chunks))))
    counts = ("vertex_count", "normal_count", "triangle_count", "edge_count")
    if max(int(tables.patch[count].max(initial=0)) for count in counts) * 4 >= 1 << QUARTER_BITS:
        raise InputError("garment", "more than 10,000 triangles meet at a vertex", "divide the mesh differently")
    return replace(tables, vertex=order[tables.vertex].astype(np.int64))


def _share_too_large(
    elements: Elements, places: Floats, groups: Sequence[Indices], terms: Terms, precision: str
) -> float:
    """How many of some of a garment's groups do not fit as patches whose threads work on pairs of triangles."""
    some = list(groups[:: -(-len(groups) // PROBED)])
    own = np.zeros(len(places), dtype=bool)
    own[np.concatenate(some)] = True
    of_others, lane = np.full(len(places), MOST_PATCHES), np.zeros(len(places), dtype=np.int64)
    ends, corners = (np.flatnonzero(own[table.ravel()]) for table in (elements.ends, elements.corners))
    tables = _tables(elements, places, terms, Part(some, 0, of_others, lane, ends, corners), True)
    return float(_too_large(tables.patch, terms, precision).mean())


def _in_rows(groups: Sequence[Indices], places: Floats, kind: Keys) -> Indices:
    """The vertices of one group after another, each group's row by row, so that neighbours are counted together.

    Those of a ``kind`` come together.
    """
    count = np.array([len(group) for group in groups])
    of, first, vertices = np.repeat(np.arange(len(groups)), count), np.cumsum(count) - count, np.concatenate(groups)
    place = places[vertices]
    low = np.minimum.reduceat(place, first, axis=0)
    extent = np.maximum.reduceat(place, first, axis=0) - low
    longest = np.argsort(-extent, axis=1, kind="stable")[of]
    lane = np.arange(len(vertices))
    share = (place - low[of]) / np.maximum(extent[of], 1e-30)
    row = np.floor(share[lane, longest[:, 0]] * np.sqrt(count[of]))
    return np.asarray(vertices[np.lexsort((share[lane, longest[:, 1]], row, kind[vertices], of))])


def _by_chunk(vertices: Indices, chunk: Keys, chunk_count: int) -> list[Keys]:
    """Where in a flattened table each chunk's vertices stand."""
    of = chunk[vertices.ravel()].astype(np.uint16)  # two bytes sort much faster
    return np.split(np.argsort(of, kind="stable"), np.cumsum(np.bincount(of, minlength=chunk_count))[:-1])


def _starts(arrays: Sequence[Any]) -> list[int]:
    """Where each array starts if they stand end to end."""
    return [0, *np.cumsum([len(array) for array in arrays])[:-1].tolist()]


def _end_to_end(parts: Sequence[PatchTables], first: Mapping[str, Sequence[int]] | None = None) -> PatchTables:
    """Patches of several parts as of one; ``first``: each part's first vertex, edge and triangle, where they differ."""
    if len(parts) == 1:
        return parts[0]
    names = [name for name in PatchTables.__dataclass_fields__ if name not in ("patch", "overflow")]
    tables = {name: concatenate([getattr(part, name) for part in parts], (first or {}).get(name)) for name in names}
    return PatchTables(patch=_rows_end_to_end(parts), overflow=0, **tables)


def _rows_end_to_end(parts: Sequence[PatchTables]) -> dict[str, Keys]:
    """Fields of several parts' patches as of one's."""
    starts = {"vertex_start": "vertex", "edge_start": "ends", "triangle_start": "corners",
              "slot_start": "slot"}  # fmt: skip
    patch = {}
    for name in parts[0].patch:
        begin = _starts([getattr(part, starts[name]) for part in parts]) if name in starts else None
        patch[name] = concatenate([part.patch[name] for part in parts], begin)
    return patch


Cluster = tuple[Indices, Floats, int]  # vertices, where they are, and into how many groups they go


def _near_groups(places: Floats, size: int, vertices: Indices | None = None) -> list[Indices]:
    """Vertices in groups of at most ``size`` that lie together, halved across the longest way again and again."""
    chosen = np.arange(len(places), dtype=np.int32) if vertices is None else vertices
    clusters = _halved((chosen, places[chosen], -(-len(chosen) // size)), CHUNK)
    return [np.sort(group) for found in map_in_threads(lambda each: _halved(each, 1), clusters) for group, *_ in found]


def _halved(cluster: Cluster, parts: int) -> list[Cluster]:
    """Clusters of at most so many groups."""
    clusters, waiting = [], [cluster]
    while waiting:
        group, place, count = waiting.pop()
        if count <= parts:
            clusters.append((group, place, count))
            continue
        half = count // 2
        size = -(-len(group) * half // count)
        axis = int(np.argmax(np.ptp(place, axis=0)))
        order = np.argpartition(place[:, axis], size - 1)
        for part, own in ((order[size:], count - half), (order[:size], half)):
            waiting.append((group[part], place[part], own))
    return clusters


def _tables(elements: Elements, places: Floats, terms: Terms, part: Part, paired: bool) -> PatchTables:
    """Tables of a part's patches, their memory not yet placed.

    ``paired``: whether threads work on pairs of triangles, across sides that are long by the vertices' ``places``.
    """
    count, corners, ends = len(part.owned), elements.corners, elements.ends
    edge_end, edge = ends.ravel()[part.ends], part.ends // 2
    corner, triangle = corners.ravel()[part.corners], part.corners // 3

    own = Members(part.owner(corner), triangle, max(len(corners), 1), count)
    patches: list[Keys] = [part.owner(edge_end)]
    found: list[Numbers] = [edge]
    if terms.folds:
        patches.append(np.repeat(own.patch, 3))
        found.append(edge_numbers(elements.edges[own.element]).ravel())
    mine = Members(np.concatenate(patches), np.concatenate(found), len(ends), count)
    folded = elements.hinge_stiffness[mine.listed] != 0.0
    beyond = np.repeat(mine.listed_patch[folded], 2), elements.adjacent_triangles[mine.listed[folded]].ravel()
    normal = Members(
        np.concatenate([own.patch, beyond[0]]), np.concatenate([own.element, beyond[1]]), max(len(corners), 1), count
    )
    items = Items(elements, places, own, part.lane) if paired else None
    if items is None:
        normal.arrange(corners[normal.element].min(axis=1), ~own.has(normal.patch, normal.element))
        mine.arrange(ends[mine.element].min(axis=1))
        item_count = np.zeros(count, dtype=np.int64)
    else:
        item_count = items.arrange(normal, mine)
    vertex = Members(
        np.concatenate([part.patch, np.repeat(normal.patch, 3), np.repeat(mine.patch, 2)]),
        np.concatenate([part.vertices, corners[normal.element].ravel(), ends[mine.element].ravel()]),
        part.garment_vertices,
        count,
    )
    vertex.arrange(vertex.element, part.owner(vertex.element) != vertex.patch)

    at = mine.listed_patch[:, None]
    word = np.concatenate(
        [vertex.find(at, ends[mine.listed]), normal.find(at, elements.adjacent_triangles[mine.listed])], axis=1
    )
    at = normal.listed_patch[:, None]
    sides = elements.edges[normal.listed]
    turned = ((sides < 0) * np.array([1, 2, 4])).sum(axis=1, keepdims=True)
    edge_entry = 2 * mine.find(part.owner(edge_end), edge) + part.ends % 2
    ranks = part.ranks(edge_end, corner)
    slots = words_of(ranks) * part.owned
    owner = part.owner(corner)
    first = normal.count if terms.folds else own.count
    other = np.where(part.corners % 3, first[owner] + (part.corners % 3 - 1) * own.count[owner], 0)
    entry = normal.find(owner, triangle) + other
    patch = {
        "vertex_start": vertex.start, "vertex_count": vertex.count, "owned_count": part.owned,
        "edge_start": mine.start, "edge_count": mine.count,
        "triangle_start": normal.start, "triangle_count": own.count, "normal_count": normal.count,
        "slot_start": np.cumsum(slots) - slots, "ranks": ranks, "item_count": item_count,
    }  # fmt: skip
    return PatchTables(
        patch=patch,
        vertex=vertex.listed,
        ends=words(word, QUARTER_BITS) if items is None else items.words(word, vertex, normal, mine),
        edge=mine.listed,
        corners=words(vertex.find(at, corners[normal.listed]), QUARTER_BITS),
        sides=words(np.concatenate([mine.find(at, edge_numbers(sides)), turned], axis=1), QUARTER_BITS),
        triangle=normal.listed,
        edge_slot=part.ranked(ranks, edge_end, edge_entry, 2 * mine.count),
        slot=part.ranked(ranks, corner, entry, first + 2 * own.count),
        overflow=0,
    )


def takes_pairs(terms: Terms, vertices: int | None = None) -> bool:
    """Whether threads work on pairs of triangles in so many vertices; None: many.

    In the small patches of a few most threads would have none, and a pair of woven triangles takes more registers than
    there are.
    """
    return terms.folds and not terms.yarns and (vertices is None or vertices > PAIRS.vertices * FEW)


def _too_large(patch: dict[str, Keys], terms: Terms, precision: str) -> NDArray[np.bool_]:
    """Whether patches ask for more than a block has of memory, or of threads, or than words of items tell apart."""
    block = block_for(bool(patch["item_count"].any()))
    over = (_memory(patch, terms, precision) > block.memory) | (patch["item_count"] > block.threads)
    return np.asarray(over | beyond_words(patch))


def beyond_words(patch: dict[str, Keys]) -> NDArray[np.bool_]:
    """Whether patches have more of anything than words of items tell apart."""
    most = np.maximum.reduce([patch[name] for name in ("vertex_count", "normal_count", "edge_count")])
    return np.asarray((patch["item_count"] > 0) & (most > 1 << NUMBER_BITS))


def _memory(patch: dict[str, Keys], terms: Terms, precision: str) -> Keys:
    """Bytes that each patch's block needs, as kernels.patches.memory lays them out, shape [P]."""
    real, wide = real_size(precision), point_size(precision) // 3
    triangles, edges, vertices = patch["triangle_count"], patch["edge_count"], patch["vertex_count"]
    first = patch["normal_count"] if terms.folds else terms.yarns * triangles
    needed = 4 * real * (first + terms.edges * (edges + 1))
    points = -(-2 * wide * vertices // 16) * 16 + -(-wide * (vertices + 1) // 16) * 16
    corners, around = 4 * real * (2 * triangles + 1), 4 * real * vertices + points
    if terms.yarns:
        needed = needed + corners + around
    else:
        needed = needed + (np.maximum(corners, around) if terms.folds else around)
    return np.asarray(-(-(needed + fold_numbers(terms) * real * terms.folds * edges) // 16) * 16)

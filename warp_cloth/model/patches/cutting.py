"""Domain decomposition: cuts cloth into patches of neighbouring vertices, one per thread block, on the host.

Kernels that read the patches: kernels.passes.gather.
"""

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
from warp_cloth.model.patches.members import Chunk, Members, edge_numbers, packed_bits, word_count
from warp_cloth.model.patches.spread import spread_places
from warp_cloth.model.patches.tiles import Tiles

SMALLEST = 16  # vertices that a patch owns; below, far more is computed around a patch than in it

MOST_HALVED, FEWER, PROBED = 0.125, 8, 64  # fraction of patches; how many vertices fewer all get then; patches sampled
CHUNK = 512  # patches cut at a time: their tables fit a processor's caches
MOST_PATCHES = 1 << 24  # in a chunk; its patches are numbered from a multiple of this

Keys = NDArray[np.int64]
Numbers = NDArray[np.integer[Any]]  # of elements, of either width
QUARTER_BITS = 16  # of a word


@dataclass(frozen=True, eq=False)
class PatchTables:
    """Tables of P patches, as in kernels.base.types.Patches; an element is repeated in every patch that needs it."""

    patch: dict[str, Keys]  # fields of kernels.base.types's Patch, shape [P] each
    vertex: Keys
    ends: NDArray[np.uint64]
    edge: Keys  # of the elements' edges, in the patches' order
    corners: NDArray[np.uint64]
    sides: NDArray[np.uint64]
    triangle: Keys  # of the elements' triangles, in the patches' order
    edge_slot: NDArray[np.int32]
    slot: NDArray[np.int32]
    overflow: int  # bytes needed by patches that are too large for a block's shared memory


def cut_patches(
    garments: Sequence[Elements],
    points: Sequence[Points],
    terms: Terms,
    *,
    precision: str,
    own_memory: bool,
    paired: bool = False,
) -> PatchTables:
    """Patches of several garments: ``garment_patches``, then ``joined_patches``; arguments as there."""
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
    """Each garment's patches of neighbouring vertices, small enough for a block's shared memory where possible.

    ``cache`` has earlier ones. ``size``: vertices that a patch owns; None: a size that keeps a large GPU busy.
    ``paired``: whether threads work on pairs of triangles (triangle_pairs).

    Raises:
        InputError: more triangles meet at a vertex than a patch can count.
    """
    size = size or even_size(sum(len(own) for own in points), block_for(paired))
    shapes = cache.get_or_make_each("shape", list(zip(garments, points, strict=True)), _shape)
    distinct = dict(zip(shapes, zip(garments, points, strict=True), strict=True))
    how = size, terms, precision, paired

    def tables_of(shape: bytes) -> PatchTables:
        return _garment_tables(*distinct[shape], size, terms, precision, paired)

    missing = [shape for shape in distinct if cache.key("patches", (), shape, *how) not in cache]
    small = [shape for shape in missing if len(distinct[shape][1]) <= CHUNK * size]
    cut = dict(zip(small, map_in_threads(tables_of, small), strict=True))
    cut |= {shape: tables_of(shape) for shape in missing if shape not in cut}  # each in threads of its own
    tables = {
        shape: cache.get_or_make("patches", (), partial(cut.__getitem__, shape), shape, *how) for shape in distinct
    }
    return [tables[shape] for shape in shapes]


def even_size(vertices: int, block: Block = SINGLE, least: int = 2) -> int:
    """Vertices that a patch owns. A large GPU that runs all patches at once gets as many for each core, or more.

    ``least``: patches per core, at least.
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
    """Concatenates the garments' patches.

    ``own_memory``: whether each block has shared memory; on the CPU one buffer serves all blocks, one after another.
    """
    first = {"vertex": points, "edge": [g.ends for g in garments], "triangle": [g.corners for g in garments]}
    patch, overflow = joined_rows(each, terms, precision=precision, own_memory=own_memory)
    tables = _concatenated(each, {name: _starts(of) for name, of in first.items()})
    return replace(tables, patch=patch, overflow=overflow)


def joined_rows(
    each: Sequence[PatchTables], terms: Terms, *, precision: str, own_memory: bool
) -> tuple[dict[str, Keys], int]:
    """Concatenated ``patch`` fields of the garments, with offsets into the overflow memory, and its size [bytes]."""
    patch = _concatenated_rows(each)
    memory = _memory(patch, terms, precision)
    if not own_memory:
        return {**patch, "overflow": np.zeros_like(memory)}, int(memory.max(initial=0))
    over = _too_large(patch, terms, precision)
    place = np.cumsum(np.where(over, memory, 0)) - np.where(over, memory, 0)
    return {**patch, "overflow": np.where(over, place, -1)}, int(memory[over].sum())


def _shape(elements: Elements, points: Points) -> bytes:
    """Hash of all that a garment's patches depend on: the same in every fabric."""
    digest = hashlib.sha256()
    for array in (
        points,
        elements.ends,
        elements.adjacent_triangles,
        elements.hinge_stiffness != 0.0,
        elements.corners,
        elements.edges,
    ):
        digest.update(str((array.shape, array.dtype)).encode() + np.ascontiguousarray(array).tobytes())
    return digest.digest()


def _garment_tables(
    elements: Elements, points: Points, size: int, terms: Terms, precision: str, paired: bool
) -> PatchTables:
    """A garment's patches of ``size`` vertices, or fewer if many do not fit; those left are halved."""
    places = spread_places(elements.ends, points) if len(points) > size else points
    groups = _near_groups(places, size)
    while paired and size > SMALLEST and _fraction_too_large(elements, places, groups, terms, precision) > MOST_HALVED:
        size = max(size - FEWER, SMALLEST)
        groups = _near_groups(places, size)
    kind = np.bincount(elements.ends.ravel()[: None if paired else 0], minlength=len(points))
    order = _in_rows(groups, places, kind)
    rank = np.empty(len(points), dtype=np.int32)
    rank[order] = np.arange(len(points), dtype=np.int32)
    # from here on vertices are numbered in that order
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
            chunk = Chunk(own, index * MOST_PATCHES, owner, lane, ends[index], corners[index])
            tables = _tables(elements, places, terms, chunk, paired)
            large = _too_large(tables.patch, terms, precision) & (tables.patch["owned_count"] > 1)
            if not large.any():
                return tables
            own = [
                half
                for group, halved in zip(own, large, strict=True)
                for half in (_near_groups(places, -(-len(group) // 2), group) if halved else [group])
            ]

    tables = _concatenated(map_in_threads(cut, range(len(chunks))))
    counts = ("vertex_count", "normal_count", "triangle_count", "edge_count")
    if max(int(tables.patch[count].max(initial=0)) for count in counts) * 4 >= 1 << QUARTER_BITS:
        raise InputError("garment", "more than 10,000 triangles meet at a vertex", "divide the mesh differently")
    return replace(tables, vertex=order[tables.vertex].astype(np.int64))


def _fraction_too_large(
    elements: Elements, places: Floats, groups: Sequence[Indices], terms: Terms, precision: str
) -> float:
    """Fraction of sampled groups that do not fit as patches whose threads work on pairs of triangles."""
    some = list(groups[:: -(-len(groups) // PROBED)])
    own = np.zeros(len(places), dtype=bool)
    own[np.concatenate(some)] = True
    of_others, lane = np.full(len(places), MOST_PATCHES), np.zeros(len(places), dtype=np.int64)
    ends, corners = (np.flatnonzero(own[table.ravel()]) for table in (elements.ends, elements.corners))
    tables = _tables(elements, places, terms, Chunk(some, 0, of_others, lane, ends, corners), True)
    return float(_too_large(tables.patch, terms, precision).mean())


def _in_rows(groups: Sequence[Indices], places: Floats, kind: Keys) -> Indices:
    """Order of the vertices: by group, ``kind``, and row within the group, so that neighbours have near numbers."""
    count = np.array([len(group) for group in groups])
    of, first, vertices = np.repeat(np.arange(len(groups)), count), np.cumsum(count) - count, np.concatenate(groups)
    place = places[vertices]
    low = np.minimum.reduceat(place, first, axis=0)
    extent = np.maximum.reduceat(place, first, axis=0) - low
    longest = np.argsort(-extent, axis=1, kind="stable")[of]
    lane = np.arange(len(vertices))
    fraction = (place - low[of]) / np.maximum(extent[of], 1e-30)
    row = np.floor(fraction[lane, longest[:, 0]] * np.sqrt(count[of]))
    return np.asarray(vertices[np.lexsort((fraction[lane, longest[:, 1]], row, kind[vertices], of))])


def _by_chunk(vertices: Indices, chunk: Keys, chunk_count: int) -> list[Keys]:
    """Positions of each chunk's vertices in a flattened table."""
    of = chunk[vertices.ravel()].astype(np.uint16)  # two bytes sort much faster
    return np.split(np.argsort(of, kind="stable"), np.cumsum(np.bincount(of, minlength=chunk_count))[:-1])


def _starts(arrays: Sequence[Any]) -> list[int]:
    """Start of each array in their concatenation."""
    return [0, *np.cumsum([len(array) for array in arrays])[:-1].tolist()]


def _concatenated(each: Sequence[PatchTables], first: Mapping[str, Sequence[int]] | None = None) -> PatchTables:
    """Concatenates tables; ``first``: each one's first vertex, edge and triangle, where they differ."""
    if len(each) == 1:
        return each[0]
    names = [name for name in PatchTables.__dataclass_fields__ if name not in ("patch", "overflow")]
    tables = {name: concatenate([getattr(own, name) for own in each], (first or {}).get(name)) for name in names}
    return PatchTables(patch=_concatenated_rows(each), overflow=0, **tables)


def _concatenated_rows(each: Sequence[PatchTables]) -> dict[str, Keys]:
    """Concatenates the ``patch`` fields of tables."""
    starts = {"vertex_start": "vertex", "edge_start": "ends", "triangle_start": "corners",
              "slot_start": "slot"}  # fmt: skip
    patch = {}
    for name in each[0].patch:
        begin = _starts([getattr(own, starts[name]) for own in each]) if name in starts else None
        patch[name] = concatenate([own.patch[name] for own in each], begin)
    return patch


Cluster = tuple[Indices, Floats, int]  # vertices, their positions, number of groups to divide them into


def _near_groups(places: Floats, size: int, vertices: Indices | None = None) -> list[Indices]:
    """Groups of at most ``size`` near vertices, by recursive bisection across the longest extent."""
    chosen = np.arange(len(places), dtype=np.int32) if vertices is None else vertices
    clusters = _halved((chosen, places[chosen], -(-len(chosen) // size)), CHUNK)
    return [np.sort(group) for found in map_in_threads(lambda each: _halved(each, 1), clusters) for group, *_ in found]


def _halved(cluster: Cluster, most: int) -> list[Cluster]:
    """Bisects a cluster until each has at most ``most`` groups."""
    clusters, waiting = [], [cluster]
    while waiting:
        group, place, count = waiting.pop()
        if count <= most:
            clusters.append((group, place, count))
            continue
        half = count // 2
        size = -(-len(group) * half // count)
        axis = int(np.argmax(np.ptp(place, axis=0)))
        order = np.argpartition(place[:, axis], size - 1)
        for half_order, own in ((order[size:], count - half), (order[:size], half)):
            waiting.append((group[half_order], place[half_order], own))
    return clusters


def _tables(elements: Elements, places: Floats, terms: Terms, chunk: Chunk, paired: bool) -> PatchTables:
    """Tables of a chunk's patches, without offsets into overflow memory.

    ``paired``: whether threads work on pairs of triangles that share a side, the longest by the vertices' ``places``.
    """
    count, corners, ends = len(chunk.owned), elements.corners, elements.ends
    edge_end, edge = ends.ravel()[chunk.ends], chunk.ends // 2
    corner, triangle = corners.ravel()[chunk.corners], chunk.corners // 3

    own = Members(chunk.owner(corner), triangle, max(len(corners), 1), count)
    patches: list[Keys] = [chunk.owner(edge_end)]
    found: list[Numbers] = [edge]
    if terms.folds:
        patches.append(np.repeat(own.patch, 3))
        found.append(edge_numbers(elements.edges[own.element]).ravel())
    local_edges = Members(np.concatenate(patches), np.concatenate(found), len(ends), count)
    folded = elements.hinge_stiffness[local_edges.listed] != 0.0
    beyond = (
        np.repeat(local_edges.listed_patch[folded], 2),
        elements.adjacent_triangles[local_edges.listed[folded]].ravel(),
    )
    normal = Members(
        np.concatenate([own.patch, beyond[0]]), np.concatenate([own.element, beyond[1]]), max(len(corners), 1), count
    )
    tiles = Tiles(elements, places, own, chunk.lane) if paired else None
    if tiles is None:
        normal.arrange(corners[normal.element].min(axis=1), ~own.has(normal.patch, normal.element))
        local_edges.arrange(ends[local_edges.element].min(axis=1))
        tile_count = np.zeros(count, dtype=np.int64)
    else:
        tile_count = tiles.arrange(normal, local_edges)
    vertex = Members(
        np.concatenate([chunk.patch, np.repeat(normal.patch, 3), np.repeat(local_edges.patch, 2)]),
        np.concatenate([chunk.vertices, corners[normal.element].ravel(), ends[local_edges.element].ravel()]),
        chunk.garment_vertices,
        count,
    )
    vertex.arrange(vertex.element, chunk.owner(vertex.element) != vertex.patch)

    at = local_edges.listed_patch[:, None]
    word = np.concatenate(
        [vertex.find(at, ends[local_edges.listed]), normal.find(at, elements.adjacent_triangles[local_edges.listed])],
        axis=1,
    )
    at = normal.listed_patch[:, None]
    sides = elements.edges[normal.listed]
    turned = ((sides < 0) * np.array([1, 2, 4])).sum(axis=1, keepdims=True)
    edge_entry = 2 * local_edges.find(chunk.owner(edge_end), edge) + chunk.ends % 2
    ranks = chunk.ranks(edge_end, corner)
    slots = word_count(ranks) * chunk.owned
    owner = chunk.owner(corner)
    first = normal.count if terms.folds else own.count
    other = np.where(chunk.corners % 3, first[owner] + (chunk.corners % 3 - 1) * own.count[owner], 0)
    entry = normal.find(owner, triangle) + other
    patch = {
        "vertex_start": vertex.start, "vertex_count": vertex.count, "owned_count": chunk.owned,
        "edge_start": local_edges.start, "edge_count": local_edges.count,
        "triangle_start": normal.start, "triangle_count": own.count, "normal_count": normal.count,
        "slot_start": np.cumsum(slots) - slots, "ranks": ranks, "tile_count": tile_count,
    }  # fmt: skip
    return PatchTables(
        patch=patch,
        vertex=vertex.listed,
        ends=packed_bits(word, QUARTER_BITS) if tiles is None else tiles.packed(word, vertex, normal, local_edges),
        edge=local_edges.listed,
        corners=packed_bits(vertex.find(at, corners[normal.listed]), QUARTER_BITS),
        sides=packed_bits(np.concatenate([local_edges.find(at, edge_numbers(sides)), turned], axis=1), QUARTER_BITS),
        triangle=normal.listed,
        edge_slot=chunk.ranked(ranks, edge_end, edge_entry, 2 * local_edges.count),
        slot=chunk.ranked(ranks, corner, entry, first + 2 * own.count),
        overflow=0,
    )


def takes_pairs(terms: Terms, vertices: int | None = None) -> bool:
    """Whether threads should work on pairs of triangles, in a model of so many vertices; None: many.

    Small models have small patches, in which most threads would have no pair; a pair of woven triangles would need
    more registers than there are.
    """
    return terms.folds and not terms.yarns and (vertices is None or vertices > PAIRS.vertices * FEW)


def _too_large(patch: dict[str, Keys], terms: Terms, precision: str) -> NDArray[np.bool_]:
    """Which patches need more shared memory or threads than a block has, or more than the bits of tiles can number."""
    block = block_for(bool(patch["tile_count"].any()))
    over = (_memory(patch, terms, precision) > block.memory) | (patch["tile_count"] > block.threads)
    return np.asarray(over | beyond_bits(patch))


def beyond_bits(patch: dict[str, Keys]) -> NDArray[np.bool_]:
    """Which patches have more vertices, normals or edges than the bits of tiles can number."""
    most = np.maximum.reduce([patch[name] for name in ("vertex_count", "normal_count", "edge_count")])
    return np.asarray((patch["tile_count"] > 0) & (most > 1 << NUMBER_BITS))


def _memory(patch: dict[str, Keys], terms: Terms, precision: str) -> Keys:
    """Bytes that each patch's block needs, as laid out by kernels.patches.memory, shape [P]."""
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

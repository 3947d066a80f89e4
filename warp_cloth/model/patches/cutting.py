"""Domain decomposition: cuts cloth into patches of neighbouring vertices, one per thread block, on the host.

Kernels that read the patches: kernels.passes.gather.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from warp_cloth.base import stored_value
from warp_cloth.base.cache import Cache
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Indices, Points
from warp_cloth.base.threads import map_in_threads
from warp_cloth.garment.elements import Elements
from warp_cloth.garment.rest import Floats
from warp_cloth.kernels.base.options import FEW, PAIRS, SINGLE, Block, Terms, block_for
from warp_cloth.model.patches.block_memory import block_memory, too_large
from warp_cloth.model.patches.members import Keys, Portion
from warp_cloth.model.patches.spread import spread_places
from warp_cloth.model.patches.tables import (
    QUARTER_BITS,
    PatchTables,
    concatenated,
    concatenated_rows,
    patch_tables,
    starts_of,
)

SMALLEST = 16  # vertices that a patch owns; below, far more is computed around a patch than in it

MOST_HALVED, FEWER, PROBED = 0.125, 8, 64  # fraction of patches; how many vertices fewer all get then; patches sampled
PORTION = 512  # patches cut at a time: their tables fit a processor's caches
PACKAGES = ("model/patches", "garment", "base", "kernels/base", "kernels/patches")  # whose code patches depend on
MOST_PATCHES = 1 << 24  # in a portion; its patches are numbered from a multiple of this


def cut_patches(
    garments: Sequence[Elements],
    points: Sequence[Points],
    terms: Terms,
    *,
    precision: str,
    own_memory: bool,
    paired: bool = False,
) -> PatchTables:
    """Patches of several garments: ``garment_patches`` and ``joined_rows``, arguments as there, in one table."""
    each = garment_patches(garments, points, terms, precision=precision, cache=Cache(), paired=paired)
    first = {"vertex": points, "edge": [g.ends for g in garments], "triangle": [g.corners for g in garments]}
    patch, overflow = joined_rows(each, terms, precision=precision, own_memory=own_memory)
    tables = concatenated(each, {name: starts_of(of) for name, of in first.items()})
    return replace(tables, patch=patch, overflow=overflow)


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
        make = partial(_garment_tables, *distinct[shape], size, terms, precision, paired)
        if len(distinct[shape][1]) < stored_value.SMALLEST:
            return make()
        return stored_value.stored("patches", PACKAGES, make, shape, *how)

    missing = [shape for shape in distinct if cache.key("patches", (), shape, *how) not in cache]
    small = [shape for shape in missing if len(distinct[shape][1]) <= PORTION * size]
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


def joined_rows(
    each: Sequence[PatchTables], terms: Terms, *, precision: str, own_memory: bool
) -> tuple[dict[str, Keys], int]:
    """Concatenated ``patch`` fields of the garments, with offsets into the overflow memory, and its size [bytes].

    ``own_memory``: whether each block has shared memory; on the CPU one buffer serves all blocks, one after another.
    """
    patch = concatenated_rows(each)
    memory = block_memory(patch, terms, precision)
    if not own_memory:
        return {**patch, "overflow": np.zeros_like(memory)}, int(memory.max(initial=0))
    over = too_large(patch, terms, precision)
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
    portions = [groups[first : first + PORTION] for first in range(0, len(groups), PORTION)]
    owner = np.empty(len(points), dtype=np.int64)
    for index, portion in enumerate(portions):
        owner[np.concatenate(portion)] = index
    ends, corners = (_by_portion(table, owner, len(portions)) for table in (elements.ends, elements.corners))
    owner *= MOST_PATCHES
    lane = np.zeros(len(points), dtype=np.int64)

    def cut(index: int) -> PatchTables:
        own = portions[index]
        while True:
            portion = Portion(own, index * MOST_PATCHES, owner, lane, ends[index], corners[index])
            tables = patch_tables(elements, places, terms, portion, paired)
            large = too_large(tables.patch, terms, precision) & (tables.patch["owned_count"] > 1)
            if not large.any():
                return tables
            own = [
                half
                for group, halved in zip(own, large, strict=True)
                for half in (_near_groups(places, -(-len(group) // 2), group) if halved else [group])
            ]

    tables = concatenated(map_in_threads(cut, range(len(portions))))
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
    tables = patch_tables(elements, places, terms, Portion(some, 0, of_others, lane, ends, corners), True)
    return float(too_large(tables.patch, terms, precision).mean())


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


def _by_portion(vertices: Indices, portion: Keys, portion_count: int) -> list[Keys]:
    """Positions of each portion's vertices in a flattened table."""
    of = portion[vertices.ravel()].astype(np.uint16)  # two bytes sort much faster
    return np.split(np.argsort(of, kind="stable"), np.cumsum(np.bincount(of, minlength=portion_count))[:-1])


Cluster = tuple[Indices, Floats, int]  # vertices, their positions, number of groups to divide them into


def _near_groups(places: Floats, size: int, vertices: Indices | None = None) -> list[Indices]:
    """Groups of at most ``size`` near vertices, by recursive bisection across the longest extent."""
    chosen = np.arange(len(places), dtype=np.int32) if vertices is None else vertices
    clusters = _halved((chosen, places[chosen], -(-len(chosen) // size)), PORTION)
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


def takes_pairs(terms: Terms, vertices: int | None = None) -> bool:
    """Whether threads should work on pairs of triangles, in a model of so many vertices; None: many.

    Small models have small patches, in which most threads would have no pair; a pair of woven triangles would need
    more registers than there are.
    """
    return terms.folds and not terms.yarns and (vertices is None or vertices > PAIRS.vertices * FEW)

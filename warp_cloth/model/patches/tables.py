"""Tables of patches: their vertices, edges and triangles by local numbers, as kernels.passes.gather reads them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.threads import concatenate
from warp_cloth.garment.elements import Elements
from warp_cloth.garment.rest import Floats
from warp_cloth.kernels.base.options import Terms
from warp_cloth.model.patches.members import Keys, Members, Numbers, Portion, edge_numbers, packed_bits, word_count
from warp_cloth.model.patches.tiles import Tiles

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


@dataclass(frozen=True, eq=False)
class PatchMembers:
    """What the patches of a portion compute, by local numbers."""

    triangles: Members  # those at vertices that the patch owns
    edges: Members  # those at its vertices, and whose hinges act on them
    normals: Members  # its triangles, and those beyond its edges
    vertices: Members  # of all these
    tiles: Tiles | None  # where threads work on pairs of triangles
    tile_count: Keys  # shape [P]


def patch_members(elements: Elements, places: Floats, terms: Terms, portion: Portion, paired: bool) -> PatchMembers:
    """Vertices, edges and triangles of a portion's patches; arguments as of ``patch_tables``."""
    count, corners, ends = len(portion.owned), elements.corners, elements.ends
    own = Members(portion.owner(corners.ravel()[portion.corners]), portion.corners // 3, max(len(corners), 1), count)
    patches: list[Keys] = [portion.owner(ends.ravel()[portion.ends])]
    found: list[Numbers] = [portion.ends // 2]
    if terms.folds:
        patches.append(np.repeat(own.patch, 3))
        found.append(edge_numbers(elements.edges[own.element]).ravel())
    edges = Members(np.concatenate(patches), np.concatenate(found), len(ends), count)
    folded = elements.hinge_stiffness[edges.listed] != 0.0
    beyond = (
        np.repeat(edges.listed_patch[folded], 2),
        elements.adjacent_triangles[edges.listed[folded]].ravel(),
    )
    normals = Members(
        np.concatenate([own.patch, beyond[0]]), np.concatenate([own.element, beyond[1]]), max(len(corners), 1), count
    )
    tiles = Tiles(elements, places, own, portion.lane) if paired else None
    if tiles is None:
        normals.arrange(corners[normals.element].min(axis=1), ~own.has(normals.patch, normals.element))
        edges.arrange(ends[edges.element].min(axis=1))
        tile_count = np.zeros(count, dtype=np.int64)
    else:
        tile_count = tiles.arrange(normals, edges)
    vertices = Members(
        np.concatenate([portion.patch, np.repeat(normals.patch, 3), np.repeat(edges.patch, 2)]),
        np.concatenate([portion.vertices, corners[normals.element].ravel(), ends[edges.element].ravel()]),
        portion.garment_vertices,
        count,
    )
    vertices.arrange(vertices.element, portion.owner(vertices.element) != vertices.patch)
    return PatchMembers(own, edges, normals, vertices, tiles, tile_count)


def patch_tables(elements: Elements, places: Floats, terms: Terms, portion: Portion, paired: bool) -> PatchTables:
    """Tables of a portion's patches, without offsets into overflow memory.

    ``paired``: whether threads work on pairs of triangles that share a side, the longest by the vertices' ``places``.
    """
    members = patch_members(elements, places, terms, portion, paired)
    own, edges, normals, vertices = members.triangles, members.edges, members.normals, members.vertices
    adjacent, at = elements.adjacent_triangles[edges.listed], edges.listed_patch[:, None]
    word = np.concatenate([vertices.find(at, elements.ends[edges.listed]), normals.find(at, adjacent)], axis=1)
    at, sides = normals.listed_patch[:, None], elements.edges[normals.listed]
    turned = ((sides < 0) * np.array([1, 2, 4])).sum(axis=1, keepdims=True)
    edge_end, corner = elements.ends.ravel()[portion.ends], elements.corners.ravel()[portion.corners]
    edge_entry = 2 * edges.find(portion.owner(edge_end), portion.ends // 2) + portion.ends % 2
    ranks = portion.ranks(edge_end, corner)
    slots = word_count(ranks) * portion.owned
    owner = portion.owner(corner)
    first = normals.count if terms.folds else own.count
    other = np.where(portion.corners % 3, first[owner] + (portion.corners % 3 - 1) * own.count[owner], 0)
    entry = normals.find(owner, portion.corners // 3) + other
    patch = {
        "vertex_start": vertices.start, "vertex_count": vertices.count, "owned_count": portion.owned,
        "edge_start": edges.start, "edge_count": edges.count,
        "triangle_start": normals.start, "triangle_count": own.count, "normal_count": normals.count,
        "slot_start": np.cumsum(slots) - slots, "ranks": ranks, "tile_count": members.tile_count,
    }  # fmt: skip
    tiles = members.tiles
    return PatchTables(
        patch=patch,
        vertex=vertices.listed,
        ends=packed_bits(word, QUARTER_BITS) if tiles is None else tiles.packed(word, vertices, normals, edges),
        edge=edges.listed,
        corners=packed_bits(vertices.find(at, elements.corners[normals.listed]), QUARTER_BITS),
        sides=packed_bits(np.concatenate([edges.find(at, edge_numbers(sides)), turned], axis=1), QUARTER_BITS),
        triangle=normals.listed,
        edge_slot=portion.ranked(ranks, edge_end, edge_entry, 2 * edges.count),
        slot=portion.ranked(ranks, corner, entry, first + 2 * own.count),
        overflow=0,
    )


def starts_of(arrays: Sequence[Any]) -> list[int]:
    """Start of each array in their concatenation."""
    return [0, *np.cumsum([len(array) for array in arrays])[:-1].tolist()]


def concatenated(each: Sequence[PatchTables], first: Mapping[str, Sequence[int]] | None = None) -> PatchTables:
    """Concatenates tables; ``first``: each one's first vertex, edge and triangle, where they differ."""
    if len(each) == 1:
        return each[0]
    names = [name for name in PatchTables.__dataclass_fields__ if name not in ("patch", "overflow")]
    tables = {name: concatenate([getattr(own, name) for own in each], (first or {}).get(name)) for name in names}
    return PatchTables(patch=concatenated_rows(each), overflow=0, **tables)


def concatenated_rows(each: Sequence[PatchTables]) -> dict[str, Keys]:
    """Concatenates the ``patch`` fields of tables."""
    starts = {"vertex_start": "vertex", "edge_start": "ends", "triangle_start": "corners",
              "slot_start": "slot"}  # fmt: skip
    patch = {}
    for name in each[0].patch:
        begin = starts_of([getattr(own, starts[name]) for own in each]) if name in starts else None
        patch[name] = concatenate([own.patch[name] for own in each], begin)
    return patch

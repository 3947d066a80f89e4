"""The device arrays of cloth on cloth: what its contact starts with, what is searched, and the trees of that."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices
from warp_cloth.contact.box_tree import box_tree
from warp_cloth.contact.crossing import Sheets
from warp_cloth.contact.leaf_order import first_order
from warp_cloth.contact.rest_neighbours import rest_near_rows
from warp_cloth.contact.sheets import SheetKind
from warp_cloth.garment.part import GarmentPart
from warp_cloth.kernels.contact.arrays import NO_LIMIT, REGIONS, TURNED, ContactData
from warp_cloth.kernels.contact.search import ContactSearch
from warp_cloth.model.permutation import Numbering

LEAST_THICKNESS = 1e-4  # [m]; thinner fabrics count as that thick: gauze is
# Pressure at which a fabric is half as thick [Pa]: KES compresses to 50 gf/cm2, 4.9 kPa, where most keep 60 to 70 %.
HALVING_PRESSURE = 1e4
FORCE_AT_HALF = 2.0  # squeeze_force over modulus times thickness, there
# Cloth within this many thicknesses along itself cannot be folded onto itself: the half turn between is pi/2 of them.
NEAR_SHARE = 1.6
OPEN_STRETCH = 2.0  # length over rest length beyond which an edge is a seam that has yet to close


def per_vertex(sheets: Sheets, values: Sequence[float] | NDArray[Any]) -> NDArray[Any]:
    """What each garment has, of each of its vertices."""
    return np.repeat(np.asarray(values), np.diff(sheets.vertex_start), axis=0)


def thicknesses(kinds: Sequence[SheetKind]) -> NDArray[np.float64]:
    """How thick each garment counts [m]."""
    return np.array([max(kind.thickness, LEAST_THICKNESS) for kind in kinds])


def contact_arrays(
    sheets: Sheets, parts: Sequence[GarmentPart], kinds: Sequence[SheetKind], numbering: Numbering
) -> Any:
    """Contact (kernels.contact.arrays ContactData) of these garments, asleep, but for its pairs and its skins."""
    count, thickness = sheets.vertex_count, thicknesses(kinds)
    area = np.array([part.rest.area / len(part.points) for part in parts])
    data = ContactData()
    modulus = HALVING_PRESSURE * area / (FORCE_AT_HALF * thickness)
    friction = np.array([kind.friction for kind in kinds])
    fabric = np.stack([thickness, modulus, friction, np.zeros(len(kinds))], axis=1)
    fabric = numbering.rows(per_vertex(sheets, fabric.astype(np.float32)))
    data.thickness = wp.array(fabric[:, 0], dtype=wp.float32)
    data.fabric = wp.array(fabric, dtype=wp.vec4f)
    data.thickest = float(thickness.max())
    data.margin = data.far = np.inf  # asleep
    data.count = wp.zeros(1, dtype=wp.int32)
    data.told = wp.zeros(2, dtype=wp.int32)
    data.sum = wp.zeros((count, 4), dtype=wp.int64)
    data.room = wp.full(count, int(NO_LIMIT), dtype=wp.int32)
    data.lift = wp.zeros(count, dtype=wp.float32)
    data.shift = wp.zeros(count, dtype=wp.vec3f)
    data.searched = wp.zeros(count, dtype=wp.vec3d)
    data.skin = wp.full(count, np.inf, dtype=wp.float32)  # asleep
    data.moved = wp.ones(1, dtype=wp.int32)
    data.asked, data.turn_then = wp.zeros(2, dtype=wp.int32), wp.zeros(1, dtype=wp.int32)
    data.region = wp.zeros(count, dtype=wp.int32)
    data.region_count = 1
    data.way, data.stride = (wp.zeros((2, REGIONS), dtype=kind) for kind in (wp.int64, wp.int32))
    data.turn = wp.zeros(2 * TURNED, dtype=wp.int32)
    return data


def search_arrays(
    sheets: Sheets, parts: Sequence[GarmentPart], kinds: Sequence[SheetKind], numbering: Numbering
) -> Any:
    """What is searched (kernels.contact.search ContactSearch), but for its trees."""
    start = sheets.vertex_start
    rows = [
        rest_near_rows(part.triangles, part.rest, len(part.points), NEAR_SHARE * thickness)
        for part, thickness in zip(parts, thicknesses(kinds), strict=True)
    ]
    counts = np.concatenate([np.diff(row_start) for row_start, _ in rows])
    search = ContactSearch()
    search.triangles = wp.array(numbering.of(sheets.triangles), dtype=wp.vec3i)
    search.edges = wp.array(numbering.of(sheets.edges), dtype=wp.vec2i)
    items = np.array([kind.item for kind in kinds], dtype=np.int32)
    search.item = wp.array(numbering.rows(per_vertex(sheets, items)), dtype=wp.int32)
    near = np.concatenate([vertices + first for (_, vertices), first in zip(rows, start, strict=False)])
    near_start, near = numbering.lists(np.concatenate([[0], np.cumsum(counts)]), numbering.of(near))
    search.near_start, search.near = wp.array(near_start, dtype=wp.int32), wp.array(near, dtype=wp.int32)
    lengths = np.concatenate([part.rest.edge_length for part in parts])
    search.longest = wp.array(OPEN_STRETCH * lengths, dtype=wp.float32)
    search.sides = wp.array(sheets.triangle_edges, dtype=wp.vec3i)
    search.whole = wp.ones(1, dtype=wp.int32)
    search.tangled = wp.zeros(sheets.vertex_count, dtype=wp.int32)
    return search


def lay_out_trees(
    search: Any, untangling: Any, sheets: Sheets, kinds: Sequence[SheetKind], numbering: Numbering
) -> tuple[Indices, Indices]:
    """Gives what is searched its trees; returns what ``Planting`` puts in order there, once it is known where it is.

    That is as of planting.first_order: triangles, then edges and vertices, one after another.
    """
    both, sheet_of = np.unique([(kind.item, kind.layer) for kind in kinds], axis=0, return_inverse=True)
    sheet = per_vertex(sheets, sheet_of.reshape(-1).astype(np.int32))
    alone = np.arange(sheets.vertex_count, dtype=np.int32)[:, None]
    all_of_it = (sheets.triangles, sheets.edges, alone)
    triangles, edges, vertices = (first_order(sheet[of[:, 0]]) for of in all_of_it)
    search.triangle_tree, search.edge_tree = box_tree(triangles[0]), box_tree(edges[0])
    search.corners = wp.zeros(len(triangles[0]), dtype=wp.vec3i)
    search.ends = wp.zeros(len(edges[0]), dtype=wp.vec2i)
    search.vertex = wp.full(len(vertices[0]), -1, dtype=wp.int32)
    of_item = np.searchsorted(both[:, 0], np.arange(both[-1, 0] + 2))  # first sheet of each item
    starts = (triangles[1], edges[1])
    leaves = [each[of_item[at : len(of_item) - 1 + at]] for each in starts for at in (0, 1)]
    search.leaves = wp.array(np.stack(leaves, axis=1), dtype=wp.vec4i)
    own = np.stack([triangles[1][sheet], triangles[1][sheet + 1]], axis=1)
    untangling.own = wp.array(numbering.rows(own), dtype=wp.vec2i)
    orders = [triangles[0], edges[0], np.where(vertices[0] < 0, -1, numbering.of(vertices[0]))]
    first = np.cumsum([0, *(len(of) for of in all_of_it[:2])])
    order = np.concatenate([np.where(own < 0, -1, own + at) for own, at in zip(orders, first, strict=True)])
    ends = np.cumsum([0, *(len(own) for own in orders[:2])])
    starts_of_all = [own[1] + at for own, at in zip((triangles, edges, vertices), ends, strict=True)]
    return order.astype(np.int32), np.concatenate(starts_of_all)

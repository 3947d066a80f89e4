"""The device arrays of cloth contact: initial state, searched geometry, and its box trees."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices
from warp_cloth.contact.box_tree import box_tree
from warp_cloth.contact.crossing import Sheets
from warp_cloth.contact.leaf_order import sheet_order
from warp_cloth.contact.rest_neighbours import rest_near_rows
from warp_cloth.contact.sheets import SheetKind
from warp_cloth.garment.garment import Garment
from warp_cloth.kernels.contact.arrays import NEXT_ITERATION, NO_LIMIT, REGIONS, ContactData, ContactFabric
from warp_cloth.kernels.contact.search import ContactSearch
from warp_cloth.model.permutation import Permutation

LEAST_THICKNESS = 1e-4  # [m], that of gauze; thinner fabrics count as that thick
# Pressure at which a fabric is half as thick [Pa]: KES compresses to 50 gf/cm2, 4.9 kPa, where most keep 60 to 70 %.
HALVING_PRESSURE = 1e4
FORCE_AT_HALF = 2.0  # squeeze force there, over modulus times thickness
# Cloth within this many thicknesses along itself cannot be folded onto itself: a half turn takes pi/2 of them.
NEAR_AT_REST = 1.6
# Length over rest length beyond which an edge is a seam that has yet to close; where nothing is to be sewn none is, and
# a stretched edge is cloth: taken for a seam it passed through all, and kept the crossing search from narrowing down.
OPEN_STRETCH = 2.0


def per_vertex(sheets: Sheets, values: Sequence[float] | NDArray[Any]) -> NDArray[Any]:
    """A value of each garment, repeated for each of its vertices."""
    return np.repeat(np.asarray(values), np.diff(sheets.vertex_start), axis=0)


def thicknesses(kinds: Sequence[SheetKind]) -> NDArray[np.float64]:
    """Thickness of each garment in contact [m]."""
    return np.array([max(kind.thickness, LEAST_THICKNESS) for kind in kinds])


def contact_arrays(
    sheets: Sheets,
    garments: Sequence[Garment],
    kinds: Sequence[SheetKind],
    permutation: Permutation,
    skins: tuple[float, float],
) -> Any:
    """Contact (kernels.contact.arrays ContactData) of these garments, asleep; least and greatest ``skins`` [m].

    All but the pair list, which grows: ``PairSearch.allocate_pairs`` makes it.
    """
    count, thickness = sheets.vertex_count, thicknesses(kinds)
    area = np.array([garment.rest.area / len(garment.points) for garment in garments])
    data = ContactData()
    of_garment = np.zeros(len(kinds), dtype=ContactFabric.numpy_dtype())
    of_garment["thickness"] = thickness
    of_garment["squeeze_modulus"] = HALVING_PRESSURE * area / (FORCE_AT_HALF * thickness)
    of_garment["friction"] = [kind.friction for kind in kinds]
    fabric = permutation.rows(per_vertex(sheets, of_garment))
    data.model.thickness = wp.array(fabric["thickness"], dtype=wp.float32)
    data.model.fabric = wp.array(fabric, dtype=ContactFabric)
    data.model.thickest = float(thickness.max())
    data.model.least_skin, data.model.most_skin = skins
    data.model.active_margin = data.model.active_distance = np.inf  # asleep
    data.model.lift = wp.zeros(count, dtype=wp.float32)
    data.pairs.count = wp.zeros(1, dtype=wp.int32)
    data.blocks.done = wp.zeros(2, dtype=wp.int32)
    data.sums.load = wp.zeros((count, 4), dtype=wp.int64)
    data.sums.step_limit = wp.full(count, int(NO_LIMIT), dtype=wp.int32)
    data.shift = wp.zeros(count, dtype=wp.vec3f)
    data.trigger.position = wp.zeros(count, dtype=wp.vec3d)
    data.trigger.skin = wp.full(count, np.inf, dtype=wp.float32)  # asleep
    data.trigger.due = wp.ones(1, dtype=wp.int32)
    data.trigger.requests, data.trigger.last_search = wp.zeros(2, dtype=wp.int32), wp.zeros(1, dtype=wp.int32)
    data.bounds.region = wp.zeros(count, dtype=wp.int32)
    data.bounds.region_count = 1
    data.bounds.path, data.bounds.step = (wp.zeros((2, REGIONS), dtype=kind) for kind in (wp.int64, wp.int32))
    data.bounds.iteration = wp.zeros(2 * NEXT_ITERATION, dtype=wp.int32)
    return data


def search_arrays(
    sheets: Sheets, garments: Sequence[Garment], kinds: Sequence[SheetKind], permutation: Permutation
) -> Any:
    """The searched geometry (kernels.contact.search ContactSearch), without its trees."""
    start = sheets.vertex_start
    rows = [
        rest_near_rows(garment.triangles, garment.rest, len(garment.points), NEAR_AT_REST * thickness)
        for garment, thickness in zip(garments, thicknesses(kinds), strict=True)
    ]
    counts = np.concatenate([np.diff(row_start) for row_start, _ in rows])
    search = ContactSearch()
    search.triangles = wp.array(permutation.of(sheets.triangles), dtype=wp.vec3i)
    search.edges = wp.array(permutation.of(sheets.edges), dtype=wp.vec2i)
    near = np.concatenate([vertices + first for (_, vertices), first in zip(rows, start, strict=False)])
    near_start, near = permutation.lists(np.concatenate([[0], np.cumsum(counts)]), permutation.of(near))
    search.near_start, search.near = wp.array(near_start, dtype=wp.int32), wp.array(near, dtype=wp.int32)
    open_stretch = [np.inf if garment.is_modelled else OPEN_STRETCH for garment in garments]
    lengths = [each * garment.rest.edge_length for each, garment in zip(open_stretch, garments, strict=True)]
    search.longest = wp.array(np.concatenate(lengths), dtype=wp.float32)
    search.sides = wp.array(sheets.triangle_edges, dtype=wp.vec3i)
    search.whole = wp.ones(1, dtype=wp.int32)
    search.tangled = wp.zeros(sheets.vertex_count, dtype=wp.int32)
    return search


def build_trees(
    search: Any, untangling: Any, sheets: Sheets, kinds: Sequence[SheetKind], permutation: Permutation
) -> tuple[Indices, Indices]:
    """Allocates the trees; returns the initial order of leaves and the starts of sheets in it, for ``LeafOrder``.

    Both as in leaf_order.sheet_order, of triangles, edges and vertices one after another.
    """
    _, sheet_of = np.unique([kind.layer for kind in kinds], return_inverse=True)
    sheet = per_vertex(sheets, sheet_of.astype(np.int32))
    alone = np.arange(sheets.vertex_count, dtype=np.int32)[:, None]
    all_of_it = (sheets.triangles, sheets.edges, alone)
    triangles, edges, vertices = (sheet_order(sheet[of[:, 0]]) for of in all_of_it)
    search.triangle_tree, search.edge_tree = box_tree(triangles[0]), box_tree(edges[0])
    search.corners = wp.zeros(len(triangles[0]), dtype=wp.vec3i)
    search.ends = wp.zeros(len(edges[0]), dtype=wp.vec2i)
    search.vertex = wp.full(len(vertices[0]), -1, dtype=wp.int32)
    own = np.stack([triangles[1][sheet], triangles[1][sheet + 1]], axis=1)
    untangling.own_leaves = wp.array(permutation.rows(own), dtype=wp.vec2i)
    orders = [triangles[0], edges[0], np.where(vertices[0] < 0, -1, permutation.of(vertices[0]))]
    first = np.cumsum([0, *(len(of) for of in all_of_it[:2])])
    order = np.concatenate([np.where(own < 0, -1, own + at) for own, at in zip(orders, first, strict=True)])
    ends = np.cumsum([0, *(len(own) for own in orders[:2])])
    starts_of_all = [own[1] + at for own, at in zip((triangles, edges, vertices), ends, strict=True)]
    return order.astype(np.int32), np.concatenate(starts_of_all)

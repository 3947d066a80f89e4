"""Search for pairs: its geometry, and the refit of two box trees (BVHs), of triangles and of edges."""

import functools
from typing import Any

import warp as wp

from warp_cloth.kernels.base.access import position_of
from warp_cloth.kernels.base.block import block_of, block_threads, lane_of, warp_size
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.contact.arrays import ContactData
from warp_cloth.kernels.contact.box_tree import (
    EMPTY_BOUND,
    LEAVES,
    WIDTH,
    BoxTree,
    refit_above,
    refit_groups,
    store_box,
    team_lane,
    team_min,
)
from warp_cloth.kernels.contact.broad_phase import Candidates, clear_candidates
from warp_cloth.kernels.contact.search_trigger import next_skin
from warp_cloth.kernels.contact.stick_memory import StickMemory, begin_search, remember_stick
from warp_cloth.kernels.patches.packing import order_functions

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

SLACK = wp.constant(wp.float32(1.0e-6))  # [m]; outweighs the rounding of a box to float32


@wp.struct
class ContactSearch:
    """The geometry that is searched: E edges and F triangles over V vertices, and trees of their boxes."""

    triangles: wp.array(dtype=wp.vec3i)  # shape [F]
    edges: wp.array(dtype=wp.vec2i)  # shape [E]
    longest: wp.array(dtype=wp.float32)  # length from which an edge is a seam that has yet to close [m], shape [E]
    sides: wp.array(dtype=wp.vec3i)  # edges of each triangle, shape [F]
    near_start: wp.array(dtype=wp.int32)  # rows of the vertices near each one in the rest shape, shape [V + 1]
    near: wp.array(dtype=wp.int32)  # those vertices, itself among them
    triangle_tree: BoxTree
    edge_tree: BoxTree
    vertex: wp.array(dtype=wp.int32)  # vertices in spatial order; -1: none, so that a group has one layer only
    corners: wp.array(dtype=wp.vec3i)  # of the triangles, in the tree's order
    ends: wp.array(dtype=wp.vec2i)  # of the edges, in the tree's order
    whole: wp.array(dtype=wp.int32)  # whether the next crossing search is for all, not only what was tangled, shape [1]
    tangled: wp.array(dtype=wp.int32)  # > 0 where a vertex belongs to what crosses, shape [V]


@wp.func
def tree_of(search: ContactSearch, triangles: bool):
    """The tree of the triangles, or of the edges."""
    if triangles:
        return search.triangle_tree
    return search.edge_tree


@wp.func
def is_open_seam(search: ContactSearch, edge: int, along: wp.vec3f):
    """Whether an edge with this edge vector [m] is a seam that has yet to close."""
    return wp.length(along) > search.longest[edge]


@wp.func
def spans_open_seam(search: ContactSearch, sides: wp.vec3i, a: wp.vec3f, b: wp.vec3f, c: wp.vec3f):
    """Whether any side of a triangle with these corners [m] is a seam that has yet to close."""
    return (
        is_open_seam(search, sides[0], b - a)
        or is_open_seam(search, sides[1], c - b)
        or is_open_seam(search, sides[2], a - c)
    )


@functools.cache
def open_seams_kernel(precision: str) -> wp.Kernel:
    """Kernel ``count_open_seams``."""
    State = cloth_types(precision).State

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def count_open_seams(state: State, search: ContactSearch, count: wp.array(dtype=wp.int32)):
        """Counts the edges that span seams yet to close."""
        edge = wp.tid()
        ends = search.edges[edge]
        if is_open_seam(search, edge, wp.vec3f(position_of(state, ends[1])) - wp.vec3f(position_of(state, ends[0]))):
            wp.atomic_add(count, 0, 1)

    return count_open_seams


@wp.func
def box_margin(contact: ContactData, skin: wp.float32):
    """Margin by which a box of cloth with such a skin is enlarged [m]: what it does not overlap is not near."""
    margin = skin + float(0.5) * float(contact.model.thickest) + SLACK
    return wp.vec3f(margin, margin, margin)


@wp.func
def least_box_margin(contact: ContactData):
    """Least margin of two boxes together [m]: boxes that do not overlap when one is reduced by it do not cross."""
    margin = float(wp.float64(2.0) * contact.model.least_skin + contact.model.thickest)
    return wp.vec3f(margin, margin, margin)


@functools.cache
def start_kernel(precision: str, in_order: bool = False) -> wp.Kernel:
    """Kernel ``start_search``; ``in_order`` as in packing.order_functions."""
    State = cloth_types(precision).State
    displacement_at = order_functions(precision, packed=False, in_order=in_order).displacement_at

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def start_search(state: State, contact: ContactData, memory: StickMemory, candidates: Candidates):
        """Stores each vertex's position, its skin, and the pairs' stick displacements; empties the candidates.

        Where the pair list was full it is chance which pairs were listed: their stick displacements are dropped.
        """
        thread = wp.tid()
        clear_candidates(candidates, thread)
        if thread == 0:
            contact.trigger.last_search[0] = contact.bounds.iteration[0]
        if thread < contact.trigger.position.shape[0]:
            position = position_of(state, thread)
            moved = wp.vec3d(displacement_at(state, thread))
            contact.trigger.skin[thread] = next_skin(contact, thread, position, moved)
            contact.trigger.position[thread] = position
        count = contact.pairs.count[0]
        if thread < count and count <= contact.pairs.corners.shape[0]:
            remember_stick(contact, memory, thread)

    return start_search


@wp.func
def triangle_box(state: Any, search: ContactSearch, contact: ContactData, place: int):
    """Corners of the box of a triangle, by its place in the tree [m]; across a seam yet to close the box is empty.

    It would overlap half the garment.
    """
    lower = wp.vec3f(EMPTY_BOUND, EMPTY_BOUND, EMPTY_BOUND)
    upper = -lower
    triangle = search.triangle_tree.leaf[place]
    if triangle >= 0:
        corners = search.corners[place]
        sides = search.sides[triangle]
        a = wp.vec3f(position_of(state, corners[0]))
        b = wp.vec3f(position_of(state, corners[1]))
        c = wp.vec3f(position_of(state, corners[2]))
        if not spans_open_seam(search, sides, a, b, c):
            skin = wp.max(
                contact.trigger.skin[corners[0]],
                wp.max(contact.trigger.skin[corners[1]], contact.trigger.skin[corners[2]]),
            )
            wide = box_margin(contact, skin)
            lower = wp.min(wp.min(a, b), c) - wide
            upper = wp.max(wp.max(a, b), c) + wide
    return lower, upper


@wp.func
def edge_box(state: Any, search: ContactSearch, contact: ContactData, place: int):
    """Corners of the box of an edge, by its place in the tree [m], empty where it is a seam yet to close.

    Until all seams have closed, the crossing search is for all.
    """
    lower = wp.vec3f(EMPTY_BOUND, EMPTY_BOUND, EMPTY_BOUND)
    upper = -lower
    edge = search.edge_tree.leaf[place]
    if edge >= 0:
        ends = search.ends[place]
        p = wp.vec3f(position_of(state, ends[0]))
        q = wp.vec3f(position_of(state, ends[1]))
        if is_open_seam(search, edge, q - p):
            search.whole[0] = 1
        else:
            wide = box_margin(contact, wp.max(contact.trigger.skin[ends[0]], contact.trigger.skin[ends[1]]))
            lower = wp.min(p, q) - wide
            upper = wp.max(p, q) + wide
    return lower, upper


@functools.cache
def refit_kernel(precision: str) -> wp.Kernel:
    """Kernel ``refit_trees``."""
    State = cloth_types(precision).State

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False)
    def refit_trees(state: State, search: ContactSearch, contact: ContactData, memory: StickMemory, clear: int):
        """Each block refits LEAVES edges, or triangles; ``clear`` also empties the pair list."""
        thread = wp.tid()
        if thread == 0 and clear > 0:
            contact.pairs.count[0] = 0
            contact.trigger.due[0] = 0
            begin_search(memory)
        lane = lane_of(thread)
        block = block_of(thread)
        edge_blocks = search.edge_tree.leaf.shape[0] // LEAVES
        local = int(lane)
        if block < edge_blocks:
            while local < LEAVES:
                place = block * LEAVES + local
                low, high = edge_box(state, search, contact, place)
                store_box(search.edge_tree, 0, place, low, high)
                local += block_threads()
            refit_above(search.edge_tree, block, lane)
        else:
            block -= edge_blocks
            while local < LEAVES:
                place = block * LEAVES + local
                low, high = triangle_box(state, search, contact, place)
                store_box(search.triangle_tree, 0, place, low, high)
                local += block_threads()
            refit_above(search.triangle_tree, block, lane)

    return refit_trees


@wp.kernel(grid_stride=False)
def refit_top(search: ContactSearch):
    """Refits the highest level of the trees that have four, one block each."""
    thread = wp.tid()
    tree = search.edge_tree
    if block_of(thread) == 1:
        tree = search.triangle_tree
    if tree.levels > 3:
        refit_groups(tree, 2, 0, tree.first[3] - tree.first[2], lane_of(thread))


@wp.func
def vertex_group_box(state: Any, search: ContactSearch, contact: ContactData, group: int):
    """Lower and upper corner of the box of a group of vertices with their margins [m], by a team."""
    low = wp.vec3f(EMPTY_BOUND, EMPTY_BOUND, EMPTY_BOUND)
    high = -low
    local = team_lane()
    while local < WIDTH:
        vertex = search.vertex[WIDTH * group + local]
        if vertex >= 0:
            x = wp.vec3f(position_of(state, vertex))
            wide = box_margin(contact, contact.trigger.skin[vertex])
            low = wp.min(low, x - wide)
            high = wp.max(high, x + wide)
        local += warp_size()
    return team_min(low), -team_min(-high)

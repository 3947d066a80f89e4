"""Narrow phase of the search: lists the pairs of cloth that are near each other."""

import functools
from typing import Any

import warp as wp

from warp_cloth.kernels.base.access import position_of
from warp_cloth.kernels.base.block import warp_size
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.contact.arrays import (
    NEIGHBOURS,
    ON_EDGE,
    ON_TRIANGLE,
    ContactData,
    due_path,
    listing_distance,
    pair_path,
    pair_regions,
    pair_thickness,
    separation_function,
)
from warp_cloth.kernels.contact.box_tree import (
    WIDTH,
    BoxWalk,
    leaf_overlaps,
    load_box,
    low_bits,
    may_overlap,
    start_walk,
    team_lane,
)
from warp_cloth.kernels.contact.broad_phase import (
    Candidates,
    Query,
    groups_kernel,
    leaves_kernel,
    list_leaves_function,
    query_of,
    search_context_function,
    walk_groups_function,
)
from warp_cloth.kernels.contact.search import ContactSearch, box_margin, tree_of, vertex_group_box
from warp_cloth.kernels.contact.stick_memory import StickMemory, remembered_stick

wp.set_module_options({"enable_backward": False, "fuse_fp": False})


# Four at a time: a GPU waits for memory far longer than it compares.
_NEAR_AT_REST = """
    const int end = start.data[vertex + 1];
    bool found = false;
    for (int row = start.data[vertex]; row < end && !found; row += 4) {
#pragma unroll
        for (int k = 0; k < 4; ++k) {
            const int other = others.data[row + k < end ? row + k : end - 1];
            found = found | (other == a) | (other == b) | (other == c);
        }
    }
    return found;
"""


@wp.func_native(_NEAR_AT_REST)
def near_at_rest(
    start: wp.array(dtype=wp.int32), others: wp.array(dtype=wp.int32), vertex: int, a: int, b: int, c: int
) -> bool:
    """Whether a vertex is near any of three others in the rest shape; rows of ContactSearch."""
    return others[start[vertex]] == a or others[start[vertex + 1] - 1] == b


_NEXT_SLOT = """
#if defined(__CUDA_ARCH__)
    const unsigned int callers = __activemask();
    const int first = __ffs(callers) - 1, lane = threadIdx.x & 31;
    int slot = 0;
    if (lane == first)
        slot = atomicAdd(count.data, __popc(callers));
    return __shfl_sync(callers, slot, first) + __popc(callers & ((1u << lane) - 1u));
#else
    return wp::atomic_add(count, 0, 1);
#endif
"""


@wp.func_native(_NEXT_SLOT)
def next_slot(count: wp.array(dtype=wp.int32)) -> int:
    """The counter's next value, a different one for each thread; one atomic for each warp."""
    ...


@wp.func
def store_pair(
    contact: ContactData, memory: StickMemory, corners: wp.vec4i, kind: int, neighbours: bool, distance: wp.float64
):
    """Counts a pair and stores it, unless the list is full, with its stick displacement from before the search."""
    slot = next_slot(contact.pairs.count)
    if slot < contact.pairs.corners.shape[0]:
        thickness = wp.float64(pair_thickness(contact, corners))
        contact.pairs.corners[slot] = corners
        regions = pair_regions(contact, corners, kind)
        contact.pairs.regions[slot] = regions
        contact.pairs.due[slot] = due_path(contact, kind, distance, thickness, pair_path(contact, regions))
        stick = wp.vec4f()
        if distance < thickness:
            stick = remembered_stick(memory, corners, kind)
        contact.pairs.stick[slot] = stick
        contact.pairs.kind[slot] = wp.where(neighbours, kind + NEIGHBOURS, kind)


@functools.cache
def near_test_function(precision: str) -> wp.Function:
    """Function ``test_near``, the exact test of two leaves whose boxes overlap."""
    triangle_separation, edge_separation = separation_function(precision, 0), separation_function(precision, 1)

    @wp.func
    def test_triangle(context: Any, vertex: int, t: wp.vec3i):
        """Stores a vertex and a triangle if they are near each other."""
        state, search, contact = context.state, context.search, context.contact
        x_0, x_1 = position_of(state, vertex), position_of(state, t[0])
        x_2, x_3 = position_of(state, t[1]), position_of(state, t[2])
        _weights, _separation, _square, length = triangle_separation(x_0, x_1, x_2, x_3)
        corners = wp.vec4i(vertex, t[0], t[1], t[2])
        distance = wp.float64(length)
        if distance < listing_distance(contact, corners, ON_TRIANGLE):
            neighbours = near_at_rest(search.near_start, search.near, vertex, t[0], t[1], t[2])
            store_pair(contact, context.extra, corners, ON_TRIANGLE, neighbours, distance)

    @wp.func
    def test_edges(context: Any, e: wp.vec2i, o: wp.vec2i):
        """Stores two edges if they are near each other."""
        state, search, contact = context.state, context.search, context.contact
        x_0, x_1 = position_of(state, e[0]), position_of(state, e[1])
        x_2, x_3 = position_of(state, o[0]), position_of(state, o[1])
        _weights, _separation, _square, length = edge_separation(x_0, x_1, x_2, x_3)
        corners = wp.vec4i(e[0], e[1], o[0], o[1])
        distance = wp.float64(length)
        if distance < listing_distance(contact, corners, ON_EDGE):
            neighbours = near_at_rest(search.near_start, search.near, e[0], o[0], o[1], o[1])
            neighbours = neighbours or near_at_rest(search.near_start, search.near, e[1], o[0], o[1], o[1])
            store_pair(contact, context.extra, corners, ON_EDGE, neighbours, distance)

    @wp.func
    def test_near(context: Any, querying: int, leaf: int):
        """Stores two leaves (Candidates.leaf) if they are near each other."""
        search = context.search
        if querying < 0:
            test_triangle(context, -1 - querying, search.corners[leaf])
        else:
            # the lower edge comes first, wherever they are in the tree
            edge, other = search.edge_tree.leaf[querying], search.edge_tree.leaf[leaf]
            one, two = search.ends[querying], search.ends[leaf]
            e, o = wp.where(edge < other, one, two), wp.where(edge < other, two, one)
            test_edges(context, e, o)

    return test_near


@functools.cache
def near_leaves_function(precision: str) -> wp.Function:
    """Function ``find_near``, the step from groups to leaves (broad_phase.walk_groups_function)."""
    list_leaves = list_leaves_function(near_test_function(precision))

    @wp.func
    def find_near(context: Any, query: Query, group: int):
        """Lists the leaves of a group that may be near a query's vertices (ON_TRIANGLE) or edges (ON_EDGE)."""
        state, search, contact = context.state, context.search, context.contact
        local = team_lane()
        while local < WIDTH:
            mask = wp.uint32(0)
            querying = WIDTH * query.group + local
            if query.kind == ON_EDGE:
                low, high = load_box(search.edge_tree, 0, querying)
                ends = search.ends[querying]
                may = may_overlap(search.edge_tree, group, low, high)
                mask = leaf_overlaps(search.edge_tree.bound, search.ends, group, low, high, ends[0], ends[1], may)
                if group == query.group:
                    mask = mask & ~low_bits(local + 1)
            else:
                vertex = search.vertex[querying]
                x = wp.vec3f(position_of(state, wp.max(vertex, 0)))
                wide = box_margin(contact, contact.trigger.skin[wp.max(vertex, 0)])
                low, high = x - wide, x + wide
                may = wp.where(vertex >= 0, may_overlap(search.triangle_tree, group, low, high), 0)
                bound = search.triangle_tree.bound
                mask = leaf_overlaps(bound, search.corners, group, low, high, vertex, vertex, may)
                querying = -1 - vertex
            list_leaves(context, querying, group, mask)
            local += warp_size()

    return find_near


@functools.cache
def near_groups_kernel(precision: str) -> wp.Kernel:
    """Kernel ``find_near_groups``."""
    State, walk_groups = cloth_types(precision).State, walk_groups_function(near_leaves_function(precision))
    search_context = search_context_function(precision, ContactSearch, StickMemory)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False)
    def find_near_groups(
        state: State, search: ContactSearch, contact: ContactData, memory: StickMemory, candidates: Candidates
    ):
        """Lists the groups of leaves that may be near each group of edges, and of vertices: a team for each."""
        context = search_context(state, search, contact, memory, candidates)
        group = wp.tid() // warp_size()
        edge_groups = search.edge_tree.leaf.shape[0] // WIDTH
        query = query_of(ON_EDGE, group)
        walk, wanted = BoxWalk(), bool(False)
        if group < edge_groups:
            edge = search.edge_tree.leaf[WIDTH * group]
            if edge >= 0:
                low, high = load_box(search.edge_tree, 1, group)
                walk = start_walk(search.edge_tree, low, high, WIDTH * group, search.edge_tree.leaf.shape[0])
                wanted = True
        else:
            query = query_of(ON_TRIANGLE, group - edge_groups)
            vertex = search.vertex[WIDTH * query.group]
            if vertex >= 0:
                low, high = vertex_group_box(state, search, contact, query.group)
                walk = start_walk(search.triangle_tree, low, high, 0, search.triangle_tree.leaf.shape[0])
                wanted = True
        if wanted:
            walk_groups(context, tree_of(search, query.kind == ON_TRIANGLE), walk, query)

    return find_near_groups


def near_list_kernels(precision: str) -> tuple[wp.Kernel, wp.Kernel]:
    """Kernels that process the lists: of pairs of groups, and of pairs of leaves, which store what is near."""
    return (
        groups_kernel(precision, near_leaves_function(precision), ContactSearch, StickMemory),
        leaves_kernel(precision, near_test_function(precision), ContactSearch, StickMemory),
    )

"""Finds which cloth is near which: the pairs that contact presses."""

import functools

import warp as wp

from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, place_function
from warp_cloth.kernels.contact.arrays import (
    NEIGHBOURS,
    ON_EDGE,
    ON_TRIANGLE,
    ContactData,
    apart_function,
    due_after,
    pair_gone,
    pair_reach,
    pair_regions,
    pair_thickness,
)
from warp_cloth.kernels.contact.box_tree import (
    WIDTH,
    below,
    box_of,
    boxes_meeting,
    may_meet,
    team_lane,
    team_threads,
    walk_from,
)
from warp_cloth.kernels.contact.broad_phase import (
    LISTING,
    Meetings,
    list_leaves_function,
    listed_groups_function,
    listed_leaves_function,
    meet_function,
)
from warp_cloth.kernels.contact.search import ContactSearch, group_box_function, room_around
from warp_cloth.kernels.contact.stick_memory import LeanMemory, remembered_lean

wp.set_module_options({"enable_backward": False, "fuse_fp": False})


# Four at a time: a GPU waits for memory far longer than it compares.
_REST_NEAR = """
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


@wp.func_native(_REST_NEAR)
def rest_near(
    start: wp.array(dtype=wp.int32), others: wp.array(dtype=wp.int32), vertex: int, a: int, b: int, c: int
) -> bool:
    """Whether a vertex is near any of three others in the rest shape; ContactSearch has who is near whom."""
    return others[start[vertex]] == a or others[start[vertex + 1] - 1] == b


_NEXT_SLOT = """
#if defined(__CUDA_ARCH__)
    const unsigned int asking = __activemask();
    const int first = __ffs(asking) - 1, lane = threadIdx.x & 31;
    int slot = 0;
    if (lane == first)
        slot = atomicAdd(count.data, __popc(asking));
    return __shfl_sync(asking, slot, first) + __popc(asking & ((1u << lane) - 1u));
#else
    return wp::atomic_add(count, 0, 1);
#endif
"""


@wp.func_native(_NEXT_SLOT)
def next_slot(count: wp.array(dtype=wp.int32)) -> int:
    """A number of its own for each that asks, counted; the threads that ask at once go to the counter together."""
    ...


@wp.func
def keep_pair(contact: ContactData, memory: LeanMemory, corners: wp.vec4i, kind: int, near: bool, distance: wp.float64):
    """Counts a pair and, while there is room, keeps it, with the lean that it had before the search."""
    slot = next_slot(contact.count)
    if slot < contact.corners.shape[0]:
        thickness = wp.float64(pair_thickness(contact, corners))
        contact.corners[slot] = corners
        regions = pair_regions(contact, corners, kind)
        contact.regions[slot] = regions
        contact.due[slot] = due_after(contact, kind, distance, thickness, pair_gone(contact, regions))
        lean = wp.vec4f()
        if distance < thickness:
            lean = remembered_lean(memory, corners, kind)
        contact.lean[slot] = lean
        contact.kind[slot] = wp.where(near, kind + NEIGHBOURS, kind)


@functools.cache
def distance_function(precision: str, sort: int) -> wp.Function:
    """The function that tells how far apart a pair of a sort is."""
    State, at, pair_apart = cloth_types(precision).State, place_function(precision), apart_function(precision, sort)

    @wp.func
    def pair_distance(state: State, corners: wp.vec4i):
        """How far apart a pair is [m]."""
        x0, x1 = at(state.position, corners[0]), at(state.position, corners[1])
        x2, x3 = at(state.position, corners[2]), at(state.position, corners[3])
        _weights, _way, _square, distance = pair_apart(x0, x1, x2, x3)
        return wp.float64(distance)

    return pair_distance


@functools.cache
def keep_function(precision: str) -> wp.Function:
    """The function that looks closely at what may be near."""
    State = cloth_types(precision).State
    to_triangle, to_edge = distance_function(precision, 0), distance_function(precision, 1)

    @wp.func
    def keep_on_triangle(
        state: State, search: ContactSearch, contact: ContactData, memory: LeanMemory, vertex: int, t: wp.vec3i
    ):
        """Keeps a vertex and a triangle if they are near each other."""
        corners = wp.vec4i(vertex, t[0], t[1], t[2])
        distance = to_triangle(state, corners)
        if distance < pair_reach(contact, corners, ON_TRIANGLE):
            near = rest_near(search.near_start, search.near, vertex, t[0], t[1], t[2])
            keep_pair(contact, memory, corners, ON_TRIANGLE, near, distance)

    @wp.func
    def keep_on_edge(
        state: State, search: ContactSearch, contact: ContactData, memory: LeanMemory, e: wp.vec2i, o: wp.vec2i
    ):
        """Keeps two edges if they are near each other."""
        corners = wp.vec4i(e[0], e[1], o[0], o[1])
        distance = to_edge(state, corners)
        if distance < pair_reach(contact, corners, ON_EDGE):
            near = rest_near(search.near_start, search.near, e[0], o[0], o[1], o[1])
            near = near or rest_near(search.near_start, search.near, e[1], o[0], o[1], o[1])
            keep_pair(contact, memory, corners, ON_EDGE, near, distance)

    @wp.func
    def keep_near(state: State, search: ContactSearch, contact: ContactData, memory: LeanMemory, asking: int, met: int):
        """Keeps two leaves (Meetings.leaf) if they are near each other."""
        if asking < 0:
            keep_on_triangle(state, search, contact, memory, -1 - asking, search.corners[met])
        else:
            # the lower comes first, wherever they are in the tree
            edge, other = search.edge_tree.leaf[asking], search.edge_tree.leaf[met]
            one, two = search.ends[asking], search.ends[met]
            e, o = wp.where(edge < other, one, two), wp.where(edge < other, two, one)
            keep_on_edge(state, search, contact, memory, e, o)

    return keep_near


@functools.cache
def near_leaves_function(precision: str) -> wp.Function:
    """The function that lists which leaves of two groups may be near each other."""
    State, at = cloth_types(precision).State, place_function(precision)
    list_leaves = list_leaves_function(keep_function(precision), State, ContactSearch, ContactData, LeanMemory)

    @wp.func
    def find_near(
        state: State,
        search: ContactSearch,
        contact: ContactData,
        memory: LeanMemory,
        meetings: Meetings,
        kind: int,
        group: int,
        met: int,
    ):
        """Lists the leaves of a group, met by another, that may be near; ``kind`` ON_TRIANGLE or ON_EDGE."""
        local = team_lane()
        while local < WIDTH:
            mask = wp.uint32(0)
            asking = WIDTH * group + local
            if kind == ON_EDGE:
                low, high = box_of(search.edge_tree, 0, asking)
                ends = search.ends[asking]
                may = may_meet(search.edge_tree, met, low, high)
                mask = boxes_meeting(search.edge_tree.bound, search.ends, met, low, high, ends[0], ends[1], may)
                if met == group:
                    mask = mask & ~below(local + 1)
            else:
                vertex = search.vertex[asking]
                x = wp.vec3f(at(state.position, wp.max(vertex, 0)))
                wide = room_around(contact, contact.skin[wp.max(vertex, 0)])
                low, high = x - wide, x + wide
                may = wp.where(vertex >= 0, may_meet(search.triangle_tree, met, low, high), 0)
                mask = boxes_meeting(search.triangle_tree.bound, search.corners, met, low, high, vertex, vertex, may)
                asking = -1 - vertex
            list_leaves(state, search, contact, memory, meetings, asking, met, mask)
            local += team_threads()

    return find_near


@functools.cache
def groups_kernel(precision: str) -> wp.Kernel:
    """Kernel ``meet_near``."""
    State, group_of_vertices = cloth_types(precision).State, group_box_function(precision)
    find_near = near_leaves_function(precision)
    meet_groups = meet_function(find_near, State, ContactSearch, ContactData, LeanMemory)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False)
    def meet_near(state: State, search: ContactSearch, contact: ContactData, memory: LeanMemory, meetings: Meetings):
        """Lists what each group of edges, and of vertices, may be near: a team for each."""
        group = wp.tid() // team_threads()
        edge_groups = search.edge_tree.leaf.shape[0] // WIDTH
        if group < edge_groups:
            edge = search.edge_tree.leaf[WIDTH * group]
            if edge >= 0:
                last = search.leaves[search.item[search.edges[edge][0]]][3]
                low, high = box_of(search.edge_tree, 1, group)
                walk = walk_from(search.edge_tree, low, high, WIDTH * group, last)
                meet_groups(state, search, contact, memory, meetings, search.edge_tree, walk, ON_EDGE, group)
        else:
            group -= edge_groups
            vertex = search.vertex[WIDTH * group]
            if vertex >= 0:
                leaves = search.leaves[search.item[vertex]]
                low, high = group_of_vertices(state, search, contact, group)
                walk = walk_from(search.triangle_tree, low, high, leaves[0], leaves[1])
                meet_groups(state, search, contact, memory, meetings, search.triangle_tree, walk, ON_TRIANGLE, group)

    return meet_near


@functools.cache
def leaves_kernel(precision: str) -> wp.Kernel:
    """Kernel ``find_near_leaves``."""
    State = cloth_types(precision).State
    work = listed_groups_function(near_leaves_function(precision), State, ContactSearch, ContactData, LeanMemory)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False, launch_bounds=LISTING)
    def find_near_leaves(
        state: State,
        search: ContactSearch,
        contact: ContactData,
        memory: LeanMemory,
        meetings: Meetings,
        threads: int,
    ):
        """Lists which leaves of the groups listed may be near each other."""
        work(state, search, contact, memory, meetings, wp.tid(), threads)

    return find_near_leaves


@functools.cache
def pairs_kernel(precision: str) -> wp.Kernel:
    """Kernel ``find_pairs``."""
    State = cloth_types(precision).State
    work = listed_leaves_function(keep_function(precision), State, ContactSearch, ContactData, LeanMemory)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False)
    def find_pairs(
        state: State,
        search: ContactSearch,
        contact: ContactData,
        memory: LeanMemory,
        meetings: Meetings,
        threads: int,
    ):
        """Keeps what is near of the leaves listed."""
        work(state, search, contact, memory, meetings, wp.tid(), threads)

    return find_pairs

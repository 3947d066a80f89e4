"""Finds which cloth crosses which, and what of other layers each vertex is nearest to."""

import functools

import warp as wp

from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, place_function
from warp_cloth.kernels.contact.arrays import ON_EDGE, ON_TRIANGLE, ContactData
from warp_cloth.kernels.contact.box_tree import (
    WIDTH,
    box_of,
    boxes_meeting,
    may_meet,
    team_lane,
    team_last,
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
from warp_cloth.kernels.contact.search import SLACK, ContactSearch, group_box_function, least_room
from warp_cloth.kernels.contact.squeeze import nearest_on_triangle
from warp_cloth.kernels.contact.untangle import Untangling, part_crossing_function, ranked

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

BY_TRIANGLE = wp.constant(wp.int32(2))  # beside ON_EDGE and ON_TRIANGLE: triangles ask for the edges that cross them


@wp.func
def tangled_edges(search: ContactSearch, group: int):
    """Whether any edge of a group has a tangled end; for a team."""
    found = int(0)
    local = team_lane()
    while local < WIDTH:
        ends = search.ends[WIDTH * group + local]
        found = wp.max(found, wp.max(search.tangled[ends[0]], search.tangled[ends[1]]))
        local += team_threads()
    return team_last(found) > 0


@wp.func
def tangled_triangles(search: ContactSearch, group: int):
    """Whether any triangle of a group has a tangled corner; for a team."""
    found = int(0)
    local = team_lane()
    while local < WIDTH:
        t = search.corners[WIDTH * group + local]
        found = wp.max(found, wp.max(search.tangled[t[0]], wp.max(search.tangled[t[1]], search.tangled[t[2]])))
        local += team_threads()
    return team_last(found) > 0


@wp.func
def tangled_vertices(search: ContactSearch, group: int):
    """Whether any vertex of a group is tangled; for a team."""
    found = int(0)
    local = team_lane()
    while local < WIDTH:
        vertex = search.vertex[WIDTH * group + local]
        if vertex >= 0:
            found = wp.max(found, search.tangled[vertex])
        local += team_threads()
    return team_last(found) > 0


@functools.cache
def part_leaves_function(precision: str) -> wp.Function:
    """The function that looks closely at what may cross, or lie beyond another layer."""
    State, at = cloth_types(precision).State, place_function(precision)
    part_crossing = part_crossing_function(precision)

    @wp.func
    def part_met(
        state: State, search: ContactSearch, contact: ContactData, untangling: Untangling, asking: int, met: int
    ):
        """Parts an edge and a triangle (Meetings.leaf); of a vertex and a triangle notes how near they are."""
        triangle = search.triangle_tree.leaf[met]
        if asking >= 0:
            part_crossing(state, search, untangling, search.edge_tree.leaf[asking], triangle)
        else:
            vertex = -1 - asking
            t = search.corners[met]
            x = at(state.position, vertex)
            a = at(state.position, t[0])
            ab = at(state.position, t[1]) - a
            ac = at(state.position, t[2]) - a
            on = nearest_on_triangle(x - a, ab, ac)
            distance = wp.length(x - a - ab * on[1] - ac * on[2])
            wp.atomic_min(untangling.beyond, vertex, ranked(float(distance)) + wp.int64(triangle))

    return part_met


@functools.cache
def crossing_leaves_function(precision: str) -> wp.Function:
    """The function that lists which leaves of two groups may cross, or lie beyond another layer."""
    State, at = cloth_types(precision).State, place_function(precision)
    list_leaves = list_leaves_function(part_leaves_function(precision), State, ContactSearch, ContactData, Untangling)

    @wp.func
    def find_crossing(
        state: State,
        search: ContactSearch,
        contact: ContactData,
        untangling: Untangling,
        meetings: Meetings,
        kind: int,
        group: int,
        met: int,
    ):
        """Lists the triangles of a group, met by another, that edges may cross or vertices (ON_TRIANGLE) be beyond.

        What triangles asked for (BY_TRIANGLE) that is tangled, too, asks by itself.
        """
        triangles = wp.where(kind == BY_TRIANGLE, group, met)
        others = wp.where(kind == BY_TRIANGLE, met, group)
        if kind == BY_TRIANGLE:
            if tangled_edges(search, others):
                return
        room = float(untangling.layer_reach) + SLACK
        wide = wp.vec3f(room, room, room)
        less = least_room(contact)
        tree = search.triangle_tree
        local = team_lane()
        while local < WIDTH:
            mask = wp.uint32(0)
            asking = WIDTH * others + local
            if kind != ON_TRIANGLE:
                low, high = box_of(search.edge_tree, 0, asking)
                low, high = low + less, high - less
                ends = search.ends[asking]
                may = may_meet(tree, triangles, low, high)
                mask = boxes_meeting(tree.bound, search.corners, triangles, low, high, ends[0], ends[1], may)
            else:
                vertex = search.vertex[asking]
                low = wp.vec3f(at(state.position, wp.max(vertex, 0))) - wide
                high = low + wide + wide
                may = wp.where(vertex >= 0, may_meet(tree, triangles, low, high), 0)
                mask = boxes_meeting(tree.bound, search.corners, triangles, low, high, vertex, vertex, may)
                asking = -1 - vertex
            list_leaves(state, search, contact, untangling, meetings, asking, triangles, mask)
            local += team_threads()

    return find_crossing


@functools.cache
def crossing_groups_kernel(precision: str) -> wp.Kernel:
    """Kernel ``meet_crossing``."""
    State, group_of_vertices = cloth_types(precision).State, group_box_function(precision)
    find_crossing = crossing_leaves_function(precision)
    meet_groups = meet_function(find_crossing, State, ContactSearch, ContactData, Untangling)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False)
    def meet_crossing(
        state: State, search: ContactSearch, contact: ContactData, untangling: Untangling, meetings: Meetings
    ):
        """Lists the triangles that each group of edges meets, and of vertices, and edges by triangles: a team each.

        What was not tangled at the last search, when all that is near was known, can have met only what was.
        """
        group = wp.tid() // team_threads()
        edge_groups = search.edge_tree.leaf.shape[0] // WIDTH
        triangle_groups = search.triangle_tree.leaf.shape[0] // WIDTH
        all = search.whole[0] > 0
        less = least_room(contact)
        tree = search.triangle_tree
        if group < edge_groups:
            edge = search.edge_tree.leaf[WIDTH * group]
            if edge >= 0 and (all or tangled_edges(search, group)):
                leaves = search.leaves[search.item[search.edges[edge][0]]]
                low, high = box_of(search.edge_tree, 1, group)
                walk = walk_from(tree, low + less, high - less, leaves[0], leaves[1])
                meet_groups(state, search, contact, untangling, meetings, tree, walk, ON_EDGE, group)
        elif group < edge_groups + triangle_groups:
            group -= edge_groups
            triangle = search.triangle_tree.leaf[WIDTH * group]
            if triangle >= 0 and not all and tangled_triangles(search, group):
                theirs = search.leaves[search.item[search.triangles[triangle][0]]]
                low, high = box_of(search.triangle_tree, 1, group)
                walk = walk_from(search.edge_tree, low + less, high - less, theirs[2], theirs[3])
                meet_groups(state, search, contact, untangling, meetings, search.edge_tree, walk, BY_TRIANGLE, group)
        else:
            group -= edge_groups + triangle_groups
            vertex = search.vertex[WIDTH * group]
            if vertex >= 0 and (all or tangled_vertices(search, group)):
                room = float(untangling.layer_reach) + SLACK
                wide = wp.vec3f(room, room, room)
                # not named as above: Warp would read both, whichever branch was taken
                whole, own = search.leaves[search.item[vertex]], untangling.own[vertex]
                low, high = group_of_vertices(state, search, contact, group)
                for side in range(2):  # of its own layer in the tree
                    begin = wp.where(side == 0, whole[0], own[1])
                    end = wp.where(side == 0, own[0], whole[1])
                    walk = walk_from(tree, low - wide, high + wide, begin, end)
                    meet_groups(state, search, contact, untangling, meetings, tree, walk, ON_TRIANGLE, group)

    return meet_crossing


@functools.cache
def crossing_leaves_kernel(precision: str) -> wp.Kernel:
    """Kernel ``find_crossing_leaves``."""
    State = cloth_types(precision).State
    work = listed_groups_function(crossing_leaves_function(precision), State, ContactSearch, ContactData, Untangling)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False, launch_bounds=LISTING)
    def find_crossing_leaves(
        state: State,
        search: ContactSearch,
        contact: ContactData,
        untangling: Untangling,
        meetings: Meetings,
        threads: int,
    ):
        """Lists which leaves of the groups listed may cross."""
        work(state, search, contact, untangling, meetings, wp.tid(), threads)

    return find_crossing_leaves


@functools.cache
def crossings_kernel(precision: str) -> wp.Kernel:
    """Kernel ``part_crossings``."""
    State = cloth_types(precision).State
    work = listed_leaves_function(part_leaves_function(precision), State, ContactSearch, ContactData, Untangling)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False)
    def part_crossings(
        state: State,
        search: ContactSearch,
        contact: ContactData,
        untangling: Untangling,
        meetings: Meetings,
        threads: int,
    ):
        """Shifts each edge that passes through a triangle, and that triangle, so that they cross less."""
        work(state, search, contact, untangling, meetings, wp.tid(), threads)

    return part_crossings

"""What is searched for cloth that is near, or crosses: two trees of boxes, an item's garments together in each."""

import functools

import warp as wp

from warp_cloth.kernels.base.block import block_of, block_threads, lane_of
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, place_function
from warp_cloth.kernels.contact.arrays import ContactData
from warp_cloth.kernels.contact.box_tree import (
    FAR_OFF,
    LEAVES,
    WIDTH,
    BoxTree,
    box_groups,
    box_up,
    put_box,
    team_lane,
    team_least,
    team_threads,
)
from warp_cloth.kernels.contact.broad_phase import Meetings, forget_meetings
from warp_cloth.kernels.contact.search_trigger import next_skin
from warp_cloth.kernels.contact.stick_memory import LeanMemory, forget_leans, remember_lean
from warp_cloth.kernels.patches.packing import order_functions

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

SLACK = wp.constant(wp.float32(1.0e-6))  # [m]; more than rounding a box to float32 moves it


@wp.struct
class ContactSearch:
    """What is searched: E edges and F triangles over V vertices, and trees of their boxes."""

    triangles: wp.array(dtype=wp.vec3i)  # shape [F]
    edges: wp.array(dtype=wp.vec2i)  # shape [E]
    item: wp.array(dtype=wp.int32)  # vertices of different items never meet, shape [V]
    longest: wp.array(dtype=wp.float32)  # of each edge before it counts as a seam yet to close [m], shape [E]
    sides: wp.array(dtype=wp.vec3i)  # edges of each triangle, shape [F]
    near_start: wp.array(dtype=wp.int32)  # rows of the vertices near each one in the rest shape, shape [V + 1]
    near: wp.array(dtype=wp.int32)  # those vertices, each one itself among them
    triangle_tree: BoxTree
    edge_tree: BoxTree
    leaves: wp.array(dtype=wp.vec4i)  # of each item: its first triangle in the tree, and its last's next; its edges'
    vertex: wp.array(dtype=wp.int32)  # vertices in an order that keeps near what is near; -1: none, whole teams of them
    corners: wp.array(dtype=wp.vec3i)  # of the triangles as they are in their tree
    ends: wp.array(dtype=wp.vec2i)  # of the edges as they are in theirs
    whole: wp.array(dtype=wp.int32)  # whether the next search is for all that crosses, whatever was tangled, shape [1]
    tangled: wp.array(dtype=wp.int32)  # whether a vertex belongs to what crosses, shape [V]


@wp.func
def opened(search: ContactSearch, edge: int, along: wp.vec3f):
    """Whether an edge that goes along this [m] is a seam that has yet to close."""
    return wp.length(along) > search.longest[edge]


@functools.cache
def open_kernel(precision: str) -> wp.Kernel:
    """Kernel ``count_open``."""
    State, at = cloth_types(precision).State, place_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def count_open(state: State, search: ContactSearch, count: wp.array(dtype=wp.int32)):
        """Counts the edges that span seams which have yet to close."""
        edge = wp.tid()
        ends = search.edges[edge]
        if opened(search, edge, wp.vec3f(at(state.position, ends[1])) - wp.vec3f(at(state.position, ends[0]))):
            wp.atomic_add(count, 0, 1)

    return count_open


@wp.func
def room_around(contact: ContactData, skin: wp.float32):
    """By how much a box of cloth with such a skin is widened on all sides [m]: what it does not meet is not near."""
    room = skin + float(0.5) * float(contact.thickest) + SLACK
    return wp.vec3f(room, room, room)


@wp.func
def least_room(contact: ContactData):
    """By how much two boxes are widened in all, at least: boxes that do not meet without it do not cross."""
    room = float(wp.float64(2.0) * contact.least_skin + contact.thickest)
    return wp.vec3f(room, room, room)


@functools.cache
def start_kernel(precision: str, in_order: bool = False) -> wp.Kernel:
    """Kernel ``start_search``; ``in_order``: as of packing.order_functions."""
    State, at = cloth_types(precision).State, place_function(precision)
    move_at = order_functions(precision, packed=False, in_order=in_order).move_at

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def start_search(state: State, contact: ContactData, memory: LeanMemory, meetings: Meetings):
        """Remembers where each vertex is, gives it its skin, remembers what pairs lean; empties the lists.

        Where not all pairs had room it is chance which did, and what they lean is forgotten.
        """
        thread = wp.tid()
        forget_meetings(meetings, thread)
        if thread == 0:
            contact.turn_then[0] = contact.turn[0]
        if thread < contact.searched.shape[0]:
            position = at(state.position, thread)
            contact.skin[thread] = next_skin(contact, thread, position, wp.vec3d(move_at(state, thread)))
            contact.searched[thread] = position
        count = contact.count[0]
        if thread < count and count <= contact.corners.shape[0]:
            remember_lean(contact, memory, thread)

    return start_search


@functools.cache
def box_functions(precision: str) -> tuple[wp.Function, wp.Function]:
    """The functions that box a triangle, and an edge, with a place in its tree."""
    State, at = cloth_types(precision).State, place_function(precision)

    @wp.func
    def box_triangle(state: State, search: ContactSearch, contact: ContactData, place: int):
        """What spans a seam that has yet to close meets nothing: its box would meet half the garment."""
        triangle = search.triangle_tree.leaf[place]
        lower = wp.vec3f(FAR_OFF, FAR_OFF, FAR_OFF)
        upper = -lower
        if triangle >= 0:
            corners = search.corners[place]
            sides = search.sides[triangle]
            a = wp.vec3f(at(state.position, corners[0]))
            b = wp.vec3f(at(state.position, corners[1]))
            c = wp.vec3f(at(state.position, corners[2]))
            open = opened(search, sides[0], b - a) or opened(search, sides[1], c - b) or opened(search, sides[2], a - c)
            if not open:
                skin = wp.max(contact.skin[corners[0]], wp.max(contact.skin[corners[1]], contact.skin[corners[2]]))
                wide = room_around(contact, skin)
                lower = wp.min(wp.min(a, b), c) - wide
                upper = wp.max(wp.max(a, b), c) + wide
        put_box(search.triangle_tree, 0, place, lower, upper)

    @wp.func
    def box_edge(state: State, search: ContactSearch, contact: ContactData, place: int):
        """The same of an edge; what it crosses is looked for everywhere till it has closed."""
        edge = search.edge_tree.leaf[place]
        lower = wp.vec3f(FAR_OFF, FAR_OFF, FAR_OFF)
        upper = -lower
        if edge >= 0:
            ends = search.ends[place]
            p = wp.vec3f(at(state.position, ends[0]))
            q = wp.vec3f(at(state.position, ends[1]))
            if opened(search, edge, q - p):
                search.whole[0] = 1
            else:
                wide = room_around(contact, wp.max(contact.skin[ends[0]], contact.skin[ends[1]]))
                lower = wp.min(p, q) - wide
                upper = wp.max(p, q) + wide
        put_box(search.edge_tree, 0, place, lower, upper)

    return box_triangle, box_edge


@functools.cache
def box_kernel(precision: str) -> wp.Kernel:
    """Kernel ``box_sheets``."""
    State = cloth_types(precision).State
    box_triangle, box_edge = box_functions(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False)
    def box_sheets(state: State, search: ContactSearch, contact: ContactData, memory: LeanMemory, anew: int):
        """Boxes LEAVES edges, or triangles, by each block; ``anew``: forgets the pairs and what they asked for."""
        thread = wp.tid()
        if thread == 0 and anew > 0:
            contact.count[0] = 0
            contact.moved[0] = 0
            forget_leans(memory)
        lane = lane_of(thread)
        block = block_of(thread)
        edge_blocks = search.edge_tree.leaf.shape[0] // LEAVES
        local = int(lane)
        if block < edge_blocks:
            while local < LEAVES:
                box_edge(state, search, contact, block * LEAVES + local)
                local += block_threads()
            box_up(search.edge_tree, block, lane)
        else:
            block -= edge_blocks
            while local < LEAVES:
                box_triangle(state, search, contact, block * LEAVES + local)
                local += block_threads()
            box_up(search.triangle_tree, block, lane)

    return box_sheets


@wp.kernel(grid_stride=False)
def box_rest(search: ContactSearch):
    """Boxes the highest level of the trees that have four, one block each."""
    thread = wp.tid()
    tree = search.edge_tree
    if block_of(thread) == 1:
        tree = search.triangle_tree
    if tree.levels > 3:
        box_groups(tree, 2, 0, tree.first[3] - tree.first[2], lane_of(thread))


@functools.cache
def group_box_function(precision: str) -> wp.Function:
    """The function that boxes a group of vertices."""
    State, at = cloth_types(precision).State, place_function(precision)

    @wp.func
    def group_of_vertices(state: State, search: ContactSearch, contact: ContactData, group: int):
        """The box of a group of vertices with their skins [m], by a team."""
        low = wp.vec3f(FAR_OFF, FAR_OFF, FAR_OFF)
        high = -low
        local = team_lane()
        while local < WIDTH:
            vertex = search.vertex[WIDTH * group + local]
            if vertex >= 0:
                x = wp.vec3f(at(state.position, vertex))
                wide = room_around(contact, contact.skin[vertex])
                low = wp.min(low, x - wide)
                high = wp.max(high, x + wide)
            local += team_threads()
        return team_least(low), -team_least(-high)

    return group_of_vertices

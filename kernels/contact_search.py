"""Finds which cloth is near which: boxes in two trees, in which the garments of an item lie together."""

import functools

import warp as wp

from warp_cloth.kernels.block import block_of, block_threads, lane_of
from warp_cloth.kernels.box_tree import (
    FAR_OFF,
    LEAVES,
    BoxTree,
    box_groups,
    box_up,
    first_place,
    meeting,
    put_box,
    step_on,
    walk_from,
)
from warp_cloth.kernels.cloth import MODULE_OPTIONS, cloth_types, place_function
from warp_cloth.kernels.cloth_contact import NEIGHBOURS, ON_EDGE, ON_TRIANGLE, ClothContact, pair_way, pair_weights
from warp_cloth.kernels.crossing import has_vertex
from warp_cloth.kernels.lean_memory import LeanMemory, forget_leans, remember_lean, remembered_lean

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
    tangles: wp.array(dtype=wp.int32)  # whether anything is tangled, shape [1]
    tangled: wp.array(dtype=wp.int32)  # whether a vertex belongs to what crosses, shape [V]


@wp.func
def rest_near(search: ContactSearch, a: int, b: int):
    """Whether two vertices are near in the rest shape."""
    for row in range(search.near_start[a], search.near_start[a + 1]):
        if search.near[row] == b:
            return True
    return False


@wp.func
def opened(search: ContactSearch, edge: int, along: wp.vec3f):
    """Whether an edge that goes along this [m] is a seam that has yet to close."""
    return wp.length(along) > search.longest[edge]


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
def keep_pair(contact: ClothContact, memory: LeanMemory, corners: wp.vec4i, kind: int, near: bool):
    """Counts a pair and, while there is room, keeps it, with the lean that it had before the search."""
    slot = next_slot(contact.count)
    if slot < contact.corners.shape[0]:
        contact.corners[slot] = corners
        contact.kind[slot] = kind
        contact.lean[slot] = remembered_lean(memory, corners, kind)
        contact.due[slot] = wp.int64(0)
        if near:
            contact.kind[slot] = kind + NEIGHBOURS


@functools.cache
def near_function(precision: str) -> wp.Function:
    """The function that tells whether a pair is nearer than some reach."""
    Cloth, at = cloth_types(precision).Cloth, place_function(precision)

    @wp.func
    def nearer(cloth: Cloth, corners: wp.vec4i, kind: int, reach: wp.float64):
        """Whether a pair is nearer than the reach [m]."""
        x0 = at(cloth.position, corners[0])
        x1 = at(cloth.position, corners[1])
        x2 = at(cloth.position, corners[2])
        x3 = at(cloth.position, corners[3])
        weights = pair_weights(kind, x0, x1, x2, x3)
        return wp.length(pair_way(weights, x0, x1, x2, x3)) < reach

    return nearer


@functools.cache
def start_kernel(precision: str) -> wp.Kernel:
    """Kernel ``start_search``."""
    Cloth, at = cloth_types(precision).Cloth, place_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def start_search(cloth: Cloth, contact: ClothContact, memory: LeanMemory):
        """Remembers where each vertex is, and what each pair leans."""
        thread = wp.tid()
        if thread < contact.searched.shape[0]:
            contact.searched[thread] = at(cloth.position, thread)
        if thread < wp.min(contact.count[0], contact.corners.shape[0]):
            remember_lean(contact, memory, thread)

    return start_search


@functools.cache
def box_functions(precision: str) -> tuple[wp.Function, wp.Function]:
    """The functions that box a triangle, and an edge, with a place in its tree."""
    Cloth, at = cloth_types(precision).Cloth, place_function(precision)

    @wp.func
    def box_triangle(cloth: Cloth, search: ContactSearch, place: int):
        """What spans a seam that has yet to close meets nothing: its box would meet half the garment."""
        triangle = search.triangle_tree.leaf[place]
        lower = wp.vec3f(FAR_OFF, FAR_OFF, FAR_OFF)
        upper = -lower
        if triangle >= 0:
            corners = search.corners[place]
            sides = search.sides[triangle]
            a = wp.vec3f(at(cloth.position, corners[0]))
            b = wp.vec3f(at(cloth.position, corners[1]))
            c = wp.vec3f(at(cloth.position, corners[2]))
            open = opened(search, sides[0], b - a) or opened(search, sides[1], c - b) or opened(search, sides[2], a - c)
            if not open:
                lower = wp.min(wp.min(a, b), c)
                upper = wp.max(wp.max(a, b), c)
        put_box(search.triangle_tree, 0, place, lower, upper)

    @wp.func
    def box_edge(cloth: Cloth, search: ContactSearch, place: int):
        """The same of an edge."""
        edge = search.edge_tree.leaf[place]
        lower = wp.vec3f(FAR_OFF, FAR_OFF, FAR_OFF)
        upper = -lower
        if edge >= 0:
            ends = search.ends[place]
            p = wp.vec3f(at(cloth.position, ends[0]))
            q = wp.vec3f(at(cloth.position, ends[1]))
            if not opened(search, edge, q - p):
                lower = wp.min(p, q)
                upper = wp.max(p, q)
        put_box(search.edge_tree, 0, place, lower, upper)

    return box_triangle, box_edge


@functools.cache
def box_kernel(precision: str) -> wp.Kernel:
    """Kernel ``box_sheets``."""
    Cloth = cloth_types(precision).Cloth
    box_triangle, box_edge = box_functions(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False)
    def box_sheets(cloth: Cloth, search: ContactSearch, contact: ClothContact, memory: LeanMemory, anew: int):
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
                box_edge(cloth, search, block * LEAVES + local)
                local += block_threads()
            box_up(search.edge_tree, block, lane)
        else:
            block -= edge_blocks
            while local < LEAVES:
                box_triangle(cloth, search, block * LEAVES + local)
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
def on_triangles_function(precision: str) -> wp.Function:
    """The function that keeps what is near a vertex."""
    Cloth, at = cloth_types(precision).Cloth, place_function(precision)
    nearer = near_function(precision)

    @wp.func
    def keep_on_triangle(
        cloth: Cloth, search: ContactSearch, contact: ClothContact, memory: LeanMemory, vertex: int, triangle: int
    ):
        """Keeps a vertex and a triangle, by its place in the tree, if they are near each other."""
        t = search.corners[triangle]
        corners = wp.vec4i(vertex, t[0], t[1], t[2])
        if nearer(cloth, corners, ON_TRIANGLE, contact.reach):
            near = rest_near(search, vertex, t[0]) or rest_near(search, vertex, t[1])
            near = near or rest_near(search, vertex, t[2])
            keep_pair(contact, memory, corners, ON_TRIANGLE, near)

    @wp.func
    def find_on_triangles(cloth: Cloth, search: ContactSearch, contact: ClothContact, memory: LeanMemory, vertex: int):
        """Keeps the triangles near a vertex, if it is one, but those that it is a corner of, and what is tangled.

        The last that may be near waits, so that mostly all threads of a team look closely at once.
        """
        low = wp.vec3f(FAR_OFF, FAR_OFF, FAR_OFF)
        high = -low
        leaves = wp.vec4i()
        tangled = int(0)
        tangles = search.tangles[0] > 0
        if vertex >= 0:
            room = float(contact.reach) + SLACK
            wide = wp.vec3f(room, room, room)
            low = wp.vec3f(at(cloth.position, vertex)) - wide
            high = low + wide + wide
            leaves = search.leaves[search.item[vertex]]
            tangled = search.tangled[vertex]
        waits = int(-1)
        walk = step_on(search.triangle_tree, walk_from(search.triangle_tree, low, high, leaves[0], leaves[1]))
        while walk.group >= 0:
            mask = meeting(search.triangle_tree, walk, low, high, leaves[0], leaves[1])
            while mask != wp.uint32(0):
                place = first_place(walk, mask)
                mask = mask & (mask - wp.uint32(1))
                t = search.corners[place]
                out = has_vertex(t, vertex)
                if tangles:
                    out = out or tangled + search.tangled[t[0]] + search.tangled[t[1]] + search.tangled[t[2]] > 0
                if not out:
                    if waits >= 0:
                        keep_on_triangle(cloth, search, contact, memory, vertex, waits)
                    waits = place
            walk = step_on(search.triangle_tree, walk)
        if waits >= 0:
            keep_on_triangle(cloth, search, contact, memory, vertex, waits)

    return find_on_triangles


@functools.cache
def on_edges_function(precision: str) -> wp.Function:
    """The function that keeps what is near an edge."""
    Cloth, at, nearer = cloth_types(precision).Cloth, place_function(precision), near_function(precision)

    @wp.func
    def keep_on_edge(
        cloth: Cloth, search: ContactSearch, contact: ClothContact, memory: LeanMemory, edge: int, other: int
    ):
        """Keeps two edges if they are near each other; the lower comes first, wherever they are in the tree."""
        e = search.edges[wp.min(edge, other)]
        o = search.edges[wp.max(edge, other)]
        corners = wp.vec4i(e[0], e[1], o[0], o[1])
        if nearer(cloth, corners, ON_EDGE, contact.reach):
            near = rest_near(search, e[0], o[0]) or rest_near(search, e[0], o[1])
            near = near or rest_near(search, e[1], o[0]) or rest_near(search, e[1], o[1])
            keep_pair(contact, memory, corners, ON_EDGE, near)

    @wp.func
    def find_on_edges(cloth: Cloth, search: ContactSearch, contact: ClothContact, memory: LeanMemory, place: int):
        """Keeps the edges near an edge, behind it in the tree, but those that share an end, and what is tangled."""
        edge = search.edge_tree.leaf[place]
        low = wp.vec3f(FAR_OFF, FAR_OFF, FAR_OFF)
        high = -low
        e = wp.vec2i()
        last = int(place)
        tangled = int(0)
        tangles = search.tangles[0] > 0
        if edge >= 0:
            room = float(contact.reach) + SLACK
            wide = wp.vec3f(room, room, room)
            e = search.ends[place]
            p = wp.vec3f(at(cloth.position, e[0]))
            q = wp.vec3f(at(cloth.position, e[1]))
            if not opened(search, edge, q - p):
                low = wp.min(p, q) - wide
                high = wp.max(p, q) + wide
            last = search.leaves[search.item[e[0]]][3]
            tangled = search.tangled[e[0]] + search.tangled[e[1]]
        waits = int(-1)
        walk = step_on(search.edge_tree, walk_from(search.edge_tree, low, high, place, last))
        while walk.group >= 0:
            mask = meeting(search.edge_tree, walk, low, high, place + 1, last)
            while mask != wp.uint32(0):
                other = first_place(walk, mask)
                mask = mask & (mask - wp.uint32(1))
                o = search.ends[other]
                out = e[0] == o[0] or e[0] == o[1] or e[1] == o[0] or e[1] == o[1]
                if tangles:
                    out = out or tangled + search.tangled[o[0]] + search.tangled[o[1]] > 0
                if not out:
                    if waits >= 0:
                        keep_on_edge(cloth, search, contact, memory, edge, search.edge_tree.leaf[waits])
                    waits = other
            walk = step_on(search.edge_tree, walk)
        if waits >= 0:
            keep_on_edge(cloth, search, contact, memory, edge, search.edge_tree.leaf[waits])

    return find_on_edges


@functools.cache
def pairs_kernel(precision: str) -> wp.Kernel:
    """Kernel ``find_pairs``."""
    Cloth = cloth_types(precision).Cloth
    find_on_triangles, find_on_edges = on_triangles_function(precision), on_edges_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False)
    def find_pairs(cloth: Cloth, search: ContactSearch, contact: ClothContact, memory: LeanMemory):
        """Keeps what is near each edge, and each vertex: in one launch, since each thread mostly waits for memory."""
        thread = wp.tid()
        edges = search.edge_tree.leaf.shape[0]
        if thread < edges:
            find_on_edges(cloth, search, contact, memory, thread)
        else:
            find_on_triangles(cloth, search, contact, memory, search.vertex[thread - edges])

    return find_pairs

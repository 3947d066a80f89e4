"""Finds which cloth is near which: boxes in trees, grouped so that only garments of one item meet."""

import functools

import warp as wp

from warp_cloth.kernels.cloth import MODULE_OPTIONS, cloth_types, place_function
from warp_cloth.kernels.cloth_contact import NEIGHBOURS, ON_EDGE, ON_TRIANGLE, ClothContact, pair_way, pair_weights
from warp_cloth.kernels.crossing import has_vertex
from warp_cloth.kernels.lean_memory import LeanMemory, remembered_lean

SLACK = wp.constant(wp.float32(1.0e-6))  # [m]; more than rounding a box to float32 moves it


@wp.struct
class ContactSearch:
    """What is searched: E edges and F triangles over V vertices, and a tree of their boxes."""

    triangles: wp.array(dtype=wp.vec3i)  # shape [F]
    edges: wp.array(dtype=wp.vec2i)  # shape [E]
    item: wp.array(dtype=wp.int32)  # vertices of different items never meet, shape [V]
    longest: wp.array(dtype=wp.float32)  # of each edge before it counts as a seam yet to close [m], shape [E]
    sides: wp.array(dtype=wp.vec3i)  # edges of each triangle, shape [F]
    near_start: wp.array(dtype=wp.int32)  # rows of the vertices near each one in the rest shape, shape [V + 1]
    near: wp.array(dtype=wp.int32)  # those vertices, each one itself among them
    tree: wp.uint64  # of all boxes; in groups by item, the triangles' and the edges' apart
    lower: wp.array(dtype=wp.vec3f)  # of the triangles' boxes, then of the edges' [m], shape [F + E]
    upper: wp.array(dtype=wp.vec3f)  # [m], shape [F + E]
    open_edge: wp.array(dtype=wp.int32)  # whether an edge is longer than its longest, shape [E]
    tangled: wp.array(dtype=wp.int32)  # whether a vertex belongs to what crosses, shape [V]


@wp.func
def triangles_root(search: ContactSearch, vertex: int):
    """Where in the tree the triangles of a vertex's item begin."""
    return wp.bvh_get_group_root(search.tree, 2 * search.item[vertex])


@wp.func
def edges_root(search: ContactSearch, vertex: int):
    """Where in the tree the edges of a vertex's item begin."""
    return wp.bvh_get_group_root(search.tree, 2 * search.item[vertex] + 1)


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


@wp.func
def spans_gap(search: ContactSearch, triangle: int):
    """Whether a triangle spans a seam that has yet to close, where there is no cloth to meet."""
    sides = search.sides[triangle]
    return search.open_edge[sides[0]] + search.open_edge[sides[1]] + search.open_edge[sides[2]] > 0


@wp.func
def keep_pair(contact: ClothContact, memory: LeanMemory, corners: wp.vec4i, kind: int, near: bool):
    """Counts a pair and, while there is room, keeps it, with the lean that it had before the search."""
    slot = wp.atomic_add(contact.count, 0, 1)
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
    def start_search(cloth: Cloth, contact: ClothContact):
        """Remembers where each vertex is, and forgets the pairs and what they asked for."""
        vertex = wp.tid()
        contact.searched[vertex] = at(cloth.position, vertex)
        if vertex == 0:
            contact.count[0] = 0
            contact.moved[0] = 0

    return start_search


@functools.cache
def box_kernel(precision: str) -> wp.Kernel:
    """Kernel ``box_sheets``."""
    Cloth, at = cloth_types(precision).Cloth, place_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def box_sheets(cloth: Cloth, search: ContactSearch):
        """The box of each triangle and of each edge: one thread for as many as there are of the more.

        What spans a seam that has yet to close meets nothing: its box would meet half the garment.
        """
        thread = wp.tid()
        triangles = search.triangles.shape[0]
        if thread < triangles:
            corners = search.triangles[thread]
            sides = search.sides[thread]
            a = wp.vec3f(at(cloth.position, corners[0]))
            b = wp.vec3f(at(cloth.position, corners[1]))
            c = wp.vec3f(at(cloth.position, corners[2]))
            open = opened(search, sides[0], b - a) or opened(search, sides[1], c - b) or opened(search, sides[2], a - c)
            if open:
                b = a
                c = a
            search.lower[thread] = wp.min(wp.min(a, b), c)
            search.upper[thread] = wp.max(wp.max(a, b), c)
        if thread < search.edges.shape[0]:
            ends = search.edges[thread]
            p = wp.vec3f(at(cloth.position, ends[0]))
            q = wp.vec3f(at(cloth.position, ends[1]))
            search.open_edge[thread] = wp.where(opened(search, thread, q - p), 1, 0)
            if search.open_edge[thread] > 0:
                q = p
            search.lower[triangles + thread] = wp.min(p, q)
            search.upper[triangles + thread] = wp.max(p, q)

    return box_sheets


@functools.cache
def on_triangles_function(precision: str) -> wp.Function:
    """The function that keeps what is near a vertex."""
    Cloth, at = cloth_types(precision).Cloth, place_function(precision)
    nearer = near_function(precision)

    @wp.func
    def find_on_triangles(cloth: Cloth, search: ContactSearch, contact: ClothContact, memory: LeanMemory, vertex: int):
        """Keeps the triangles near a vertex, but those that it is a corner of, and where both are tangled."""
        centre = wp.vec3f(at(cloth.position, vertex))
        room = float(contact.reach) + SLACK
        wide = wp.vec3f(room, room, room)
        query = wp.bvh_query_aabb(search.tree, centre - wide, centre + wide, triangles_root(search, vertex))
        triangle = int(0)
        while wp.bvh_query_next(query, triangle):
            t = search.triangles[triangle]
            tangled = search.tangled[t[0]] + search.tangled[t[1]] + search.tangled[t[2]]
            out = tangled + search.tangled[vertex] > 0 or has_vertex(t, vertex) or spans_gap(search, triangle)
            corners = wp.vec4i(vertex, t[0], t[1], t[2])
            if not out and nearer(cloth, corners, ON_TRIANGLE, contact.reach):
                near = rest_near(search, vertex, t[0]) or rest_near(search, vertex, t[1])
                near = near or rest_near(search, vertex, t[2])
                keep_pair(contact, memory, corners, ON_TRIANGLE, near)

    return find_on_triangles


@functools.cache
def on_edges_function(precision: str) -> wp.Function:
    """The function that keeps what is near an edge."""
    Cloth, nearer = cloth_types(precision).Cloth, near_function(precision)

    @wp.func
    def find_on_edges(cloth: Cloth, search: ContactSearch, contact: ClothContact, memory: LeanMemory, edge: int):
        """Keeps the later edges near an edge, but those that share an end, and where both are tangled."""
        if search.open_edge[edge] > 0:
            return
        room = float(contact.reach) + SLACK
        wide = wp.vec3f(room, room, room)
        e = search.edges[edge]
        tangled = search.tangled[e[0]] + search.tangled[e[1]]
        box = search.triangles.shape[0] + edge
        query = wp.bvh_query_aabb(
            search.tree, search.lower[box] - wide, search.upper[box] + wide, edges_root(search, e[0])
        )
        found = int(0)
        while wp.bvh_query_next(query, found):
            if found > box:
                other = found - search.triangles.shape[0]
                o = search.edges[other]
                out = e[0] == o[0] or e[0] == o[1] or e[1] == o[0] or e[1] == o[1]
                out = out or tangled + search.tangled[o[0]] + search.tangled[o[1]] > 0
                out = out or search.open_edge[other] > 0
                corners = wp.vec4i(e[0], e[1], o[0], o[1])
                if not out and nearer(cloth, corners, ON_EDGE, contact.reach):
                    near = rest_near(search, e[0], o[0]) or rest_near(search, e[0], o[1])
                    near = near or rest_near(search, e[1], o[0]) or rest_near(search, e[1], o[1])
                    keep_pair(contact, memory, corners, ON_EDGE, near)

    return find_on_edges


@functools.cache
def pairs_kernel(precision: str) -> wp.Kernel:
    """Kernel ``find_pairs``."""
    Cloth = cloth_types(precision).Cloth
    find_on_triangles, find_on_edges = on_triangles_function(precision), on_edges_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def find_pairs(cloth: Cloth, search: ContactSearch, contact: ClothContact, memory: LeanMemory):
        """Keeps what is near each vertex, and each edge: in one launch, since each thread mostly waits for memory."""
        thread = wp.tid()
        vertices = search.item.shape[0]
        if thread < vertices:
            find_on_triangles(cloth, search, contact, memory, thread)
        else:
            find_on_edges(cloth, search, contact, memory, thread - vertices)

    return find_pairs

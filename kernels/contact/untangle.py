"""Takes cloth that passes through cloth back out, without knowing how it came there."""

import functools

import warp as wp

from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, place_function
from warp_cloth.kernels.contact.arrays import EVER, ContactData, due_of
from warp_cloth.kernels.contact.broad_phase import Meetings, forget_meetings
from warp_cloth.kernels.contact.crossing import segment_pierces, volume
from warp_cloth.kernels.contact.search import ContactSearch
from warp_cloth.kernels.contact.squeeze import NOTHING, WHOLE, nearest_on_triangle

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

SHIFT_UNIT = wp.constant(wp.float64(2.0**-40))  # whole numbers of it are summed, the same in every order
LEAST_SLOPE = wp.constant(wp.float64(0.05))  # of an edge to a triangle; one nearly in its plane says little
LAYERS = wp.constant(wp.int32(1))  # crosses another layer: which way is out is known
ITSELF = wp.constant(wp.int32(2))  # crosses its own garment, or one of the same layer
RING = wp.constant(wp.int32(16))  # searches that a tangle must last before one more ring of vertices is smoothed
WIDEST = wp.constant(wp.int32(8 * 16))  # of those rings
# Layers that have crossed for so many times this number of searches are parted by shifts so many times as long, up to
# so many times: where taut cloth holds them, as under an arm, shorter ones would lead nowhere.
PATIENCE = wp.constant(wp.float64(32.0))
INSISTENCE = wp.constant(wp.float64(4.0))
SMOOTHING = wp.constant(wp.float64(0.2))  # share of the way to the mean of its neighbours that a vertex is shifted
TRIANGLE = wp.constant(wp.int64(2**32 - 1))  # the part of ``Untangling.beyond`` that names one
ASTRIDE = wp.constant(wp.float64(0.5))  # cosine to the normal below which a nearest point tells no side


@wp.struct
class Untangling:
    """What untangling needs of the garments, and sums up."""

    wings: wp.array(dtype=wp.vec2i)  # third corners of the triangles at each edge, -1 where there is none, shape [E]
    rim: wp.array(dtype=wp.int32)  # whether a vertex lies on the garment's border, shape [V]
    beside_start: wp.array(dtype=wp.int32)  # rows of the vertices that an edge joins to each one, shape [V + 1]
    beside: wp.array(dtype=wp.int32)  # those vertices, shape [2 E]
    crosses: wp.array(dtype=wp.int32)  # whether a vertex belongs to what crosses, LAYERS or ITSELF, shape [V]
    age: wp.array(dtype=wp.int32)  # for how many searches it or those beside it have crossed other layers, shape [V]
    grown: wp.array(dtype=wp.int32)  # the same after this search, shape [V]
    level: wp.array(dtype=wp.int32)  # how far round it the tangle is smoothed [1 / RING rings], shape [V]
    layer: wp.array(dtype=wp.int32)  # garments of one item from the inside out, shape [V]
    own: wp.array(dtype=wp.vec2i)  # of a vertex's layer, its first triangle in the tree and its last's next, shape [V]
    outward: wp.array(dtype=wp.float32)  # whether triangles face away from the body, 1, or to it, -1, shape [V]
    layer_reach: float  # how far on the wrong side of another layer a vertex is still found [m]
    stride: wp.float64  # longest shift in an iteration [m]
    sum: wp.array2d(dtype=wp.int64)  # shifts [SHIFT_UNIT] and how many there are, shape [V, 4]
    count: wp.array(dtype=wp.int32)  # edges that cross, vertices on the wrong side of a layer or tangled, shape [3]
    beyond: wp.array(dtype=wp.int64)  # the other layers' triangle nearest to a vertex, below how near [m], shape [V]


@wp.func
def contour_slope(along: wp.vec3d, normal: wp.vec3d, wing: wp.vec3d):
    """Which way an edge goes against a triangle to make the line shorter along which its own triangle crosses it.

    G = R - 2 (E R) / (E N) N, R along that line from the edge inwards (Volino and Magnenat-Thalmann 2006, Resolving
    surface collisions through intersection contour minimization, eq. 5); ``along`` E and ``normal`` N unit vectors,
    ``wing`` from the edge to the third corner.
    """
    inward = wing - along * wp.dot(wing, along)
    line = wp.cross(normal, wp.cross(along, wing))
    size = wp.length(line)
    if size <= NOTHING:
        return wp.vec3d()
    line = line / size
    if wp.dot(line, inward) < NOTHING:
        line = -line
    slope = wp.dot(along, normal)
    slope = wp.where(slope < NOTHING, wp.min(slope, -LEAST_SLOPE), wp.max(slope, LEAST_SLOPE))
    return line - normal * (wp.float64(2.0) * wp.dot(along, line) / slope)


@wp.func
def add_shift(sum: wp.array2d(dtype=wp.int64), vertex: int, shift: wp.vec3d):
    """Adds one shift [m] to a vertex's sum."""
    wp.atomic_add(sum, vertex, 0, wp.int64(shift[0] / SHIFT_UNIT))
    wp.atomic_add(sum, vertex, 1, wp.int64(shift[1] / SHIFT_UNIT))
    wp.atomic_add(sum, vertex, 2, wp.int64(shift[2] / SHIFT_UNIT))
    wp.atomic_add(sum, vertex, 3, wp.int64(1))


_BITS = """
    float given = value;
    int bits;
    memcpy(&bits, &given, sizeof(bits));
    return (int64_t)bits << 32;
"""


@wp.func_native(_BITS)
def ranked(value: wp.float32) -> wp.int64:
    """A number that grows with a positive one, and whose lower half is free."""
    ...


@wp.kernel
def forget_tangles(search: ContactSearch, untangling: Untangling, meetings: Meetings):
    """Forgets what crossed at the last search."""
    vertex = wp.tid()
    untangling.level[vertex] = search.tangled[vertex]
    untangling.age[vertex] = untangling.grown[vertex]
    untangling.crosses[vertex] = 0
    untangling.beyond[vertex] = ranked(untangling.layer_reach)
    forget_meetings(meetings, vertex)
    for column in range(4):
        untangling.sum[vertex, column] = wp.int64(0)
    if vertex < 3:
        untangling.count[vertex] = 0


@functools.cache
def edge_slope_function(precision: str) -> wp.Function:
    """The function that sums contour_slope over the triangles at an edge."""
    State, at = cloth_types(precision).State, place_function(precision)

    @wp.func
    def edge_slope(state: State, ends: wp.vec2i, wings: wp.vec2i, normal: wp.vec3d):
        """Sum of contour_slope over the triangles at an edge, at most one long."""
        start = at(state.position, ends[0])
        along = wp.normalize(at(state.position, ends[1]) - start)
        slope = wp.vec3d()
        for side in range(2):
            if wings[side] >= 0:
                slope += contour_slope(along, normal, at(state.position, wings[side]) - start)
        return slope / wp.sqrt(wp.dot(slope, slope) + WHOLE)

    return edge_slope


@functools.cache
def part_crossing_function(precision: str) -> wp.Function:
    """The function that parts an edge from a triangle that it passes through."""
    State, at = cloth_types(precision).State, place_function(precision)
    edge_slope = edge_slope_function(precision)

    @wp.func
    def part_crossing(state: State, search: ContactSearch, untangling: Untangling, edge: int, triangle: int):
        """Shifts an edge, if it passes through a triangle, and that triangle, so that they cross less."""
        ends = search.edges[edge]
        corners = search.triangles[triangle]
        p = at(state.position, ends[0])
        q = at(state.position, ends[1])
        a = at(state.position, corners[0])
        b = at(state.position, corners[1])
        c = at(state.position, corners[2])
        if not segment_pierces(p, q, a, b, c):
            return
        wp.atomic_add(untangling.count, 0, 1)
        before = volume(a, b, c, p)
        share = before / (before - volume(a, b, c, q))
        on = nearest_on_triangle(p + (q - p) * share - a, b - a, c - a)
        normal = wp.normalize(wp.cross(b - a, c - a))
        what = ITSELF
        slope = wp.vec3d()
        if untangling.layer[ends[0]] == untangling.layer[corners[0]]:
            slope = edge_slope(state, ends, untangling.wings[edge], normal) * untangling.stride
        else:  # the outer one goes outwards
            what = LAYERS
            slope = normal * (wp.float64(untangling.outward[corners[0]]) * untangling.stride)
            if untangling.layer[ends[0]] < untangling.layer[corners[0]]:
                slope = -slope
        add_shift(untangling.sum, ends[0], slope * (WHOLE - share))
        add_shift(untangling.sum, ends[1], slope * share)
        for corner in range(3):
            add_shift(untangling.sum, corners[corner], -slope * on[corner])
            wp.atomic_max(untangling.crosses, corners[corner], what)
        wp.atomic_max(untangling.crosses, ends[0], what)
        wp.atomic_max(untangling.crosses, ends[1], what)

    return part_crossing


@functools.cache
def layers_kernel(precision: str) -> wp.Kernel:
    """Kernel ``part_layers``."""
    State, at = cloth_types(precision).State, place_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False)
    def part_layers(state: State, search: ContactSearch, contact: ContactData, untangling: Untangling):
        """Shifts each vertex on the wrong side of another garment, and the triangle of that which is nearest."""
        vertex = wp.tid()
        found = untangling.beyond[vertex]
        if found < ranked(untangling.layer_reach):
            layer = untangling.layer[vertex]
            x = at(state.position, vertex)
            t = search.triangles[wp.int32(found & TRIANGLE)]
            a = at(state.position, t[0])
            ab = at(state.position, t[1]) - a
            ac = at(state.position, t[2]) - a
            on = nearest_on_triangle(x - a, ab, ac)
            inner = NOTHING
            for corner in range(3):
                if untangling.rim[t[corner]] == 0:
                    inner += on[corner]
            facing = wp.float64(untangling.outward[t[0]])
            if untangling.layer[t[0]] > layer:
                facing = -facing
            normal = wp.normalize(wp.cross(ab, ac)) * facing
            way = x - a - ab * on[1] - ac * on[2]
            side = wp.dot(way, normal)
            if inner > NOTHING and side < -ASTRIDE * wp.length(way):
                wp.atomic_add(untangling.count, 1, 1)
                thickness = wp.float64(contact.thickness[vertex])
                shift = normal * wp.min(untangling.stride, wp.float64(0.5) * (thickness - side))
                add_shift(untangling.sum, vertex, shift)
                wp.atomic_max(untangling.crosses, vertex, LAYERS)
                for corner in range(3):
                    add_shift(untangling.sum, t[corner], -shift * on[corner])
                    wp.atomic_max(untangling.crosses, t[corner], LAYERS)

    return part_layers


@functools.cache
def settle_kernel(precision: str) -> wp.Kernel:
    """Kernel ``settle_shifts``."""
    State, at = cloth_types(precision).State, place_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def settle_shifts(state: State, search: ContactSearch, contact: ContactData, untangling: Untangling):
        """A vertex's untangling shift: the mean of what its crossings ask for, and smoothing round tangles that last.

        A fold that passes through itself is a loop; smoothed, it becomes shorter and comes undone, as a curve's does.
        """
        vertex = wp.tid()
        if vertex == 0:
            search.whole[0] = 0
        level = int(0)
        age = int(untangling.age[vertex])
        mean = wp.vec3d()
        x = at(state.position, vertex)
        first = untangling.beside_start[vertex]
        last = untangling.beside_start[vertex + 1]
        for row in range(first, last):
            other = untangling.beside[row]
            level = wp.max(level, untangling.level[other] - RING)
            age = wp.max(age, untangling.age[other])
            mean += at(state.position, other) - x
        if untangling.crosses[vertex] == ITSELF:
            level = wp.max(level, wp.clamp(untangling.level[vertex] + 1, RING, WIDEST))
        search.tangled[vertex] = wp.max(level, untangling.crosses[vertex])
        if search.tangled[vertex] > 0:
            wp.atomic_add(untangling.count, 2, 1)
        count = untangling.sum[vertex, 3]
        shift = wp.vec3d()
        crosses = untangling.crosses[vertex] == LAYERS
        untangling.grown[vertex] = wp.where(crosses, age + 1, wp.max(untangling.age[vertex] - 1, 0))
        if count > wp.int64(0):
            insistence = wp.clamp(wp.float64(age) / PATIENCE, WHOLE, INSISTENCE)
            scale = SHIFT_UNIT * insistence / wp.float64(count)
            dx = wp.float64(untangling.sum[vertex, 0])
            dy = wp.float64(untangling.sum[vertex, 1])
            shift = wp.vec3d(dx, dy, wp.float64(untangling.sum[vertex, 2])) * scale
        if level > 0:
            shift += mean * (SMOOTHING / wp.float64(last - first))
        contact.shift[vertex] = wp.vec3f(shift)

    return settle_shifts


@wp.kernel(grid_stride=False)
def spare_tangled(search: ContactSearch, contact: ContactData):
    """Has no pair pressed of which a vertex is tangled: contact would hold what crosses where it is."""
    pair = wp.tid()
    if pair < contact.count[0]:
        corners = contact.corners[pair]
        tangled = search.tangled[corners[0]] + search.tangled[corners[1]]
        tangled += search.tangled[corners[2]] + search.tangled[corners[3]]
        kind = contact.kind[pair] & 1
        spared = contact.due[pair] > EVER
        if tangled > 0:
            contact.due[pair] = due_of(EVER + wp.int64(2), kind)
            contact.lean[pair] = wp.vec4f()
        elif spared:
            contact.due[pair] = due_of(wp.int64(-2), kind)

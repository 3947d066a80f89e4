"""Untangling: moves cloth that passes through cloth back out, without knowing how it got there."""

import functools
from typing import Any

import warp as wp

from warp_cloth.kernels.base.access import position_of
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.contact.arrays import NEVER, ContactData, tagged_path
from warp_cloth.kernels.contact.broad_phase import Candidates, clear_candidates
from warp_cloth.kernels.contact.crossing import segment_pierces, volume
from warp_cloth.kernels.contact.search import ContactSearch
from warp_cloth.kernels.math.closest_points import NOTHING, WHOLE, nearest_on_triangle

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

SHIFT_UNIT = wp.constant(wp.float64(2.0**-40))  # [m]; integers of it are summed, the same in any order
LEAST_SLOPE = wp.constant(wp.float64(0.05))  # sine between edge and triangle; one nearly in the plane is uninformative
LAYERS = wp.constant(wp.int32(1))  # crosses another layer: the direction outwards is known
ITSELF = wp.constant(wp.int32(2))  # crosses its own garment, or one of the same layer
RING = wp.constant(wp.int32(16))  # searches that a tangle must last before one more ring of vertices is smoothed
WIDEST = wp.constant(wp.int32(8 * 16))  # at most eight rings
# Shifts between layers grow in proportion to the searches for which they have crossed, over PATIENCE, up to LONGEST
# times: where taut cloth holds them, as under an arm, shorter ones have no effect.
PATIENCE = wp.constant(wp.float64(32.0))
LONGEST = wp.constant(wp.float64(4.0))
SMOOTHING = wp.constant(wp.float64(0.2))  # fraction of the vector to the mean of its neighbours that a vertex moves
TRIANGLE = wp.constant(wp.int64(2**32 - 1))  # the bits of ``Untangling.nearest`` that name a triangle
ASTRIDE = wp.constant(wp.float64(0.5))  # cosine to the normal below which a nearest point decides no side


@wp.struct
class Untangling:
    """Untangling's constants of the garments, then its state, then its sums."""

    wings: wp.array(dtype=wp.vec2i)  # third corners of the triangles at each edge, -1 where there is none, shape [E]
    rim: wp.array(dtype=wp.int32)  # whether a vertex lies on the garment's border, shape [V]
    adjacent_start: wp.array(dtype=wp.int32)  # rows of the vertices that share an edge with each one, shape [V + 1]
    adjacent: wp.array(dtype=wp.int32)  # those vertices, shape [2 E]
    layer: wp.array(dtype=wp.int32)  # of the vertex's garment, from the inside out, shape [V]
    own_leaves: wp.array(dtype=wp.vec2i)  # first and end of its layer's triangles in the tree, shape [V]
    outward: wp.array(dtype=wp.float32)  # 1 where triangles face away from the body, or -1, shape [V]
    layer_depth: float  # greatest distance on the wrong side of another layer at which a vertex is found [m]
    longest_shift: wp.float64  # in an iteration [m]
    crosses: wp.array(dtype=wp.int32)  # whether a vertex belongs to what crosses, LAYERS or ITSELF, shape [V]
    age: wp.array(dtype=wp.int32)  # searches for which it or an adjacent one has crossed other layers, shape [V]
    next_age: wp.array(dtype=wp.int32)  # the same after this search, shape [V]
    level: wp.array(dtype=wp.int32)  # how far around it the tangle is smoothed [1 / RING rings], shape [V]
    sum: wp.array2d(dtype=wp.int64)  # shifts [SHIFT_UNIT] and their count, shape [V, 4]
    # crossing edges; vertices beyond a layer; tangled vertices; of the edges those that cross another layer, shape [4]
    count: wp.array(dtype=wp.int32)
    nearest: wp.array(dtype=wp.int64)  # other layers' triangle nearest to a vertex, by ``distance_key``, shape [V]


@wp.func
def contour_slope(along: wp.vec3d, normal: wp.vec3d, wing: wp.vec3d):
    """Direction in which an edge moves relative to a triangle so that its own triangle's intersection line shortens.

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
    float key = value;
    int bits;
    memcpy(&bits, &key, sizeof(bits));  // the bits of positive floats are ordered as they are
    return (int64_t)bits << 32;
"""


@wp.func_native(_BITS)
def distance_key(value: wp.float32) -> wp.int64:
    """An integer that grows with a positive number, its lower 32 bits zero."""
    ...


@wp.kernel
def clear_tangles(search: ContactSearch, untangling: Untangling, candidates: Candidates):
    """Resets what crossed at the last search."""
    vertex = wp.tid()
    untangling.level[vertex] = search.tangled[vertex]
    untangling.age[vertex] = untangling.next_age[vertex]
    untangling.crosses[vertex] = 0
    untangling.nearest[vertex] = distance_key(untangling.layer_depth)
    clear_candidates(candidates, vertex)
    for column in range(4):
        untangling.sum[vertex, column] = wp.int64(0)
    if vertex < 4:
        untangling.count[vertex] = 0


@wp.func
def edge_slope(state: Any, ends: wp.vec2i, wings: wp.vec2i, normal: wp.vec3d):
    """Sum of contour_slope over the triangles at an edge, of length at most one."""
    start = position_of(state, ends[0])
    along = wp.normalize(position_of(state, ends[1]) - start)
    slope = wp.vec3d()
    for side in range(2):
        if wings[side] >= 0:
            slope += contour_slope(along, normal, position_of(state, wings[side]) - start)
    return slope / wp.sqrt(wp.dot(slope, slope) + WHOLE)


@wp.func
def separate_crossing(state: Any, search: ContactSearch, untangling: Untangling, edge: int, triangle: int):
    """Shifts an edge, if it passes through a triangle, and that triangle, so that they cross less."""
    ends = search.edges[edge]
    corners = search.triangles[triangle]
    p = position_of(state, ends[0])
    q = position_of(state, ends[1])
    a = position_of(state, corners[0])
    b = position_of(state, corners[1])
    c = position_of(state, corners[2])
    if not segment_pierces(p, q, a, b, c):
        return
    wp.atomic_add(untangling.count, 0, 1)
    before = volume(a, b, c, p)
    along = before / (before - volume(a, b, c, q))  # where the edge passes the plane, 0 to 1
    on = nearest_on_triangle(p + (q - p) * along - a, b - a, c - a)
    normal = wp.normalize(wp.cross(b - a, c - a))
    crossed = ITSELF
    slope = wp.vec3d()
    if untangling.layer[ends[0]] == untangling.layer[corners[0]]:
        slope = edge_slope(state, ends, untangling.wings[edge], normal) * untangling.longest_shift
    else:  # the outer one goes outwards
        crossed = LAYERS
        wp.atomic_add(untangling.count, 3, 1)
        slope = normal * (wp.float64(untangling.outward[corners[0]]) * untangling.longest_shift)
        if untangling.layer[ends[0]] < untangling.layer[corners[0]]:
            slope = -slope
    add_shift(untangling.sum, ends[0], slope * (WHOLE - along))
    add_shift(untangling.sum, ends[1], slope * along)
    for corner in range(3):
        add_shift(untangling.sum, corners[corner], -slope * on[corner])
        wp.atomic_max(untangling.crosses, corners[corner], crossed)
    wp.atomic_max(untangling.crosses, ends[0], crossed)
    wp.atomic_max(untangling.crosses, ends[1], crossed)


@functools.cache
def layers_kernel(precision: str) -> wp.Kernel:
    """Kernel ``separate_layers``."""
    State = cloth_types(precision).State

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False)
    def separate_layers(state: State, search: ContactSearch, contact: ContactData, untangling: Untangling):
        """Shifts each vertex on the wrong side of another layer, and that layer's nearest triangle, apart."""
        vertex = wp.tid()
        found = untangling.nearest[vertex]
        if found < distance_key(untangling.layer_depth):
            layer = untangling.layer[vertex]
            x = position_of(state, vertex)
            t = search.triangles[wp.int32(found & TRIANGLE)]
            a = position_of(state, t[0])
            ab = position_of(state, t[1]) - a
            ac = position_of(state, t[2]) - a
            on = nearest_on_triangle(x - a, ab, ac)
            inner = NOTHING
            for corner in range(3):
                if untangling.rim[t[corner]] == 0:
                    inner += on[corner]
            facing = wp.float64(untangling.outward[t[0]])
            if untangling.layer[t[0]] > layer:
                facing = -facing
            normal = wp.normalize(wp.cross(ab, ac)) * facing
            separation = x - a - ab * on[1] - ac * on[2]
            side = wp.dot(separation, normal)
            if inner > NOTHING and side < -ASTRIDE * wp.length(separation):
                wp.atomic_add(untangling.count, 1, 1)
                thickness = wp.float64(contact.model.thickness[vertex])
                shift = normal * wp.min(untangling.longest_shift, wp.float64(0.5) * (thickness - side))
                add_shift(untangling.sum, vertex, shift)
                wp.atomic_max(untangling.crosses, vertex, LAYERS)
                for corner in range(3):
                    add_shift(untangling.sum, t[corner], -shift * on[corner])
                    wp.atomic_max(untangling.crosses, t[corner], LAYERS)

    return separate_layers


@functools.cache
def finish_kernel(precision: str) -> wp.Kernel:
    """Kernel ``finish_shifts``."""
    State = cloth_types(precision).State

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def finish_shifts(state: State, search: ContactSearch, contact: ContactData, untangling: Untangling):
        """A vertex's untangling shift: the mean over its crossings, plus smoothing around tangles that last.

        A fold that passes through itself is a loop; smoothed, it shortens and comes undone, as a curve does.
        """
        vertex = wp.tid()
        if vertex == 0:
            search.whole[0] = 0
        level = int(0)
        age = int(untangling.age[vertex])
        mean = wp.vec3d()
        x = position_of(state, vertex)
        first = untangling.adjacent_start[vertex]
        last = untangling.adjacent_start[vertex + 1]
        for row in range(first, last):
            other = untangling.adjacent[row]
            level = wp.max(level, untangling.level[other] - RING)
            age = wp.max(age, untangling.age[other])
            mean += position_of(state, other) - x
        if untangling.crosses[vertex] == ITSELF:
            level = wp.max(level, wp.clamp(untangling.level[vertex] + 1, RING, WIDEST))
        search.tangled[vertex] = wp.max(level, untangling.crosses[vertex])
        if search.tangled[vertex] > 0:
            wp.atomic_add(untangling.count, 2, 1)
        count = untangling.sum[vertex, 3]
        shift = wp.vec3d()
        crosses = untangling.crosses[vertex] == LAYERS
        untangling.next_age[vertex] = wp.where(crosses, age + 1, wp.max(untangling.age[vertex] - 1, 0))
        if count > wp.int64(0):
            longer = wp.clamp(wp.float64(age) / PATIENCE, WHOLE, LONGEST)
            scale = SHIFT_UNIT * longer / wp.float64(count)
            dx = wp.float64(untangling.sum[vertex, 0])
            dy = wp.float64(untangling.sum[vertex, 1])
            shift = wp.vec3d(dx, dy, wp.float64(untangling.sum[vertex, 2])) * scale
        if level > 0:
            shift += mean * (SMOOTHING / wp.float64(last - first))
        contact.shift[vertex] = wp.vec3f(shift)

    return finish_shifts


@wp.kernel(grid_stride=False)
def exclude_tangled(search: ContactSearch, contact: ContactData):
    """Excludes pairs with a tangled vertex: contact would hold what crosses where it is."""
    pair = wp.tid()
    if pair < contact.pairs.count[0]:
        corners = contact.pairs.corners[pair]
        tangled = search.tangled[corners[0]] + search.tangled[corners[1]]
        tangled += search.tangled[corners[2]] + search.tangled[corners[3]]
        kind = contact.pairs.kind[pair] & 1
        excluded = contact.pairs.due[pair] > NEVER
        if tangled > 0:
            contact.pairs.due[pair] = tagged_path(NEVER + wp.int64(2), kind)
            contact.pairs.stick[pair] = wp.vec4f()
        elif excluded:
            contact.pairs.due[pair] = tagged_path(wp.int64(-2), kind)

"""Crossing test and count: an edge that passes through a triangle, decided in float64."""

import warp as wp

wp.set_module_options({"enable_backward": False, "fuse_fp": False})  # the same answer on CPU and CUDA

# Relative to the product of three sides: rounding gives four coplanar points, centimetres apart at a metre from the
# origin, a volume of up to about 1e-14 of it.
ROUNDING = wp.constant(wp.float64(1.0e-13))


@wp.func
def volume(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, d: wp.vec3d):
    """Six times the signed volume of the tetrahedron a b c d [m3]."""
    return wp.dot(wp.cross(b - a, c - a), d - a)


@wp.func
def segment_pierces(p: wp.vec3d, q: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d):
    """Whether the segment p q passes through the triangle a b c.

    Its ends lie on different sides of the plane, and the three volumes with the sides have one sign. A segment with an
    end in the plane, within float64's rounding, passes nothing; nor does one whose box does not overlap, whatever
    rounding makes of a segment in line with a distant side. A segment through a side has the same volume there for both
    triangles at that side: it passes through at least one of them.
    """
    low = wp.min(wp.min(a, b), c) - wp.max(p, q)
    high = wp.min(p, q) - wp.max(wp.max(a, b), c)
    if wp.max(wp.max(low), wp.max(high)) > wp.float64(0.0):
        return False
    zero = wp.float64(0.0)
    before = volume(a, b, c, p)
    behind = volume(a, b, c, q)
    rounding = ROUNDING * wp.length(b - a) * wp.length(c - a) * wp.max(wp.length(p - a), wp.length(q - a))
    if before * behind >= zero or wp.min(wp.abs(before), wp.abs(behind)) <= rounding:
        return False
    u = volume(p, q, a, b)
    v = volume(p, q, b, c)
    w = volume(p, q, c, a)
    return (u >= zero and v >= zero and w >= zero) or (u <= zero and v <= zero and w <= zero)


@wp.func
def has_vertex(triangle: wp.vec3i, vertex: int):
    """Whether the vertex is a corner of the triangle."""
    return triangle[0] == vertex or triangle[1] == vertex or triangle[2] == vertex


@wp.func
def pierces(position: wp.array(dtype=wp.vec3d), ends: wp.vec2i, corners: wp.vec3i):
    """Whether an edge passes through a triangle; not one that it has a vertex in common with."""
    if has_vertex(corners, ends[0]) or has_vertex(corners, ends[1]):
        return False
    return segment_pierces(
        position[ends[0]], position[ends[1]], position[corners[0]], position[corners[1]], position[corners[2]]
    )


@wp.func
def lower_first(ends: wp.vec2i):
    """An edge's ends in ascending order, so that rounding does not depend on its direction."""
    return wp.vec2i(wp.min(ends[0], ends[1]), wp.max(ends[0], ends[1]))


@wp.kernel
def find_crossings(
    tree: wp.uint64,  # wp.Bvh of the triangles' boxes, grouped by item
    position: wp.array(dtype=wp.vec3d),  # [m], shape [V]
    edges: wp.array(dtype=wp.vec2i),  # shape [E]
    triangles: wp.array(dtype=wp.vec3i),  # shape [F]
    item: wp.array(dtype=wp.int32),  # vertices of different items do not collide, shape [V]
    count_out: wp.array(dtype=wp.int32),  # shape [1]
    crossing_out: wp.array(dtype=wp.vec2i),  # edge and triangle, shape [capacity]
):
    """Tests every edge against the triangles whose boxes overlap its own."""
    edge = wp.tid()
    ends = lower_first(edges[edge])
    p = wp.vec3f(position[ends[0]])
    q = wp.vec3f(position[ends[1]])
    query = wp.bvh_query_aabb(tree, wp.min(p, q), wp.max(p, q), wp.bvh_get_group_root(tree, item[ends[0]]))
    triangle = int(0)
    while wp.bvh_query_next(query, triangle):
        if pierces(position, ends, triangles[triangle]):
            slot = wp.atomic_add(count_out, 0, 1)
            if slot < crossing_out.shape[0]:  # else the list is full, and only counted
                crossing_out[slot] = wp.vec2i(edge, triangle)


@wp.kernel
def box_triangles(
    position: wp.array(dtype=wp.vec3d),  # [m], shape [V]
    triangles: wp.array(dtype=wp.vec3i),  # shape [F]
    item: wp.array(dtype=wp.int32),  # shape [V]
    lower_out: wp.array(dtype=wp.vec3f),  # [m], shape [F]
    upper_out: wp.array(dtype=wp.vec3f),  # [m], shape [F]
    group_out: wp.array(dtype=wp.int32),  # its item, shape [F]
):
    """Writes the box of each triangle."""
    triangle = wp.tid()
    corners = triangles[triangle]
    a = wp.vec3f(position[corners[0]])  # rounding is monotonic: boxes that overlapped still do
    b = wp.vec3f(position[corners[1]])
    c = wp.vec3f(position[corners[2]])
    lower_out[triangle] = wp.min(wp.min(a, b), c)
    upper_out[triangle] = wp.max(wp.max(a, b), c)
    group_out[triangle] = item[corners[0]]

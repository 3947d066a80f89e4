"""Closest points of a point and a triangle, and of two edges; the weight of nearly parallel edges.

In the precision of forces: the distance is subtracted in float64, and the closest points need not be known as well,
because the distance is least there.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.math.real import inner, quotient, scaled_sum

wp.set_module_options({"enable_backward": False, "fuse_fp": False})  # the same bits on CPU and CUDA

# Squared sine of the angle between two edges below which their weight falls to zero: parallel edges have no unique
# nearest point, and a jump of that point would be a jump of the force. Their ends still collide with the triangles.
PARALLEL = 0.01
NOTHING = wp.constant(wp.float64(0.0))
WHOLE = wp.constant(wp.float64(1.0))
LEAST = 1e-30  # least divisor: it matters only where an edge or a triangle has no size


@functools.cache
def on_triangle_function(real: type) -> wp.Function:
    """Function ``on_triangle`` in float32 or float64."""
    vec3 = wp.types.vector(3, real)
    nothing, whole_one, least = wp.constant(real(0.0)), wp.constant(real(1.0)), wp.constant(real(LEAST))

    @wp.func
    def on_triangle(p: vec3, ab: vec3, ac: vec3):
        """Barycentric coordinates of the point of the triangle a b c nearest to a point; all vectors from a.

        Ericson, Real-Time Collision Detection, 5.1.5: by the Voronoi region in which the point lies.
        """
        d1 = inner(ab, p)
        d2 = inner(ac, p)
        bp = p - ab
        d3 = inner(ab, bp)
        d4 = inner(ac, bp)
        cp = p - ac
        d5 = inner(ab, cp)
        d6 = inner(ac, cp)
        va = d3 * d6 - d5 * d4
        vb = d5 * d2 - d1 * d6
        vc = d1 * d4 - d3 * d2
        at_a = d1 <= nothing and d2 <= nothing
        at_b = d3 >= nothing and d4 <= d3
        at_c = d6 >= nothing and d5 <= d6
        on_ab = vc <= nothing and d1 >= nothing and d3 <= nothing
        on_ac = vb <= nothing and d2 >= nothing and d6 <= nothing
        on_bc = va <= nothing and d4 - d3 >= nothing and d5 - d6 >= nothing
        # selects instead of branches, which would make a GPU's warp diverge
        whole = wp.where(on_bc, (d4 - d3) + (d5 - d6), va + vb + vc)
        whole = wp.where(on_ac, d2 - d6, whole)
        whole = wp.where(on_ab, d1 - d3, whole)
        scale = quotient(whole_one, wp.max(whole, least))
        v = wp.where(on_ab, d1, vb) * scale
        w = wp.where(on_ac, d2, wp.where(on_bc, d4 - d3, vc)) * scale
        on = vec3(va * scale, v, w)
        on = wp.where(on_bc, vec3(nothing, whole_one - w, w), on)
        on = wp.where(on_ac, vec3(whole_one - w, nothing, w), on)
        on = wp.where(at_c, vec3(nothing, nothing, whole_one), on)
        on = wp.where(on_ab, vec3(whole_one - v, v, nothing), on)
        on = wp.where(at_b, vec3(nothing, whole_one, nothing), on)
        return wp.where(at_a, vec3(whole_one, nothing, nothing), on)

    return on_triangle


@functools.cache
def on_edges_function(real: type) -> wp.Function:
    """Function ``on_edges`` in float32 or float64."""
    vec2, vec3 = wp.types.vector(2, real), wp.types.vector(3, real)
    nothing, whole_one, least = wp.constant(real(0.0)), wp.constant(real(1.0)), wp.constant(real(LEAST))

    @wp.func
    def clamped(value: real):
        """The value clamped to [0, 1]."""
        return wp.clamp(value, nothing, whole_one)

    @wp.func
    def on_edges(along_0: vec3, along_1: vec3, between: vec3):
        """Parameters s, t in [0, 1] along two edges where they are nearest; ``between``: first start - second start.

        Ericson, Real-Time Collision Detection, 5.1.9; by cross products, which lose fewer digits for nearly parallel
        edges than the difference a e - b^2 does.
        """
        a = inner(along_0, along_0)
        e = inner(along_1, along_1)
        b = inner(along_0, along_1)
        c = inner(along_0, between)
        f = inner(along_1, between)
        inverse_a, inverse_e = quotient(whole_one, wp.max(a, least)), quotient(whole_one, wp.max(e, least))
        cross = wp.cross(along_0, along_1)
        slant = inner(cross, cross)
        s = clamped(quotient(inner(wp.cross(along_1, between), cross), wp.max(slant, least)))
        t = (b * s + f) * inverse_e
        beyond = clamped(wp.where(t < nothing, -c, b - c) * inverse_a)
        return vec2(wp.where(t < nothing or t > whole_one, beyond, s), clamped(t))

    return on_edges


nearest_on_triangle = on_triangle_function(wp.float64)


@functools.cache
def parallel_functions(real: type) -> SimpleNamespace:
    """Functions ``weight`` and ``sine_gradient`` of two nearly parallel edges."""
    vec2, vec3 = wp.types.vector(2, real), wp.types.vector(3, real)
    one, two, least = wp.constant(real(1.0)), wp.constant(real(2.0)), wp.constant(real(LEAST))
    by_parallel = wp.constant(real(1.0 / PARALLEL))

    @wp.func
    def weight(along_0: vec3, along_1: vec3):
        """Weight w of a pair of edges, 0 to 1, and dw/dq, q the squared sine of the angle between them.

        w = (q/e) (2 - q/e) below e = PARALLEL, 1 above (after Li et al. 2020, Incremental Potential Contact, eq. 24).
        """
        cross = wp.cross(along_0, along_1)
        size = wp.max(inner(along_0, along_0) * inner(along_1, along_1), least)
        ratio = quotient(inner(cross, cross), size) * by_parallel
        if ratio >= one:
            return vec2(one, real(0.0))
        return vec2(ratio * (two - ratio), two * (one - ratio) * by_parallel)

    @wp.func
    def sine_gradient(along: vec3, other: vec3):
        """Gradient with respect to ``along`` of the squared sine of the angle between two edges [1/m]."""
        a = wp.max(inner(along, along), least)
        dot = inner(along, other)
        scale = quotient(two * dot, wp.max(a * inner(other, other), least))
        return scaled_sum(along, quotient(dot, a), -other) * scale

    return SimpleNamespace(weight=weight, sine_gradient=sine_gradient)

"""Two bits of cloth that touch: where they are nearest, and how hard their fabric pushes back when squeezed."""

import warp as wp

wp.set_module_options({"enable_backward": False, "fuse_fp": False})  # the same bits on CPU and CUDA

# Squared sine of the angle between two edges below which they count less and less: parallel edges have no single
# nearest point, and a jump there would be a jump in the force. Their ends still meet the triangles.
PARALLEL = wp.constant(wp.float64(0.01))
NOTHING = wp.constant(wp.float64(0.0))
WHOLE = wp.constant(wp.float64(1.0))


@wp.func
def clamped(value: wp.float64):
    """The value, kept in [0, 1]."""
    return wp.clamp(value, NOTHING, WHOLE)


@wp.func
def nearest_on_triangle(p: wp.vec3d, ab: wp.vec3d, ac: wp.vec3d):
    """Barycentric coordinates of the point of the triangle a b c nearest to a point; all vectors from a.

    Ericson, Real-Time Collision Detection, 5.1.5: by the Voronoi region in which the point lies.
    """
    d1 = wp.dot(ab, p)
    d2 = wp.dot(ac, p)
    bp = p - ab
    d3 = wp.dot(ab, bp)
    d4 = wp.dot(ac, bp)
    cp = p - ac
    d5 = wp.dot(ab, cp)
    d6 = wp.dot(ac, cp)
    va = d3 * d6 - d5 * d4
    vb = d5 * d2 - d1 * d6
    vc = d1 * d4 - d3 * d2
    at_a = d1 <= NOTHING and d2 <= NOTHING
    at_b = d3 >= NOTHING and d4 <= d3
    at_c = d6 >= NOTHING and d5 <= d6
    on_ab = vc <= NOTHING and d1 >= NOTHING and d3 <= NOTHING
    on_ac = vb <= NOTHING and d2 >= NOTHING and d6 <= NOTHING
    on_bc = va <= NOTHING and d4 - d3 >= NOTHING and d5 - d6 >= NOTHING
    # threads that go together take one way through all: a GPU's would wait for each other's
    whole = wp.where(on_bc, (d4 - d3) + (d5 - d6), va + vb + vc)
    whole = wp.where(on_ac, d2 - d6, whole)
    whole = wp.where(on_ab, d1 - d3, whole)
    share = WHOLE / whole
    u = va * share
    v = wp.where(on_ab, d1, vb) * share
    w = wp.where(on_ac, d2, wp.where(on_bc, d4 - d3, vc)) * share
    on = wp.vec3d(u, v, w)
    on = wp.where(on_bc, wp.vec3d(NOTHING, WHOLE - w, w), on)
    on = wp.where(on_ac, wp.vec3d(WHOLE - w, NOTHING, w), on)
    on = wp.where(at_c, wp.vec3d(NOTHING, NOTHING, WHOLE), on)
    on = wp.where(on_ab, wp.vec3d(WHOLE - v, v, NOTHING), on)
    on = wp.where(at_b, wp.vec3d(NOTHING, WHOLE, NOTHING), on)
    return wp.where(at_a, wp.vec3d(WHOLE, NOTHING, NOTHING), on)


@wp.func
def nearest_on_edges(along_0: wp.vec3d, along_1: wp.vec3d, between: wp.vec3d):
    """Shares s, t of the way along two edges where they are nearest; ``between`` is first start less second start.

    Ericson, Real-Time Collision Detection, 5.1.9.
    """
    a = wp.dot(along_0, along_0)
    e = wp.dot(along_1, along_1)
    b = wp.dot(along_0, along_1)
    c = wp.dot(along_0, between)
    f = wp.dot(along_1, between)
    if a <= NOTHING and e <= NOTHING:
        return wp.vec2d(NOTHING, NOTHING)
    if a <= NOTHING:
        return wp.vec2d(NOTHING, clamped(f / e))
    if e <= NOTHING:
        return wp.vec2d(clamped(-c / a), NOTHING)
    share_0, share_1 = WHOLE / a, WHOLE / e
    slant = a * e - b * b
    s = wp.where(slant > NOTHING, clamped((b * f - c * e) / slant), NOTHING)
    t = (b * s + f) * share_1
    beyond = clamped(wp.where(t < NOTHING, -c, b - c) * share_0)
    return wp.vec2d(wp.where(t < NOTHING or t > WHOLE, beyond, s), clamped(t))


@wp.func
def squeeze_energy(x: wp.float64, inverse: wp.float64, thickness: wp.float64, modulus: wp.float64):
    """Energy [J] of two bits of cloth nearer than their thickness h: E = m h^2 (1/x + 3 x - x^2 - 3), x = d / h.

    Zero with zero slope and curvature at x = 1, without bound towards x = 0; ``modulus`` m [N/m], ``inverse`` 1/x.
    """
    return modulus * thickness * thickness * (inverse + wp.float64(3.0) * x - x * x - wp.float64(3.0))


@wp.func
def squeeze_force(x: wp.float64, inverse: wp.float64, thickness: wp.float64, modulus: wp.float64):
    """Force [N] that pushes them apart, -dE/dd = m h (1/x^2 - 3 + 2 x)."""
    return modulus * thickness * (inverse * inverse - wp.float64(3.0) + wp.float64(2.0) * x)


@wp.func
def squeeze_stiffness(inverse: wp.float64, modulus: wp.float64):
    """Its stiffness [N/m], d2E/dd2 = 2 m (1/x^3 - 1)."""
    return wp.float64(2.0) * modulus * (inverse * inverse * inverse - WHOLE)


@wp.func
def slant_share(along_0: wp.vec3d, along_1: wp.vec3d):
    """What a pair of edges counts for, 0 to 1, and its derivative by the squared sine q of the angle between them.

    m = (q/e) (2 - q/e) below e = PARALLEL, 1 above (after Li et al. 2020, Incremental Potential Contact, eq. 24).
    """
    a = wp.dot(along_0, along_0)
    e = wp.dot(along_1, along_1)
    cross = wp.cross(along_0, along_1)
    share = wp.dot(cross, cross) / (PARALLEL * wp.max(a * e, wp.float64(1.0e-60)))
    if share >= WHOLE:
        return wp.vec2d(WHOLE, NOTHING)
    return wp.vec2d(share * (wp.float64(2.0) - share), wp.float64(2.0) * (WHOLE - share) / PARALLEL)


@wp.func
def slant_slope(along: wp.vec3d, other: wp.vec3d):
    """Gradient by ``along`` of the squared sine of the angle between two edges [1/m]."""
    a = wp.dot(along, along)
    dot = wp.dot(along, other)
    scale = wp.float64(2.0) * dot / wp.max(a * wp.dot(other, other), wp.float64(1.0e-60))
    return scale * (along * (dot / wp.max(a, wp.float64(1.0e-60))) - other)

"""Signed distance field (SDF): distance to the avatar on a grid, sampled by a quadratic B-spline."""

import warp as wp

from warp_cloth.kernels.math.real import inner, quotient, root, scaled_sum

wp.set_module_options({"enable_backward": False, "fuse_fp": False})  # the same bits on CPU and CUDA

FLAT = wp.constant(wp.float32(1.0e-3))  # gradient below which it gives no normal
ROUNDING = wp.constant(wp.float32(1.0e-6))  # [m], more than the rounding of a float32 distance


@wp.struct
class ContactField:
    """Signed distance to the avatar on a grid, positive outside; between nodes a quadratic B-spline."""

    values: wp.array3d(dtype=wp.float32)  # spline coefficients [m], shape [nx, ny, nz]
    origin: wp.vec3d  # node (0, 0, 0) in the world [m]
    spacing: float  # [m]
    reach: float  # distance from the surface up to which the field holds; beyond it a point is simply far [m]
    near: float  # distance up to which the normal is computed: contact at an offset needs none beyond it [m]
    steepest: float  # upper bound of the distance's slope; 0: not known
    beyond: float  # lower bound of the true distance, inside the grid, where the field returns ``reach`` [m]


@wp.func
def far_contact(distance: float) -> wp.vec4f:
    """No contact: zero normal and that distance [m]."""
    return wp.vec4f(0.0, 0.0, 0.0, distance)


@wp.func
def spline_weights(t: float) -> wp.vec3f:
    """Quadratic B-spline weights of the nodes -1, 0, 1 at an offset t in [-1/2, 1/2] from the nearest one."""
    return wp.vec3f(0.5 * (0.5 - t) * (0.5 - t), 0.75 - t * t, 0.5 * (0.5 + t) * (0.5 + t))


@wp.func
def spline_slopes(t: float) -> wp.vec3f:
    """Derivatives of spline_weights by t."""
    return wp.vec3f(t - 0.5, -2.0 * t, t + 0.5)


_ROW = """
    const float* row = values.data + node;
#if defined(__CUDA_ARCH__)
    return wp::vec_t<3, wp::float32>(__ldg(row - 1), __ldg(row), __ldg(row + 1));
#else
    return wp::vec_t<3, wp::float32>(row[-1], row[0], row[1]);
#endif
"""


@wp.func_native(_ROW)
def row_about(values: wp.array3d(dtype=wp.float32), node: int) -> wp.vec3f:
    """A node's value between its two neighbours' along z; ``node`` counts in memory order (C-contiguous)."""
    return wp.vec3f(values[0, 0, node - 1], values[0, 0, node], values[0, 0, node + 1])


_FETCH = """
#if !defined(__CUDA_ARCH__)
    __builtin_prefetch(values.data + node - 1);
#endif
"""


@wp.func_native(_FETCH)
def fetch_row(values: wp.array3d(dtype=wp.float32), node: int):
    """Prefetches what ``row_about`` reads."""
    ...


@wp.func
def fetch_field(field: ContactField, p: wp.vec3d):
    """Prefetches what ``field_contact`` reads at a point.

    On the CPU only; a GPU hides the latency by working on other points.
    """
    q = p - field.origin
    inverse = quotient(1.0, field.spacing)
    i = int(wp.floor(float(q[0]) * inverse + 0.5))
    j = int(wp.floor(float(q[1]) * inverse + 0.5))
    k = int(wp.floor(float(q[2]) * inverse + 0.5))
    ny = field.values.shape[1]
    nz = field.values.shape[2]
    if i < 1 or j < 1 or k < 1 or i > field.values.shape[0] - 2 or j > ny - 2 or k > nz - 2:
        return
    for a in range(3):
        for b in range(3):
            fetch_row(field.values, ((i + a - 1) * ny + j + b - 1) * nz + k)


@wp.func
def field_clearance(field: ContactField, p: wp.vec3d, distance: float, offset: float) -> float:
    """Clearance: how far a point at p may move in any direction and surely stay farther off than ``offset`` [m].

    (d - offset) / max |grad d|; ``distance`` is that of ``field_contact`` at p. 0 outside the grid, where its edge may
    be near.
    """
    q = p - field.origin
    least = wp.float64(field.spacing)
    for axis in range(3):
        far = least * wp.float64(field.values.shape[axis] - 2)
        if q[axis] < least or q[axis] > far:
            return 0.0
    gap = wp.where(distance < field.reach, distance, field.beyond) - offset - ROUNDING
    if gap <= 0.0 or field.steepest == 0.0:
        return 0.0
    return gap / field.steepest


@wp.kernel
def measure_slopes(
    values: wp.array3d(dtype=wp.float32),  # shape [nx, ny, nz]
    slope_out: wp.array(dtype=wp.float32),  # largest difference of neighbours along x, y and z, shape [3]
):
    """Bounds a spline's slopes: weighted means of differences of neighbouring coefficients. Threads: lines along z."""
    i, j = wp.tid()
    before_i, before_j = wp.max(i - 1, 0), wp.max(j - 1, 0)
    last = values[i, j, 0]
    slope = wp.vec3f()
    for k in range(values.shape[2]):
        here = values[i, j, k]
        neighbours = wp.vec3f(values[before_i, j, k], values[i, before_j, k], last)
        slope = wp.max(slope, wp.abs(wp.vec3f(here, here, here) - neighbours))
        last = here
    for axis in range(3):
        if slope[axis] > slope_out[axis]:  # else thousands of threads would queue for the atomic
            wp.atomic_max(slope_out, axis, slope[axis])


@wp.func
def steepest_axis(values: wp.array3d(dtype=wp.float32), i: int, j: int, k: int) -> wp.vec3f:
    """Of the six grid directions, that to the neighbour of an inner node with the greatest distance."""
    best = float(values[i, j, k + 1])
    normal = wp.vec3f(0.0, 0.0, 1.0)
    for axis in range(3):
        for direction in range(2):
            step = wp.vec3i(0, 0, 0)
            step[axis] = 1 - 2 * direction
            value = values[i + step[0], j + step[1], k + step[2]]
            if value > best:
                best = value
                normal = wp.vec3f(float(step[0]), float(step[1]), float(step[2]))
    return normal


@wp.func
def field_contact(field: ContactField, p: wp.vec3d) -> wp.vec4f:
    """Unit normal and signed distance [m] at a world point p: (normal, d), d > 0 outside the avatar.

    d = sum c_ijk w_i(x) w_j(y) w_k(z) over 27 nodes, normal = grad d / |grad d|: both continuous everywhere
    closer than reach; the normal is zero beyond ``near``. Beyond reach, and outside the grid: normal zero, d >= reach.
    Where the gradient vanishes (on a medial axis deep inside), the normal is the grid direction along which d grows
    most.
    """
    q = p - field.origin
    inverse = quotient(1.0, field.spacing)
    x = float(q[0]) * inverse
    y = float(q[1]) * inverse
    z = float(q[2]) * inverse
    i = int(wp.floor(x + 0.5))
    j = int(wp.floor(y + 0.5))
    k = int(wp.floor(z + 0.5))
    nx = field.values.shape[0]
    ny = field.values.shape[1]
    nz = field.values.shape[2]
    if i < 1 or j < 1 or k < 1 or i > nx - 2 or j > ny - 2 or k > nz - 2:
        return far_contact(field.reach)
    plane_nodes = ny * nz
    first = i * plane_nodes + j * nz + k
    middle = row_about(field.values, first)
    if middle[1] > field.reach + field.spacing:
        return far_contact(field.reach)
    first -= plane_nodes + nz
    u = x - float(i)
    v = y - float(j)
    w = z - float(k)
    wx = spline_weights(u)
    wy = spline_weights(v)
    wz = spline_weights(w)
    sx = spline_slopes(u)
    sy = spline_slopes(v)
    across = wp.vec3f()  # of the three nodes along z, summed across x and y; then by the slopes along x, along y
    across_x = wp.vec3f()
    across_y = wp.vec3f()
    for a in range(3):
        plane = wp.vec3f()
        plane_y = wp.vec3f()
        for b in range(3):
            row = row_about(field.values, first + a * plane_nodes + b * nz)
            plane = scaled_sum(row, wy[b], plane)
            plane_y = scaled_sum(row, sy[b], plane_y)
        across = scaled_sum(plane, wx[a], across)
        across_x = scaled_sum(plane, sx[a], across_x)
        across_y = scaled_sum(plane_y, wx[a], across_y)
    distance = inner(wz, across)
    if distance > field.near:
        return far_contact(distance)
    gx, gy, gz = inner(wz, across_x), inner(wz, across_y), inner(spline_slopes(w), across)
    gradient = wp.vec3f(gx, gy, gz)  # per spacing
    length = root(inner(gradient, gradient))
    if length > FLAT * field.spacing:
        normal = gradient * quotient(1.0, length)
    else:
        normal = steepest_axis(field.values, i, j, k)
    return wp.vec4f(normal[0], normal[1], normal[2], distance)


@wp.kernel
def sample_field(
    field: ContactField,
    points: wp.array(dtype=wp.vec3d),  # [m], shape [N]
    contact_out: wp.array(dtype=wp.vec4f),  # normal and signed distance [m], shape [N]
):
    """Samples field_contact at points."""
    point = wp.tid()
    contact_out[point] = field_contact(field, points[point])

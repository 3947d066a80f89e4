"""The contact field: signed distance to the avatar on a grid, sampled smoothly by the relaxation."""

import warp as wp

from warp_cloth.kernels.arithmetic import quotient, root

wp.set_module_options({"enable_backward": False, "fuse_fp": False})  # the same bits on CPU and CUDA

FLAT = wp.constant(wp.float32(1.0e-3))  # gradient below which no normal is told


@wp.struct
class ContactField:
    """Signed distance to the avatar on a grid, positive outside; between nodes a quadratic B-spline."""

    values: wp.array3d(dtype=wp.float32)  # spline coefficients [m], shape [nx, ny, nz]
    origin: wp.vec3d  # node (0, 0, 0) in the world [m]
    spacing: float  # [m]
    reach: float  # distance from the surface up to which answers are exact; farther is simply far [m]
    near: float  # distance up to which a normal is told: who meets cloth at an offset asks for none beyond it [m]


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
    const float* row = values.data + ((size_t)i * values.shape[1] + j) * values.shape[2] + k;
    return wp::vec_t<3, wp::float32>(row[-1], row[0], row[1]);
"""


@wp.func_native(_ROW)
def row_about(values: wp.array3d(dtype=wp.float32), i: int, j: int, k: int) -> wp.vec3f:
    """Nodes (i, j, k - 1) to (i, j, k + 1) of a grid that lies in memory as it is counted."""
    return wp.vec3f(values[i, j, k - 1], values[i, j, k], values[i, j, k + 1])


@wp.func
def steepest_axis(values: wp.array3d(dtype=wp.float32), i: int, j: int, k: int) -> wp.vec3f:
    """Of the six grid directions, that to the neighbour of an inner node with the greatest distance."""
    best = float(values[i, j, k + 1])
    normal = wp.vec3f(0.0, 0.0, 1.0)
    for axis in range(3):
        for way in range(2):
            step = wp.vec3i(0, 0, 0)
            step[axis] = 1 - 2 * way
            value = values[i + step[0], j + step[1], k + step[2]]
            if value > best:
                best = value
                normal = wp.vec3f(float(step[0]), float(step[1]), float(step[2]))
    return normal


@wp.func
def field_contact(field: ContactField, p: wp.vec3d) -> wp.vec4f:
    """Unit normal and signed distance [m] at a world point p: (normal, d), d > 0 outside the avatar.

    d = sum c_ijk w_i(x) w_j(y) w_k(z) over 27 nodes, normal = grad d / |grad d|: both continuous everywhere
    nearer than reach; the normal is zero beyond ``near``. Beyond reach, and outside the grid: normal zero, d >= reach.
    Where the gradient vanishes (on a medial axis deep inside), the normal is the grid direction along which d grows
    most.
    """
    q = p - field.origin
    x = quotient(float(q[0]), field.spacing)
    y = quotient(float(q[1]), field.spacing)
    z = quotient(float(q[2]), field.spacing)
    i = int(wp.floor(x + 0.5))
    j = int(wp.floor(y + 0.5))
    k = int(wp.floor(z + 0.5))
    nx = field.values.shape[0]
    ny = field.values.shape[1]
    nz = field.values.shape[2]
    if i < 1 or j < 1 or k < 1 or i > nx - 2 or j > ny - 2 or k > nz - 2:
        return far_contact(field.reach)
    middle = row_about(field.values, i, j, k)
    if middle[1] > field.reach + field.spacing:
        return far_contact(field.reach)
    u = x - float(i)
    v = y - float(j)
    w = z - float(k)
    wx = spline_weights(u)
    wy = spline_weights(v)
    wz = spline_weights(w)
    distance = float(0.0)
    for a in range(3):
        plane = float(0.0)
        for b in range(3):
            plane += wy[b] * wp.dot(wz, row_about(field.values, i + a - 1, j + b - 1, k))
        distance += wx[a] * plane
    if distance > field.near:
        return far_contact(distance)
    sx = spline_slopes(u)
    sy = spline_slopes(v)
    sz = spline_slopes(w)
    gx = float(0.0)
    gy = float(0.0)
    gz = float(0.0)
    for a in range(3):
        plane_x = float(0.0)
        plane_y = float(0.0)
        plane_z = float(0.0)
        for b in range(3):
            row = row_about(field.values, i + a - 1, j + b - 1, k)
            line = wp.dot(wz, row)
            plane_x += wy[b] * line
            plane_y += sy[b] * line
            plane_z += wy[b] * wp.dot(sz, row)
        gx += sx[a] * plane_x
        gy += wx[a] * plane_y
        gz += wx[a] * plane_z
    gradient = wp.vec3f(gx, gy, gz)  # per spacing
    length = root(wp.dot(gradient, gradient))
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
    """What field_contact answers at points."""
    point = wp.tid()
    contact_out[point] = field_contact(field, points[point])

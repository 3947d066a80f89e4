"""Orthographic z-buffer: triangles drawn into depth images, for the depth buffers and the preview."""

import warp as wp

wp.set_module_options({"enable_backward": False, "fuse_fp": False})  # the same bits on CPU and CUDA

COVERAGE_TOLERANCE = wp.constant(wp.float32(1.0e-5))  # barycentric slack: fused multiply-add must not open cracks

TIE_TOLERANCE = wp.constant(wp.float32(1.0e-6))  # [m]; two kernels may round one depth differently


@wp.struct
class View:
    """An orthographic camera over a grid of pixel centres; depth is the coordinate along ``toward``."""

    origin: wp.vec3f  # centre of pixel (0, 0) at depth 0 [m]
    right: wp.vec3f  # unit vector along columns
    up: wp.vec3f  # unit vector along rows
    toward: wp.vec3f  # unit vector from the scene to the viewer
    pixel: float  # pixel size [m]
    columns: int
    rows: int


@wp.func
def pixel_position(view: View, p: wp.vec3f) -> wp.vec3f:
    """Column, row (both in pixels, fractional) and depth [m] of a point."""
    q = p - view.origin
    return wp.vec3f(wp.dot(q, view.right) / view.pixel, wp.dot(q, view.up) / view.pixel, wp.dot(q, view.toward))


@wp.func
def pixel_triangle(view: View, points: wp.array(dtype=wp.vec3f), triangles: wp.array2d(dtype=wp.int32), triangle: int):
    """``pixel_position`` of a triangle's corners."""
    a, b = points[triangles[triangle, 0]], points[triangles[triangle, 1]]
    return pixel_position(view, a), pixel_position(view, b), pixel_position(view, points[triangles[triangle, 2]])


@wp.func
def pixel_box(a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, columns: int, rows: int) -> wp.vec4i:
    """First and end of the columns, then of the rows, whose centres a projected triangle may cover."""
    low = wp.min(wp.min(a, b), c)
    high = wp.max(wp.max(a, b), c)
    return wp.vec4i(
        wp.max(int(wp.ceil(low[0])), 0),
        wp.min(int(wp.floor(high[0])), columns - 1) + 1,
        wp.max(int(wp.ceil(low[1])), 0),
        wp.min(int(wp.floor(high[1])), rows - 1) + 1,
    )


@wp.func
def barycentric(a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, x: float, y: float) -> wp.vec3f:
    """Barycentric coordinates of (x, y) in the projected triangle; all negative where it is degenerate.

    Three edge functions, each antisymmetric in its edge's ends, over their sum: two triangles that share an
    edge get opposite signs there, so no pixel falls between them.
    """
    ax = a[0] - x
    ay = a[1] - y
    bx = b[0] - x
    by = b[1] - y
    cx = c[0] - x
    cy = c[1] - y
    w = wp.vec3f(bx * cy - cx * by, cx * ay - ax * cy, ax * by - bx * ay)
    area = w[0] + w[1] + w[2]
    if wp.abs(area) < 1.0e-12:
        return wp.vec3f(-1.0, -1.0, -1.0)
    return w / area


@wp.func
def edge_side(ux: float, uy: float, vx: float, vy: float) -> int:
    """On which side of the edge from u to v the origin lies: 1 left, -1 right; never both, nor neither.

    Antisymmetric in its ends to the bit; on the edge itself its direction decides.
    """
    w = ux * vy - vx * uy
    if w == 0.0:
        w = wp.where(uy == vy, vx - ux, vy - uy)
    return wp.where(w > 0.0, 1, -1)


@wp.func
def sided_cover(a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, x: float, y: float) -> int:
    """Whether a projected triangle covers (x, y): 1 seen from its front, -1 from its back, 0 not at all.

    Of the triangles round an edge or a vertex exactly one takes a point on it: along any ray the surfaces of a
    closed mesh that are entered and left balance.
    """
    side = edge_side(b[0] - x, b[1] - y, c[0] - x, c[1] - y)
    if edge_side(c[0] - x, c[1] - y, a[0] - x, a[1] - y) != side:
        return 0
    if edge_side(a[0] - x, a[1] - y, b[0] - x, b[1] - y) != side:
        return 0
    return side


@wp.func
def pixel_weights(a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, x: float, y: float) -> wp.vec3f:
    """Barycentric coordinates of (x, y), thirds where the projected triangle has no area."""
    w = barycentric(a, b, c, x, y)
    if wp.min(w) < -0.5:
        return wp.vec3f(1.0, 1.0, 1.0) / 3.0
    return w


@wp.kernel
def draw_depth(
    points: wp.array(dtype=wp.vec3f),  # [m], shape [V]
    triangles: wp.array2d(dtype=wp.int32),  # shape [F, 3]
    view: View,
    depth_out: wp.array2d(dtype=wp.float32),  # greatest depth [m], shape [rows, columns]; start it at -inf
):
    """Draws the surface nearest to the viewer: the greatest depth of the triangles over a pixel's centre."""
    triangle = wp.tid()
    a, b, c = pixel_triangle(view, points, triangles, triangle)
    box = pixel_box(a, b, c, view.columns, view.rows)
    for row in range(box[2], box[3]):
        for column in range(box[0], box[1]):
            w = barycentric(a, b, c, float(column), float(row))
            if wp.min(w) >= -COVERAGE_TOLERANCE:
                wp.atomic_max(depth_out, row, column, w[0] * a[2] + w[1] * b[2] + w[2] * c[2])


@wp.kernel
def draw_triangle_ids(
    points: wp.array(dtype=wp.vec3f),  # [m], shape [V]
    triangles: wp.array2d(dtype=wp.int32),  # shape [F, 3]
    view: View,
    depth: wp.array2d(dtype=wp.float32),  # from draw_depth [m], shape [rows, columns]
    id_out: wp.array2d(dtype=wp.int32),  # lowest id of the triangles at that depth; start it at F
):
    """Draws which triangle a pixel shows; equal depths go to the lowest id: the same picture every time."""
    triangle = wp.tid()
    a, b, c = pixel_triangle(view, points, triangles, triangle)
    box = pixel_box(a, b, c, view.columns, view.rows)
    for row in range(box[2], box[3]):
        for column in range(box[0], box[1]):
            w = barycentric(a, b, c, float(column), float(row))
            if wp.min(w) >= -COVERAGE_TOLERANCE:
                here = w[0] * a[2] + w[1] * b[2] + w[2] * c[2]
                if here >= depth[row, column] - TIE_TOLERANCE:
                    wp.atomic_min(id_out, row, column, triangle)

"""Depth buffers: the solid that three of them enclose, behind the front surface, before the back, under the top."""

import warp as wp

wp.set_module_options({"enable_backward": False, "fuse_fp": False})  # the same bits on CPU and CUDA

EMPTY = wp.constant(wp.float32(-1.0e30))  # level of a point with no surface around it
JUMP_SLOPE = wp.constant(wp.float32(4.0))  # pixels of height per pixel above which a cell of the top buffer is a wall


@wp.struct
class DepthSolid:
    """Three depth buffers over one local frame; pixel (0, 0) is centred at the local origin in every view."""

    origin: wp.vec3d  # local origin in the world [m]
    pixel: float  # pixel size [m]
    reach: float  # distance outside at and beyond which plain_contact finds no contact [m]
    front: wp.array2d(dtype=wp.float32)  # greatest z [m], -inf where empty, shape [rows along y, columns along x]
    back: wp.array2d(dtype=wp.float32)  # greatest -z [m], same shape
    top: wp.array2d(dtype=wp.float32)  # greatest y [m], -inf where empty, shape [rows along z, columns along x]
    middle: wp.array2d(dtype=wp.float32)  # mean of front and back surface [m], one pixel beyond the silhouette too
    bulge: wp.array2d(dtype=wp.float32)  # half thickness squared [m2], negative beyond the silhouette, EMPTY far away


@wp.func
def covered(depth: float) -> bool:
    """Whether a pixel shows a surface."""
    return depth > EMPTY


@wp.struct
class Cell:
    """Four neighbouring pixels, and where a point lies between them."""

    row: int  # lower of both
    column: int
    s: float  # fraction of the way to the next column, 0 to 1
    t: float  # and to the next row


@wp.func
def lower_pixel(coordinate: float, pixel: float, count: int) -> wp.vec2f:
    """Index of the lower pixel around a coordinate [m], and the fraction beyond it; within the image."""
    x = wp.clamp(coordinate / pixel, 0.0, float(count - 1))
    i = wp.min(wp.floor(x), float(wp.max(count - 2, 0)))
    return wp.vec2f(i, x - i)


@wp.func
def image_cell(image: wp.array2d(dtype=wp.float32), pixel: float, x: float, y: float):
    """The cell of an image around a point; coordinates along columns and rows [m]."""
    column = lower_pixel(x, pixel, image.shape[1])
    row = lower_pixel(y, pixel, image.shape[0])
    cell = Cell()
    cell.row = int(row[0])
    cell.column = int(column[0])
    cell.s = column[1]
    cell.t = row[1]
    return cell


@wp.func
def cell_values(image: wp.array2d(dtype=wp.float32), cell: Cell) -> wp.vec4f:
    """Values of a cell's pixels, row by row."""
    i, j = cell.column, cell.row
    return wp.vec4f(image[j, i], image[j, i + 1], image[j + 1, i], image[j + 1, i + 1])


@wp.func
def bilinear(v: wp.vec4f, cell: Cell) -> float:
    """Bilinear mean of a cell's values at its point."""
    low = v[0] + cell.s * (v[1] - v[0])
    high = v[2] + cell.s * (v[3] - v[2])
    return low + cell.t * (high - low)


@wp.func
def top_height(solid: DepthSolid, x: float, z: float) -> float:
    """Height of the top surface [m]: bilinear on slopes, the highest pixel around at walls and silhouettes.

    There this view locates the surface to a pixel only; the front and back silhouettes locate it better and decide.
    """
    cell = image_cell(solid.top, solid.pixel, x, z)
    v = cell_values(solid.top, cell)
    high = wp.max(v)
    if high - wp.min(v) < JUMP_SLOPE * solid.pixel:
        return bilinear(v, cell)
    return high


@wp.func
def slab_level(solid: DepthSolid, x: float, y: float, z: float) -> float:
    """How far a point is inside the slab between back and front surface, along z [m]; negative outside.

    Away from silhouettes min(front - z, z + back), both bilinear. In a cell that the silhouette crosses the
    half thickness falls to zero as a square root, so its square g is interpolated: g > (z - m)^2 is inside.
    """
    cell = image_cell(solid.front, solid.pixel, x, y)
    front = cell_values(solid.front, cell)
    if covered(wp.min(front)):
        return wp.min(bilinear(front, cell) - z, z + bilinear(cell_values(solid.back, cell), cell))
    if not covered(wp.max(front)):
        return EMPTY
    g = bilinear(cell_values(solid.bulge, cell), cell)
    m = bilinear(cell_values(solid.middle, cell), cell)
    return wp.sign(g) * wp.sqrt(wp.abs(g)) - wp.abs(z - m)


@wp.func
def solid_level(solid: DepthSolid, q: wp.vec3f) -> float:
    """Positive inside the solid of the views, negative outside, zero on its surface [m]; q is local [m]."""
    level = slab_level(solid, q[0], q[1], q[2])
    if level <= 0.0:
        return level
    return wp.min(level, top_height(solid, q[0], q[2]) - q[1])


@wp.func
def view_plane(depth: wp.array2d(dtype=wp.float32), pixel: float, x: float, y: float, along: float) -> wp.vec4f:
    """Normal (right, up, toward) and signed distance [m] to the plane tangent to a view's surface at (x, y).

    Bilinear depth and its slope, in a cell with an empty pixel the nearest pixel's depth and no slope; normal zero
    where that pixel is empty. x, y, along: the point's coordinates in the view [m].
    """
    cell = image_cell(depth, pixel, x, y)
    v = cell_values(depth, cell)
    if covered(wp.min(v)):
        slope_x = ((1.0 - cell.t) * (v[1] - v[0]) + cell.t * (v[3] - v[2])) / pixel
        slope_y = ((1.0 - cell.s) * (v[2] - v[0]) + cell.s * (v[3] - v[1])) / pixel
        normal = wp.normalize(wp.vec3f(-slope_x, -slope_y, 1.0))
        return wp.vec4f(normal[0], normal[1], normal[2], (along - bilinear(v, cell)) * normal[2])
    nearest = depth[cell.row + int(cell.t + 0.5), cell.column + int(cell.s + 0.5)]
    if covered(nearest):
        return wp.vec4f(0.0, 0.0, 1.0, along - nearest)
    return wp.vec4f(0.0, 0.0, 0.0, 0.0)


@wp.func
def plain_contact(solid: DepthSolid, p: wp.vec3d) -> wp.vec4f:
    """The paper's own query at a world point p: unit normal and signed distance [m] of the nearest of three planes.

    Of the planes of the front, back and top view it takes the one least deep under its surface; the result jumps where
    that changes and at silhouettes. Where a view sees nothing, and at reach and beyond: normal zero, d = reach.
    """
    q = wp.vec3f(p - solid.origin)
    if not wp.isfinite(q):  # a diverged garment must not index the images
        return wp.vec4f(0.0, 0.0, 0.0, solid.reach)
    front = view_plane(solid.front, solid.pixel, q[0], q[1], q[2])
    back = view_plane(solid.back, solid.pixel, q[0], q[1], -q[2])
    top = view_plane(solid.top, solid.pixel, q[0], q[2], q[1])
    nearest = wp.max(front[3], wp.max(back[3], top[3]))
    if front[2] == 0.0 or back[2] == 0.0 or top[2] == 0.0 or nearest >= solid.reach:
        return wp.vec4f(0.0, 0.0, 0.0, solid.reach)
    if front[3] == nearest:
        return front
    if back[3] == nearest:
        return wp.vec4f(back[0], back[1], -back[2], nearest)
    return wp.vec4f(top[0], top[2], top[1], nearest)


@wp.kernel
def sample_plain(
    solid: DepthSolid,
    points: wp.array(dtype=wp.vec3d),  # [m], shape [N]
    contact_out: wp.array(dtype=wp.vec4f),  # normal and signed distance [m], shape [N]
):
    """Samples plain_contact at points."""
    point = wp.tid()
    contact_out[point] = plain_contact(solid, points[point])


@wp.kernel
def sample_level(
    solid: DepthSolid,
    points: wp.array(dtype=wp.vec3d),  # [m], shape [N]
    level_out: wp.array(dtype=wp.float32),  # positive inside [m], shape [N]
):
    """Samples solid_level at points: on which side of the surface they are."""
    point = wp.tid()
    level_out[point] = solid_level(solid, wp.vec3f(points[point] - solid.origin))


@wp.func
def shows_surface(depth: wp.array2d(dtype=wp.float32), row: int, column: int) -> bool:
    """Whether a pixel is in the image and shows a surface."""
    if row < 0 or column < 0 or row >= depth.shape[0] or column >= depth.shape[1]:
        return False
    return covered(depth[row, column])


@wp.func
def extrapolated_slab(
    front: wp.array2d(dtype=wp.float32),
    back: wp.array2d(dtype=wp.float32),
    row: int,
    column: int,
    dr: int,
    dc: int,
) -> wp.vec3f:
    """Weight (0 or 1), middle [m], squared half thickness [m2] of an empty pixel, from the next two in one direction.

    min(2 g1 - g2, 0), and -g1 where the second pixel is empty too: the silhouette lies half way then.
    """
    r = row + dr
    c = column + dc
    if not shows_surface(front, r, c):
        return wp.vec3f(0.0, 0.0, 0.0)
    half = 0.5 * (front[r, c] + back[r, c])
    middle = 0.5 * (front[r, c] - back[r, c])
    near = half * half
    r += dr
    c += dc
    if not shows_surface(front, r, c):
        return wp.vec3f(1.0, middle, -near)
    half = 0.5 * (front[r, c] + back[r, c])
    return wp.vec3f(1.0, middle, wp.min(2.0 * near - half * half, 0.0))


@wp.kernel
def extend_silhouette(
    front: wp.array2d(dtype=wp.float32),  # greatest z [m], shape [rows, columns]
    back: wp.array2d(dtype=wp.float32),  # greatest -z [m], shape [rows, columns]
    middle_out: wp.array2d(dtype=wp.float32),  # [m], shape [rows, columns]
    bulge_out: wp.array2d(dtype=wp.float32),  # [m2], shape [rows, columns]
):
    """Extrapolates middle and squared half thickness g one pixel past the silhouette, g0 = min(2 g1 - g2, 0).

    On a rounded side g falls linearly to zero, so its zero between the pixels is the silhouette itself. The
    mean is over the covered straight neighbours, or over the diagonal ones where there is none.
    """
    row, column = wp.tid()
    if covered(front[row, column]):
        half = 0.5 * (front[row, column] + back[row, column])
        middle_out[row, column] = 0.5 * (front[row, column] - back[row, column])
        bulge_out[row, column] = half * half
        return
    total = extrapolated_slab(front, back, row, column, 0, 1)
    total += extrapolated_slab(front, back, row, column, 0, -1)
    total += extrapolated_slab(front, back, row, column, 1, 0)
    total += extrapolated_slab(front, back, row, column, -1, 0)
    if total[0] == 0.0:
        total += extrapolated_slab(front, back, row, column, 1, 1)
        total += extrapolated_slab(front, back, row, column, 1, -1)
        total += extrapolated_slab(front, back, row, column, -1, 1)
        total += extrapolated_slab(front, back, row, column, -1, -1)
    if total[0] > 0.0:
        middle_out[row, column] = total[1] / total[0]
        bulge_out[row, column] = total[2] / total[0]
    else:
        middle_out[row, column] = 0.0
        bulge_out[row, column] = EMPTY

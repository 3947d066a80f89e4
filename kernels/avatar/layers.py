"""Depth peeling: the solid that all surfaces along three axes enclose, every layer of every view."""

import warp as wp

from warp_cloth.kernels.avatar.raster import pixel_box, pixel_weights, sided_cover

wp.set_module_options({"enable_backward": False, "fuse_fp": False})  # the same bits on CPU and CUDA

CLAMP = wp.constant(wp.float32(8.0))  # pixels of depth beyond which a level only means inside or outside
UNBALANCED = wp.constant(-1)  # in place of a pixel's number of intervals


@wp.struct
class LayeredView:
    """Intervals inside the avatar along one axis; columns run along the next axis, rows along the one after."""

    columns: int
    rows: int
    start: wp.array(dtype=wp.int32)  # first interval of each pixel, row by row, shape [rows columns]
    count: wp.array(dtype=wp.int32)  # intervals of each pixel; UNBALANCED where its surfaces do not pair up
    ends: wp.array(dtype=wp.vec2f)  # low and high end of each interval [m]


@wp.struct
class LayeredSolid:
    """Three peeled views over one local frame; pixel (0, 0) is centred at the local origin in every view."""

    origin: wp.vec3d  # local origin in the world [m]
    pixel: float  # pixel size [m]
    along_x: LayeredView
    along_y: LayeredView
    along_z: LayeredView


@wp.struct
class LayerImage:
    """The image of one peeled view."""

    axis: int  # that the view looks along
    pixel: float  # [m]
    columns: int
    rows: int


@wp.func
def view_coordinates(p: wp.vec3f, axis: int) -> wp.vec3f:
    """Coordinates of a point in the view along an axis: right, up, toward."""
    return wp.vec3f(p[(axis + 1) % 3], p[(axis + 2) % 3], p[axis])


@wp.kernel
def draw_layers(
    points: wp.array(dtype=wp.vec3f),  # [m], shape [V]
    triangles: wp.array2d(dtype=wp.int32),  # shape [F, 3]
    image: LayerImage,
    start: wp.array(dtype=wp.int32),  # first surface of each pixel, shape [rows columns]; not read when counting
    store: bool,  # otherwise the surfaces are only counted
    count_out: wp.array(dtype=wp.int32),  # surfaces over each pixel's centre, shape [rows columns]; start it at 0
    surface_out: wp.array(dtype=wp.vec2f),  # depth [m], +1 facing the viewer or -1; any order within a pixel
):
    """Counts or stores the surfaces that a ray through each pixel's centre crosses."""
    triangle = wp.tid()
    a = view_coordinates(points[triangles[triangle, 0]], image.axis) / image.pixel
    b = view_coordinates(points[triangles[triangle, 1]], image.axis) / image.pixel
    c = view_coordinates(points[triangles[triangle, 2]], image.axis) / image.pixel
    shallow, deep = wp.min(wp.min(a[2], b[2]), c[2]), wp.max(wp.max(a[2], b[2]), c[2])
    box = pixel_box(a, b, c, image.columns, image.rows)
    for row in range(box[2], box[3]):
        for column in range(box[0], box[1]):
            side = sided_cover(a, b, c, float(column), float(row))
            if side != 0:
                place = row * image.columns + column
                slot = wp.atomic_add(count_out, place, 1)
                if store:
                    w = pixel_weights(a, b, c, float(column), float(row))
                    depth = wp.clamp(w[0] * a[2] + w[1] * b[2] + w[2] * c[2], shallow, deep)
                    surface_out[start[place] + slot] = wp.vec2f(depth * image.pixel, float(side))


@wp.kernel
def pair_layers(
    start: wp.array(dtype=wp.int32),  # first surface of each pixel, shape [rows columns]
    surface: wp.array(dtype=wp.vec2f),  # from draw_layers; sorted here, then low and high ends of intervals [m]
    count: wp.array(dtype=wp.int32),  # surfaces of each pixel, then intervals, or UNBALANCED
):
    """Sorts a pixel's surfaces and pairs them: inside is where more have been entered than left.

    So nested and crossing parts become one solid. Surfaces that do not pair up leave the pixel UNBALANCED.
    """
    place = wp.tid()
    first = start[place]
    total = count[place]
    for i in range(1, total):
        moved = surface[first + i]
        j = int(i)
        while j > 0 and (
            surface[first + j - 1][0] < moved[0]
            or (surface[first + j - 1][0] == moved[0] and surface[first + j - 1][1] < moved[1])
        ):
            surface[first + j] = surface[first + j - 1]
            j -= 1
        surface[first + j] = moved
    entered = wp.int32(0)
    found = wp.int32(0)
    high = float(0.0)
    for i in range(total):
        here = surface[first + i]
        before = entered
        entered += int(here[1])
        if before == 0 and entered == 1:
            high = here[0]
        if before == 1 and entered == 0:
            surface[first + found] = wp.vec2f(here[0], high)
            found += 1
    count[place] = wp.where(entered == 0, found, UNBALANCED)


@wp.func
def interval_level(view: LayeredView, place: int, depth: float, most: float) -> float:
    """How deep a depth is inside the nearest interval of a pixel, negative outside, at most +-most [m]."""
    first = view.start[place]
    level = -most
    for i in range(view.count[place]):
        ends = view.ends[first + i]
        level = wp.max(level, wp.min(ends[1] - depth, depth - ends[0]))
    return wp.min(level, most)


@wp.func
def view_level(view: LayeredView, pixel: float, q: wp.vec3f) -> wp.vec2f:
    """Weighted distance from a view's surface, positive inside [m], and the weight; q in the view's coordinates [m].

    The level along the view is bilinear between four pixels; divided by its slope g = sqrt(1 + |grad|^2) it is the
    distance to the plane that they show, and 1 / g is the cosine of the angle at which they see it: the weight is g^-4.
    """
    x = wp.clamp(q[0] / pixel, 0.0, float(view.columns - 1))
    y = wp.clamp(q[1] / pixel, 0.0, float(view.rows - 1))
    i = wp.min(int(x), wp.max(view.columns - 2, 0))
    j = wp.min(int(y), wp.max(view.rows - 2, 0))
    s = x - float(i)
    t = y - float(j)
    place = j * view.columns + i
    above = place + view.columns
    if wp.min(wp.min(view.count[place], view.count[place + 1]), wp.min(view.count[above], view.count[above + 1])) < 0:
        return wp.vec2f(0.0, 0.0)
    most = CLAMP * pixel
    v00 = interval_level(view, place, q[2], most)
    v01 = interval_level(view, place + 1, q[2], most)
    v10 = interval_level(view, above, q[2], most)
    v11 = interval_level(view, above + 1, q[2], most)
    low = v00 + s * (v01 - v00)
    high = v10 + s * (v11 - v10)
    slope_x = ((1.0 - t) * (v01 - v00) + t * (v11 - v10)) / pixel
    slope_y = (high - low) / pixel
    steepness = 1.0 + slope_x * slope_x + slope_y * slope_y
    weight = 1.0 / (steepness * steepness)
    return wp.vec2f(weight * (low + t * (high - low)) / wp.sqrt(steepness), weight)


@wp.func
def layered_level(solid: LayeredSolid, q: wp.vec3f) -> float:
    """Positive inside the solid of the views, negative outside, zero on its surface [m]; q is local [m].

    Near the surface it is the distance: the mean of the views' distances, weighted by how squarely each sees it.
    """
    total = view_level(solid.along_x, solid.pixel, view_coordinates(q, 0))
    total += view_level(solid.along_y, solid.pixel, view_coordinates(q, 1))
    total += view_level(solid.along_z, solid.pixel, view_coordinates(q, 2))
    if total[1] == 0.0:
        return -CLAMP * solid.pixel
    return total[0] / total[1]

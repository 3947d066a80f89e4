"""Shading from z-buffers: smooth normals, a key light with soft shadows, ambient occlusion in folds (horizons)."""

import warp as wp

from warp_cloth.kernels.avatar.raster import View, barycentric, pixel_position, pixel_triangle

# unrolled, the occlusion loops take long to compile; nobody differentiates a picture
wp.set_module_options({"max_unroll": 1, "enable_backward": False})

OCCLUSION_REACH = wp.constant(wp.float32(0.06))  # [m], a sleeve's width: folds and hems darken, limbs do not
OCCLUSION_BIAS = wp.constant(wp.float32(0.08))  # sine of the elevation below which facets are not folds
OCCLUSION_STRENGTH = wp.constant(wp.float32(2.0))
SHADOW_LIFT = wp.constant(wp.float32(0.006))  # [m], off the surface, so that it does not shade itself


@wp.struct
class Appearance:
    """Which side of a mesh is out, and how dark the other one is."""

    outside: float  # 1 where triangles wind outward, -1 where inward
    inside: float  # fraction of the reflectance left on the inside


@wp.func
def turned_to_viewer(normal: wp.vec3f, toward: wp.vec3f) -> wp.vec3f:
    """Unit normal with at least a little of it toward the viewer, as everything seen has."""
    least = 0.05
    short = wp.max(least - wp.dot(normal, toward), 0.0)
    return wp.normalize(normal + short * toward)


@wp.func
def light_on(normal: wp.vec3f, key: wp.vec3f, fill: wp.vec3f, up: wp.vec3f, lit: float, open: float):
    """Light on a surface: a warm key where ``lit``, a cool fill and the sky where ``open``; both 0..1."""
    sky = 0.5 + 0.5 * wp.dot(normal, up)
    ambient = wp.lerp(wp.vec3f(0.24, 0.23, 0.22), wp.vec3f(0.44, 0.45, 0.48), sky)
    soft = ambient + wp.max(wp.dot(normal, fill), 0.0) * wp.vec3f(0.14, 0.15, 0.17)
    return open * soft + lit * wp.max(wp.dot(normal, key), 0.0) * wp.vec3f(0.78, 0.76, 0.72)


@wp.func
def horizon(height: float, square: float) -> float:
    """How far a neighbour ``height`` [m] over the tangent plane rises, 0..1; fades at the reach.

    ``square`` is its distance squared [m2].
    """
    if height <= 0.0:
        return 0.0
    distance = wp.max(wp.sqrt(square), 1.0e-6)
    fade = wp.max(1.0 - distance / OCCLUSION_REACH, 0.0)
    return wp.max(height / distance - OCCLUSION_BIAS, 0.0) * fade


@wp.struct
class Surface:
    """What a picture shows, all meshes one after another; V vertices, F triangles."""

    points: wp.array(dtype=wp.vec3f)  # [m], shape [V]
    normals: wp.array(dtype=wp.vec3f)  # unit, shape [V]
    colours: wp.array(dtype=wp.vec3f)  # reflectance in linear light, 0..1, shape [V]
    triangles: wp.array2d(dtype=wp.int32)  # shape [F, 3]
    owners: wp.array(dtype=wp.int32)  # whose triangle it is, an index of appearances, shape [F]
    appearances: wp.array(dtype=Appearance)


@wp.kernel
def sample_surface(
    surface: Surface,
    view: View,
    ids: wp.array2d(dtype=wp.int32),  # from draw_triangle_ids, shape [rows, columns]
    normal_out: wp.array2d(dtype=wp.vec3f),  # turned to the viewer, shape [rows, columns]
    reflectance_out: wp.array2d(dtype=wp.vec3f),  # linear, 0..1; both left as they are where nothing is drawn
):
    """Samples the surface under every pixel: normal and colour interpolated over the triangle, the inside darker."""
    row, column = wp.tid()
    triangle = ids[row, column]
    if triangle >= surface.triangles.shape[0]:
        return
    i = surface.triangles[triangle, 0]
    j = surface.triangles[triangle, 1]
    k = surface.triangles[triangle, 2]
    a, b, c = pixel_triangle(view, surface.points, surface.triangles, triangle)
    w = barycentric(a, b, c, float(column), float(row))
    normal = w[0] * surface.normals[i] + w[1] * surface.normals[j] + w[2] * surface.normals[k]
    # the flat triangle decides which side is seen; the smooth normal may waver at a silhouette
    facing = wp.sign((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]))
    appearance = surface.appearances[surface.owners[triangle]]
    normal_out[row, column] = turned_to_viewer(facing * normal, view.toward)
    colour = w[0] * surface.colours[i] + w[1] * surface.colours[j] + w[2] * surface.colours[k]
    reflectance_out[row, column] = colour * wp.where(facing * appearance.outside < 0.0, appearance.inside, 1.0)


@wp.func
def pixel_point(view: View, row: int, column: int, depth: float) -> wp.vec3f:
    """The point [m] that a pixel shows at a depth [m]: the inverse of pixel_position."""
    aside = float(column) * view.right + float(row) * view.up
    return view.origin + view.pixel * aside + depth * view.toward


@wp.func
def pattern(row: int, column: int) -> int:
    """Which of four sampling patterns a pixel has, one of four in a 2 x 2 block: supersampling averages them."""
    return 2 * (row % 2) + column % 2


@wp.kernel
def cast_shadows(
    depth: wp.array2d(dtype=wp.float32),  # from draw_depth [m], -inf where empty, shape [rows, columns]
    normal: wp.array2d(dtype=wp.vec3f),  # from sample_surface, shape [rows, columns]
    view: View,
    key: View,  # from the key light
    key_depth: wp.array2d(dtype=wp.float32),  # from draw_depth [m], shape [key.rows, key.columns]
    taps: wp.array2d(dtype=wp.vec2f),  # where it looks: columns and rows from a point, shape [patterns, taps]
    lit_out: wp.array2d(dtype=wp.float32),  # fraction of the key's light, 0..1, likewise, shape [rows, columns]
):
    """Fraction of a disc of the key's depth image round each drawn pixel's point that is not before it."""
    row, column = wp.tid()
    if depth[row, column] <= -wp.inf:
        return
    point = pixel_point(view, row, column, depth[row, column]) + SHADOW_LIFT * normal[row, column]
    place = pixel_position(key, point)
    lit = float(0.0)
    which = pattern(row, column)
    for tap in range(taps.shape[1]):
        aside = taps[which, tap]
        x = int(wp.round(place[0] + aside[0]))
        y = int(wp.round(place[1] + aside[1]))
        if x < 0 or x >= key.columns or y < 0 or y >= key.rows:
            lit += 1.0
        elif key_depth[y, x] <= place[2] + SHADOW_LIFT:
            lit += 1.0
    lit_out[row, column] = lit / float(taps.shape[1])


@wp.kernel
def light_pixels(  # ten arguments: a picture's layers, each an array
    depth: wp.array2d(dtype=wp.float32),  # from draw_depth [m], shape [rows, columns]
    normal: wp.array2d(dtype=wp.vec3f),  # from sample_surface, shape [rows, columns]
    lit: wp.array2d(dtype=wp.float32),  # from cast_shadows, shape [rows, columns]
    view: View,
    key: wp.vec3f,  # unit vector to the key light
    fill: wp.vec3f,  # unit vector to the fill light
    taps: wp.array2d(dtype=wp.vec2i),  # where it looks: rows and columns from a pixel, shape [patterns, taps]
    steps: int,  # of each direction; taps follow one another
    light_out: wp.array2d(dtype=wp.vec3f),  # linear, left as it is where nothing is drawn, shape [rows, columns]
):
    """The light on every drawn pixel, less where its surroundings rise over it.

    open = 1 - strength * mean over directions of the highest horizon.
    """
    row, column = wp.tid()
    if depth[row, column] <= -wp.inf:
        return
    n = normal[row, column]
    here = depth[row, column]
    across, along, toward = wp.dot(n, view.right), wp.dot(n, view.up), wp.dot(n, view.toward)
    risen = float(0.0)
    which = pattern(row, column)
    directions = taps.shape[1] / steps
    for direction in range(directions):
        highest = float(0.0)
        for step in range(steps):
            aside = taps[which, direction * steps + step]
            y = row + aside[0]
            x = column + aside[1]
            if y >= 0 and y < view.rows and x >= 0 and x < view.columns:
                rise = depth[y, x] - here
                if rise > -OCCLUSION_REACH:  # false for the background, too
                    right = view.pixel * float(aside[1])
                    up = view.pixel * float(aside[0])
                    height = right * across + up * along + rise * toward
                    highest = wp.max(highest, horizon(height, right * right + up * up + rise * rise))
        risen += highest
    open = wp.clamp(1.0 - OCCLUSION_STRENGTH * risen / float(directions), 0.0, 1.0)
    light_out[row, column] = light_on(n, key, fill, view.up, lit[row, column], open)


@wp.func
def srgb_byte(light: float) -> wp.uint8:
    """An sRGB value in a byte from linear light, clipped to 0..1 (IEC 61966-2-1)."""
    value = wp.clamp(light, 0.0, 1.0)
    curved = wp.where(value <= 0.0031308, 12.92 * value, 1.055 * wp.pow(value, 1.0 / 2.4) - 0.055)
    return wp.uint8(wp.round(255.0 * curved))


@wp.kernel
def resolve_pixels(
    ids: wp.array2d(dtype=wp.int32),  # from draw_triangle_ids, shape [rows, columns], of samples; rows run upwards
    empty: int,  # the id where nothing is drawn
    light: wp.array2d(dtype=wp.vec3f),  # from light_pixels, shape [rows, columns]
    reflectance: wp.array2d(dtype=wp.vec3f),  # from sample_surface, likewise
    background: wp.vec3f,  # linear light
    samples: int,  # along each side of a pixel
    image_out: wp.array3d(dtype=wp.uint8),  # sRGB, top row first, shape [height, width, 3]; start it as background
):
    """The mean light of each pixel's samples, where any shows something."""
    row, column = wp.tid()
    first = (image_out.shape[0] - 1 - row) * samples
    drawn = int(0)
    total = wp.vec3f()
    for y in range(samples):
        for x in range(samples):
            at, across = first + y, column * samples + x
            if ids[at, across] < empty:
                total += wp.cw_mul(reflectance[at, across], light[at, across])
                drawn += 1
            else:
                total += background
    if drawn == 0:
        return
    mean = total / float(samples * samples)
    for channel in range(3):
        image_out[row, column, channel] = srgb_byte(mean[channel])

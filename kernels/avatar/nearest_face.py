"""Which triangle of the avatar is closest to a point, where a search in float32 cannot tell neighbours apart."""

import warp as wp

from warp_cloth.kernels.math.closest_points import nearest_on_triangle
from warp_cloth.kernels.math.real import inner, root, scaled_sum

wp.set_module_options({"enable_backward": False, "fuse_fp": False})  # the same bits on CPU and CUDA

# Relative and absolute [m] excess over a distance of float32 within which other triangles may be closer.
SLACK = wp.constant(1.0e-5)


@wp.struct
class Surface:
    """Triangles in float64, in the order of a wp.Mesh whose points lie in the mesh's own frame."""

    mesh: wp.uint64
    origin: wp.vec3d  # of that frame [m]
    points: wp.array(dtype=wp.vec3d)  # [m], shape [V]
    corners: wp.array(dtype=wp.vec3i)  # vertices of each triangle, shape [F]


@wp.func
def weights_on(surface: Surface, face: int, p: wp.vec3d) -> wp.vec3d:
    """Barycentric coordinates of the point of a triangle that is closest to p."""
    corners = surface.corners[face]
    a = surface.points[corners[0]]
    return nearest_on_triangle(p - a, surface.points[corners[1]] - a, surface.points[corners[2]] - a)


@wp.func
def square_distance(surface: Surface, face: int, weights: wp.vec3d, p: wp.vec3d) -> wp.float64:
    """Square of p's distance from a point of a triangle [m2]."""
    corners = surface.corners[face]
    off = p - weights[0] * surface.points[corners[0]]
    off = scaled_sum(surface.points[corners[1]], -weights[1], off)
    off = scaled_sum(surface.points[corners[2]], -weights[2], off)
    return inner(off, off)


@wp.kernel
def choose_nearest_faces(
    surface: Surface,
    within: float,  # distance [m] from which on the triangle found is taken
    points: wp.array(dtype=wp.vec3d),  # [m], shape [N]
    found: wp.array(dtype=wp.int32),  # a triangle about as close to each as any, shape [N]; -1: none
    face_out: wp.array(dtype=wp.int32),  # the closest one, the first of equals, shape [N]
    weights_out: wp.array(dtype=wp.vec3d),  # barycentric coordinates there, shape [N]
):
    """Chooses in float64 between all triangles that may be the closest, so that all devices choose the same."""
    point = wp.tid()
    best = found[point]
    face_out[point] = best
    if best < 0:
        return
    p = points[point]
    weights = weights_on(surface, best, p)
    least = square_distance(surface, best, weights, p)
    distance = wp.float32(root(least))
    if distance < within:
        q = wp.vec3f(p - surface.origin)
        far = (1.0 + SLACK) * distance + SLACK
        room = wp.vec3f(far, far, far)
        query = wp.mesh_query_aabb(surface.mesh, q - room, q + room)
        face = int(0)
        while wp.mesh_query_aabb_next(query, face):
            on = weights_on(surface, face, p)
            square = square_distance(surface, face, on, p)
            if square < least or (square == least and face < best):
                best, weights, least = face, on, square
    face_out[point] = best
    weights_out[point] = weights

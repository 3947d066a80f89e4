"""Visibility of points of the avatar's surface from a view, by ray casts."""

import warp as wp

from warp_cloth.kernels.avatar.closest import FARTHEST

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

EDGE_ON = wp.constant(wp.float32(0.05))  # cosine below which a view sees a surface edge-on only


@wp.kernel
def mark_visible(
    mesh: wp.uint64,
    points: wp.array(dtype=wp.vec3f),  # just off the surface [m], shape [N]
    normals: wp.array(dtype=wp.vec3f),  # of the surface, outward, shape [N]
    toward: wp.vec3f,  # unit vector to the viewer
    seen_out: wp.array(dtype=wp.int32),  # set to 1 where nothing occludes it, shape [N]
):
    """Marks the points that a view sees, by a ray to the viewer."""
    point = wp.tid()
    if wp.dot(normals[point], toward) > EDGE_ON:
        if not wp.mesh_query_ray_anyhit(mesh, points[point], toward, FARTHEST):
            seen_out[point] = 1

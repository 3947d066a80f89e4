"""Closest point of a surface, with barycentric weights, whether inside or outside."""

import warp as wp

wp.set_module_options({"enable_backward": False})

FARTHEST = wp.constant(wp.float32(1.0e6))  # [m]; across any garment


@wp.kernel
def find_nearest(
    mesh: wp.uint64,
    points: wp.array(dtype=wp.vec3f),  # [m], shape [N]
    face_out: wp.array(dtype=wp.int32),  # shape [N]; -1 where there is none
    weight_out: wp.array(dtype=wp.vec3f),  # of the face's corners there, shape [N]
):
    """Face and barycentric weights of the nearest point of a mesh."""
    point = wp.tid()
    face_out[point] = -1
    near = wp.mesh_query_point_no_sign(mesh, points[point], FARTHEST)
    if near.result:
        face_out[point] = near.face
        weight_out[point] = wp.vec3f(near.u, near.v, 1.0 - near.u - near.v)

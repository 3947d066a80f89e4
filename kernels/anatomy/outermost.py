"""How far out a surface reaches along rays, on the CPU."""

import warp as wp

wp.set_module_options({"enable_backward": False, "fuse_fp": False})


@wp.kernel
def find_outermost(
    mesh: wp.uint64,
    start: wp.array(dtype=wp.vec3f),  # [m], shape [N]
    out: wp.array(dtype=wp.vec3f),  # unit vectors, shape [N]
    far: wp.float32,  # as far out as nothing of the surface is [m]
    distance_out: wp.array(dtype=wp.float32),  # [m], shape [N]
):
    """Distance at which each ray leaves the surface for good, met from far out; 0 where it does not meet it."""
    ray = wp.tid()
    query = wp.mesh_query_ray(mesh, start[ray] + far * out[ray], -out[ray], far)
    distance_out[ray] = wp.float32(0.0)
    if query.result:
        distance_out[ray] = far - query.t

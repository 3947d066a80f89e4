"""Exact contact: the closest point of the avatar's own triangles, inside told by the winding number."""

import warp as wp

wp.set_module_options({"enable_backward": False})

INSIDE_WINDING = wp.constant(wp.float32(0.5))  # half a turn: 1 inside, 0 outside, between them across a hole
TOUCHING = wp.constant(wp.float32(1.0e-6))  # distance [m] below which float32 no longer tells a direction


@wp.struct
class MeshCollider:
    """A wp.Mesh built with winding numbers, over points relative to ``origin``."""

    mesh: wp.uint64
    origin: wp.vec3d  # local origin in the world [m]
    depth: float  # deepest a point may lie inside and still be found [m]
    reach: float  # distance outside at and beyond which a point is simply far [m]


@wp.func
def mesh_contact(collider: MeshCollider, p: wp.vec3d) -> wp.vec4f:
    """Unit normal and signed distance [m] at a world point p: (normal, d), d > 0 outside the avatar.

    d = +-|p - c| with c the closest point of the mesh, normal = (p - c) / d; on the surface the face's own
    normal. Inside is where the winding number is above a half: holes, crossings and inner parts do no harm.
    At reach and beyond, and deeper than depth: normal zero, d = reach.
    """
    q = wp.vec3f(p - collider.origin)
    query = wp.mesh_query_point_sign_winding_number(
        collider.mesh, q, wp.max(collider.depth, collider.reach), 2.0, INSIDE_WINDING
    )
    if not query.result:
        return wp.vec4f(0.0, 0.0, 0.0, collider.reach)
    way = q - wp.mesh_eval_position(collider.mesh, query.face, query.u, query.v)
    distance = wp.length(way)
    if query.sign > 0.0 and distance >= collider.reach:
        return wp.vec4f(0.0, 0.0, 0.0, collider.reach)
    normal = wp.vec3f(0.0, 0.0, 0.0)
    if distance > TOUCHING:
        normal = query.sign * way / distance
    else:
        normal = wp.mesh_eval_face_normal(collider.mesh, query.face)
    return wp.vec4f(normal[0], normal[1], normal[2], query.sign * distance)


@wp.kernel
def sample_mesh(
    collider: MeshCollider,
    points: wp.array(dtype=wp.vec3d),  # [m], shape [N]
    contact_out: wp.array(dtype=wp.vec4f),  # normal and signed distance [m], shape [N]
):
    """What mesh_contact answers at points."""
    point = wp.tid()
    contact_out[point] = mesh_contact(collider, points[point])

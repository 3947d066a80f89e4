"""Exact contact: the closest point of the avatar's own triangles, inside told by the winding number."""

import warp as wp

wp.set_module_options({"enable_backward": False})

INSIDE_WINDING = wp.constant(wp.float32(0.5))  # half a turn: 1 inside, 0 outside, between them across a hole
FARTHEST = wp.constant(wp.float32(1.0e6))  # [m]; across any avatar
TOUCHING = wp.constant(wp.float32(1.0e-6))  # distance [m] below which float32 no longer tells a direction


@wp.struct
class MeshCollider:
    """A wp.Mesh built with winding numbers, over points relative to ``origin``."""

    mesh: wp.uint64
    origin: wp.vec3d  # local origin in the world [m]
    depth: float  # deepest a point may lie inside and still be found [m]
    reach: float  # distance outside at and beyond which a point is simply far [m]


@wp.func
def directed_contact(mesh: wp.uint64, q: wp.vec3f, face: int, u: float, v: float, sign: float) -> wp.vec4f:
    """Unit normal and signed distance [m] of q from its closest point; on the surface the face's own normal."""
    way = q - wp.mesh_eval_position(mesh, face, u, v)
    distance = wp.length(way)
    if distance > TOUCHING:
        normal = sign * way / distance
        return wp.vec4f(normal[0], normal[1], normal[2], sign * distance)
    normal = wp.mesh_eval_face_normal(mesh, face)
    return wp.vec4f(normal[0], normal[1], normal[2], sign * distance)


@wp.func
def mesh_contact(collider: MeshCollider, p: wp.vec3d) -> wp.vec4f:
    """Unit normal and signed distance [m] at a world point p: (normal, d), d > 0 outside the avatar.

    d = +-|p - c| with c the closest point of the mesh, normal = (p - c) / d. Inside is where the winding number is
    above a half: holes, crossings and inner parts do no harm. A point with nothing before it, or nothing behind it,
    whose closest face looks at it is outside: most are, and need no winding number. At reach and beyond, and deeper
    than depth: normal zero, d = reach.
    """
    far = wp.vec4f(0.0, 0.0, 0.0, collider.reach)
    q = wp.vec3f(p - collider.origin)
    if not wp.mesh_query_ray_anyhit(collider.mesh, q, wp.vec3f(0.0, 0.0, wp.sign(q[2])), FARTHEST):
        near = wp.mesh_query_point_sign_normal(collider.mesh, q, collider.reach)
        if not near.result:
            return far
        if near.sign > 0.0:
            return directed_contact(collider.mesh, q, near.face, near.u, near.v, 1.0)
    query = wp.mesh_query_point_sign_winding_number(
        collider.mesh, q, wp.max(collider.depth, collider.reach), 2.0, INSIDE_WINDING
    )
    if not query.result:
        return far
    contact = directed_contact(collider.mesh, q, query.face, query.u, query.v, query.sign)
    if contact[3] >= collider.reach:
        return far
    return contact


@wp.kernel
def sample_mesh(
    collider: MeshCollider,
    points: wp.array(dtype=wp.vec3d),  # [m], shape [N]
    contact_out: wp.array(dtype=wp.vec4f),  # normal and signed distance [m], shape [N]
):
    """What mesh_contact answers at points."""
    point = wp.tid()
    contact_out[point] = mesh_contact(collider, points[point])


@wp.kernel
def find_closest(
    mesh: wp.uint64,
    points: wp.array(dtype=wp.vec3f),  # [m], shape [N]
    closest_out: wp.array(dtype=wp.vec3f),  # closest point of the mesh [m], shape [N]
    face_out: wp.array(dtype=wp.int32),  # its triangle, shape [N]
    weights_out: wp.array(dtype=wp.vec3f),  # its barycentric coordinates there, shape [N]
):
    """Finds the surface nearest to each point."""
    point = wp.tid()
    query = wp.mesh_query_point_no_sign(mesh, points[point], FARTHEST)
    closest_out[point] = wp.mesh_eval_position(mesh, query.face, query.u, query.v)
    face_out[point] = query.face
    weights_out[point] = wp.vec3f(query.u, query.v, 1.0 - query.u - query.v)

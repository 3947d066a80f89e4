"""Exact collider: the closest point of the avatar's own triangles; the winding number decides what is inside."""

import warp as wp

wp.set_module_options({"enable_backward": False})

INSIDE_WINDING = wp.constant(wp.float32(0.5))  # half a revolution: 1 inside, 0 outside, between them across a hole
FARTHEST = wp.constant(wp.float32(1.0e6))  # [m]; across any avatar
ON_SURFACE = wp.constant(wp.float32(1.0e-6))  # distance [m] below which float32 yields no direction


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
    away = q - wp.mesh_eval_position(mesh, face, u, v)
    distance = wp.length(away)
    if distance > ON_SURFACE:
        normal = sign * away / distance
        return wp.vec4f(normal[0], normal[1], normal[2], sign * distance)
    normal = wp.mesh_eval_face_normal(mesh, face)
    return wp.vec4f(normal[0], normal[1], normal[2], sign * distance)


@wp.func
def covered(mesh: wp.uint64, q: wp.vec3f):
    """Whether the mesh covers a point along z: in front of a point in the front half, behind one in the back half."""
    return wp.mesh_query_ray_anyhit(mesh, q, wp.vec3f(0.0, 0.0, wp.sign(q[2])), FARTHEST)


@wp.func
def mesh_contact(collider: MeshCollider, p: wp.vec3d) -> wp.vec4f:
    """Unit normal and signed distance [m] at a world point p: (normal, d), d > 0 outside the avatar.

    d = +-|p - c| with c the closest point of the mesh, normal = (p - c) / d. A point is inside where the winding
    number is above a half: holes, crossings and inner parts do no harm. A point that is not ``covered`` and whose
    closest face faces it is outside: most are, and need no winding number. At reach and beyond, and deeper than
    depth: normal zero, d = reach.
    """
    far = wp.vec4f(0.0, 0.0, 0.0, collider.reach)
    q = wp.vec3f(p - collider.origin)
    if not covered(collider.mesh, q):
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
    """Samples mesh_contact at points."""
    point = wp.tid()
    contact_out[point] = mesh_contact(collider, points[point])


@wp.func
def group_of(first: wp.array(dtype=wp.int32), point: int):
    """The group of a point; ``first`` are the groups' first points, and the point count."""
    return wp.lower_bound(first, point + 1) - 1


@wp.kernel
def find_covered(
    points: wp.array(dtype=wp.vec3d),  # [m], shape [N], by groups
    first: wp.array(dtype=wp.int32),  # first point of each group, and the point count
    of: wp.array(dtype=wp.int32),  # the collider of each group; -1: none, and the depth is 0
    colliders: wp.array(dtype=MeshCollider),
    closed: wp.array(dtype=wp.uint8),  # whether each collider's mesh is closed
    depth_out: wp.array(dtype=wp.float32),  # [m], shape [N]
    count_out: wp.array(dtype=wp.int32),
    covered_out: wp.array(dtype=wp.int32),  # shape [N]
):
    """Lists the points that may lie inside; the others' depth is 0, or NaN where they are not finite.

    A point that is not ``covered`` is outside a closed mesh: mesh_contact would find the same at ten times the work.
    """
    point = wp.tid()
    p = points[point]
    lost = float(wp.length(p - p))
    depth_out[point] = lost
    if not lost == 0.0:
        return
    which = of[group_of(first, point)]
    if which < 0:
        return
    if closed[which] != wp.uint8(0) and not covered(colliders[which].mesh, wp.vec3f(p - colliders[which].origin)):
        return
    covered_out[wp.atomic_add(count_out, 0, 1)] = point


@wp.kernel
def measure_depths(
    points: wp.array(dtype=wp.vec3d),  # as in find_covered
    first: wp.array(dtype=wp.int32),
    of: wp.array(dtype=wp.int32),
    colliders: wp.array(dtype=MeshCollider),
    count: wp.array(dtype=wp.int32),  # points listed
    listed: wp.array(dtype=wp.int32),
    depth_out: wp.array(dtype=wp.float32),  # [m], shape [N]
):
    """Measures how deep the listed points lie inside; 0 outside."""
    entry = wp.tid()
    if entry >= count[0]:
        return
    point = listed[entry]
    contact = mesh_contact(colliders[of[group_of(first, point)]], points[point])
    depth_out[point] = wp.max(-contact[3], 0.0)


@wp.kernel
def find_closest(
    mesh: wp.uint64,
    points: wp.array(dtype=wp.vec3f),  # [m], shape [N]
    closest_out: wp.array(dtype=wp.vec3f),  # closest point of the mesh [m], shape [N]
    face_out: wp.array(dtype=wp.int32),  # its triangle, shape [N]; -1 where the point is not finite
    weights_out: wp.array(dtype=wp.vec3f),  # its barycentric coordinates there, shape [N]
):
    """Finds the surface nearest to each point, whether inside or outside."""
    point = wp.tid()
    query = wp.mesh_query_point_no_sign(mesh, points[point], FARTHEST)
    face_out[point] = -1
    if query.result:
        closest_out[point] = wp.mesh_eval_position(mesh, query.face, query.u, query.v)
        face_out[point] = query.face
        weights_out[point] = wp.vec3f(query.u, query.v, 1.0 - query.u - query.v)

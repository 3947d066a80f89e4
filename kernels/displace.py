"""Force, cap, displacement: one iteration's end for a vertex (the paper, section 4), then contact (section 5)."""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_cloth.kernels.cloth import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.friction import friction_slide


@wp.func
def capped(force: Any, limit: Any):
    """The force, or where it passes the limit one of that size in its direction (the paper, section 4)."""
    size = wp.length(force)
    if size > limit:
        return force * (limit / size)
    return force


@wp.func
def direct_move(force: Any, weight: Any, cap: Any):
    """Displacement [m] by the paper's rule: total force, capped slightly above gravity, added to the position.

    A force of 1.1 weights is "slightly larger than gravity" and moves the vertex by ``cap``.
    """
    limit = type(weight)(1.1) * weight
    return capped(force, limit) * (cap / limit)


@wp.func
def accelerated_move(force: Any, stiffness: Any, last: Any, momentum: Any, damping: Any, cap: Any):
    """Displacement [m]: force over the vertex's own stiffness, plus momentum, damped where it fights the force."""
    kept = wp.where(wp.dot(last, force) < type(cap)(0.0), momentum * damping, momentum)
    return capped(last * kept + force / stiffness, cap)


@functools.cache
def displace_kernels(precision: str, contact: wp.Function | None, collider_type: type | None) -> SimpleNamespace:
    """Kernels ``displace_direct`` and ``displace_accelerated``, meeting the avatar through ``contact``.

    Args:
        precision: of positions and forces.
        contact: (collider, world position) -> (normal, distance [m]); None where the scene has no avatar.
        collider_type: the struct that it asks.
    """
    types = cloth_types(precision)
    real, point, vec3, vec4 = types.real, types.point, types.vec3, types.vec4
    Cloth, Step = types.Cloth, types.Step

    if contact is None:

        @wp.struct
        class NoCollider:
            """A scene without avatar asks nothing."""

        collider_type = NoCollider

    @wp.func
    def settle(cloth: Cloth, step: Step, collider: collider_type, vertex: int, move: vec3):
        """Moves a vertex, pushes it out to the contact offset, takes friction off, remembers what is left."""
        old = cloth.position[vertex]
        if wp.static(contact is not None):
            at = contact(collider, wp.vec3d(old) + wp.vec3d(move))
            push = step.offset - at[3]
            if push > 0.0:
                normal = vec3(real(at[0]), real(at[1]), real(at[2]))
                pushed = move + normal * wp.min(real(push), step.cap)
                move = friction_slide(pushed, normal, real(push), real(step.friction))
        cloth.move[vertex] = move
        cloth.position[vertex] = old + point(move)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def displace_direct(
        step: Step,
        collider: collider_type,
        load: wp.array(dtype=vec4),  # forces of the cloth [N], shape [V]; left at zero
        cloth: Cloth,
    ):
        """Moves each free vertex by the paper's rule."""
        vertex = wp.tid()
        sum = load[vertex]
        load[vertex] = vec4()
        if cloth.pinned[vertex] == wp.uint8(0):
            weight = cloth.weight[vertex]
            force = vec3(sum[0], sum[1], sum[2]) + step.gravity * weight
            settle(cloth, step, collider, vertex, direct_move(force, weight, step.cap))

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def displace_accelerated(
        step: Step,
        collider: collider_type,
        load: wp.array(dtype=vec4),  # forces of the cloth [N] and stiffness bounds [N/m], shape [V]; left at zero
        cloth: Cloth,
    ):
        """Moves each free vertex by its own step and its momentum."""
        vertex = wp.tid()
        sum = load[vertex]
        load[vertex] = vec4()
        if cloth.pinned[vertex] == wp.uint8(0):
            weight = cloth.weight[vertex]
            force = vec3(sum[0], sum[1], sum[2]) + step.gravity * weight
            stiffness = wp.max(sum[3] + weight / step.cap, cloth.stiffness[vertex] * step.memory)
            momentum = step.momentum * wp.min(cloth.stiffness[vertex] / stiffness, real(1.0))
            cloth.stiffness[vertex] = stiffness
            move = accelerated_move(force, stiffness, cloth.move[vertex], momentum, step.damping, step.cap)
            settle(cloth, step, collider, vertex, move)

    return SimpleNamespace(
        displace_direct=displace_direct, displace_accelerated=displace_accelerated, collider_type=collider_type
    )

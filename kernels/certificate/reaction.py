"""The avatar's reaction to a vertex's force: what it leaves is the residual, its normal part the contact pressure."""

import functools

import warp as wp

from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.laws.friction import friction_residual, friction_slide
from warp_cloth.kernels.passes.step import capped


@functools.cache
def reaction_function(precision: str, avatar_contact: wp.Function, collider_type: type) -> wp.Function:
    """The function ``react``, with the contact that the iteration uses."""
    types = cloth_types(precision)
    real, vec3, Model, State, Item = types.real, types.vec3, types.Model, types.State, types.Item

    @wp.func
    def react_to_step(force: vec3, displacement: vec3, distance: wp.vec4f, item: Item):
        """Residual and normal force [N] of a vertex whose ``displacement`` enters the offset (see ``react``)."""
        depth = item.offset - distance[3]
        normal = vec3(real(distance[0]), real(distance[1]), real(distance[2]))
        raised = wp.min(real(depth), item.cap)
        scale = wp.length(force) / wp.length(displacement)
        slid = friction_slide(displacement + normal * raised, normal, real(depth), real(item.avatar_friction))
        return scale * wp.length(slid), scale * raised

    @wp.func
    def react(model: Model, state: State, vertex: int, force: vec3, collider: collider_type, slack: float):
        """Residual |F| that contact and friction's cone leave of a force, and the normal force [N].

        A vertex below the contact offset, or at most ``slack`` [m] above it, is in contact: the avatar takes
        max(-F . n, 0) and friction up to its cone. One that stands higher takes the force's own next step s, without
        momentum: s = F / stiffness, capped, then pushed out of the offset and slowed by friction as in an iteration.
        The residual is |F| |s after contact| / |s|: all of F where s does not reach the offset, nothing where the step
        ends where it began. So a taut seam that every step presses in by millimetres counts as at rest, with a residual
        a little too high where the field's gradient is above 1; what hovers and would fall counts by how far it falls.
        """
        item = model.items[model.item[vertex]]
        distance = avatar_contact(collider, wp.vec3d(state.position[vertex]))
        size = wp.length(force)
        residual, normal_force = size, real(0.0)
        if distance[3] < item.offset + slack:
            normal = vec3(real(distance[0]), real(distance[1]), real(distance[2]))
            residual = friction_residual(force, normal, real(item.avatar_friction))
            normal_force = wp.max(-wp.dot(force, normal), real(0.0))
        elif state.stiffness.shape[0] > 0 and size > real(0.0):  # only the accelerated method has stiffness bounds
            stiffness = state.stiffness[vertex]
            if stiffness > real(0.0):
                displacement = capped(force / stiffness, item.cap)
                there = avatar_contact(collider, wp.vec3d(state.position[vertex]) + wp.vec3d(displacement))
                if item.offset - there[3] > 0.0:
                    residual, normal_force = react_to_step(force, displacement, there, item)
        return residual, normal_force

    return react

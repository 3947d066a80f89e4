"""What an avatar carries of a vertex's force: the rest is the residual, its normal part the pressure (model: rest)."""

import functools

import warp as wp

from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.laws.friction import friction_residual, friction_slide
from warp_cloth.kernels.passes.step import capped


@functools.cache
def carried_function(precision: str, avatar_contact: wp.Function, collider_type: type) -> wp.Function:
    """Function ``carried_force`` in one precision, with the contact that the iteration uses."""
    types = cloth_types(precision)
    real, vec3, Model, State = types.real, types.vec3, types.Model, types.State

    @wp.func
    def carried_force(model: Model, state: State, vertex: int, force: vec3, collider: collider_type, slack: float):
        """Force left on a vertex after contact's push and friction's cone, and that push [N].

        A vertex that stands in the offset, or no further than ``slack`` [m] above it, is held. Of one that stands
        higher the force's own next step s is taken, without momentum: s = F / stiffness, capped, then pushed out of
        the offset and slowed by friction as in an iteration. What is left of s, is left of F:
        |F| |s after contact| / |s|; all of it where s does not reach the offset, nothing where the step ends where it
        began. So a taut seam holds that is pressed millimetres deep in every step, and comes out a little too high
        where the field's gradient is above 1; what hovers and would fall on the body counts by how far it falls.
        """
        item = model.items[model.item[vertex]]
        at = avatar_contact(collider, wp.vec3d(state.position[vertex]))
        size = wp.length(force)
        left, push = size, real(0.0)
        if at[3] < item.offset + slack:
            normal = vec3(real(at[0]), real(at[1]), real(at[2]))
            left = friction_residual(force, normal, real(item.avatar_friction))
            push = wp.max(-wp.dot(force, normal), real(0.0))
        elif state.stiffness.shape[0] > 0 and size > real(0.0):  # the other methods have none
            stiffness = state.stiffness[vertex]
            if stiffness > real(0.0):
                move = capped(force / stiffness, item.cap)
                there = avatar_contact(collider, wp.vec3d(state.position[vertex]) + wp.vec3d(move))
                deep = item.offset - there[3]
                if deep > 0.0:
                    normal = vec3(real(there[0]), real(there[1]), real(there[2]))
                    raised = wp.min(real(deep), item.cap)
                    scale = size / wp.length(move)
                    left = scale * wp.length(
                        friction_slide(move + normal * raised, normal, real(deep), real(item.avatar_friction))
                    )
                    push = scale * raised
        return left, push

    return carried_force

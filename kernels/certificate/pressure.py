"""How hard cloth is pressed on the avatar, from the forces that the certificate balances (model: rest)."""

import functools

import warp as wp

from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, free_function
from warp_cloth.kernels.certificate.reaction import carried_function


@functools.cache
def push_kernel(precision: str, avatar_contact: wp.Function, collider_type: type, pins: bool) -> wp.Kernel:
    """Kernel ``measure_push`` in one precision, with the contact that the iteration uses, with or without pins."""
    types = cloth_types(precision)
    vec3, vec4, Model, State, Step = types.vec3, types.vec4, types.Model, types.State, types.Step
    free = free_function(precision, pins)
    carried_force = carried_function(precision, avatar_contact, collider_type)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def measure_push(
        model: Model,
        state: State,
        step: Step,
        slack: float,  # how far above the contact offset a vertex still counts as in contact [m]
        colliders: wp.array(dtype=collider_type),
        load: wp.array(dtype=vec4),  # forces of the cloth [N], shape [V]; left at zero
        push_out: wp.array(dtype=wp.float64),  # [N], shape [V]; 0 away from the avatar and where pinned
    ):
        """Normal part of the force that a vertex in contact hands on to the avatar: max(-F . n, 0) where it is held."""
        vertex = wp.tid()
        sum = load[vertex]
        load[vertex] = vec4()
        push_out[vertex] = wp.float64(0.0)
        if free(model, vertex):
            force = vec3(sum[0], sum[1], sum[2]) + step.gravity * model.weight[vertex]
            _left, push = carried_force(model, state, vertex, force, colliders[model.item[vertex]], slack)
            push_out[vertex] = wp.float64(push)

    return measure_push

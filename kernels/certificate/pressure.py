"""Contact pressure: how hard cloth is pressed on the avatar, from the forces that the certificate balances."""

import functools

import warp as wp

from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, free_function
from warp_cloth.kernels.certificate.reaction import reaction_function


@functools.cache
def normal_force_kernel(precision: str, avatar_contact: wp.Function, collider_type: type, pins: bool) -> wp.Kernel:
    """Kernel ``measure_normal_force``, with the contact that the iteration uses, with or without pins."""
    types = cloth_types(precision)
    vec3, vec4, Model, State, Step = types.vec3, types.vec4, types.Model, types.State, types.Step
    free, react = free_function(precision, pins), reaction_function(precision, avatar_contact, collider_type)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def measure_normal_force(
        model: Model,
        state: State,
        step: Step,
        slack: float,  # how far above the contact offset a vertex still counts as in contact [m]
        colliders: wp.array(dtype=collider_type),
        load_out: wp.array(dtype=vec4),  # an input: forces of the cloth [N], shape [V]; left at zero
        normal_force_out: wp.array(dtype=wp.float64),  # [N], shape [V]; 0 away from the avatar and where pinned
    ):
        """Force with which each vertex presses on the avatar, along its normal."""
        vertex = wp.tid()
        load = load_out[vertex]
        load_out[vertex] = vec4()
        normal_force_out[vertex] = wp.float64(0.0)
        if free(model, vertex):
            force = vec3(load[0], load[1], load[2]) + step.gravity * model.weight[vertex]
            _residual, normal_force = react(model, state, vertex, force, colliders[model.item[vertex]], slack)
            normal_force_out[vertex] = wp.float64(normal_force)

    return measure_normal_force

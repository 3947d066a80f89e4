"""Residual: the force that contact and friction leave on a vertex, in weights and relative (model: rest)."""

import functools

import warp as wp

from warp_cloth.kernels.base.active_set import active_element
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, free_function
from warp_cloth.kernels.certificate.reaction import reaction_function
from warp_cloth.kernels.passes.step import colliders_type


@functools.cache
def residual_kernel(precision: str, avatar_contact: wp.Function | None, collider_type: type, pins: bool) -> wp.Kernel:
    """Kernel ``measure_residual``, with the contact that the iteration uses, with or without pins."""
    types = cloth_types(precision)
    vec3, vec4, Model, State, Step = types.vec3, types.vec4, types.Model, types.State, types.Step
    free = free_function(precision, pins)
    if avatar_contact is not None:
        react = reaction_function(precision, avatar_contact, collider_type)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def measure_residual(
        model: Model,
        state: State,
        groups: wp.array(dtype=wp.int32),  # active set of vertices; others keep their residual
        step: Step,
        slack: float,  # how far above the contact offset a vertex still counts as in contact [m]
        colliders: colliders_type(avatar_contact, collider_type),
        load_out: wp.array(dtype=vec4),  # an input: forces and sum of their magnitudes [N], shape [V]; left at zero
        residual_out: wp.array(dtype=wp.vec2f),  # in vertex weights, and relative, shape [V]; -1 where pinned
    ):
        """|R| / weight and |R| / (weight + sum of |F|), R the force that contact and friction leave on a vertex."""
        vertex = active_element(groups, wp.tid())
        if vertex >= load_out.shape[0]:
            return
        load = load_out[vertex]
        load_out[vertex] = vec4()
        item = model.items[model.item[vertex]]
        if item.active == 0:
            return
        residual_out[vertex] = wp.vec2f(-1.0, -1.0)
        if free(model, vertex):
            weight = model.weight[vertex]
            force = vec3(load[0], load[1], load[2]) + step.gravity * weight
            residual = wp.length(force)
            if wp.static(avatar_contact is not None):
                residual, _normal_force = react(model, state, vertex, force, colliders[model.item[vertex]], slack)
            residual_out[vertex] = wp.vec2f(float(residual / weight), float(residual / (weight + load[3])))

    return measure_residual

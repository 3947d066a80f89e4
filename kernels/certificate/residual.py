"""The certificate's figures per vertex and per element: residual, energies, strains (model: rest)."""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.base.subset import listed
from warp_cloth.kernels.base.types import (
    MODULE_OPTIONS,
    cloth_types,
    difference_function,
    free_function,
    hinge_sides_function,
)
from warp_cloth.kernels.certificate.reaction import reaction_function
from warp_cloth.kernels.laws.bending import hinge_normals, rotated_back
from warp_cloth.kernels.laws.energy import bending_energy, tension_energy, yarn_energy
from warp_cloth.kernels.laws.yarn import bias_vectors, warp_vector, weft_vector, yarn_law
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
        groups: wp.array(dtype=wp.int32),  # active set of vertices (kernels.base.subset); others keep their residual
        step: Step,
        slack: float,  # how far above the contact offset a vertex still counts as in contact [m]
        colliders: colliders_type(avatar_contact, collider_type),
        load_out: wp.array(dtype=vec4),  # an input: forces and sum of their magnitudes [N], shape [V]; left at zero
        residual_out: wp.array(dtype=wp.vec2f),  # in vertex weights, and relative, shape [V]; -1 where pinned
    ):
        """|R| / weight and |R| / (weight + sum of |F|), R the force that contact and friction leave on a vertex."""
        vertex = listed(groups, wp.tid())
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
                residual, _push = react(model, state, vertex, force, colliders[model.item[vertex]], slack)
            residual_out[vertex] = wp.vec2f(float(residual / weight), float(residual / (weight + load[3])))

    return measure_residual


@functools.cache
def energy_kernels(precision: str) -> SimpleNamespace:
    """Kernels ``measure_tension`` and ``measure_weave``: energies, and strains of edges and stretches of yarns."""
    types = cloth_types(precision)
    real, vec4 = types.real, types.vec4
    State, Edges, Weave = types.State, types.Edges, types.Weave
    difference = difference_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def measure_tension(
        state: State,
        edges: Edges,
        energy_out: wp.array(dtype=wp.float64),  # [J], shape [E]
        strain_out: wp.array(dtype=real),  # (r - L) / L, shape [E]
    ):
        """Energy and strain of each edge."""
        edge = wp.tid()
        law = edges.law[edge]
        length = wp.length(difference(state.position[edges.ends[edge][1]], state.position[edges.ends[edge][0]]))
        energy_out[edge] = wp.float64(tension_energy(length - law[0], law[1], law[2]))
        strain_out[edge] = (length - law[0]) / law[0]

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def measure_weave(
        state: State,
        weave: Weave,
        energy_out: wp.array(dtype=wp.float64),  # [J], shape [T]
        stretch_out: wp.array(dtype=vec4),  # of weft, warp and both biases: r / L, shape [T]
    ):
        """Energy and stretches of each woven triangle."""
        triangle = wp.tid()
        corners = weave.corners[triangle]
        weft_pull, warp_pull, shear_pull, compression = yarn_law(weave.law[triangle])
        slope = weave.slope[triangle]
        side_1 = difference(state.position[corners[1]], state.position[corners[0]])
        side_2 = difference(state.position[corners[2]], state.position[corners[0]])
        weft, warp = weft_vector(slope, side_1, side_2), warp_vector(slope, side_1, side_2)
        plus, minus = bias_vectors(weft, warp)
        weft_push, warp_push, shear_push = weft_pull * compression, warp_pull * compression, shear_pull * compression
        energy = yarn_energy(weft, weft_pull, weft_push) + yarn_energy(warp, warp_pull, warp_push)
        energy += yarn_energy(plus, shear_pull, shear_push) + yarn_energy(minus, shear_pull, shear_push)
        energy_out[triangle] = wp.float64(energy)
        stretch_out[triangle] = vec4(wp.length(weft), wp.length(warp), wp.length(plus), wp.length(minus))

    return SimpleNamespace(measure_tension=measure_tension, measure_weave=measure_weave)


@functools.cache
def bending_energy_kernel(precision: str, angles: bool) -> wp.Kernel:
    """Kernel ``measure_bending``, of hinges with rest angles or flat ones."""
    types = cloth_types(precision)
    real, State, Hinges = types.real, types.State, types.Hinges
    hinge_sides = hinge_sides_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def measure_bending(
        state: State,
        hinges: Hinges,
        energy_out: wp.array(dtype=wp.float64),  # [J], shape [H]
    ):
        """Energy of each hinge; none where a triangle has no area."""
        hinge = wp.tid()
        corners = hinges.corners[hinge]
        axis, wing_0, wing_1 = hinge_sides(state.position, corners)
        normal_0, normal_1, area_0, area_1 = hinge_normals(axis, wing_0, wing_1)
        if wp.static(angles):
            normal_1 = rotated_back(normal_1, axis, hinges.rest[hinge])
        energy = real(0.0)
        if area_0 > real(0.0) and area_1 > real(0.0):
            energy = bending_energy(normal_0, normal_1, hinges.stiffness[hinge])
        energy_out[hinge] = wp.float64(energy)

    return measure_bending

"""Both ends of an implicit step: right-hand side and constraints, and the capped displacement (sections 4 and 5)."""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, free_function, rests
from warp_cloth.kernels.implicit.adaptive_inertia import adapt_inertia, grow_free_fall_kernel
from warp_cloth.kernels.implicit.avatar_constraint import close, presses, stick_or_slip
from warp_cloth.kernels.implicit.momentum import adapt_momentum_kernel, measure_momentum_work_kernel
from warp_cloth.kernels.implicit.system import FIXED, FREE, SLIDING, filtered, system_types
from warp_cloth.kernels.laws.friction import friction_slide
from warp_cloth.kernels.math.symmetric import (
    inverse,
    multiple_of_unit,
    outer,
    symmetric_times,
    upper_triangle,
)
from warp_cloth.kernels.passes.step import capped, colliders_type


@functools.cache
def own_block_function(precision: str) -> wp.Function:
    """The function ``own_block``: the stiffness around a vertex."""
    vec6, LinearSystem = cloth_types(precision).vec6, system_types(precision).LinearSystem

    @wp.func
    def own_block(system: LinearSystem, vertex: int):
        """Sum of the couplings of a vertex [N/m]; by fours, whose loads are issued together."""
        block = vec6()
        start, last = system.row_start[vertex], system.row_start[vertex + 1]
        for row in range(start, last - 3, 4):
            for i in range(4):
                block += upper_triangle(system.coupling[row + i])
        for row in range(start + (last - start) // 4 * 4, last):
            block += upper_triangle(system.coupling[row])
        return block

    return own_block


@wp.func
def anchor_of(diagonal: Any, constraint: int, normal: Any, block: Any):
    """Stiffness of a vertex against the world [N/m]: inertia and drag, and its own where it may not move."""
    anchor = multiple_of_unit(diagonal)
    if constraint == SLIDING:
        anchor += outer(wp.dot(normal, symmetric_times(block, normal)), normal)
    if constraint == FIXED:
        anchor += block
    return anchor


@functools.cache
def prepare_step_kernel(
    precision: str, avatar_contact: wp.Function | None, collider_type: type, pins: bool
) -> wp.Kernel:
    """Kernel ``prepare_step``, with the contact of ``kernels.passes.move.displacement``."""
    types, own = cloth_types(precision), system_types(precision)
    real, vec3, vec4, Model, State, Step = types.real, types.vec3, types.vec4, types.Model, types.State, types.Step
    LinearSystem, SolutionState, ImplicitState = own.LinearSystem, own.SolutionState, own.ImplicitState
    free = free_function(precision, pins)
    own_block = own_block_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def prepare_step(
        model: Model,
        state: State,
        step: Step,
        colliders: colliders_type(avatar_contact, collider_type),
        implicit: ImplicitState,
        solution: SolutionState,
        load_out: wp.array(dtype=vec4),  # an input: forces of the cloth [N], shape [V]; left at zero
        system_out: LinearSystem,  # whose couplings are an input
    ):
        """Right-hand side, constraints and inverse blocks, and the displacement that the solution starts from."""
        vertex = wp.tid()
        load = load_out[vertex]
        load_out[vertex] = vec4()
        weight = model.weight[vertex]
        last = state.displacement[vertex]
        block = own_block(system_out, vertex)
        constraint = int(FREE)
        force = vec3(load[0], load[1], load[2]) + step.gravity * weight
        normal = vec3()
        drag = real(0.0)
        if wp.static(avatar_contact is not None):
            item = model.items[model.item[vertex]]
            answer = avatar_contact(colliders[model.item[vertex]], wp.vec3d(state.position[vertex]))
            gap = real(answer[3] - item.offset)
            system_out.gap[vertex] = gap
            if close(gap, implicit.in_contact[vertex]):
                normal = vec3(real(answer[0]), real(answer[1]), real(answer[2]))
                if presses(force, normal, gap, block):
                    constraint, force, drag = stick_or_slip(force, normal, real(item.avatar_friction), last)
        if not free(model, vertex) or rests(model, vertex):
            constraint = int(FIXED)
            force = vec3()
        inertia = adapt_inertia(implicit, system_out.inertia[vertex], last, force, block)
        inertia = wp.max(inertia, weight / implicit.free_fall[system_out.garment[vertex]])
        anchor = anchor_of(inertia + drag, constraint, normal, block)
        start = filtered(last, normal, constraint) * step.momentum
        if implicit.step_fraction > real(0.0):
            extrapolation = filtered(implicit.extrapolation[vertex], normal, constraint)
            implicit.extrapolation[vertex] = extrapolation
            force -= extrapolation * drag
            start = vec3()
        system_out.constraint[vertex] = constraint
        system_out.drag[vertex] = drag
        system_out.normal[vertex] = normal
        system_out.inertia[vertex] = inertia
        system_out.anchor[vertex] = anchor
        system_out.inverse[vertex] = inverse(block + anchor)
        system_out.force[vertex] = force
        solution.residual[vertex] = force
        solution.displacement[vertex] = start

    return prepare_step


@functools.cache
def take_step_kernel(precision: str, avatar_contact: wp.Function | None, collider_type: type, pins: bool) -> wp.Kernel:
    """Kernel ``take_step``, with the contact of ``kernels.passes.move.displacement``."""
    types, own = cloth_types(precision), system_types(precision)
    real, point, vec3, Model, State = types.real, types.point, types.vec3, types.Model, types.State
    LinearSystem, SolutionState, ImplicitState = own.LinearSystem, own.SolutionState, own.ImplicitState
    free = free_function(precision, pins)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def take_step(
        model: Model,
        system: LinearSystem,
        solution: SolutionState,
        colliders: colliders_type(avatar_contact, collider_type),
        implicit: ImplicitState,
        state: State,
    ):
        """Moves each free vertex by its displacement, capped; a constrained one stays on the avatar's surface.

        Under Nesterov momentum it goes a fraction of it, and on to where the momentum then leads. Where the avatar
        stops a vertex that did not touch it, friction shortens the displacement's tangential part.
        """
        vertex = wp.tid()
        if free(model, vertex):
            displacement = solution.displacement[vertex]
            solved = vec3()
            if implicit.step_fraction > real(0.0):
                solved = displacement * implicit.step_fraction
                beta = implicit.momentum[system.garment[vertex]]
                displacement = solved + (solved + implicit.extrapolation[vertex]) * beta
            normal = system.normal[vertex]
            touched = wp.dot(normal, normal) > real(0.5)
            if touched:
                beyond = wp.dot(displacement, normal) + system.gap[vertex]
                if system.constraint[vertex] != FREE or beyond < real(0.0):
                    displacement = displacement - normal * beyond
            item = model.items[model.item[vertex]]
            displacement = capped(displacement, item.cap)
            if wp.static(avatar_contact is not None):
                there = wp.vec3d(state.position[vertex]) + wp.vec3d(displacement)
                answer = avatar_contact(colliders[model.item[vertex]], there)
                depth = item.offset - answer[3]
                implicit.in_contact[vertex] = wp.uint8(depth > 0.0 or system.constraint[vertex] != FREE)
                if depth > 0.0:
                    out = vec3(real(answer[0]), real(answer[1]), real(answer[2]))
                    displacement = displacement + out * wp.min(real(depth), item.cap)
                    if not touched:
                        displacement = friction_slide(displacement, out, real(depth), real(item.avatar_friction))
            implicit.extrapolation[vertex] = displacement - solved
            state.displacement[vertex] = displacement
            state.position[vertex] = state.position[vertex] + point(displacement)

    return take_step


@functools.cache
def implicit_kernels(
    precision: str, avatar_contact: wp.Function | None, collider_type: type, pins: bool
) -> SimpleNamespace:
    """The kernels of a step's two ends; those of the momentum come between them."""
    return SimpleNamespace(
        prepare_step=prepare_step_kernel(precision, avatar_contact, collider_type, pins),
        measure_momentum_work=measure_momentum_work_kernel(precision),
        adapt_momentum=adapt_momentum_kernel(precision),
        take_step=take_step_kernel(precision, avatar_contact, collider_type, pins),
        grow_free_fall=grow_free_fall_kernel(precision),
    )

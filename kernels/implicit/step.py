"""Both ends of an implicit step: right-hand side and constraints, and the capped displacement (sections 4 and 5)."""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_cloth.kernels.base.access import permuted
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, free_function, rests
from warp_cloth.kernels.contact.arrays import LENGTH_UNIT, NO_LIMIT, ContactData, load_vertex_contact
from warp_cloth.kernels.contact.search_trigger import load_bounds, note_displacement
from warp_cloth.kernels.implicit.adaptive_inertia import adapt_inertia, grow_free_fall_kernel
from warp_cloth.kernels.implicit.avatar_constraint import close, presses, stick_or_slip
from warp_cloth.kernels.implicit.contact_pairs import (
    FRACTION_UNIT,
    LEAST_FRACTION,
    WHOLE,
    pressing_argument,
    pressing_functions,
    pressing_type,
)
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
def avatar_constraint_function(precision: str, avatar_contact: wp.Function | None, collider_type: type) -> wp.Function:
    """Function ``avatar_constraint``."""
    types = cloth_types(precision)
    real, vec3, vec6, Model, State = types.real, types.vec3, types.vec6, types.Model, types.State

    @wp.func
    def avatar_constraint(
        model: Model,
        state: State,
        colliders: colliders_type(avatar_contact, collider_type),
        in_contact: wp.array(dtype=wp.uint8),
        gap_out: wp.array(dtype=real),
        vertex: int,
        force: vec3,
        block: vec6,
    ):
        """Constraint of a vertex by the avatar, the force that this leaves [N], its normal and its drag [N/m]."""
        constraint, normal, drag = int(FREE), vec3(), real(0.0)
        if wp.static(avatar_contact is not None):
            item = model.items[model.item[vertex]]
            answer = avatar_contact(colliders[model.item[vertex]], wp.vec3d(state.position[vertex]))
            gap = real(answer[3] - item.offset)
            gap_out[vertex] = gap
            if close(gap, in_contact[vertex]):
                normal = vec3(real(answer[0]), real(answer[1]), real(answer[2]))
                if presses(force, normal, gap, block):
                    last = state.displacement[vertex]
                    constraint, force, drag = stick_or_slip(force, normal, real(item.avatar_friction), last)
        return constraint, force, normal, drag

    return avatar_constraint


@functools.cache
def prepare_step_kernel(
    precision: str, avatar_contact: wp.Function | None, collider_type: type, cloth_contact: bool, pins: bool
) -> wp.Kernel:
    """Kernel ``prepare_step``, with the contact of ``kernels.passes.move.displacement``."""
    types, own = cloth_types(precision), system_types(precision)
    real, vec3, vec4, vec6 = types.real, types.vec3, types.vec4, types.vec6
    Model, State, Step = types.Model, types.State, types.Step
    LinearSystem, SolutionState, ImplicitState = own.LinearSystem, own.SolutionState, own.ImplicitState
    PressingState, take_block = pressing_argument(precision, cloth_contact), pressing_functions(precision).take_block
    free = free_function(precision, pins)
    own_block = own_block_function(precision)
    avatar_constraint = avatar_constraint_function(precision, avatar_contact, collider_type)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def prepare_step(  # nine arguments: what a fit has (model, state, step, colliders), and what the system does
        model: Model,
        state: State,
        step: Step,
        colliders: colliders_type(avatar_contact, collider_type),
        implicit: ImplicitState,
        pressing: PressingState,
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
        pressed = vec6()
        if wp.static(cloth_contact):
            if vertex == 0:
                pressing.fraction[0] = WHOLE
            pressed = take_block(pressing, vertex)
            block += pressed
        own_force = vec3(load[0], load[1], load[2]) + step.gravity * weight
        constraint, force, normal, drag = avatar_constraint(
            model, state, colliders, implicit.in_contact, system_out.gap, vertex, own_force, block
        )
        if not free(model, vertex) or rests(model, vertex):
            constraint = int(FIXED)
            force = vec3()
        inertia = adapt_inertia(implicit, system_out.inertia[vertex], last, force, block)
        inertia = wp.max(inertia, weight / implicit.free_fall[system_out.garment[vertex]])
        anchor = anchor_of(inertia + drag, constraint, normal, block)
        own_inverse = inverse(block + anchor)
        if wp.static(cloth_contact):  # coarse levels know of pairs what resists where they lie
            anchor += pressed
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
        system_out.inverse[vertex] = own_inverse
        system_out.force[vertex] = force
        solution.residual[vertex] = force
        solution.displacement[vertex] = start

    return prepare_step


@functools.cache
def take_step_kernel(
    precision: str, avatar_contact: wp.Function | None, collider_type: type, cloth_contact: bool, pins: bool
) -> wp.Kernel:
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
        stops a vertex that did not touch it, friction shortens the displacement's tangential part. Where cloth meets
        cloth only the displacement is stored: ``move_together`` goes it.
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
            if wp.static(not cloth_contact):
                state.position[vertex] = state.position[vertex] + point(displacement)

    return take_step


@functools.cache
def move_together_kernel(precision: str, pins: bool) -> wp.Kernel:
    """Kernel ``move_together``, after ``limit_by_pairs``."""
    types = cloth_types(precision)
    real, point, Model, State = types.real, types.point, types.Model, types.State
    ImplicitState, PressingState = system_types(precision).ImplicitState, pressing_type(precision)
    free = free_function(precision, pins)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def move_together(
        model: Model,
        contact: ContactData,
        order: wp.array(dtype=wp.int32),  # as in contact_pairs.linearise_pairs
        pressing: PressingState,
        implicit: ImplicitState,
        state: State,
    ):
        """Moves every vertex by the same fraction of its displacement: one that stopped alone would tear the cloth.

        Where some pair would let all go by less than LEAST_FRACTION each goes as far as its own step limit lets it.
        """
        place = wp.tid()
        vertex = permuted(order, place)
        iteration, path = load_bounds(contact, place)
        known = load_vertex_contact(contact, place, wp.vec3d(state.position[vertex]))
        limit = contact.sums.step_limit[place]
        contact.sums.step_limit[place] = NO_LIMIT
        length = real(0.0)
        if free(model, vertex):
            fraction = real(float(wp.max(pressing.fraction[0], LEAST_FRACTION)) * float(FRACTION_UNIT))
            if pressing.fraction[0] < LEAST_FRACTION:
                longest = real(wp.min(known.step_limit, float(limit) * float(LENGTH_UNIT)))
                fraction = wp.min(fraction, longest / wp.max(wp.length(state.displacement[vertex]), real(1.0e-12)))
            displacement = state.displacement[vertex] * fraction
            length = wp.length(displacement)
            implicit.extrapolation[vertex] = implicit.extrapolation[vertex] * fraction
            state.displacement[vertex] = displacement
            state.position[vertex] = state.position[vertex] + point(displacement)
        note_displacement(contact, place, known, float(length), iteration, path)

    return move_together


@functools.cache
def implicit_kernels(
    precision: str, avatar_contact: wp.Function | None, collider_type: type, cloth_contact: bool, pins: bool
) -> SimpleNamespace:
    """The kernels of a step's two ends; those of the momentum come between them."""
    return SimpleNamespace(
        prepare_step=prepare_step_kernel(precision, avatar_contact, collider_type, cloth_contact, pins),
        measure_momentum_work=measure_momentum_work_kernel(precision),
        adapt_momentum=adapt_momentum_kernel(precision),
        take_step=take_step_kernel(precision, avatar_contact, collider_type, cloth_contact, pins),
        grow_free_fall=grow_free_fall_kernel(precision),
        **({"move_together": move_together_kernel(precision, pins)} if cloth_contact else {}),
    )

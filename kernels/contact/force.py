"""Contact force: squeeze, friction (stick and slip) and step limits of the pairs, summed for the next move."""

import functools
from typing import Any

import warp as wp

from warp_cloth.kernels.base.access import element, position_of, put
from warp_cloth.kernels.base.block import BLOCK_THREADS, own_memory
from warp_cloth.kernels.base.options import Accumulate
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.contact.arrays import (
    LENGTH_UNIT,
    NEIGHBOURS,
    STEP_FRACTION,
    ContactData,
    ContactFabric,
    due_path,
    pair_fabric,
    separation_function,
)
from warp_cloth.kernels.contact.displacement_bounds import advance_bounds, block_pair_path
from warp_cloth.kernels.contact.narrow_phase_queue import (
    ROUNDS,
    first_queued,
    load_due,
    queue_capacity,
    queue_due,
    queue_stride,
    queued_pair,
)
from warp_cloth.kernels.contact.sums import add_functions, lower_step_limit
from warp_cloth.kernels.laws.friction import friction_slide
from warp_cloth.kernels.laws.squeeze import squeeze_energy, squeeze_force, squeeze_stiffness
from warp_cloth.kernels.math.closest_points import parallel_functions
from warp_cloth.kernels.math.real import inner, quotient, root, scaled_sum
from warp_cloth.kernels.patches.packing import order_functions

LEAST_DISTANCE = wp.constant(0.02)  # of the thickness; nearer than this, force and stiffness grow no more
MOST_NEARNESS = wp.constant(1.0 / LEAST_DISTANCE)  # of 1/x there

# Fibres bend over by this fraction of the thickness (stick) before one layer slides on the other (slip).
STICK_FRACTION = wp.constant(0.2)


@wp.func
def limit_pair_step(
    contact: ContactData,
    pair: int,
    kind: int,
    corners: wp.vec4i,
    distance: wp.float64,
    thickness: wp.float64,
    path: wp.int64,
):
    """Lowers the step limits of a pair's vertices, or where it is far apart stores when it is due again."""
    if distance > thickness + contact.model.active_margin:
        contact.pairs.due[pair] = due_path(contact, kind, distance, thickness, path)
    else:
        limit = wp.int32(STEP_FRACTION * distance / LENGTH_UNIT)
        for corner in range(4):
            lower_step_limit(contact.sums.step_limit, corners[corner], limit)


@functools.cache
def couple_function(precision: str, accumulate: Accumulate) -> wp.Function:
    """Function ``add_parallel_couples``; ``accumulate`` as in ``force_kernel``."""
    types = cloth_types(precision)
    real, vec3 = types.real, types.vec3
    sine_gradient, add_couples = parallel_functions(real).sine_gradient, add_functions(real).add_couples

    @wp.func
    def add_parallel_couples(contact: ContactData, corners: wp.vec4i, along_0: vec3, along_1: vec3, slope: real):
        """Adds couples that rotate nearly parallel edges apart: -dE/dx by ``slope`` = dE/dq, q the squared sine [J]."""
        couple_0 = sine_gradient(along_0, along_1) * slope
        couple_1 = sine_gradient(along_1, along_0) * slope
        component = real(0.0)
        if wp.static(accumulate is Accumulate.STIFFNESS):
            shorter = wp.min(inner(along_0, along_0), inner(along_1, along_1))
            component = quotient(real(4.0) * slope, wp.max(shorter, real(1.0e-12)))
        if wp.static(accumulate is Accumulate.MAGNITUDE):
            component = root(wp.max(inner(couple_0, couple_0), inner(couple_1, couple_1)))
        add_couples(contact.sums.load, corners, couple_0, couple_1, component)

    return add_parallel_couples


@wp.func
def slipped(stick: Any, change: Any, normal: Any, thickness: Any, friction: Any):
    """Stick displacement after a relative displacement ``change`` [m]: tangential, and cut where layers slip.

    They slip beyond friction times STICK_FRACTION of the thickness.
    """
    bent = stick + change
    bent = bent - normal * inner(normal, bent)
    return bent - friction_slide(bent, normal, type(thickness)(STICK_FRACTION) * thickness, friction)


@wp.func
def nearness(square: wp.float64, distance: Any, thickness_32: float):
    """1/d and 1/h [1/m], x = d/h, y = 1 - x and 1/x of a distance d < h [m], h the thickness.

    y is computed from d^2 in float64, so that it keeps all digits near x = 1. Few divisions, each of which takes as
    long as all else.
    """
    one, least = type(distance)(1.0), type(distance)(LEAST_DISTANCE)
    thickness = type(distance)(thickness_32)
    by_distance, by_thickness = quotient(one, distance), quotient(one, thickness)
    x, inverse = wp.max(distance * by_thickness, least), wp.min(thickness * by_distance, type(distance)(MOST_NEARNESS))
    thick = wp.float64(thickness_32)
    y = quotient(type(distance)(thick * thick - square), thickness * (thickness + distance))
    return by_distance, by_thickness, x, wp.clamp(y, type(distance)(0.0), one - least), inverse


@wp.func
def stiffness_ahead(step: Any, approach: Any, by_thickness: Any, x: Any, modulus: Any):
    """Stiffness bound [N/m]: at the distance left after ``allowance`` times the last approach, but at least x/2."""
    closing = wp.max(step.allowance * approach * by_thickness, type(x)(0.0))
    nearer = wp.max(x - closing, type(x)(0.5) * x)
    return squeeze_stiffness(quotient(type(x)(1.0), nearer), modulus)


@functools.cache
def pair_law_function(precision: str, accumulate: Accumulate) -> wp.Function:
    """Function ``pair_law``; ``accumulate`` as in ``force_kernel``."""
    types = cloth_types(precision)
    real, vec3, Step = types.real, types.vec3, types.Step
    by_stick = wp.constant(real(1.0 / STICK_FRACTION))

    @wp.func
    def pair_law(
        step: Step,
        fabric: ContactFabric,
        square: wp.float64,
        distance: real,
        separation: vec3,
        weight: real,
        change: vec3,
        stick: vec3,
    ):
        """Force on a pair's first [N], its fourth component, its stick displacement [m] and squeeze energy [J] then.

        Args:
            step: of the iteration.
            fabric: where the two meet.
            square: of the distance, in float64 [m2].
            distance: between them, more than zero and less than the thickness [m].
            separation: from the second to the first [m].
            weight: of the normal force, 1 but for nearly parallel edges.
            change: how far the first moved in the last iteration relative to the second [m].
            stick: stick displacement before [m].
        """
        thickness, modulus = real(fabric.thickness), real(fabric.squeeze_modulus)
        by_distance, by_thickness, x, y, inverse = nearness(square, distance, fabric.thickness)
        normal = separation * by_distance
        normal_force = weight * squeeze_force(y, inverse, thickness, modulus)
        sticks = slipped(stick, change, normal, thickness, real(fabric.friction))
        grip = normal_force * by_thickness * by_stick
        force = normal * normal_force - sticks * grip
        component = real(0.0)
        if wp.static(accumulate is Accumulate.STIFFNESS):
            approach = -inner(normal, change)
            stiffness = weight * stiffness_ahead(step, approach, by_thickness, x, modulus)
            force += normal * (real(step.viscosity) * stiffness * approach)
            component = real(2.0) * (stiffness + grip)  # the weights' absolute values sum to two
        if wp.static(accumulate is Accumulate.MAGNITUDE):
            component = normal_force + grip * root(inner(sticks, sticks))
        return force, component, sticks, squeeze_energy(y, inverse, thickness, modulus)

    return pair_law


@functools.cache
def pair_force_function(precision: str, accumulate: Accumulate, sort: int, in_order: bool) -> wp.Function:
    """Function ``add_pair_force`` for pairs of a sort (ON_TRIANGLE, ON_EDGE); others as in ``force_kernel``."""
    types, iterates = cloth_types(precision), accumulate is not Accumulate.MAGNITUDE
    State, Step, real, vec2, vec3 = types.State, types.Step, types.real, types.vec2, types.vec3
    pair_separation, pair_law = separation_function(precision, sort), pair_law_function(precision, accumulate)
    add_parallel_couples = couple_function(precision, accumulate)
    displacement_at = order_functions(precision, packed=False, in_order=in_order).displacement_at
    edge_weight, add_pair = parallel_functions(real).weight, add_functions(real).add_pair
    one, nothing = wp.constant(real(1.0)), wp.constant(real(0.0))

    @wp.func
    def add_pair_force(step: Step, state: State, contact: ContactData, pair: int, place: int):
        """Adds a pair's forces to its four vertices, and lowers their step limits; ``place`` of ``advance_bounds``.

        All of a pair's loads come first: a GPU waits for memory far longer than it computes.
        """
        corners = element(contact.pairs.corners, pair)
        kind = element(contact.pairs.kind, pair)
        stick_4 = element(contact.pairs.stick, pair)
        stick = vec3(real(stick_4[0]), real(stick_4[1]), real(stick_4[2]))
        path = wp.int64(0)
        if wp.static(iterates):
            path = block_pair_path(place, contact.bounds.path, element(contact.pairs.regions, pair))
        x_0, x_1 = position_of(state, corners[0]), position_of(state, corners[1])
        x_2, x_3 = position_of(state, corners[2]), position_of(state, corners[3])
        fabric = pair_fabric(contact, corners)
        move_0, move_1, move_2, move_3 = vec3(), vec3(), vec3(), vec3()
        if wp.static(iterates):
            move_0, move_1 = displacement_at(state, corners[0]), displacement_at(state, corners[1])
            move_2, move_3 = displacement_at(state, corners[2]), displacement_at(state, corners[3])
        weights, separation, square, distance = pair_separation(x_0, x_1, x_2, x_3)
        if wp.static(iterates):
            limit_pair_step(
                contact, pair, wp.static(sort), corners, wp.float64(distance), wp.float64(fabric.thickness), path
            )
        if kind >= NEIGHBOURS or distance >= real(fabric.thickness) or distance <= nothing:
            if wp.static(iterates):
                contact.pairs.stick[pair] = wp.vec4f()
            return
        along_0, along_1 = vec3(), vec3()
        weight = vec2(one, nothing)
        if wp.static(sort == 1):
            along_0, along_1 = vec3(x_1 - x_0), vec3(x_3 - x_2)
            weight = edge_weight(along_0, along_1)
        change = scaled_sum(move_1, weights[1], move_0 * weights[0])
        change = scaled_sum(move_3, weights[3], scaled_sum(move_2, weights[2], change))
        force, component, sticks, energy = pair_law(
            step, fabric, square, distance, separation, weight[0], change, stick
        )
        if wp.static(iterates):
            put(contact.pairs.stick, pair, wp.vec4f(float(sticks[0]), float(sticks[1]), float(sticks[2]), 0.0))
        add_pair(contact.sums.load, corners, weights, force, component)
        if wp.static(sort == 1):
            if weight[1] > nothing:  # nearly parallel edges are also rotated
                add_parallel_couples(contact, corners, along_0, along_1, weight[1] * energy)

    return add_pair_force


@functools.cache
def queued_forces_function(precision: str, accumulate: Accumulate, sort: int, in_order: bool) -> wp.Function:
    """Function ``add_queued_forces``; arguments as in ``pair_force_function``."""
    types = cloth_types(precision)
    State, Step = types.State, types.Step
    add_pair_force = pair_force_function(precision, accumulate, sort, in_order)
    all = int(accumulate is Accumulate.MAGNITUDE)

    @wp.func
    def add_queued_forces(step: Step, state: State, contact: ContactData, place: int, begin: int, total: int):
        """Adds the forces of those queued pairs of a sort that a thread takes."""
        number = first_queued(wp.static(sort))
        while number < total:
            pair = queued_pair(
                place,
                contact.pairs.due,
                contact.pairs.regions,
                contact.bounds.path,
                begin,
                wp.static(sort),
                number,
                wp.static(all),
            )
            if pair >= 0:
                add_pair_force(step, state, contact, pair, place)
            number += queue_stride(wp.static(sort))

    return add_queued_forces


@functools.cache
def block_forces_function(precision: str, accumulate: Accumulate, in_order: bool) -> wp.Function:
    """Function ``add_block_forces``; arguments as in ``force_kernel``."""
    types = cloth_types(precision)
    State, Step = types.State, types.Step
    add_triangle_forces = queued_forces_function(precision, accumulate, 0, in_order)
    add_edge_forces = queued_forces_function(precision, accumulate, 1, in_order)
    all = int(accumulate is Accumulate.MAGNITUDE)

    @wp.func
    def add_block_forces(step: Step, state: State, contact: ContactData, blocks: int):
        """Adds the forces of those due pairs that one of ``blocks`` blocks takes; the first also advances the bounds.

        A block queues them first: they are few and scattered, so that otherwise most threads would wait for others.
        """
        first = int(0)
        capacity = contact.pairs.corners.shape[0]
        dues = load_due(contact.pairs.due, first, capacity, blocks)  # issued together with the loads that follow
        regions = load_due(contact.pairs.regions, first, capacity, blocks)
        count = contact.pairs.count[0]
        place = own_memory()
        if wp.static(accumulate is not Accumulate.MAGNITUDE):
            advance_bounds(
                place,
                contact.bounds.path,
                contact.bounds.step,
                contact.bounds.iteration,
                contact.bounds.region_count,
            )
        if count > capacity:  # nothing moves: which pairs are listed is chance
            count = 0
        restart = int(1)
        while first < count:
            total = queue_due(place, dues, regions, first, count, wp.static(all), blocks, restart)
            begin = int(first)
            first += ROUNDS * BLOCK_THREADS * blocks
            dues = load_due(contact.pairs.due, first, count, blocks)
            regions = load_due(contact.pairs.regions, first, count, blocks)
            restart = int(0)
            if first >= count or total[0] + total[1] > queue_capacity():
                restart = int(1)
                add_triangle_forces(step, state, contact, place, begin, total[0])
                add_edge_forces(step, state, contact, place, begin, total[1])

    return add_block_forces


@functools.cache
def force_kernel(precision: str, accumulate: Accumulate, in_order: bool = False) -> wp.Kernel:
    """Kernel ``add_contact_forces``.

    Args:
        precision: of positions and forces.
        accumulate: what the fourth component sums; MAGNITUDE, the certificate's, only measures.
        in_order: as in packing.order_functions.
    """
    types = cloth_types(precision)
    State, Step = types.State, types.Step
    add_block_forces = block_forces_function(precision, accumulate, in_order)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False, launch_bounds=BLOCK_THREADS)
    def add_contact_forces(state: State, step: Step, contact: ContactData, blocks: int):
        """Adds the forces of all pairs."""
        add_block_forces(step, state, contact, blocks)

    return add_contact_forces

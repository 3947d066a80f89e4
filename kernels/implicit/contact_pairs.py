"""Contact of cloth with cloth in the linear system: every pair that presses is a spring between its four vertices.

A pair's nearest points are apart by u = sum_i w_i x_i, w its weights. Displacements change the force on it by minus
S du, with S = k n n^T + g (1 - n n^T): k the stiffness of the squeezed fabric along the normal n, g that of the fibres
that friction bends over. A_ij = w_i w_j S is positive semidefinite, and what moves both alike costs nothing.

Pairs are listed in any order, so what is summed over them is summed in integers.
"""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_cloth.kernels.base.access import permuted
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.contact.arrays import (
    FORCE_UNIT,
    NEIGHBOURS,
    ON_EDGE,
    STIFFNESS_UNIT,
    ContactData,
    load_vertex_contact,
    pair_fabric,
    pair_thickness,
    separation_function,
)
from warp_cloth.kernels.contact.force import STICK_FRACTION, nearness
from warp_cloth.kernels.contact.pairs import next_slot
from warp_cloth.kernels.laws.squeeze import squeeze_force, squeeze_stiffness
from warp_cloth.kernels.math.closest_points import parallel_functions
from warp_cloth.kernels.math.real import inner, quotient, scaled_sum
from warp_cloth.kernels.math.symmetric import multiple_of_unit, outer, symmetric_times
from warp_cloth.kernels.passes.step import NoClothContact
from warp_cloth.kernels.patches.packing import order_functions

FRACTION_UNIT = wp.constant(2.0**-24)  # of ``PressingState.fraction``
WHOLE = wp.constant(wp.int32(2**24))
LEAST_FRACTION = wp.constant(wp.int32(2**20))
# How much nearer a pair may come in a step: to NEAREST of its thickness, but by no less than NEAREST and no more than
# MOST_CLOSING of its distance. Force and stiffness grow without bound as the distance vanishes.
MOST_CLOSING, NEAREST = wp.constant(0.9), wp.constant(0.5)


@functools.cache
def pressing_type(precision: str) -> type:
    """Struct ``PressingState``."""
    types = cloth_types(precision)

    @wp.struct
    class PressingState:
        """The pairs that press, P at most, and sums over them; V vertices, numbered as in the model."""

        count: wp.array(dtype=wp.int32)  # shape [1]
        corners: wp.array(dtype=wp.vec4i)  # shape [P]
        weights: wp.array(dtype=types.vec4)  # w, shape [P]
        stiffness: wp.array(dtype=types.vec6)  # S [N/m], shape [P]
        block: wp.array2d(dtype=wp.int64)  # of each vertex, the sum of w_i^2 S [STIFFNESS_UNIT], shape [V, 6]
        distance: wp.array(dtype=types.real)  # of each listed pair [m], shape [P]
        fraction: wp.array(dtype=wp.int32)  # of all displacements that is taken [FRACTION_UNIT], shape [1]
        product: wp.array2d(dtype=wp.int64)  # of each vertex's row times displacements [FORCE_UNIT], shape [V, 3]; zero

    return PressingState


def pressing_argument(precision: str, cloth_contact: bool) -> type:
    """What kernels take for them: nothing where cloth passes through cloth."""
    return pressing_type(precision) if cloth_contact else NoClothContact


@wp.func
def lower_fraction(fraction_out: wp.array(dtype=wp.int32), limit: Any, length: Any):
    """Lowers the fraction to what shortens a length [m] to a limit."""
    if length > limit:
        wp.atomic_min(fraction_out, 0, wp.int32(float(limit / length) * float(WHOLE)))


@wp.func
def model_corners(order: wp.array(dtype=wp.int32), corners: wp.vec4i):
    """Corners as the model numbers them; ``order`` has the model's number of each vertex, or is empty."""
    return wp.vec4i(
        permuted(order, corners[0]),
        permuted(order, corners[1]),
        permuted(order, corners[2]),
        permuted(order, corners[3]),
    )


@wp.func
def add_block(block_out: wp.array2d(dtype=wp.int64), vertex: int, block: Any):
    """Adds a stiffness [N/m] to a vertex's block."""
    for entry in range(6):
        wp.atomic_add(block_out, vertex, entry, wp.int64(wp.float64(block[entry]) / STIFFNESS_UNIT))


@functools.cache
def pressing_stiffness_function(precision: str) -> wp.Function:
    """Function ``pressing_stiffness``."""
    types = cloth_types(precision)
    real, vec3, Step = types.real, types.vec3, types.Step
    by_stick = wp.constant(real(1.0 / STICK_FRACTION))

    @wp.func
    def pressing_stiffness(
        step: Step, fabric: Any, square: wp.float64, distance: real, separation: vec3, weight: real, change: vec3
    ):
        """S of a pair [N/m]; arguments as in kernels.contact.force ``pair_law``."""
        thickness, modulus = real(fabric.thickness), real(fabric.squeeze_modulus)
        by_distance, by_thickness, x, y, inverse = nearness(square, distance, fabric.thickness)
        normal = separation * by_distance
        closing = wp.abs(inner(normal, change)) * by_thickness * step.allowance
        nearer = wp.clamp(x - closing, real(NEAREST) * wp.min(x, real(1.0)), real(1.0))
        stiffness = weight * squeeze_stiffness(quotient(real(1.0), nearer), modulus)
        grip = weight * squeeze_force(y, inverse, thickness, modulus) * by_thickness * by_stick
        return outer(stiffness - grip, normal) + multiple_of_unit(grip)

    return pressing_stiffness


@functools.cache
def linearise_pairs_kernel(precision: str, in_order: bool) -> wp.Kernel:
    """Kernel ``linearise_pairs``; ``in_order`` as in packing.order_functions."""
    types, PressingState = cloth_types(precision), pressing_type(precision)
    real, State, Step = types.real, types.State, types.Step
    on_triangle, on_edges = separation_function(precision, 0), separation_function(precision, 1)
    displacement_at = order_functions(precision, packed=False, in_order=in_order).displacement_at
    edge_weight = parallel_functions(real).weight
    pressing_stiffness = pressing_stiffness_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def linearise_pairs(
        state: State,
        step: Step,
        contact: ContactData,
        order: wp.array(dtype=wp.int32),  # the model's number of each vertex, shape [V]; empty: the same numbers
        pressing: PressingState,
    ):
        """Lists the pairs that press, or may at the pace at which they move, and adds to their vertices' blocks."""
        pair = wp.tid()
        count = contact.pairs.count[0]
        if pair >= count or count > contact.pairs.corners.shape[0]:
            return
        kind = contact.pairs.kind[pair]
        corners = contact.pairs.corners[pair]
        x_0, x_1 = wp.vec3d(state.position[corners[0]]), wp.vec3d(state.position[corners[1]])
        x_2, x_3 = wp.vec3d(state.position[corners[2]]), wp.vec3d(state.position[corners[3]])
        weight = real(1.0)
        weights, separation, square, distance = on_triangle(x_0, x_1, x_2, x_3)
        if (kind & 1) == ON_EDGE:
            weights, separation, square, distance = on_edges(x_0, x_1, x_2, x_3)
            between = edge_weight(types.vec3(x_1 - x_0), types.vec3(x_3 - x_2))
            weight = between[0]
        pressing.distance[pair] = distance
        change = scaled_sum(
            displacement_at(state, corners[1]), weights[1], displacement_at(state, corners[0]) * weights[0]
        )
        change = scaled_sum(displacement_at(state, corners[2]), weights[2], change)
        change = scaled_sum(displacement_at(state, corners[3]), weights[3], change)
        fabric = pair_fabric(contact, corners)
        closing = wp.abs(inner(separation, change)) * step.allowance  # times the distance
        near = real(fabric.thickness)
        if kind >= NEIGHBOURS or distance <= real(0.0) or distance * (distance - near) >= closing:
            return
        stiffness = pressing_stiffness(step, fabric, square, distance, separation, weight, change)
        slot = next_slot(pressing.count)
        named = model_corners(order, corners)
        pressing.corners[slot] = named
        pressing.weights[slot] = weights
        pressing.stiffness[slot] = stiffness
        for corner in range(4):
            add_block(pressing.block, named[corner], stiffness * (weights[corner] * weights[corner]))

    return linearise_pairs


@wp.func
def wider(one: Any, other: Any, third: Any):
    """The longer of two vectors' distances from a third."""
    return wp.max(wp.length(one - third), wp.length(other - third))


@functools.cache
def limit_by_pairs_kernel(precision: str) -> wp.Kernel:
    """Kernel ``limit_by_pairs``."""
    types, PressingState = cloth_types(precision), pressing_type(precision)
    real, State = types.real, types.State

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def limit_by_pairs(
        state: State,
        contact: ContactData,
        order: wp.array(dtype=wp.int32),  # as in linearise_pairs
        pressing: PressingState,
    ):
        """Lowers the fraction of the displacements that is taken, so that no pair comes too near.

        Nor does a vertex move farther than its step limit, within which all cloth near it is listed. A thread is of a
        pair and of a vertex.
        """
        thread = wp.tid()
        if thread < contact.trigger.position.shape[0]:
            vertex = permuted(order, thread)
            known = load_vertex_contact(contact, thread, wp.vec3d(state.position[vertex]))
            lower_fraction(pressing.fraction, real(known.step_limit), wp.length(state.displacement[vertex]))
        count = contact.pairs.count[0]
        if thread < count and count <= contact.pairs.corners.shape[0]:
            corners = model_corners(order, contact.pairs.corners[thread])
            d_0, d_1 = state.displacement[corners[0]], state.displacement[corners[1]]
            d_2, d_3 = state.displacement[corners[2]], state.displacement[corners[3]]
            moved = wider(d_2, d_3, d_0)
            if (contact.pairs.kind[thread] & 1) == ON_EDGE:
                moved = wp.max(moved, wider(d_2, d_3, d_1))
            else:
                moved = wp.max(moved, wp.length(d_1 - d_0))
            distance = pressing.distance[thread]
            free = distance - real(NEAREST) * real(pair_thickness(contact, contact.pairs.corners[thread]))
            most = wp.clamp(free, real(NEAREST) * distance, real(MOST_CLOSING) * distance)
            lower_fraction(pressing.fraction, most, moved)

    return limit_by_pairs


@functools.cache
def multiply_pairs_kernel(precision: str) -> wp.Kernel:
    types, PressingState = cloth_types(precision), pressing_type(precision)
    vec3 = types.vec3

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def multiply_pairs(
        x: wp.array(dtype=vec3),  # displacements [m], shape [V]
        pressing: PressingState,
    ):
        """Multiplies displacements with the pairs' stiffness: adds w_i S sum_j w_j x_j to each vertex i's product."""
        pair = wp.tid()
        if pair >= pressing.count[0]:
            return
        corners, weights = pressing.corners[pair], pressing.weights[pair]
        between = vec3()
        for corner in range(4):
            between += x[corners[corner]] * weights[corner]
        force = symmetric_times(pressing.stiffness[pair], between)
        for corner in range(4):
            own = wp.vec3d(force * weights[corner])
            for axis in range(3):
                wp.atomic_add(pressing.product, corners[corner], axis, wp.int64(own[axis] / FORCE_UNIT))

    return multiply_pairs


@wp.func
def take_entry(sums: wp.array2d(dtype=wp.int64), vertex: int, entry: int, unit: wp.float64) -> wp.float64:
    """An entry of a vertex's sums, of integers in this unit; resets it."""
    value = wp.float64(sums[vertex, entry]) * unit
    sums[vertex, entry] = wp.int64(0)
    return value


@functools.cache
def pressing_functions(precision: str) -> SimpleNamespace:
    """Functions ``take_product`` and ``take_block`` of a vertex."""
    types, PressingState = cloth_types(precision), pressing_type(precision)
    real, vec3, vec6 = types.real, types.vec3, types.vec6

    @wp.func
    def take_product(pressing: PressingState, vertex: int):
        """A vertex's sum of ``multiply_pairs`` [N]; resets it."""
        result = vec3()
        for axis in range(3):
            result[axis] = real(take_entry(pressing.product, vertex, axis, FORCE_UNIT))
        return result

    @wp.func
    def take_block(pressing: PressingState, vertex: int):
        """A vertex's own block [N/m]; resets it."""
        result = vec6()
        for entry in range(6):
            result[entry] = real(take_entry(pressing.block, vertex, entry, STIFFNESS_UNIT))
        return result

    return SimpleNamespace(take_product=take_product, take_block=take_block)

"""Conjugate gradients on a garment's linearised forces, every sum in one fixed order.

A x = b with A = inertia + sum over pairs of S_ij, on what contact and pins leave free. Each garment has step lengths of
its own, so that it ends in the same bits alone and beside others.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.base.block import block_of, block_threads, lane_of
from warp_cloth.kernels.base.reduction import Parts, ratio, sum_part
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.elements.stiffness import stiffness_types, symmetric_functions
from warp_cloth.kernels.implicit.coarse_levels import level_types, row_function

# What contact, friction and pins leave of a vertex's freedom: all, all but its normal, nothing.
FREE, SLIDES, STAYS = wp.constant(0), wp.constant(1), wp.constant(2)


@functools.cache
def conjugate_types(precision: str) -> SimpleNamespace:
    """Struct ``System``."""
    real, vec3 = cloth_types(precision).real, cloth_types(precision).vec3
    own = stiffness_types(precision)

    @wp.struct
    class System:
        """The linearised forces and their solution; V vertices, N pairs, G garments."""

        garment: wp.array(dtype=wp.int32)  # of each vertex, shape [V]
        start: wp.array(dtype=wp.int32)  # rows of the pairs at each vertex, shape [V + 1]
        other: wp.array(dtype=wp.int32)  # the pair's other vertex, shape [2 N]
        coupling: wp.array(dtype=own.mat3)  # [N/m], shape [2 N]
        fall: wp.array(dtype=real)  # how far its own weight moves a vertex in a step [m], shape [G]
        inertia: wp.array(dtype=real)  # what resists a change of the displacement [N/m], shape [V]
        divisor: wp.array(dtype=own.vec6)  # inverse of each vertex's own block [m/N], shape [V]
        hold: wp.array(dtype=wp.int32)  # FREE, SLIDES or STAYS, shape [V]
        normal: wp.array(dtype=vec3)  # of the avatar where it is met, else zero, shape [V]
        drag: wp.array(dtype=real)  # with which friction resists its displacement there [N/m], shape [V]
        gap: wp.array(dtype=real)  # to the contact offset there [m], shape [V]
        pressed: wp.array(dtype=wp.uint8)  # whether contact bore on the vertex's last displacement, shape [V]
        made_heavy: wp.bool  # whether what trembles is, at once
        share: real  # of the solution that is gone where forces are seen ahead; 0: they are not
        momentum: wp.array(dtype=real)  # share of the displacement that leads on there, shape [G]
        onward: wp.array(dtype=vec3)  # how much further momentum has led, to where forces are seen [m], shape [V]
        force: wp.array(dtype=vec3)  # b, what drives the displacement [N], shape [V]
        displacement: wp.array(dtype=vec3)  # x [m], shape [V]
        residual: wp.array(dtype=vec3)  # b - A x [N], shape [V]
        correction: wp.array(dtype=vec3)  # the residual by the preconditioner [m], shape [V]
        direction: wp.array(dtype=vec3)  # [m], shape [V]
        product: wp.array(dtype=vec3)  # A direction [N], shape [V]

    return SimpleNamespace(System=System)


@functools.cache
def allowed_function(precision: str) -> wp.Function:
    """The function that leaves of a vector what contact and pins leave free."""
    vec3 = cloth_types(precision).vec3

    @wp.func
    def allowed(v: vec3, normal: vec3, hold: int):
        """v, v without its part along the normal, or nothing."""
        result = v
        if hold == SLIDES:
            result = v - normal * wp.dot(v, normal)
        if hold == STAYS:
            result = vec3()
        return result

    return allowed


@functools.cache
def product_kernels(precision: str) -> SimpleNamespace:
    """Kernels ``begin_solution`` and ``multiply_direction``: products with A."""
    real, vec3 = cloth_types(precision).real, cloth_types(precision).vec3
    System, allowed = conjugate_types(precision).System, allowed_function(precision)

    @wp.func
    def coupled(system: System, x: wp.array(dtype=vec3), vertex: int):
        """Sum of S_ij (x_i - x_j) over the pairs at a vertex [N], by threes, which are asked for at once."""
        sum = vec3()
        own = x[vertex]
        start, last = system.start[vertex], system.start[vertex + 1]
        for row in range(start, last - 2, 3):
            for i in range(3):
                sum += system.coupling[row + i] * (own - x[system.other[row + i]])
        for row in range(start + (last - start) // 3 * 3, last):
            sum += system.coupling[row] * (own - x[system.other[row]])
        return sum

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def begin_solution(
        share: real,  # the rest of it swings on, whatever the solution
        system: System,
    ):
        """Takes off the residual what a share of the displacement that is kept changes of the forces."""
        vertex = wp.tid()
        hold = system.hold[vertex]
        system.direction[vertex] = vec3()
        if hold != STAYS:
            kept = system.displacement[vertex]
            changed = coupled(system, system.displacement, vertex) * share + kept * system.drag[vertex]
            system.residual[vertex] = system.residual[vertex] - allowed(changed, system.normal[vertex], hold)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def multiply_direction(
        system: System,
        parts: Parts,
        across_out: wp.array(dtype=wp.float64),  # direction . product of each part [J]
    ):
        """product = A direction."""
        thread = wp.tid()
        part, lane = block_of(thread), lane_of(thread)
        for vertex in range(parts.first[part] + lane, parts.first[part + 1], block_threads()):
            hold = system.hold[vertex]
            direction = system.direction[vertex]
            sum = vec3()
            if hold != STAYS:
                against = system.inertia[vertex] + system.drag[vertex]
                sum = coupled(system, system.direction, vertex) + direction * against
            product = allowed(sum, system.normal[vertex], hold)
            system.product[vertex] = product
            parts.dot[vertex] = wp.float64(wp.dot(direction, product))
        sum_part(parts, part, lane, across_out)

    return SimpleNamespace(begin_solution=begin_solution, multiply_direction=multiply_direction)


@functools.cache
def step_kernels(precision: str) -> SimpleNamespace:
    """Kernels ``turn_direction`` and ``advance_solution``: by each garment's own lengths."""
    real, System = cloth_types(precision).real, conjugate_types(precision).System

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def turn_direction(
        system: System,
        parts: Parts,
        along: wp.array(dtype=wp.float64),  # residual . correction of each part [J]
        before: wp.array(dtype=wp.float64),  # the last round's; None where directions begin anew
    ):
        """The next direction: correction + along / before direction."""
        thread = wp.tid()
        part, lane = block_of(thread), lane_of(thread)
        share = real(0.0)
        if before:
            share = real(ratio(parts, along, before, parts.garment[part], False))
        for vertex in range(parts.first[part] + lane, parts.first[part + 1], block_threads()):
            system.direction[vertex] = system.correction[vertex] + system.direction[vertex] * share

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def advance_solution(
        system: System,
        parts: Parts,
        along: wp.array(dtype=wp.float64),  # residual . correction of each part [J]
        across: wp.array(dtype=wp.float64),  # direction . product [J]
    ):
        """displacement += step direction, residual -= step product, step = along / across."""
        thread = wp.tid()
        part, lane = block_of(thread), lane_of(thread)
        step = real(ratio(parts, along, across, parts.garment[part], False))
        for vertex in range(parts.first[part] + lane, parts.first[part + 1], block_threads()):
            system.displacement[vertex] = system.displacement[vertex] + system.direction[vertex] * step
            system.residual[vertex] = system.residual[vertex] - system.product[vertex] * step

    return SimpleNamespace(turn_direction=turn_direction, advance_solution=advance_solution)


@functools.cache
def precondition_kernel(precision: str) -> wp.Kernel:
    """Kernel ``precondition_residual``."""
    vec3, System, Rows = cloth_types(precision).vec3, conjugate_types(precision).System, level_types(precision).Rows
    times = symmetric_functions(precision).times
    allowed, add_row = allowed_function(precision), row_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def precondition_residual(
        system: System,
        parts: Parts,
        up: Rows,  # from the coarser level
        coarser: wp.array(dtype=vec3),  # its displacements [m]; None without coarser levels
        along_out: wp.array(dtype=wp.float64),  # residual . correction of each part [J]
    ):
        """Each vertex's residual by its own block, and what it follows."""
        thread = wp.tid()
        part, lane = block_of(thread), lane_of(thread)
        for vertex in range(parts.first[part] + lane, parts.first[part + 1], block_threads()):
            hold = system.hold[vertex]
            residual = system.residual[vertex]
            sum = vec3()
            if hold != STAYS:
                sum = times(system.divisor[vertex], residual)
                if coarser:
                    sum = add_row(sum, up, vertex, coarser)
            correction = allowed(sum, system.normal[vertex], hold)
            system.correction[vertex] = correction
            parts.dot[vertex] = wp.float64(wp.dot(residual, correction))
        sum_part(parts, part, lane, along_out)

    return precondition_residual


@functools.cache
def conjugate_kernels(precision: str) -> SimpleNamespace:
    """Kernels of the solution, in the order of a round; ``begin_solution`` comes before the first."""
    products, steps = product_kernels(precision), step_kernels(precision)
    return SimpleNamespace(
        begin_solution=products.begin_solution,
        precondition_residual=precondition_kernel(precision),
        turn_direction=steps.turn_direction,
        multiply_direction=products.multiply_direction,
        advance_solution=steps.advance_solution,
    )

"""Preconditioned conjugate gradients on a garment's linearised forces, every sum in one fixed order.

With r = b - A x, z = B r (implicit.coarse_levels) and a direction p, an iteration is
    p <- z + beta p,  beta = rho / rho_before,  rho = r . z
    x <- x + alpha p,  r <- r - alpha A p,  alpha = rho / (p . A p).
Each garment has step lengths of its own, so that it gets the same bits alone and in a batch.
"""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_cloth.kernels.base.block import block_of, block_threads, lane_of
from warp_cloth.kernels.base.reduction import Chunks, garment_ratio, sum_chunk
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.implicit.contact_pairs import pressing_argument, pressing_functions
from warp_cloth.kernels.implicit.sparse import add_row, sparse_types
from warp_cloth.kernels.implicit.system import FIXED, filtered, system_types
from warp_cloth.kernels.math.symmetric import symmetric_times


@wp.func
def coupled(system: Any, x: Any, vertex: int):
    """A vertex's row of the pairs' part of A times displacements x: sum_j S_ij (x_i - x_j) over its pairs [N].

    By threes, whose loads are issued together; ``system`` of system_types.
    """
    own = x[vertex]
    sum = type(own)()
    start, last = system.row_start[vertex], system.row_start[vertex + 1]
    for row in range(start, last - 2, 3):
        for i in range(3):
            sum += system.coupling[row + i] * (own - x[system.neighbour[row + i]])
    for row in range(start + (last - start) // 3 * 3, last):
        sum += system.coupling[row] * (own - x[system.neighbour[row]])
    return sum


@functools.cache
def subtract_initial_guess_kernel(precision: str, cloth_contact: bool) -> wp.Kernel:
    real, vec3 = cloth_types(precision).real, cloth_types(precision).vec3
    types = system_types(precision)
    LinearSystem, SolutionState = types.LinearSystem, types.SolutionState
    PressingState = pressing_argument(precision, cloth_contact)
    take_product = pressing_functions(precision).take_product

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def subtract_initial_guess(
        system: LinearSystem,
        stiffness_fraction: real,  # of the pairs' part of A; what is left out swings on, whatever the solution
        pressing: PressingState,  # with the products of contact_pairs.multiply_pairs
        solution: SolutionState,
    ):
        """r <- r - A x of the displacement that the solution starts from, and p <- 0."""
        vertex = wp.tid()
        constraint = system.constraint[vertex]
        solution.direction[vertex] = vec3()
        pressed = vec3()
        if wp.static(cloth_contact):
            pressed = take_product(pressing, vertex)
        if constraint != FIXED:
            x = solution.displacement[vertex]
            product = coupled(system, solution.displacement, vertex) * stiffness_fraction + x * system.drag[vertex]
            if wp.static(cloth_contact):
                product += pressed
            solution.residual[vertex] = solution.residual[vertex] - filtered(product, system.normal[vertex], constraint)

    return subtract_initial_guess


@functools.cache
def precondition_residual_kernel(precision: str) -> wp.Kernel:
    vec3, CsrMatrix = cloth_types(precision).vec3, sparse_types(precision).CsrMatrix
    LinearSystem, SolutionState = system_types(precision).LinearSystem, system_types(precision).SolutionState

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def precondition_residual(
        system: LinearSystem,
        chunks: Chunks,
        prolongation: CsrMatrix,  # from the first coarse level
        coarser: wp.array(dtype=vec3),  # its correction [m]; None without coarse levels
        solution: SolutionState,
        rho_out: wp.array(dtype=wp.float64),  # r . z of each chunk [J]
    ):
        """z = D^-1 r + P times the coarser level's correction, and rho."""
        thread = wp.tid()
        chunk, lane = block_of(thread), lane_of(thread)
        for vertex in range(chunks.first[chunk] + lane, chunks.first[chunk + 1], block_threads()):
            constraint = system.constraint[vertex]
            residual = solution.residual[vertex]
            sum = vec3()
            if constraint != FIXED:
                sum = symmetric_times(system.inverse[vertex], residual)
                if coarser:
                    sum = add_row(sum, prolongation, vertex, coarser)
            correction = filtered(sum, system.normal[vertex], constraint)
            solution.correction[vertex] = correction
            chunks.scratch[vertex] = wp.float64(wp.dot(residual, correction))
        sum_chunk(chunks, chunk, lane, rho_out)

    return precondition_residual


@functools.cache
def update_direction_kernel(precision: str) -> wp.Kernel:
    real, SolutionState = cloth_types(precision).real, system_types(precision).SolutionState

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def update_direction(
        chunks: Chunks,
        rho: wp.array(dtype=wp.float64),  # r . z of each chunk [J]
        rho_before: wp.array(dtype=wp.float64),  # of the last iteration; None: directions start afresh
        solution: SolutionState,
    ):
        """p <- z + rho / rho_before p."""
        thread = wp.tid()
        chunk, lane = block_of(thread), lane_of(thread)
        beta = real(0.0)
        if rho_before:
            beta = real(garment_ratio(chunks, rho, rho_before, chunks.garment[chunk], False))
        for vertex in range(chunks.first[chunk] + lane, chunks.first[chunk + 1], block_threads()):
            solution.direction[vertex] = solution.correction[vertex] + solution.direction[vertex] * beta

    return update_direction


@functools.cache
def multiply_direction_kernel(precision: str, cloth_contact: bool) -> wp.Kernel:
    vec3, types = cloth_types(precision).vec3, system_types(precision)
    LinearSystem, SolutionState = types.LinearSystem, types.SolutionState
    PressingState = pressing_argument(precision, cloth_contact)
    take_product = pressing_functions(precision).take_product

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def multiply_direction(
        system: LinearSystem,
        chunks: Chunks,
        pressing: PressingState,  # with the products of contact_pairs.multiply_pairs
        solution: SolutionState,
        curvature_out: wp.array(dtype=wp.float64),  # p . A p of each chunk [J]
    ):
        """A p, and p . A p."""
        thread = wp.tid()
        chunk, lane = block_of(thread), lane_of(thread)
        for vertex in range(chunks.first[chunk] + lane, chunks.first[chunk + 1], block_threads()):
            constraint = system.constraint[vertex]
            direction = solution.direction[vertex]
            sum, pressed = vec3(), vec3()
            if wp.static(cloth_contact):
                pressed = take_product(pressing, vertex)
            if constraint != FIXED:
                diagonal = system.inertia[vertex] + system.drag[vertex]
                sum = coupled(system, solution.direction, vertex) + direction * diagonal
                if wp.static(cloth_contact):
                    sum += pressed
            product = filtered(sum, system.normal[vertex], constraint)
            solution.product[vertex] = product
            chunks.scratch[vertex] = wp.float64(wp.dot(direction, product))
        sum_chunk(chunks, chunk, lane, curvature_out)

    return multiply_direction


@functools.cache
def advance_solution_kernel(precision: str) -> wp.Kernel:
    real, SolutionState = cloth_types(precision).real, system_types(precision).SolutionState

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def advance_solution(
        chunks: Chunks,
        rho: wp.array(dtype=wp.float64),  # r . z of each chunk [J]
        curvature: wp.array(dtype=wp.float64),  # p . A p of each chunk [J]
        solution: SolutionState,
    ):
        """x <- x + alpha p and r <- r - alpha A p, alpha = rho / (p . A p)."""
        thread = wp.tid()
        chunk, lane = block_of(thread), lane_of(thread)
        alpha = real(garment_ratio(chunks, rho, curvature, chunks.garment[chunk], False))
        for vertex in range(chunks.first[chunk] + lane, chunks.first[chunk + 1], block_threads()):
            solution.displacement[vertex] = solution.displacement[vertex] + solution.direction[vertex] * alpha
            solution.residual[vertex] = solution.residual[vertex] - solution.product[vertex] * alpha

    return advance_solution


@functools.cache
def conjugate_gradient_kernels(precision: str, cloth_contact: bool) -> SimpleNamespace:
    """Kernels in the order of an iteration, after ``precondition_residual``; the first comes before all iterations."""
    return SimpleNamespace(
        subtract_initial_guess=subtract_initial_guess_kernel(precision, cloth_contact),
        update_direction=update_direction_kernel(precision),
        multiply_direction=multiply_direction_kernel(precision, cloth_contact),
        advance_solution=advance_solution_kernel(precision),
    )

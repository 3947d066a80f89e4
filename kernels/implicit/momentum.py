"""Nesterov momentum with adaptive restart: forces are taken where the momentum leads, not where the last step ended.

After n steps a garment keeps beta = n / (n + 3) of its displacement (Nesterov, 1983). Where momentum leads uphill n
falls to a fraction (O'Donoghue and Candes, "Adaptive Restart for Accelerated Gradient Schemes", 2015).
"""

import functools

import warp as wp

from warp_cloth.kernels.base.block import block_of, block_threads, lane_of
from warp_cloth.kernels.base.reduction import Chunks, garment_sums, sum_chunk
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.implicit.system import system_types


@functools.cache
def measure_momentum_work_kernel(precision: str) -> wp.Kernel:
    types = system_types(precision)
    LinearSystem, SolutionState, ImplicitState = types.LinearSystem, types.SolutionState, types.ImplicitState

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def measure_momentum_work(
        system: LinearSystem,
        implicit: ImplicitState,
        solution: SolutionState,
        chunks: Chunks,
        momentum_work_out: wp.array(dtype=wp.float64),  # b . extrapolation of each chunk [J]
        solution_work_out: wp.array(dtype=wp.float64),  # b . x of each chunk [J]
    ):
        """Work of the forces along the extrapolation, and along the solution."""
        thread = wp.tid()
        chunk, lane = block_of(thread), lane_of(thread)
        for vertex in range(chunks.first[chunk] + lane, chunks.first[chunk + 1], block_threads()):
            chunks.scratch[vertex] = wp.float64(wp.dot(system.force[vertex], implicit.extrapolation[vertex]))
        sum_chunk(chunks, chunk, lane, momentum_work_out)
        for vertex in range(chunks.first[chunk] + lane, chunks.first[chunk + 1], block_threads()):
            chunks.scratch[vertex] = wp.float64(wp.dot(system.force[vertex], solution.displacement[vertex]))
        sum_chunk(chunks, chunk, lane, solution_work_out)

    return measure_momentum_work


@functools.cache
def adapt_momentum_kernel(precision: str) -> wp.Kernel:
    real, ImplicitState = cloth_types(precision).real, system_types(precision).ImplicitState

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def adapt_momentum(
        least: real,
        most: real,
        restart_fraction: real,  # of n that a restart leaves
        chunks: Chunks,
        momentum_work: wp.array(dtype=wp.float64),
        solution_work: wp.array(dtype=wp.float64),
        implicit: ImplicitState,
    ):
        """beta <- n / (n + 3), n one more than before, or a fraction of that where b . (extrapolation + x) < 0.

        The extrapolation's own work would not do: a single fold that oscillates would stop the sliding of all others.
        """
        thread = wp.tid()
        garment = block_of(thread)
        work = garment_sums(chunks, momentum_work, solution_work, garment, False)
        if lane_of(thread) == 0:
            delay = real(3.0)
            beta = implicit.momentum[garment]
            n = delay * beta / (real(1.0) - beta) + real(1.0)
            if work[0] + work[1] < wp.float64(0.0):
                n = restart_fraction * n
            implicit.momentum[garment] = wp.clamp(n / (n + delay), least, most)

    return adapt_momentum

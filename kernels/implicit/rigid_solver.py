"""Conjugate gradients on the coarse level with rigid modes, in one persistent kernel.

All iterations are one launch: as many blocks as the GPU runs at once take the chunks one after another, and wait for
each other at a grid barrier twice an iteration. The preconditioner is each vertex's own 6 x 6 block.
"""

import functools
from typing import Any

import warp as wp

from warp_cloth.kernels.base.block import block_of, block_threads, lane_of, wait_for_block
from warp_cloth.kernels.base.reduction import coherent_load, garment_ratio, grid_barrier, sum_chunk
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.implicit.rigid_types import INTERLEAVED, rigid_types
from warp_cloth.kernels.math.operators import add, mul, sub  # noqa: F401  what + - * below call
from warp_cloth.kernels.math.packet import vector3
from warp_cloth.kernels.math.symmetric import symmetric_times


@wp.func
def precondition(level: Any, rigid: Any, vertex: int, force: Any, moment: Any):
    """Stores a coarse vertex's residual, its correction by its own block, and the product of both.

    w = Schur^-1 (moment - K_tw^T K_tt^-1 force), t = K_tt^-1 (force - K_tw w).
    """
    tw = level.cross[vertex]
    inverse_tt = level.inverse[vertex, 0]
    left = moment - wp.transpose(tw) * symmetric_times(inverse_tt, force)
    rotation = symmetric_times(level.inverse[vertex, 1], left)
    translation = symmetric_times(inverse_tt, force - tw * rotation)
    rigid.residual[2 * vertex] = force
    rigid.residual[2 * vertex + 1] = moment
    rigid.correction[2 * vertex] = translation
    rigid.correction[2 * vertex + 1] = rotation
    rho = wp.float64(wp.dot(force, translation)) + wp.float64(wp.dot(moment, rotation))
    level.chunks.scratch[vertex] = rho


@functools.cache
def begin_chunk_function(precision: str) -> wp.Function:
    vec3, own = cloth_types(precision).vec3, rigid_types(precision)
    RigidLevel, RigidState = own.RigidLevel, own.RigidState

    @wp.func
    def wrench_on(level: RigidLevel, rigid: RigidState, vertex: int, which: int):
        """Force or moment on a coarse vertex, added in the order of its row; by eights, loaded together."""
        sum = vec3()
        start, last = level.restriction.start[vertex], level.restriction.start[vertex + 1]
        for entry in range(start, last - 7, 8):
            for i in range(8):
                sum += rigid.wrench[entry + i, which]
        for entry in range(start + (last - start) // 8 * 8, last):
            sum += rigid.wrench[entry, which]
        return sum

    @wp.func
    def begin_chunk(level: RigidLevel, rigid: RigidState, chunk: int, lane: int, lanes: int):
        """r = what is left of force and moment, x = 0, z = B r, rho = r . z."""
        first, last = level.chunks.first[chunk], level.chunks.first[chunk + 1]
        for i in range(2 * first + lane, 2 * last, lanes):
            rigid.residual[i] = wrench_on(level, rigid, i // 2, i % 2)
            rigid.displacement[i] = vec3()
        wait_for_block()
        for vertex in range(first + lane, last, lanes):
            precondition(level, rigid, vertex, rigid.residual[2 * vertex], rigid.residual[2 * vertex + 1])
        sum_chunk(level.chunks, chunk, lane, rigid.rho)

    return begin_chunk


@wp.func
def resistance(rigid: Any, i: int):
    """Vector i of K direction: the force or the moment that resists it."""
    return vector3(rigid.product[3 * i], rigid.product[3 * i + 1], rigid.product[3 * i + 2])


@wp.func
def block_number(level: Any, entry: int, row: int, column: int):
    """One of a block's 36 numbers."""
    return level.block[entry // INTERLEAVED, 6 * row + column, entry % INTERLEAVED]


@wp.func
def multiply_block(level: Any, rigid: Any, entry: int, d: Any):
    """Stores the block's six terms of the product."""
    for k in range(6):
        by_translation = block_number(level, entry, k, 0) * d[0] + block_number(level, entry, k, 1) * d[1]
        by_translation += block_number(level, entry, k, 2) * d[2]
        by_rotation = block_number(level, entry, k, 3) * d[3] + block_number(level, entry, k, 4) * d[4]
        by_rotation += block_number(level, entry, k, 5) * d[5]
        rigid.product_term[entry, k] = by_translation + by_rotation


@functools.cache
def multiply_chunk_function(precision: str) -> wp.Function:
    real, vec3, own = cloth_types(precision).real, cloth_types(precision).vec3, rigid_types(precision)
    RigidLevel, RigidState, vectors = own.RigidLevel, own.RigidState, wp.array(dtype=vec3)

    @wp.func
    def row_sum(level: RigidLevel, rigid: RigidState, vertex: int, i: int):
        """One of the six components of K direction at a vertex, added in the order of its row."""
        sum = real(0.0)
        start, last = level.row_start[vertex], level.row_start[vertex + 1]
        for entry in range(start, last - 3, 4):
            for k in range(4):
                sum += rigid.product_term[entry + k, i]
        for entry in range(start + (last - start) // 4 * 4, last):
            sum += rigid.product_term[entry, i]
        return sum

    @wp.func
    def multiply_chunk(
        level: RigidLevel, rigid: RigidState, chunk: int, thread: int, beta: real, last: vectors, next: vectors
    ):
        """p = z + beta p of the last iteration, computed by every block that reads it; K p, and p . K p."""
        first, end = level.chunks.first[chunk], level.chunks.first[chunk + 1]
        lane, lanes, others = lane_of(thread), block_threads(), rigid.blocks > 1
        for entry in range(level.row_start[first] + lane, level.row_start[end], lanes):
            i = level.neighbour[entry]
            direction = coherent_load(rigid.correction, i, others) + coherent_load(last, i, others) * beta
            multiply_block(level, rigid, entry, direction)
        wait_for_block()
        for item in range(lane, 8 * (end - first), lanes):
            if item % 8 < 6:
                sum = row_sum(level, rigid, first + item // 8, item % 8)
                rigid.product[6 * first + 6 * (item // 8) + item % 8] = sum
        wait_for_block()
        for vertex in range(first + lane, end, lanes):
            translation = rigid.correction[2 * vertex] + last[2 * vertex] * beta
            rotation = rigid.correction[2 * vertex + 1] + last[2 * vertex + 1] * beta
            next[2 * vertex] = translation
            next[2 * vertex + 1] = rotation
            curvature = wp.float64(wp.dot(translation, resistance(rigid, 2 * vertex)))
            curvature += wp.float64(wp.dot(rotation, resistance(rigid, 2 * vertex + 1)))
            level.chunks.scratch[vertex] = curvature
        sum_chunk(level.chunks, chunk, lane, rigid.curvature)

    return multiply_chunk


@wp.func
def advance_chunk(level: Any, rigid: Any, chunk: int, thread: int, alpha: Any, direction: Any, rho: Any):
    """x <- x + alpha p, r <- r - alpha K p, z = B r, rho = r . z."""
    lane = lane_of(thread)
    for vertex in range(level.chunks.first[chunk] + lane, level.chunks.first[chunk + 1], block_threads()):
        t, w = 2 * vertex, 2 * vertex + 1
        rigid.displacement[t] = rigid.displacement[t] + direction[t] * alpha
        rigid.displacement[w] = rigid.displacement[w] + direction[w] * alpha
        force = rigid.residual[t] - resistance(rigid, t) * alpha
        precondition(level, rigid, vertex, force, rigid.residual[w] - resistance(rigid, w) * alpha)
    sum_chunk(level.chunks, chunk, lane, rho)


@functools.cache
def solve_rigid_level_kernel(precision: str) -> wp.Kernel:
    real, vec3, own = cloth_types(precision).real, cloth_types(precision).vec3, rigid_types(precision)
    RigidLevel, RigidState = own.RigidLevel, own.RigidState
    sums, vectors = wp.array(dtype=wp.float64), wp.array(dtype=vec3)
    begin_chunk, multiply_chunk = begin_chunk_function(precision), multiply_chunk_function(precision)

    @wp.func
    def iterate(
        level: RigidLevel,
        rigid: RigidState,
        number: int,  # of the iteration
        thread: int,
        rho: sums,  # r . z of each chunk [J]
        rho_before: sums,  # the last iteration's; in the end the next one's
        last: vectors,  # the last iteration's direction
        next: vectors,
    ):
        """One iteration of a block: alpha = rho / (p . K p), beta = rho / rho_before."""
        block, blocks, chunks = block_of(thread), rigid.blocks, level.chunks.garment.shape[0]
        grid_barrier(rigid.arrived, blocks, 2 * number + 1)
        for chunk in range(block, chunks, blocks):
            beta = real(0.0)
            if number > 0:
                beta = real(garment_ratio(level.chunks, rho, rho_before, level.chunks.garment[chunk], blocks > 1))
            multiply_chunk(level, rigid, chunk, thread, beta, last, next)
        grid_barrier(rigid.arrived, blocks, 2 * number + 2)
        for chunk in range(block, chunks, blocks):
            garment = level.chunks.garment[chunk]
            alpha = real(garment_ratio(level.chunks, rho, rigid.curvature, garment, blocks > 1))
            advance_chunk(level, rigid, chunk, thread, alpha, next, rho_before)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def solve_rigid_level(level: RigidLevel, rigid: RigidState, iterations: int):
        """K x = r by conjugate gradients from x = 0; directions and their rho are swapped from one to the next."""
        thread = wp.tid()
        for chunk in range(block_of(thread), level.chunks.garment.shape[0], rigid.blocks):
            begin_chunk(level, rigid, chunk, lane_of(thread), block_threads())
        for number in range(iterations):
            rho, rho_before, last, next = rigid.rho, rigid.rho_before, rigid.direction, rigid.direction_before
            if number % 2 == 0:
                iterate(level, rigid, number, thread, rho, rho_before, last, next)
            else:
                iterate(level, rigid, number, thread, rho_before, rho, next, last)

    return solve_rigid_level

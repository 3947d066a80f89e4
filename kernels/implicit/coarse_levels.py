"""Coarser levels of a garment's stiffness: a residual is gathered to them, a correction gathered back.

A fine vertex follows coarse ones, x_i = sum_I P_iI x_I. Of sums over pairs of S_ij (d_i - d_j)^2 the coarse ones are
S_IJ = -sum_ij (P_iI - P_jI) (P_iJ - P_jJ) S_ij, exactly. What stays where it is (pins) is one more coarse vertex.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.base.block import block_threads, lane_of, wait_for_block
from warp_cloth.kernels.base.reduction import lanes_together, order_function
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.elements.stiffness import stiffness_types, symmetric_functions

COARSEST = 1024  # threads of the block that works on the coarsest levels, on a GPU


@functools.cache
def level_types(precision: str) -> SimpleNamespace:
    """Struct ``Rows``."""
    real = cloth_types(precision).real

    @wp.struct
    class Rows:
        """A sparse matrix by rows."""

        start: wp.array(dtype=wp.int32)  # shape [rows + 1]
        index: wp.array(dtype=wp.int32)  # column
        weight: wp.array(dtype=real)

    return SimpleNamespace(Rows=Rows)


@functools.cache
def row_function(precision: str) -> wp.Function:
    """The function that adds a row of a sparse matrix times displacements [m], or forces [N], to a sum."""
    vec3, Rows = cloth_types(precision).vec3, level_types(precision).Rows

    @wp.func
    def add_row(sum: vec3, rows: Rows, row: int, x: wp.array(dtype=vec3)):
        """sum + sum_j P_ij x_j, added in the order of the row; by fours, which are asked for at once."""
        start, last = rows.start[row], rows.start[row + 1]
        for entry in range(start, last - 3, 4):
            for i in range(4):
                sum += x[rows.index[entry + i]] * rows.weight[entry + i]
        for entry in range(start + (last - start) // 4 * 4, last):
            sum += x[rows.index[entry]] * rows.weight[entry]
        return sum

    return add_row


@functools.cache
def level_kernels(precision: str) -> SimpleNamespace:
    """Kernels ``gather_blocks``, ``gather_anchors``, ``restrict_residual``, ``correct_level``, ``correct_coarsest``."""
    vec3 = cloth_types(precision).vec3
    vec6, Rows = stiffness_types(precision).vec6, level_types(precision).Rows
    symmetric = symmetric_functions(precision)
    inverse, times = symmetric.inverse, symmetric.times
    add_row, add_forces = row_function(precision), order_function(precision, vec3)
    add_blocks = order_function(precision, vec6)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def gather_blocks(
        rows: Rows,
        fine: wp.array(dtype=vec6),
        coarse_out: wp.array(dtype=vec6),
    ):
        """Sums weighted symmetric blocks [N/m]: pairs to coarse pairs, or to the coarse vertices."""
        row, lane = wp.tid() // lanes_together(), wp.tid() % lanes_together()
        sum = vec6()
        last = rows.start[row + 1]
        for first in range(rows.start[row], last, lanes_together()):
            part = vec6()
            if first + lane < last:
                part = fine[rows.index[first + lane]] * rows.weight[first + lane]
            sum = add_blocks(sum, part, wp.min(last - first, lanes_together()))
        if lane == 0:
            coarse_out[row] = sum

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def gather_anchors(
        down: Rows,  # of the coarse vertices, from the finer ones
        together: bool,  # whether what the finer ones follow is anchored all around, as cloth on an avatar
        anchor: wp.array(dtype=vec6),  # stiffness of the finer vertices against the world [N/m]
        stiffness: wp.array(dtype=vec6),  # of the coarse vertices against each other [N/m]
        anchor_out: wp.array(dtype=vec6),
        inverse_out: wp.array(dtype=vec6),  # of both together [m/N]
    ):
        """Anchors of the coarse vertices, P^2 times those of the finer ones, and what their blocks divide by.

        Anchors are kept for each vertex alone. Of a whole stretch of anchored vertices that leaves out what a coarse
        displacement does to two finer ones at once: a share of all from level to level, and held cloth looks soft on
        the coarsest. Where they are anchored ``together`` they count in full, P times.
        """
        vertex, lane = wp.tid() // lanes_together(), wp.tid() % lanes_together()
        sum = vec6()
        last = down.start[vertex + 1]
        for first in range(down.start[vertex], last, lanes_together()):
            part = vec6()
            if first + lane < last:
                weight = down.weight[first + lane]
                share = wp.where(together, wp.abs(weight), weight * weight)
                part = anchor[down.index[first + lane]] * share
            sum = add_blocks(sum, part, wp.min(last - first, lanes_together()))
        if lane == 0:
            anchor_out[vertex] = sum
            inverse_out[vertex] = inverse(stiffness[vertex] + sum)

    @wp.func
    def restrict(down: Rows, residual: wp.array(dtype=vec3), vertex: int, lane: int):
        """Force left on a coarse vertex [N]; all threads that go together ask."""
        sum = vec3()
        last = down.start[vertex + 1]
        for first in range(down.start[vertex], last, lanes_together()):
            part = vec3()
            if first + lane < last:
                part = residual[down.index[first + lane]] * down.weight[first + lane]
            sum = add_forces(sum, part, wp.min(last - first, lanes_together()))
        return sum

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def restrict_residual(
        down: Rows,
        residual: wp.array(dtype=vec3),  # of the finer vertices [N]
        residual_out: wp.array(dtype=vec3),
    ):
        """Forces left on the coarse vertices."""
        vertex, lane = wp.tid() // lanes_together(), wp.tid() % lanes_together()
        restricted = restrict(down, residual, vertex, lane)
        if lane == 0:
            residual_out[vertex] = restricted

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def correct_level(
        up: Rows,  # of these vertices, from the coarser ones
        divisor: wp.array(dtype=vec6),  # inverse blocks [m/N]
        residual: wp.array(dtype=vec3),  # [N]
        coarser: wp.array(dtype=vec3),  # displacements of the coarser vertices [m]; None on the coarsest level
        correction_out: wp.array(dtype=vec3),  # [m]
    ):
        """Displacements: each vertex's own block, and what it follows."""
        vertex = wp.tid()
        sum = times(divisor[vertex], residual[vertex])
        if coarser:
            sum = add_row(sum, up, vertex, coarser)
        correction_out[vertex] = sum

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, launch_bounds=COARSEST)
    def correct_coarsest(
        level: wp.array(dtype=wp.int32),  # first vertex of each level, shape [levels + 1]
        down: Rows,  # from the level before; of the first of these levels empty
        up: Rows,  # from the level after
        divisor: wp.array(dtype=vec6),
        residual: wp.array(dtype=vec3),  # given on the first of these levels [N]
        correction_out: wp.array(dtype=vec3),  # [m]
    ):
        """As ``restrict_residual`` to the last of these levels, then as ``correct_level`` on all, by a single block."""
        thread = wp.tid()
        lane, lanes = lane_of(thread), block_threads()
        last = level.shape[0] - 2
        for number in range(1, last + 1):
            row, rows = lane // lanes_together(), lanes // lanes_together()
            for vertex in range(level[number] + row, level[number + 1], rows):
                restricted = restrict(down, residual, vertex, lane % lanes_together())
                if lane % lanes_together() == 0:
                    residual[vertex] = restricted
            wait_for_block()
        for number in range(last + 1):
            for vertex in range(level[last - number] + lane, level[last - number + 1], lanes):
                own = times(divisor[vertex], residual[vertex])
                correction_out[vertex] = add_row(own, up, vertex, correction_out)
            wait_for_block()

    return SimpleNamespace(
        gather_blocks=gather_blocks,
        gather_anchors=gather_anchors,
        restrict_residual=restrict_residual,
        correct_level=correct_level,
        correct_coarsest=correct_coarsest,
    )

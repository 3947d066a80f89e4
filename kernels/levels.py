"""Coarser levels of a garment's stiffness: a residual is gathered to them, a correction gathered back.

A fine vertex follows coarse ones, x_i = sum_I P_iI x_I. Of sums over pairs of S_ij (d_i - d_j)^2 the coarse ones are
S_IJ = -sum_ij (P_iI - P_jI) (P_iJ - P_jJ) S_ij, exactly. What stays where it is (pins) is one more coarse vertex.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.block import block_threads, lane_of, wait_for_block
from warp_cloth.kernels.cloth import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.stiffness import stiffness_types, symmetric_functions

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
def row_function(precision: str, blocks: bool = False) -> wp.Function:
    """The function that adds a row of a sparse matrix times displacements [m], forces [N] or ``blocks`` to a sum."""
    types, Rows = cloth_types(precision), level_types(precision).Rows
    kind = types.vec6 if blocks else types.vec3

    @wp.func
    def add_row(sum: kind, rows: Rows, row: int, x: wp.array(dtype=kind)):
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
    add_row, add_blocks = row_function(precision), row_function(precision, blocks=True)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def gather_blocks(
        rows: Rows,
        fine: wp.array(dtype=vec6),
        coarse_out: wp.array(dtype=vec6),
    ):
        """Sums weighted symmetric blocks [N/m]: pairs to coarse pairs, or to the coarse vertices."""
        row = wp.tid()
        coarse_out[row] = add_blocks(vec6(), rows, row, fine)

    @wp.func
    def anchored(down: Rows, together: bool, anchor: wp.array(dtype=vec6), entry: int):
        """What an entry of a row adds to its vertex's anchor."""
        weight = down.weight[entry]
        return anchor[down.index[entry]] * wp.where(together, wp.abs(weight), weight * weight)

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
        vertex = wp.tid()
        sum = vec6()
        start, last = down.start[vertex], down.start[vertex + 1]
        for entry in range(start, last - 3, 4):
            for i in range(4):
                sum += anchored(down, together, anchor, entry + i)
        for entry in range(start + (last - start) // 4 * 4, last):
            sum += anchored(down, together, anchor, entry)
        anchor_out[vertex] = sum
        inverse_out[vertex] = inverse(stiffness[vertex] + sum)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def restrict_residual(
        down: Rows,
        residual: wp.array(dtype=vec3),  # of the finer vertices [N]
        residual_out: wp.array(dtype=vec3),
    ):
        """Forces left on the coarse vertices."""
        vertex = wp.tid()
        residual_out[vertex] = add_row(vec3(), down, vertex, residual)

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
            for vertex in range(level[number] + lane, level[number + 1], lanes):
                residual[vertex] = add_row(vec3(), down, vertex, residual)
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

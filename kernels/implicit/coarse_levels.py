"""Additive multilevel preconditioner: Galerkin coarse levels of a garment's stiffness, restriction and prolongation.

With the prolongation P a fine vertex follows coarse ones, x_i = sum_I P_iI x_I. Coarse stiffness is Galerkin's,
P^T A P: of sums over pairs of S_ij (d_i - d_j)^2 that is S_IJ = -sum_ij (P_iI - P_jI) (P_iJ - P_jJ) S_ij, a sum over
pairs again. What does not move (pins) is one more coarse vertex. The correction is B r = sum_l P_l D_l^-1 P_l^T r over
the levels, D_l the 3 x 3 blocks on the diagonal (Bramble, Pasciak and Xu, "Parallel multilevel preconditioners", 1990).
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.base.block import block_threads, lane_of, wait_for_block, warp_size
from warp_cloth.kernels.base.reduction import add_in_lane_order
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.implicit.sparse import add_row, add_row_by_warp, sparse_types
from warp_cloth.kernels.math.symmetric import inverse, symmetric_times

COARSEST_THREADS = 1024  # of the one block that works on the coarsest levels, on a GPU


@functools.cache
def coarsen_stiffness_kernel(precision: str) -> wp.Kernel:
    vec6, CsrMatrix = cloth_types(precision).vec6, sparse_types(precision).CsrMatrix

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def coarsen_stiffness(
        rows: CsrMatrix,  # to coarse pairs, or coarse vertices, from finer pairs
        fine: wp.array(dtype=vec6),  # symmetric blocks of the finer pairs [N/m]
        coarse_out: wp.array(dtype=vec6),  # [N/m]
    ):
        """Weighted sums of symmetric blocks: the Galerkin stiffness of coarse pairs, or of coarse vertices."""
        row, lane = wp.tid() // warp_size(), wp.tid() % warp_size()
        sum = add_row_by_warp(vec6(), rows, row, fine, lane)
        if lane == 0:
            coarse_out[row] = sum

    return coarsen_stiffness


@functools.cache
def coarsen_anchors_kernel(precision: str) -> wp.Kernel:
    vec6, CsrMatrix = cloth_types(precision).vec6, sparse_types(precision).CsrMatrix

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def coarsen_anchors(
        restriction: CsrMatrix,  # to the coarse vertices from the finer ones
        lumped: bool,  # whether anchors count by P, not P^2
        anchor: wp.array(dtype=vec6),  # stiffness of the finer vertices against the world [N/m]
        stiffness: wp.array(dtype=vec6),  # of the coarse vertices against each other [N/m]
        anchor_out: wp.array(dtype=vec6),  # of the coarse vertices against the world [N/m]
        inverse_out: wp.array(dtype=vec6),  # of stiffness and anchor together [m/N]
    ):
        """Anchors of the coarse vertices, sum_i P_iI^2 a_i, and the inverse blocks of the preconditioner.

        Anchors are stored per vertex only. P^2 leaves out what one coarse displacement does to two anchored vertices
        at once: a fraction of all from level to level, and cloth in contact would look soft on the coarsest. Where the
        finer vertices are anchored all around, as cloth on an avatar, anchors are lumped, sum_i |P_iI| a_i.
        """
        vertex, lane = wp.tid() // warp_size(), wp.tid() % warp_size()
        sum = vec6()
        last = restriction.start[vertex + 1]
        for first in range(restriction.start[vertex], last, warp_size()):
            term = vec6()
            if first + lane < last:
                weight = restriction.value[first + lane]
                factor = wp.where(lumped, wp.abs(weight), weight * weight)
                term = anchor[restriction.column[first + lane]] * factor
            sum = add_in_lane_order(sum, term, wp.min(last - first, warp_size()))
        if lane == 0:
            anchor_out[vertex] = sum
            inverse_out[vertex] = inverse(stiffness[vertex] + sum)

    return coarsen_anchors


@functools.cache
def restrict_residual_kernel(precision: str) -> wp.Kernel:
    vec3, CsrMatrix = cloth_types(precision).vec3, sparse_types(precision).CsrMatrix

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def restrict_residual(
        restriction: CsrMatrix,
        residual: wp.array(dtype=vec3),  # of the finer vertices [N]
        residual_out: wp.array(dtype=vec3),  # of the coarse ones [N]
    ):
        """r_coarse = P^T r."""
        vertex, lane = wp.tid() // warp_size(), wp.tid() % warp_size()
        restricted = add_row_by_warp(vec3(), restriction, vertex, residual, lane)
        if lane == 0:
            residual_out[vertex] = restricted

    return restrict_residual


@functools.cache
def prolong_correction_kernel(precision: str) -> wp.Kernel:
    vec3, vec6 = cloth_types(precision).vec3, cloth_types(precision).vec6
    CsrMatrix = sparse_types(precision).CsrMatrix

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def prolong_correction(
        prolongation: CsrMatrix,  # to these vertices from the coarser ones
        inverse: wp.array(dtype=vec6),  # of these vertices' blocks [m/N]
        residual: wp.array(dtype=vec3),  # [N]
        coarser: wp.array(dtype=vec3),  # correction of the coarser vertices [m]; None on the coarsest level
        correction_out: wp.array(dtype=vec3),  # [m]
    ):
        """Correction of a level: D^-1 r + P times the coarser level's."""
        vertex = wp.tid()
        sum = symmetric_times(inverse[vertex], residual[vertex])
        if coarser:
            sum = add_row(sum, prolongation, vertex, coarser)
        correction_out[vertex] = sum

    return prolong_correction


@functools.cache
def correct_coarsest_levels_kernel(precision: str) -> wp.Kernel:
    vec3, vec6 = cloth_types(precision).vec3, cloth_types(precision).vec6
    CsrMatrix = sparse_types(precision).CsrMatrix

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, launch_bounds=COARSEST_THREADS)
    def correct_coarsest_levels(
        first: wp.array(dtype=wp.int32),  # vertex of each level, and the vertex count, shape [levels + 1]
        restriction: CsrMatrix,  # from the level before; empty for the first of these levels
        prolongation: CsrMatrix,  # from the level after
        inverse: wp.array(dtype=vec6),  # of the vertices' blocks [m/N]
        residual_out: wp.array(dtype=vec3),  # [N]; an input on the first of these levels
        correction_out: wp.array(dtype=vec3),  # [m]
    ):
        """As ``restrict_residual`` down to the coarsest level and ``prolong_correction`` back, by a single block."""
        thread = wp.tid()
        lane, lanes = lane_of(thread), block_threads()
        coarsest = first.shape[0] - 2
        for level in range(1, coarsest + 1):
            row, rows = lane // warp_size(), lanes // warp_size()
            for vertex in range(first[level] + row, first[level + 1], rows):
                restricted = add_row_by_warp(vec3(), restriction, vertex, residual_out, lane % warp_size())
                if lane % warp_size() == 0:
                    residual_out[vertex] = restricted
            wait_for_block()
        for level in range(coarsest + 1):
            for vertex in range(first[coarsest - level] + lane, first[coarsest - level + 1], lanes):
                own = symmetric_times(inverse[vertex], residual_out[vertex])
                correction_out[vertex] = add_row(own, prolongation, vertex, correction_out)
            wait_for_block()

    return correct_coarsest_levels


@functools.cache
def coarse_level_kernels(precision: str) -> SimpleNamespace:
    """All kernels of the coarse levels."""
    return SimpleNamespace(
        coarsen_stiffness=coarsen_stiffness_kernel(precision),
        coarsen_anchors=coarsen_anchors_kernel(precision),
        restrict_residual=restrict_residual_kernel(precision),
        prolong_correction=prolong_correction_kernel(precision),
        correct_coarsest_levels=correct_coarsest_levels_kernel(precision),
    )

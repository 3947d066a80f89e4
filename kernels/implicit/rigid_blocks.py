"""Galerkin stiffness of the coarse level with rigid modes, 6 x 6 blocks, and their block-Jacobi inverses.

Of a pair's d_i - d_j coarse vertex I makes D_I (t_I, w_I), D_I = [a 1, -[v]], [v] u = v x u, with a = P_iI - P_jI and
the lever v = P_iI (x_i - c_I) - P_jI (x_j - c_I). So the pair's stiffness S adds D_I^T S D_J to the block K_IJ. A fine
vertex's anchor is a pair of it and the world.
"""

import functools
from typing import Any

import warp as wp

from warp_cloth.kernels.base.block import warp_size
from warp_cloth.kernels.base.reduction import add_in_lane_order
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.elements.stiffness import stiffness_types
from warp_cloth.kernels.implicit.rigid_types import INTERLEAVED, rigid_types
from warp_cloth.kernels.implicit.sparse import sparse_types
from warp_cloth.kernels.math.symmetric import full_matrix, inverse, upper_triangle


@functools.cache
def lever_function(precision: str) -> wp.Function:
    """The function ``lever``: a and v of one coarse vertex for one fine pair."""
    types, CsrMatrix = cloth_types(precision), sparse_types(precision).CsrMatrix
    real, vec3, State, RigidLevel = types.real, types.vec3, types.State, rigid_types(precision).RigidLevel

    @wp.func
    def weight_of(prolongation: CsrMatrix, vertex: int, coarse: int):
        """P_iI."""
        result = real(0.0)
        for entry in range(prolongation.start[vertex], prolongation.start[vertex + 1]):
            if prolongation.column[entry] == coarse:
                result = prolongation.value[entry]
        return result

    @wp.func
    def lever(state: State, level: RigidLevel, first: int, second: int, coarse: int):
        """a = P_iI - P_jI and v = P_iI (x_i - c_I) - P_jI (x_j - c_I) [m]; ``second`` -1: the world, which stays."""
        a = weight_of(level.prolongation, first, coarse)
        v = vec3(state.position[first] - level.centre[coarse]) * a
        if second >= 0:
            b = weight_of(level.prolongation, second, coarse)
            v -= vec3(state.position[second] - level.centre[coarse]) * b
            a -= b
        return a, v

    return lever


@wp.func
def store_quarter(level: Any, entry: int, row: int, column: int, quarter: Any):
    """Stores the 3 x 3 quarter of a block that begins at a row and column."""
    for i in range(3):
        for j in range(3):
            level.block[entry // INTERLEAVED, 6 * (row + i) + column + j, entry % INTERLEAVED] = quarter[i, j]


@functools.cache
def assemble_blocks_kernel(precision: str) -> wp.Kernel:
    types, own, RigidLevel = cloth_types(precision), stiffness_types(precision), rigid_types(precision).RigidLevel
    mat3, vec6, State = own.mat3, own.vec6, types.State
    lever = lever_function(precision)

    @wp.func
    def store_block(level: RigidLevel, entry: int, tt: mat3, tw: mat3, wt: mat3, ww: mat3):
        """Stores the four quarters of a block."""
        store_quarter(level, entry, 0, 0, tt)
        store_quarter(level, entry, 0, 3, tw)
        store_quarter(level, entry, 3, 0, wt)
        store_quarter(level, entry, 3, 3, ww)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def assemble_blocks(
        state: State,
        coupling: wp.array(dtype=vec6),  # of the pairs [N/m], shape [N]
        anchor: wp.array(dtype=vec6),  # of the fine vertices against the world [N/m], shape [V]
        level_out: RigidLevel,
    ):
        """K_IJ = sum of D_I^T S D_J over what adds to a block: quarters tt, tw, wt and ww of (t, w) against (t, w)."""
        block, lane = wp.tid() // warp_size(), wp.tid() % warp_size()
        one, other = level_out.block_ends[block][0], level_out.block_ends[block][1]
        pairs = coupling.shape[0]
        tt, tw, wt, ww = mat3(), mat3(), mat3(), mat3()
        last = level_out.source_start[block + 1]
        for begin in range(level_out.source_start[block], last, warp_size()):
            tt_term, tw_term, wt_term, ww_term = mat3(), mat3(), mat3(), mat3()
            if begin + lane < last:
                source = level_out.source[begin + lane]
                first, second = source - pairs, -1
                if source < pairs:
                    first, second = level_out.pair_ends[source][0], level_out.pair_ends[source][1]
                    s = full_matrix(coupling[source])
                else:
                    s = full_matrix(anchor[first])
                a, v = lever(state, level_out, first, second, one)
                b, w = lever(state, level_out, first, second, other)
                v_s, w_cross = wp.skew(v) * s, wp.skew(w)
                tt_term = s * (a * b)
                tw_term = -(s * w_cross * a)
                wt_term = v_s * b
                ww_term = -(v_s * w_cross)
            count = wp.min(last - begin, warp_size())
            tt = add_in_lane_order(tt, tt_term, count)
            tw = add_in_lane_order(tw, tw_term, count)
            wt = add_in_lane_order(wt, wt_term, count)
            ww = add_in_lane_order(ww, ww_term, count)
        if lane > 0:
            return
        slot = level_out.slot[block]
        store_block(level_out, slot[0], tt, tw, wt, ww)
        if slot[1] >= 0:
            store_block(level_out, slot[1], wp.transpose(tt), wp.transpose(wt), wp.transpose(tw), wp.transpose(ww))

    return assemble_blocks


@functools.cache
def invert_diagonal_kernel(precision: str) -> wp.Kernel:
    mat3, RigidLevel = stiffness_types(precision).mat3, rigid_types(precision).RigidLevel

    @wp.func
    def quarter_of(level: RigidLevel, entry: int, row: int, column: int):
        """The 3 x 3 quarter of a block that begins at a row and column."""
        quarter = mat3()
        for i in range(3):
            for j in range(3):
                quarter[i, j] = level.block[entry // INTERLEAVED, 6 * (row + i) + column + j, entry % INTERLEAVED]
        return quarter

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def invert_diagonal(level_out: RigidLevel):
        """Inverses of each diagonal block's K_tt and of its Schur complement, K_ww - K_tw^T K_tt^-1 K_tw."""
        vertex = wp.tid()
        own = level_out.diagonal[vertex]
        inverse_tt = inverse(upper_triangle(quarter_of(level_out, own, 0, 0)))
        tw = quarter_of(level_out, own, 0, 3)
        level_out.cross[vertex] = tw
        level_out.inverse[vertex, 0] = inverse_tt
        schur = quarter_of(level_out, own, 3, 3) - wp.transpose(tw) * full_matrix(inverse_tt) * tw
        level_out.inverse[vertex, 1] = inverse(upper_triangle(schur))

    return invert_diagonal

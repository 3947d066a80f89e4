"""Memory of the coarse level with rigid modes: who follows whom, its block matrix, and what its solution writes."""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.base.reduction import Chunks
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.elements.stiffness import stiffness_types
from warp_cloth.kernels.implicit.sparse import sparse_types

INTERLEAVED = wp.constant(32)  # blocks stored interleaved, so that a warp's threads read neighbouring numbers


@functools.cache
def rigid_types(precision: str) -> SimpleNamespace:
    """Structs ``RigidLevel`` and ``RigidState``."""
    types, own, CsrMatrix = cloth_types(precision), stiffness_types(precision), sparse_types(precision).CsrMatrix

    @wp.struct
    class RigidLevel:
        """n coarse vertices and the M blocks K_IJ, I <= J, of every two that one fine vertex or pair follows."""

        prolongation: CsrMatrix  # to the fine vertices from these
        restriction: CsrMatrix  # to these from the fine vertices; D entries
        entry_vertex: wp.array(dtype=wp.int32)  # coarse vertex of each entry of ``restriction``, shape [D]
        pair_ends: wp.array(dtype=wp.vec2i)  # of the fine pairs, shape [N]
        centre: wp.array(dtype=types.point)  # c [m], shape [n]
        block_ends: wp.array(dtype=wp.vec2i)  # I and J of a block, shape [M]
        source_start: wp.array(dtype=wp.int32)  # first row of ``source``, shape [M + 1]
        source: wp.array(dtype=wp.int32)  # what adds to a block: fine pairs; from N on, fine vertices by their anchors
        slot: wp.array(dtype=wp.vec2i)  # where the block stands in I's row and in J's, or -1: I is J, shape [M]
        row_start: wp.array(dtype=wp.int32)  # first entry of each vertex's row, shape [n + 1]
        neighbour: wp.array(dtype=wp.int32)  # the other vertex of each entry, shape [E]
        block: wp.array3d(dtype=types.real)  # their 36 numbers row by row, shape [E / INTERLEAVED, 36, INTERLEAVED]
        diagonal: wp.array(dtype=wp.int32)  # entry of a vertex's block with itself, shape [n]
        cross: wp.array(dtype=own.mat3)  # that block's K_tw, translation against rotation, shape [n]
        inverse: wp.array2d(dtype=own.vec6)  # of its K_tt, and of the Schur complement of that, shape [n, 2]
        chunks: Chunks  # of these vertices

    @wp.struct
    class RigidState:
        """What the solution on that level writes."""

        wrench: wp.array2d(dtype=types.vec3)  # force and moment of each entry of ``restriction`` [N, N m], shape [D, 2]
        product_term: wp.array2d(dtype=types.real)  # what each block adds to the product, shape [E, 6]
        residual: wp.array(dtype=types.vec3)  # force and moment left on each vertex [N, N m], shape [2 n]
        correction: wp.array(dtype=types.vec3)  # translation and rotation by its own block [m, 1], shape [2 n]
        direction: wp.array(dtype=types.vec3)
        direction_before: wp.array(dtype=types.vec3)  # the last iteration's; the two are swapped
        product: wp.array(dtype=types.real)  # K direction: force and moment, shape [6 n]
        displacement: wp.array(dtype=types.vec3)  # the solution: translation and rotation [m, 1], shape [2 n]
        rho: wp.array(dtype=wp.float64)  # residual . correction of each chunk [J]
        rho_before: wp.array(dtype=wp.float64)  # the last iteration's; the two are swapped
        curvature: wp.array(dtype=wp.float64)  # direction . product of each chunk [J]
        arrived: wp.array(dtype=wp.int32)  # of ``grid_barrier``, shape [1]
        blocks: int  # thread blocks that solve together

    return SimpleNamespace(RigidLevel=RigidLevel, RigidState=RigidState)

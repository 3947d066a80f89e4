"""A coarse level with rigid modes: each coarse vertex translates and rotates, and wrinkles that follow it move rigidly.

A vertex at x_i follows coarse ones at c_I, d_i = sum_I P_iI (t_I + w_I x (x_i - c_I)), with translations t and
rotations w: the coarse space holds what elasticity hardly resists, its rigid modes, as in smoothed aggregation (Vanek,
Mandel and Brezina, 1996). Translations alone would stretch every wrinkle that they rotate.

Translation and rotation of coarse vertex I are the vectors 2 I and 2 I + 1; so are the force and the moment on it.
"""

import functools

import warp as wp

from warp_cloth.kernels.base.block import block_of, block_threads, lane_of
from warp_cloth.kernels.base.reduction import Chunks, sum_chunk
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.implicit.rigid_types import rigid_types
from warp_cloth.kernels.implicit.system import filtered, system_types


@functools.cache
def place_centres_kernel(precision: str) -> wp.Kernel:
    types, RigidLevel = cloth_types(precision), rigid_types(precision).RigidLevel
    real, point, State = types.real, types.point, types.State

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def place_centres(state: State, level_out: RigidLevel):
        """Centre of a coarse vertex: the weighted mean of what follows it, c_I = sum_i P_iI x_i / sum_i P_iI."""
        vertex = wp.tid()
        sum = point()
        weight = real(0.0)
        for entry in range(level_out.restriction.start[vertex], level_out.restriction.start[vertex + 1]):
            weight += level_out.restriction.value[entry]
            position = state.position[level_out.restriction.column[entry]]
            sum += position * type(sum[0])(level_out.restriction.value[entry])
        level_out.centre[vertex] = sum / type(sum[0])(weight)

    return place_centres


@functools.cache
def restrict_wrenches_kernel(precision: str) -> wp.Kernel:
    types, own = cloth_types(precision), rigid_types(precision)
    vec3, State, RigidLevel, RigidState = types.vec3, types.State, own.RigidLevel, own.RigidState

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def restrict_wrenches(
        state: State,
        level: RigidLevel,
        residual: wp.array(dtype=vec3),  # of the fine vertices [N]
        rigid: RigidState,
    ):
        """Force P_iI r_i and moment (x_i - c_I) x P_iI r_i of each fine vertex on each coarse one that it follows."""
        entry = wp.tid()
        if entry == 0:
            rigid.arrived[0] = 0
        i = level.restriction.column[entry]
        force = residual[i] * level.restriction.value[entry]
        rigid.wrench[entry, 0] = force
        rigid.wrench[entry, 1] = wp.cross(vec3(state.position[i] - level.centre[level.entry_vertex[entry]]), force)

    return restrict_wrenches


@functools.cache
def prolong_motion_kernel(precision: str) -> wp.Kernel:
    types, own, fine = cloth_types(precision), rigid_types(precision), system_types(precision)
    real, vec3, State, RigidLevel, RigidState = types.real, types.vec3, types.State, own.RigidLevel, own.RigidState
    LinearSystem, SolutionState = fine.LinearSystem, fine.SolutionState

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def prolong_motion(
        state: State,
        level: RigidLevel,
        rigid: RigidState,
        weight: real,
        system: LinearSystem,
        chunks: Chunks,  # of the fine vertices
        solution: SolutionState,
        rho_out: wp.array(dtype=wp.float64),  # residual . correction of each chunk [J]
    ):
        """Adds ``weight`` times what each vertex follows to its correction."""
        thread = wp.tid()
        chunk, lane = block_of(thread), lane_of(thread)
        for vertex in range(chunks.first[chunk] + lane, chunks.first[chunk + 1], block_threads()):
            sum = vec3()
            for entry in range(level.prolongation.start[vertex], level.prolongation.start[vertex + 1]):
                i = level.prolongation.column[entry]
                arm = vec3(state.position[vertex] - level.centre[i])
                moved = rigid.displacement[2 * i] + wp.cross(rigid.displacement[2 * i + 1], arm)
                sum += moved * level.prolongation.value[entry]
            constraint = system.constraint[vertex]
            correction = solution.correction[vertex] + filtered(sum, system.normal[vertex], constraint) * weight
            solution.correction[vertex] = correction
            chunks.scratch[vertex] = wp.float64(wp.dot(solution.residual[vertex], correction))
        sum_chunk(chunks, chunk, lane, rho_out)

    return prolong_motion

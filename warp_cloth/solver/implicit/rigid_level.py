"""Coarse level with rigid modes: its choice among the levels, its prolongation, and its correction of a step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.base.compiling import in_blocks
from warp_cloth.base.mesh import Indices
from warp_cloth.base.topology import ragged_rows
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.elements.stiffness import stiffness_types
from warp_cloth.kernels.implicit.rigid_blocks import assemble_blocks_kernel, invert_diagonal_kernel
from warp_cloth.kernels.implicit.rigid_level import (
    place_centres_kernel,
    prolong_motion_kernel,
    restrict_wrenches_kernel,
)
from warp_cloth.kernels.implicit.rigid_solver import solve_rigid_level_kernel
from warp_cloth.kernels.implicit.rigid_types import INTERLEAVED, rigid_types
from warp_cloth.model.model import ClothModel
from warp_cloth.solver.implicit.coarse_levels import Level
from warp_cloth.solver.implicit.sparse import Ints, SparseMatrix, couples, entries_of
from warp_cloth.solver.reduction import in_rows, launch_blocks, launch_rows, split_into_chunks

# Vertices of the level with rigid modes, at most, and as a fraction of all: its iterations count as three of all
# vertices at most.
MOST = 1_500
FRACTION = 0.1
FOLLOWED = 3  # coarse vertices that a vertex is interpolated from, at most; six are hardly better
ITERATIONS = 30  # of conjugate gradients on that level
# Factor on this level's solution in the correction. The corrections of the other levels overlap, so that they are
# scaled by a quarter: that would leave three quarters of this one.
WEIGHT = 4.0
CHUNK = 32  # vertices that a block works on together
SINGLE_CHUNK = 128  # the same where a single block has all vertices and waits for no other
THREADS = 64  # of a block where rows are long and few


def rigid_depth(levels: Sequence[Level], vertices: int) -> int | None:
    """Number of levels down to the one with rigid modes; None: there is none so coarse."""
    for number, level in enumerate(levels, 1):
        if 0 < level.count <= min(MOST, FRACTION * vertices):
            return number
    return None


def prolongation_over(levels: Sequence[Level], vertices: int) -> SparseMatrix:
    """Product of these levels' prolongations, truncated to the FOLLOWED largest weights of each vertex."""
    row = column = np.arange(vertices, dtype=np.int64)
    value = np.ones(vertices)
    for level in levels:
        start, index, weight = (getattr(level.prolongation, name).numpy() for name in ("start", "column", "value"))
        owner, entry = entries_of(start, column)
        key, number = np.unique(row[owner] * level.count + index[entry], return_inverse=True)
        value = np.bincount(number, value[owner] * weight[entry]).astype(np.float64)
        row, column = key // level.count, key % level.count
    whole = np.bincount(row, value, vertices)
    order = np.lexsort((column, -value, row))
    size = np.bincount(row, minlength=vertices)
    rank = np.arange(len(order)) - (np.cumsum(size) - size)[row[order]]
    largest = np.sort(order[(rank < FOLLOWED) & (value[order] > 0.0)])
    row, column, value = row[largest], column[largest], value[largest]
    left = np.bincount(row, value, vertices)
    used, column = np.unique(column, return_inverse=True)
    return SparseMatrix(row, column, value * whole[row] / left[row], (vertices, len(used)))


class RigidCorrection:
    """Owns the level with rigid modes, and solves for a step's residual on it."""

    def __init__(self, model: ClothModel, pairs: Indices, levels: Sequence[Level]) -> None:
        prolongation = prolongation_over(levels, model.vertex_count)
        self._model, self._count = model, prolongation.shape[1]
        precision = model.precision
        self.level = self._build_level(pairs, prolongation)
        self._state = self._build_state()
        self._place_centres = in_blocks(place_centres_kernel(precision), THREADS)
        self._assemble_blocks = in_rows(assemble_blocks_kernel(precision))
        self._invert_diagonal = in_blocks(invert_diagonal_kernel(precision), THREADS)
        self._restrict_wrenches = in_blocks(restrict_wrenches_kernel(precision), THREADS)
        self._solve_rigid_level = solve_rigid_level_kernel(precision)
        self._prolong_motion = prolong_motion_kernel(precision)

    def _zeros(self, shape: Any, dtype: Any) -> wp.array:
        return wp.zeros(shape, dtype=dtype, device=self._model.device)

    def _upload(self, array: NDArray[Any], dtype: Any = wp.int32) -> wp.array:
        return wp.array(np.ascontiguousarray(array, dtype=np.int32), dtype=dtype, device=self._model.device)

    def _build_level(self, pairs: Indices, prolongation: SparseMatrix) -> Any:
        """A kernels.implicit.rigid_types RigidLevel."""
        model, types = self._model, cloth_types(self._model.precision)
        own = stiffness_types(model.precision)
        count = self._count
        level = rigid_types(model.precision).RigidLevel()
        level.prolongation, level.restriction = prolongation.upload(model), prolongation.transposed.upload(model)
        level.entry_vertex = self._upload(np.sort(prolongation.column))
        level.pair_ends = self._upload(pairs, wp.vec2i)
        level.centre = self._zeros(count, types.point)
        one, other, number, source = _block_sources(pairs, prolongation)
        blocks = len(one)
        level.block_ends = self._upload(np.stack([one, other], axis=1), wp.vec2i)
        start, order = ragged_rows(number, blocks)
        level.source_start, level.source = self._upload(start), self._upload(source[order])
        apart = np.flatnonzero(one != other)
        start, order = ragged_rows(np.concatenate([one, other[apart]]), count)
        place = np.argsort(order)
        slot = np.stack([place[:blocks], np.full(blocks, -1)], axis=1)
        slot[apart, 1] = place[blocks:]
        level.row_start, level.slot = self._upload(start), self._upload(slot, wp.vec2i)
        level.neighbour = self._upload(np.concatenate([other, one[apart]])[order])
        level.block = self._zeros((-(-len(order) // INTERLEAVED), 36, INTERLEAVED), types.real)
        level.diagonal = self._upload(slot[one == other, 0])
        level.inverse, level.cross = self._zeros((count, 2), own.vec6), self._zeros(count, own.mat3)
        groups = len(model.vertex_start) - 1
        garment = np.zeros(count, dtype=np.int64)
        garment[prolongation.column] = np.repeat(np.arange(groups), np.diff(model.vertex_start))[prolongation.row]
        size = SINGLE_CHUNK if count <= SINGLE_CHUNK else CHUNK
        level.chunks = split_into_chunks(np.searchsorted(garment, np.arange(groups + 1)), size, model.device)
        return level

    def _build_state(self) -> Any:
        """A kernels.implicit.rigid_types RigidState."""
        count, types = self._count, cloth_types(self._model.precision)
        state = rigid_types(self._model.precision).RigidState()
        for name in ("residual", "correction", "direction", "direction_before", "displacement"):
            setattr(state, name, self._zeros(2 * count, types.vec3))
        state.product = self._zeros(6 * count, types.real)
        state.product_term = self._zeros((len(self.level.neighbour), 6), types.real)
        state.wrench = self._zeros((len(self.level.entry_vertex), 2), types.vec3)
        chunks = len(self.level.chunks.garment)
        for name in ("rho", "rho_before", "curvature"):
            setattr(state, name, self._zeros(chunks, wp.float64))
        state.arrived = self._zeros(1, wp.int32)
        device = wp.get_device(self._model.device)
        state.blocks = min(chunks, device.sm_count) if device.is_cuda else 1
        return state

    def kernels(self) -> list[wp.Kernel]:
        """The kernels of this level."""
        renewal = [self._place_centres, self._assemble_blocks, self._invert_diagonal]
        return [*renewal, self._restrict_wrenches, self._solve_rigid_level, self._prolong_motion]

    def renew(self, coupling: wp.array, anchor: wp.array) -> None:
        """Assembles its stiffness from the pairs' coupling and the vertices' anchors, both vec6 [N/m]."""
        state, level, device = self._model.state, self.level, self._model.device
        self._launch(self._place_centres, self._count, [state, level])
        launch_rows(self._assemble_blocks, len(level.block_ends), [state, coupling, anchor, level], device)
        self._launch(self._invert_diagonal, self._count, [level])

    def correct(
        self,
        system: Any,
        solution: Any,
        chunks: Any,
        rho: wp.array,
        *,
        weight: float = WEIGHT,
        iterations: int = ITERATIONS,
    ) -> None:
        """Adds the coarse solution for the residual to a solution's correction.

        Args:
            system: a kernels.implicit.system LinearSystem.
            solution: its SolutionState.
            chunks: of its vertices (kernels.base.reduction).
            rho: residual . correction of each chunk [J], written.
            weight: factor on this level's solution.
            iterations: of conjugate gradients.
        """
        state, level, rigid, device = self._model.state, self.level, self._state, self._model.device
        inputs = [state, level, solution.residual, rigid]
        self._launch(self._restrict_wrenches, len(level.entry_vertex), inputs)
        launch_blocks(self._solve_rigid_level, rigid.blocks, [level, rigid, iterations], device)
        inputs = [state, level, rigid, weight, system, chunks, solution, rho]
        launch_blocks(self._prolong_motion, len(chunks.garment), inputs, device)

    def _launch(self, kernel: wp.Kernel, size: int, inputs: list[Any]) -> None:
        wp.launch(kernel, dim=size, inputs=inputs, device=self._model.device, block_dim=THREADS)


def _block_sources(pairs: Indices, prolongation: SparseMatrix) -> tuple[Ints, Ints, Ints, Ints]:
    """Blocks I <= J of coarse vertices, and the sources of each: pairs, and after them vertices (their anchors).

    Returns:
        I and J of each block, shape [M]; then of each source its block and its number, shape [S].
    """
    vertices, count = prolongation.shape
    start, order = ragged_rows(prolongation.row, vertices)
    ends = np.concatenate([pairs.astype(np.int64), np.repeat(np.arange(vertices)[:, None], 2, axis=1)])
    owner, entry = entries_of(start, ends.ravel())
    key = np.unique(owner // 2 * count + prolongation.column[order][entry])
    member, coarse = key // count, key % count
    left, right = couples(member, equal=True)
    block, number = np.unique(coarse[left] * count + coarse[right], return_inverse=True)
    return block // count, block % count, number, member[left]

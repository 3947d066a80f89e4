"""Multilevel preconditioner of a model: memory and renewal of its coarse levels, corrections."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import warp as wp

from warp_cloth.base.compiling import in_blocks
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.elements.stiffness import stiffness_types
from warp_cloth.kernels.implicit.coarse_levels import COARSEST_THREADS, coarse_level_kernels
from warp_cloth.kernels.implicit.conjugate_gradient import precondition_residual_kernel
from warp_cloth.kernels.implicit.sparse import sparse_types
from warp_cloth.model.model import ClothModel
from warp_cloth.solver.implicit.coarse_levels import Level, join_levels
from warp_cloth.solver.reduction import in_rows, launch_blocks, launch_rows

# Vertices of a level that a single block works on along with all levels below: each launch takes as long.
SMALL = 512


class Preconditioner:
    """Owns the coarse levels' arrays; z = B r by kernels.implicit.coarse_levels."""

    def __init__(self, model: ClothModel, levels: Sequence[Level], pair: wp.array, anchor: wp.array) -> None:
        """``pair`` and ``anchor`` are the model's own couplings and anchors, as vec6 [N/m]."""
        types, own = cloth_types(model.precision), stiffness_types(model.precision)
        self._model, self._levels = model, levels
        self._pair = [pair, *(self._zeros(level.pair_count, own.vec6) for level in levels)]
        self._anchor = [anchor, *(self._zeros(level.count, own.vec6) for level in levels)]
        self.block = [self._zeros(level.count, own.vec6) for level in levels]  # of coarse vertices [N/m]
        self._large = sum(level.count > SMALL for level in levels)
        self._small = join_levels(levels[self._large :], model) if self._large < len(levels) else None
        self._inverse, self._small_inverse = self._of_levels(own.vec6)
        self._residual, self._small_residual = self._of_levels(types.vec3)
        self._correction, self._small_correction = self._of_levels(types.vec3)
        self._no_rows = sparse_types(model.precision).CsrMatrix()
        self._kernels = kernels = coarse_level_kernels(model.precision)
        for kernel in (kernels.coarsen_stiffness, kernels.coarsen_anchors, kernels.restrict_residual):
            in_rows(kernel)
        in_blocks(kernels.correct_coarsest_levels, COARSEST_THREADS)
        self._precondition_residual = precondition_residual_kernel(model.precision)

    def _zeros(self, shape: Any, dtype: Any) -> wp.array:
        return wp.zeros(shape, dtype=dtype, device=self._model.device)

    def _of_levels(self, dtype: Any) -> tuple[list[wp.array], wp.array]:
        """Arrays of the coarse vertices, level by level; and those of small levels as a single array."""
        start = np.cumsum([0, *(level.count for level in self._levels)]).tolist()
        whole = self._zeros(start[-1], dtype)
        levels = [whole[first:last] for first, last in pairwise(start)]
        return levels, whole[start[self._large] :] if self._small is not None else None

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that it launches."""
        return [*(vars(self._kernels).values() if self._levels else ()), self._precondition_residual]

    def coarsen_stiffness(self) -> None:
        """Sums the coarse levels' couplings and blocks from the model's couplings."""
        kernel = self._kernels.coarsen_stiffness
        for number, level in enumerate(self._levels):
            finer, pair = self._pair[number : number + 2]
            self._launch_rows(kernel, level.pair_count, [level.pairs, finer, pair])
            self._launch_rows(kernel, level.count, [level.blocks, pair, self.block[number]])

    def coarsen_anchors(self, *, lumped: bool) -> None:
        """Sums the coarse levels' anchors, and inverts their blocks; ``lumped``: in full, from the second level on."""
        for number, level in enumerate(self._levels):
            finer, anchor = self._anchor[number : number + 2]
            inputs = [level.restriction, lumped and number > 0, finer, self.block[number]]
            written = [anchor, self._inverse[number]]
            self._launch_rows(self._kernels.coarsen_anchors, level.count, [*inputs, *written])

    def launch(self, system: Any, chunks: Any, solution: Any, rho: wp.array) -> None:
        """z = B r of a solution, and rho = r . z [J] of each chunk."""
        large, kernels = self._large, self._kernels
        finer = solution.residual
        for level, residual in zip(self._levels[: large + 1], self._residual, strict=False):
            self._launch_rows(kernels.restrict_residual, level.count, [level.restriction, finer, residual])
            finer = residual
        prolongation, coarser = self._no_rows, None
        small = self._small
        if small is not None:
            inputs = [small.first, small.restriction, small.prolongation, self._small_inverse]
            written = [self._small_residual, self._small_correction]
            kernel = kernels.correct_coarsest_levels
            launch_blocks(kernel, 1, [*inputs, *written], self._model.device, COARSEST_THREADS)
            prolongation, coarser = self._levels[large].prolongation, self._correction[large]
        for number in range(large - 1, -1, -1):
            level, correction = self._levels[number], self._correction[number]
            inputs = [prolongation, self._inverse[number], self._residual[number], coarser, correction]
            wp.launch(kernels.prolong_correction, dim=level.count, inputs=inputs, device=self._model.device)
            prolongation, coarser = level.prolongation, correction
        inputs = [system, chunks, prolongation, coarser, solution, rho]
        launch_blocks(self._precondition_residual, len(chunks.garment), inputs, self._model.device)

    def _launch_rows(self, kernel: wp.Kernel, rows: int, inputs: list[Any]) -> None:
        launch_rows(kernel, rows, inputs, self._model.device)

"""A coarse level whose vertices turn: who follows whom there, and its part of an implicit step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices
from warp_cloth.base.topology import ragged_rows
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.elements.stiffness import stiffness_types
from warp_cloth.kernels.implicit.rigid_level import TOGETHER, block_kernels, turn_kernels, turn_types
from warp_cloth.model.model import ClothModel
from warp_cloth.solver.implicit.coarse_levels import Level, Sparse, rows_of, transposed
from warp_cloth.solver.reduction import launch_blocks, launch_rows, split

# Vertices of the level that turns, at most, and as a share of all: its rounds count as three of all vertices at most.
MOST = 1_500
SHARE = 0.1
FOLLOWED = 3  # coarse vertices that one follows, at most: with six, a step takes hardly more of a displacement
ROUNDS = 30  # of conjugate gradients on that level
# What solves the residual there counts so many times in the correction. The other levels' parts overlap, and a step as
# long as suits them, a quarter, would leave three quarters of it.
WEIGHT = 4.0
PART = 32  # vertices that a block works on at a time
ALONE = 128  # or so many, where a single block does and waits for no other
SPREAD = 64  # threads of a block where rows are long and few


def turning_level(levels: Sequence[Level], vertices: int) -> int | None:
    """Number of levels down to the one that turns; None: there is none so coarse."""
    for number, level in enumerate(levels, 1):
        if 0 < level.count <= min(MOST, SHARE * vertices):
            return number
    return None


def followed(levels: Sequence[Level], vertices: int) -> Sparse:
    """How vertices follow those of the last of these levels that any do, each no more than FOLLOWED."""
    row = column = np.arange(vertices, dtype=np.int64)
    value = np.ones(vertices)
    for level in levels:
        start, index, weight = (getattr(level.up, name).numpy() for name in ("start", "index", "weight"))
        size = np.diff(start)[column]
        entry = np.arange(size.sum()) + np.repeat(start[column] - (np.cumsum(size) - size), size)
        value = np.repeat(value, size) * weight[entry]
        key, number = np.unique(np.repeat(row, size) * level.count + index[entry], return_inverse=True)
        row, column, value = key // level.count, key % level.count, np.bincount(number, value).astype(np.float64)
    whole = np.bincount(row, value, vertices)
    order = np.lexsort((column, -value, row))
    size = np.bincount(row, minlength=vertices)
    rank = np.arange(len(order)) - (np.cumsum(size) - size)[row[order]]
    kept = np.sort(order[(rank < FOLLOWED) & (value[order] > 0.0)])
    row, column, value = row[kept], column[kept], value[kept]
    left = np.bincount(row, value, vertices)
    used, column = np.unique(column, return_inverse=True)
    return Sparse(row, column, value * whole[row] / left[row], (vertices, len(used)))


def joined(owner: NDArray[np.int64], item: NDArray[np.int64]) -> tuple[NDArray[np.int64], ...]:
    """Every two items a <= b of one owner: the owner, a and b. Owners come in order, and their items, too."""
    size = np.bincount(owner)
    first = np.cumsum(size) - size
    left = np.repeat(np.arange(len(owner)), size[owner])
    right = np.arange(len(left)) - np.repeat(np.cumsum(size[owner]) - size[owner], size[owner]) + first[owner[left]]
    kept = left <= right
    return owner[left[kept]], item[left[kept]], item[right[kept]]


class Turning:
    """Owns the level that turns and solves on it what is left of a step's forces."""

    def __init__(self, model: ClothModel, pairs: Indices, levels: Sequence[Level]) -> None:
        follow = followed(levels, model.vertex_count)
        self._model, self._count = model, follow.shape[1]
        self.turns = self._make_turns(pairs, follow)
        self._gathers, self._kernels = block_kernels(model.precision), turn_kernels(model.precision)

    def _zeros(self, shape: Any, dtype: Any) -> wp.array:
        return wp.zeros(shape, dtype=dtype, device=self._model.device)

    def _upload(self, array: NDArray[Any], dtype: Any = wp.int32) -> wp.array:
        return wp.array(np.ascontiguousarray(array, dtype=np.int32), dtype=dtype, device=self._model.device)

    def _make_turns(self, pairs: Indices, follow: Sparse) -> Any:
        model, own = self._model, stiffness_types(self._model.precision)
        types = cloth_types(model.precision)
        vertices, count = follow.shape
        turns = turn_types(model.precision).Turns()
        turns.up, turns.down = rows_of(follow, model), rows_of(transposed(follow), model)
        turns.ends = self._upload(pairs, wp.vec2i)
        turns.centre = self._zeros(count, types.point)
        # pairs, and after them vertices, each with all coarse ones that they follow
        start, order = ragged_rows(follow.row, vertices)
        ends = np.concatenate([pairs.astype(np.int64), np.repeat(np.arange(vertices)[:, None], 2, axis=1)])
        size = np.diff(start)[ends.ravel()]
        entry = np.arange(size.sum()) + np.repeat(start[ends.ravel()] - (np.cumsum(size) - size), size)
        key = np.unique(np.repeat(np.arange(len(ends)), 2).repeat(size) * count + follow.column[order][entry])
        member, one, other = joined(key // count, key % count)
        block, number = np.unique(one * count + other, return_inverse=True)
        one, other = block // count, block % count
        turns.two = self._upload(np.stack([one, other], axis=1), wp.vec2i)
        start, order = ragged_rows(number, len(block))
        turns.member_start, turns.member = self._upload(start), self._upload(member[order])
        apart = np.flatnonzero(one != other)
        start, order = ragged_rows(np.concatenate([one, other[apart]]), count)
        place = np.argsort(order)
        slot = np.stack([place[: len(block)], np.full(len(block), -1)], axis=1)
        slot[apart, 1] = place[len(block) :]
        turns.start, turns.slot = self._upload(start), self._upload(slot, wp.vec2i)
        turns.beside = self._upload(np.concatenate([other, one[apart]])[order])
        turns.block = self._zeros((-(-len(order) // TOGETHER), 36, TOGETHER), types.real)
        turns.diagonal = self._upload(slot[one == other, 0])
        turns.divisor, turns.right = self._zeros((count, 2), own.vec6), self._zeros(count, own.mat3)
        self._make_solution(turns, follow)
        return turns

    def _make_solution(self, turns: Any, follow: Sparse) -> None:
        """What conjugate gradients need there."""
        model, count, types = self._model, self._count, cloth_types(self._model.precision)
        groups = len(model.vertex_start) - 1
        garment = np.zeros(count, dtype=np.int64)
        garment[follow.column] = np.repeat(np.arange(groups), np.diff(model.vertex_start))[follow.row]
        turns.parts = split(
            np.searchsorted(garment, np.arange(groups + 1)), ALONE if count <= ALONE else PART, model.device
        )
        parts = len(turns.parts.garment)
        for name in ("residual", "correction", "direction", "other", "displacement"):
            setattr(turns, name, self._zeros(2 * count, types.vec3))
        turns.product, turns.term = self._zeros(6 * count, types.real), self._zeros((len(turns.beside), 6), types.real)
        turns.owner = self._upload(np.sort(follow.column))
        turns.pull = self._zeros((len(follow.column), 2), types.vec3)
        for name in ("along", "before", "across"):
            setattr(turns, name, self._zeros(parts, wp.float64))
        turns.came = self._zeros(1, wp.int32)
        device = wp.get_device(model.device)
        self._blocks = min(parts, device.sm_count) if device.is_cuda else 1

    def kernels(self) -> list[wp.Kernel]:
        """The kernels of its own that it launches."""
        return [*vars(self._gathers).values(), *vars(self._kernels).values()]

    def renew(self, coupling: wp.array, anchor: wp.array) -> None:
        """Sums its stiffness anew: of the model's pairs, and of what holds its vertices, both as vec6 [N/m]."""
        state, turns = self._model.state, self.turns
        self._launch(self._gathers.find_centres, self._count, [state, turns])
        launch_rows(self._gathers.gather_turns, len(turns.two), [state, coupling, anchor, turns], self._model.device)
        self._launch(self._gathers.divide_turns, self._count, [turns])

    def correct(
        self, system: Any, parts: Any, along: wp.array, *, weight: float = WEIGHT, rounds: int = ROUNDS
    ) -> None:
        """Adds to a system's correction what solves its residual on this level.

        Args:
            system: a kernels.implicit.conjugate_gradient System.
            parts: its vertices' (kernels.base.reduction).
            along: residual . correction of each part [J], written.
            weight: times this level's solution.
            rounds: of conjugate gradients.
        """
        state, turns, kernels, device = self._model.state, self.turns, self._kernels, self._model.device
        self._launch(kernels.pull_turns, len(turns.owner), [state, turns, system.residual])
        launch_blocks(kernels.solve_turns, self._blocks, [turns, rounds, self._blocks], device)
        inputs = [state, weight, turns, system, parts, along]
        launch_blocks(kernels.follow_turns, len(parts.garment), inputs, device)

    def _launch(self, kernel: wp.Kernel, size: int, inputs: list[Any]) -> None:
        wp.launch(kernel, dim=size, inputs=inputs, device=self._model.device, block_dim=SPREAD)

"""A coarse level whose vertices turn (kernels.turns): who follows whom there, and its part of an implicit step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.kernels.cloth import cloth_types
from warp_cloth.kernels.conjugate import conjugate_types, dot_kernels
from warp_cloth.kernels.stiffness import stiffness_types
from warp_cloth.kernels.turns import block_kernels, turn_kernels, turn_types
from warp_cloth.mesh import Indices
from warp_cloth.model import ClothModel
from warp_cloth.solver.hierarchy import Level, Sparse, rows_of, transposed
from warp_cloth.topology import ragged_rows

# Vertices of the level that turns, at most, and as a share of all: its rounds count as three of all vertices at most.
MOST = 1_500
SHARE = 0.1
FOLLOWED = 3  # coarse vertices that one follows, at most: with six, a step takes hardly more of a displacement
ROUNDS = 30  # of conjugate gradients on that level
# What solves the residual there counts so many times in the correction. The other levels' parts overlap, and a step as
# long as suits them, a quarter, would leave three quarters of it.
WEIGHT = 4.0
PARTS = 64  # of a garment's sums


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
        self._system, self._first = self._make_system(follow)
        groups = len(model.vertex_start) - 1
        self._parts = [self._zeros((groups, PARTS), wp.float64) for _ in range(3)]
        self._blocks, self._kernels = block_kernels(model.precision), turn_kernels(model.precision)
        self._dot_parts = dot_kernels(model.precision).dot_parts

    def _zeros(self, shape: Any, dtype: Any) -> wp.array:
        return wp.zeros(shape, dtype=dtype, device=self._model.device)

    def _upload(self, array: NDArray[Any], dtype: Any = wp.int32) -> wp.array:
        return wp.array(np.ascontiguousarray(array, dtype=np.int32), dtype=dtype, device=self._model.device)

    def _make_system(self, follow: Sparse) -> tuple[Any, wp.array]:
        """What conjugate gradients need there, and the first vector of each garment."""
        model = self._model
        groups = len(model.vertex_start) - 1
        garment = np.zeros(self._count, dtype=np.int64)
        garment[follow.column] = np.repeat(np.arange(groups), np.diff(model.vertex_start))[follow.row]
        system = conjugate_types(model.precision).System()
        system.garment = self._upload(np.repeat(garment, 2))
        for name in ("residual", "correction", "direction", "product", "displacement"):
            setattr(system, name, self._zeros(2 * self._count, cloth_types(model.precision).vec3))
        return system, self._upload(2 * np.searchsorted(garment, np.arange(groups + 1)))

    def _make_turns(self, pairs: Indices, follow: Sparse) -> Any:
        model, own = self._model, stiffness_types(self._model.precision)
        vertices, count = follow.shape
        turns = turn_types(model.precision).Turns()
        turns.up, turns.down = rows_of(follow, model), rows_of(transposed(follow), model)
        turns.ends = self._upload(pairs, wp.vec2i)
        turns.centre = self._zeros(count, cloth_types(model.precision).point)
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
        turns.block = self._zeros((len(block), 4), own.mat3)
        apart = np.flatnonzero(one != other)
        slot = np.concatenate([2 * np.arange(len(block)), 2 * apart + 1])
        start, order = ragged_rows(np.concatenate([one, other[apart]]), count)
        turns.start, turns.slot = self._upload(start), self._upload(slot[order])
        turns.diagonal = self._upload(np.flatnonzero(one == other))
        turns.divisor = self._zeros((count, 2), own.vec6)
        return turns

    def kernels(self) -> list[wp.Kernel]:
        """The kernels of its own that it launches."""
        return [*vars(self._blocks).values(), *vars(self._kernels).values()]

    def renew(self, coupling: wp.array, anchor: wp.array) -> None:
        """Sums its stiffness anew: of the model's pairs, and of what holds its vertices, both as vec6 [N/m]."""
        cloth, turns = self._model.cloth, self.turns
        self._launch(self._blocks.find_centres, self._count, [cloth, turns])
        self._launch(self._blocks.gather_turns, len(turns.two), [cloth, coupling, anchor, turns])
        self._launch(self._blocks.divide_turns, self._count, [turns])

    def correct(self, system: Any, weight: float = WEIGHT, rounds: int = ROUNDS) -> None:
        """Adds to a system's correction what solves its residual on this level."""
        cloth, turns, own, kernels = self._model.cloth, self.turns, self._system, self._kernels
        self._launch(kernels.begin_turns, self._count, [cloth, turns, system.residual, own])
        before = None
        for number in range(rounds):
            along = self._dot(own.residual, own.correction, number % 2)
            self._launch(kernels.lead_turns, 2 * self._count, [along, before, own])
            self._launch(kernels.multiply_turns, self._count, [turns, own])
            across = self._dot(own.direction, own.product, 2)
            self._launch(kernels.advance_turns, self._count, [along, across, turns, own])
            before = along
        self._launch(kernels.follow_turns, self._model.vertex_count, [weight, cloth, turns, own, system])

    def _dot(self, a: wp.array, b: wp.array, which: int) -> wp.array:
        part = self._parts[which]
        self._launch(self._dot_parts, part.shape, [self._first, a, b, part])
        return part

    def _launch(self, kernel: wp.Kernel, size: Any, inputs: list[Any]) -> None:
        wp.launch(kernel, dim=size, inputs=inputs, device=self._model.device)

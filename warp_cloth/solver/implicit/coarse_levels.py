"""Coarser levels of a model: who follows whom, and how pairs of fine vertices couple coarse ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices
from warp_cloth.base.topology import ragged_rows
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.implicit.coarse_levels import level_types
from warp_cloth.model.model import ClothModel
from warp_cloth.solver.implicit.coarse_garments import Ladder

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

SMALLEST = 1e-4  # weights below this share couple nothing worth the reading


@dataclass(frozen=True, eq=False)
class Sparse:
    """A sparse matrix: row, column and value of each entry, by rows."""

    row: Ints
    column: Ints
    value: Floats
    shape: tuple[int, int]


@dataclass(frozen=True, eq=False)
class Level:
    """A coarser level on the device."""

    count: int
    up: Any  # Rows: finer vertices from these
    down: Any  # Rows: these from finer vertices
    pairs: Any  # Rows: couplings of these from couplings of finer ones
    pair_count: int
    blocks: Any  # Rows: each vertex's block from the couplings


@dataclass(frozen=True, eq=False)
class Coarsest:
    """The coarsest levels one after another, each vertex numbered on from the last level's."""

    start: wp.array  # first vertex of each level, and the end
    down: Any  # Rows: vertices from the level before; of the first level empty
    up: Any  # Rows: vertices from the level after


def build_hierarchy(model: ClothModel, ladders: Sequence[Ladder], pairs: Indices) -> list[Level]:
    """Coarser levels of all garments, finest first. ``pairs`` [N, 2] are the model's own."""
    counts = [len(ladder.part.points) for ladder in ladders]
    chains = [_chain(ladder) for ladder in ladders]
    levels = []
    for depth in range(max(len(chain) for chain in chains)):
        # a garment without further levels has no coarse vertices there, and follows nothing
        follows = [
            chain[depth] if depth < len(chain) else _nothing(count) for chain, count in zip(chains, counts, strict=True)
        ]
        counts = [follow.shape[1] for follow in follows]
        level, pairs = coarse_level(pairs, _side_by_side(follows), model)
        levels.append(level)
    return levels


def coarsest(levels: Sequence[Level], model: ClothModel) -> Coarsest:
    """These levels, of which each is the next one's finer."""
    start = np.cumsum([0, *(level.count for level in levels)])
    down, up = [_empty(start[-1])], [_empty(start[-1])]
    for number, level in enumerate(levels[1:], 1):
        down.append(_shifted(level.down, start[number], start[number - 1], start[-1]))
        up.append(_shifted(level.up, start[number - 1], start[number], start[-1]))
    numbers = wp.array(start, dtype=wp.int32, device=model.device)
    return Coarsest(numbers, rows_of(_added(down), model), rows_of(_added(up), model))


def _empty(count: int) -> Sparse:
    none = np.zeros(0, dtype=np.int64)
    return Sparse(none, none, np.zeros(0), (count, count))


def _shifted(rows: Any, row: int, column: int, count: int) -> Sparse:
    """Rows on the device, as part of a larger square matrix from this row and column on."""
    start, index, weight = (getattr(rows, name).numpy() for name in ("start", "index", "weight"))
    owner = np.repeat(np.arange(len(start) - 1), np.diff(start))
    return Sparse(owner + row, index.astype(np.int64) + column, weight, (count, count))


def _added(matrices: Sequence[Sparse]) -> Sparse:
    """Matrices of one shape whose entries lie in different places, in order."""
    row, column, value = (
        np.concatenate([getattr(one, name) for one in matrices]) for name in ("row", "column", "value")
    )
    return Sparse(row, column, value, matrices[0].shape)


def _chain(ladder: Ladder) -> list[Sparse]:
    """How one garment's free vertices follow fewer ones, those fewer still, and so on."""
    chain = []
    cloth = ladder.pattern
    for found in ladder.rungs:
        if cloth is None:
            break
        row = np.repeat(np.arange(len(cloth.pinned)), np.diff(found.start))
        free = ~cloth.pinned[row] & ~found.cloth.pinned[found.index] & (np.abs(found.weight) > SMALLEST)
        shape = (len(cloth.pinned), len(found.kept))
        chain.append(Sparse(row[free], found.index[free].astype(np.int64), found.weight[free], shape))
        cloth = found.cloth
    return chain


def _nothing(count: int) -> Sparse:
    none = np.zeros(0, dtype=np.int64)
    return Sparse(none, none, np.zeros(0), (count, 0))


def _side_by_side(matrices: Sequence[Sparse]) -> Sparse:
    """One matrix with these along its diagonal."""
    rows = np.cumsum([0, *(matrix.shape[0] for matrix in matrices)])
    columns = np.cumsum([0, *(matrix.shape[1] for matrix in matrices)])
    return Sparse(
        np.concatenate([matrix.row + first for matrix, first in zip(matrices, rows, strict=False)]),
        np.concatenate([matrix.column + first for matrix, first in zip(matrices, columns, strict=False)]),
        np.concatenate([matrix.value for matrix in matrices]),
        (int(rows[-1]), int(columns[-1])),
    )


def rows_of(matrix: Sparse, model: ClothModel) -> Any:
    """The matrix on the model's device."""
    start, order = ragged_rows(matrix.row, matrix.shape[0])
    rows = level_types(model.precision).Rows()
    rows.start = wp.array(start, dtype=wp.int32, device=model.device)
    rows.index = wp.array(matrix.column[order].astype(np.int32), dtype=wp.int32, device=model.device)
    rows.weight = wp.array(matrix.value[order], dtype=cloth_types(model.precision).real, device=model.device)
    return rows


def transposed(matrix: Sparse) -> Sparse:
    order = np.argsort(matrix.column, kind="stable")
    return Sparse(matrix.column[order], matrix.row[order], matrix.value[order], matrix.shape[::-1])


def coarse_level(finer_pairs: Indices, follow: Sparse, model: ClothModel) -> tuple[Level, Indices]:
    """A level from how finer vertices follow its own, and its own pairs.

    ``finer_pairs`` [N, 2] may name one vertex more than there are, the world, which what is pinned follows.
    """
    coarse = follow.shape[1]
    pair, vertex, change = _changes(finer_pairs, follow)
    # every two coarse vertices that a fine pair pulls apart
    size = np.bincount(pair, minlength=len(finer_pairs))
    first = (np.cumsum(size) - size)[pair]
    left = np.repeat(np.arange(len(pair)), size[pair])
    right = np.arange(len(left)) - np.repeat(np.cumsum(size[pair]) - size[pair], size[pair]) + first[left]
    kept = left < right
    left, right = left[kept], right[kept]
    unique, number = np.unique(vertex[left] * (coarse + 1) + vertex[right], return_inverse=True)
    pairs = np.stack([unique // (coarse + 1), unique % (coarse + 1)], axis=1)
    to_pairs = Sparse(number, pair[left], -change[left] * change[right], (len(pairs), len(finer_pairs)))
    ends = pairs.ravel()
    own = np.flatnonzero(ends < coarse)
    to_blocks = Sparse(ends[own], own // 2, np.ones(len(own)), (coarse, len(pairs)))
    level = Level(
        count=coarse,
        up=rows_of(follow, model),
        down=rows_of(transposed(follow), model),
        pairs=rows_of(to_pairs, model),
        pair_count=len(pairs),
        blocks=rows_of(to_blocks, model),
    )
    return level, pairs.astype(np.int32)


def _changes(pairs: Indices, follow: Sparse) -> tuple[Ints, Ints, Floats]:
    """What each coarse vertex does to each fine pair, P_iI - P_jI: the pair, the coarse vertex, the value, in order."""
    fine, coarse = follow.shape
    world = 1.0 - np.bincount(follow.row, follow.value, fine)
    tied = np.flatnonzero(np.abs(world) > SMALLEST)
    row = np.concatenate([follow.row, tied, [fine]])
    order = np.argsort(row, kind="stable")
    column = np.concatenate([follow.column, np.full(len(tied), coarse), [coarse]])[order]
    value = np.concatenate([follow.value, world[tied], [1.0]])[order]
    start = np.searchsorted(row[order], np.arange(fine + 2))
    ends = pairs.astype(np.int64).ravel()
    count = start[ends + 1] - start[ends]
    owner = np.repeat(np.arange(len(ends)), count)
    at = np.arange(len(owner)) - (np.cumsum(count) - count)[owner] + start[ends][owner]
    key = owner // 2 * (coarse + 1) + column[at]
    unique, number = np.unique(key, return_inverse=True)
    change = np.bincount(number, np.where(owner % 2 == 0, value[at], -value[at]), len(unique)).astype(np.float64)
    used = np.abs(change) > SMALLEST
    return unique[used] // (coarse + 1), unique[used] % (coarse + 1), change[used]

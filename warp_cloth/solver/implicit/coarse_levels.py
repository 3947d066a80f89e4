"""Coarse levels of a model for the preconditioner: prolongations, and Galerkin's couplings of coarse vertices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from warp_cloth.base.mesh import Indices
from warp_cloth.model.model import ClothModel
from warp_cloth.solver.implicit.coarse_garments import Hierarchy
from warp_cloth.solver.implicit.sparse import (
    Floats,
    Ints,
    SparseMatrix,
    block_diagonal,
    couples,
    empty_matrix,
    entries_of,
    merged,
    placed,
)

SMALLEST = 1e-4  # weights below this couple nothing worth reading


@dataclass(frozen=True, eq=False)
class Level:
    """A coarse level on the device; matrices are kernels.implicit.sparse CsrMatrix."""

    count: int  # of its vertices
    prolongation: Any  # P: to the finer vertices from these
    restriction: Any  # P^T: to these from the finer vertices
    pairs: Any  # to couplings of these from couplings of finer ones
    pair_count: int
    blocks: Any  # to each vertex's block from the couplings


@dataclass(frozen=True, eq=False)
class CoarsestLevels:
    """The coarsest levels one after another, their vertices numbered through."""

    first: wp.array  # vertex of each level, and the vertex count
    restriction: Any  # from the level before; empty for the first level
    prolongation: Any  # from the level after


def build_levels(model: ClothModel, hierarchies: Sequence[Hierarchy], pairs: Indices) -> list[Level]:
    """Coarse levels of all garments, finest first. ``pairs`` [N, 2] are the model's own."""
    counts = [len(hierarchy.garment.points) for hierarchy in hierarchies]
    chains = [_prolongations(hierarchy) for hierarchy in hierarchies]
    levels = []
    for depth in range(max(len(chain) for chain in chains)):
        # a garment without further levels has no coarse vertices there, and follows nothing
        prolongations = [
            chain[depth] if depth < len(chain) else empty_matrix(count, 0)
            for chain, count in zip(chains, counts, strict=True)
        ]
        counts = [prolongation.shape[1] for prolongation in prolongations]
        level, pairs = coarse_level(pairs, block_diagonal(prolongations), model)
        levels.append(level)
    return levels


def join_levels(levels: Sequence[Level], model: ClothModel) -> CoarsestLevels:
    """Successive levels as one."""
    first = np.cumsum([0, *(level.count for level in levels)])
    size = first[-1]
    restriction, prolongation = [empty_matrix(size, size)], [empty_matrix(size, size)]
    for number, level in enumerate(levels[1:], 1):
        restriction.append(placed(level.restriction, first[number], first[number - 1], size))
        prolongation.append(placed(level.prolongation, first[number - 1], first[number], size))
    numbers = wp.array(first, dtype=wp.int32, device=model.device)
    return CoarsestLevels(numbers, merged(restriction).upload(model), merged(prolongation).upload(model))


def _prolongations(hierarchy: Hierarchy) -> list[SparseMatrix]:
    """How one garment's free vertices follow fewer ones, those fewer still, and so on."""
    chain = []
    cloth = hierarchy.pattern
    for coarsening in hierarchy.coarsenings:
        if cloth is None:
            break
        row = np.repeat(np.arange(len(cloth.pinned)), np.diff(coarsening.start))
        free = ~cloth.pinned[row] & ~coarsening.cloth.pinned[coarsening.index] & (np.abs(coarsening.weight) > SMALLEST)
        shape = (len(cloth.pinned), len(coarsening.fine_vertex))
        chain.append(SparseMatrix(row[free], coarsening.index[free].astype(np.int64), coarsening.weight[free], shape))
        cloth = coarsening.cloth
    return chain


def coarse_level(finer_pairs: Indices, prolongation: SparseMatrix, model: ClothModel) -> tuple[Level, Indices]:
    """A level from its prolongation, and its own pairs (kernels.implicit.coarse_levels has the formula).

    ``finer_pairs`` [N, 2] may name one vertex more than there are, the world, which what is pinned follows.
    """
    coarse = prolongation.shape[1]
    pair, vertex, change = _changes(finer_pairs, prolongation)
    # every two coarse vertices that a fine pair pulls apart
    left, right = couples(pair, equal=False)
    unique, number = np.unique(vertex[left] * (coarse + 1) + vertex[right], return_inverse=True)
    pairs = np.stack([unique // (coarse + 1), unique % (coarse + 1)], axis=1)
    to_pairs = SparseMatrix(number, pair[left], -change[left] * change[right], (len(pairs), len(finer_pairs)))
    ends = pairs.ravel()
    own = np.flatnonzero(ends < coarse)
    to_blocks = SparseMatrix(ends[own], own // 2, np.ones(len(own)), (coarse, len(pairs)))
    level = Level(
        count=coarse,
        prolongation=prolongation.upload(model),
        restriction=prolongation.transposed.upload(model),
        pairs=to_pairs.upload(model),
        pair_count=len(pairs),
        blocks=to_blocks.upload(model),
    )
    return level, pairs.astype(np.int32)


def _changes(pairs: Indices, prolongation: SparseMatrix) -> tuple[Ints, Ints, Floats]:
    """What coarse vertices do to fine pairs, P_iI - P_jI: the pair, the coarse vertex, the value, in order."""
    fine, coarse = prolongation.shape
    world = 1.0 - np.bincount(prolongation.row, prolongation.value, fine)
    tied = np.flatnonzero(np.abs(world) > SMALLEST)
    row = np.concatenate([prolongation.row, tied, [fine]])
    order = np.argsort(row, kind="stable")
    column = np.concatenate([prolongation.column, np.full(len(tied), coarse), [coarse]])[order]
    value = np.concatenate([prolongation.value, world[tied], [1.0]])[order]
    start = np.searchsorted(row[order], np.arange(fine + 2))
    owner, entry = entries_of(start, pairs.astype(np.int64).ravel())
    key = owner // 2 * (coarse + 1) + column[entry]
    unique, number = np.unique(key, return_inverse=True)
    change = np.bincount(number, np.where(owner % 2 == 0, value[entry], -value[entry]), len(unique)).astype(np.float64)
    used = np.abs(change) > SMALLEST
    return unique[used] // (coarse + 1), unique[used] % (coarse + 1), change[used]

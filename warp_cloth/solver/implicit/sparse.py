"""Sparse matrices by rows, columns and values, as they are put together on the host, and as CSR on the device.

Own code: products are computed on the device, and importing ``scipy.sparse`` takes 0.14 s of a fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.base.topology import ragged_rows
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.implicit.sparse import sparse_types
from warp_cloth.model.model import ClothModel

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SparseMatrix:
    """Row, column and value of each entry."""

    row: Ints
    column: Ints
    value: Floats
    shape: tuple[int, int]

    @property
    def transposed(self) -> SparseMatrix:
        """The transposed matrix, its entries by rows."""
        order = np.argsort(self.column, kind="stable")
        return SparseMatrix(self.column[order], self.row[order], self.value[order], self.shape[::-1])

    def upload(self, model: ClothModel) -> Any:
        """The matrix as a kernels.implicit.sparse CsrMatrix on the model's device."""
        start, order = ragged_rows(self.row, self.shape[0])
        matrix = sparse_types(model.precision).CsrMatrix()
        matrix.start = wp.array(start, dtype=wp.int32, device=model.device)
        matrix.column = wp.array(self.column[order].astype(np.int32), dtype=wp.int32, device=model.device)
        matrix.value = wp.array(self.value[order], dtype=cloth_types(model.precision).real, device=model.device)
        return matrix


def empty_matrix(rows: int, columns: int) -> SparseMatrix:
    """A matrix without entries."""
    none = np.zeros(0, dtype=np.int64)
    return SparseMatrix(none, none, np.zeros(0), (rows, columns))


def placed(matrix: Any, row: int, column: int, size: int) -> SparseMatrix:
    """A CsrMatrix on the device, as part of a larger square matrix from this row and column on."""
    start, columns, value = (getattr(matrix, name).numpy() for name in ("start", "column", "value"))
    owner = np.repeat(np.arange(len(start) - 1), np.diff(start))
    return SparseMatrix(owner + row, columns.astype(np.int64) + column, value, (size, size))


def merged(matrices: Sequence[SparseMatrix]) -> SparseMatrix:
    """The sum of matrices of one shape whose entries lie in different places, in order."""
    row, column, value = (
        np.concatenate([getattr(one, name) for one in matrices]) for name in ("row", "column", "value")
    )
    return SparseMatrix(row, column, value, matrices[0].shape)


def block_diagonal(matrices: Sequence[SparseMatrix]) -> SparseMatrix:
    """One matrix with these along its diagonal."""
    rows = np.cumsum([0, *(matrix.shape[0] for matrix in matrices)])
    columns = np.cumsum([0, *(matrix.shape[1] for matrix in matrices)])
    return SparseMatrix(
        np.concatenate([matrix.row + first for matrix, first in zip(matrices, rows, strict=False)]),
        np.concatenate([matrix.column + first for matrix, first in zip(matrices, columns, strict=False)]),
        np.concatenate([matrix.value for matrix in matrices]),
        (int(rows[-1]), int(columns[-1])),
    )


def entries_of(start: Ints | NDArray[np.int32], rows: Ints) -> tuple[Ints, Ints]:
    """Entries start[row] .. start[row + 1] - 1 of each of ``rows``: its place in ``rows``, repeated, and the entry."""
    count = start[rows + 1] - start[rows]
    owner = np.repeat(np.arange(len(rows)), count)
    return owner, np.arange(len(owner)) - (np.cumsum(count) - count)[owner] + start[rows][owner]


def couples(owner: Ints, *, equal: bool) -> tuple[Ints, Ints]:
    """Every two entries of one owner, as places left < right, or left <= right if ``equal``; ``owner`` is sorted."""
    size = np.bincount(owner)
    first = np.cumsum(size) - size
    left = np.repeat(np.arange(len(owner)), size[owner])
    right = np.arange(len(left)) - np.repeat(np.cumsum(size[owner]) - size[owner], size[owner]) + first[owner[left]]
    selected = left <= right if equal else left < right
    return left[selected], right[selected]

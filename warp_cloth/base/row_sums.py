"""Sparse row sums (a CSR matrix times vectors) in the order of ``numpy.bincount``, so with the same bits.

By SciPy's compiled product, which takes a third of the time (all sums that fit the hinges of a T-shirt with 6,200
vertices: 16 and 45 ms). It is loaded without ``scipy.sparse``, whose import takes 0.1 to 0.3 s: 8 ms. Where a SciPy has
it elsewhere, NumPy sums; so it does entries with factors where SciPy's build rounds each product with its sum only
(fused multiply-add).
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.chunks import map_chunks
from warp_cloth.base.compiled_scipy import compiled_scipy
from warp_cloth.base.topology import ragged_rows

Floats = NDArray[np.float64]
Columns = NDArray[np.integer]

# Starts of rows, shape [rows + 1], and the entries row by row, shape [N]; None: they are row by row already
Grouped = tuple[NDArray[np.integer], NDArray[np.integer] | None]


class RowSums:
    """Sums over the entries of every row."""

    def __init__(
        self,
        rows: NDArray[np.integer] | Grouped,
        columns: NDArray[np.integer],
        count: int,
        factors: Floats | None = None,
    ) -> None:
        """Entry n adds the value at ``columns[n]``, times ``factors[n]``, to the sum of ``rows[n]``.

        Args:
            rows: shape [N], or the entries grouped by their rows.
            columns: shape [N].
            count: of rows.
            factors: shape [N]; None: all 1.
        """
        self.count = count
        starts, order = rows if isinstance(rows, tuple) else ragged_rows(rows, count)
        if order is not None:
            columns, factors = columns[order], None if factors is None else factors[order]
        tools = sparse_tools()
        if tools is None or (factors is not None and is_fused(tools)):
            self._sums: Callable[[slice, Floats], Floats] = _Counted(starts, columns, factors)
        else:
            self._sums = _Compiled(tools, starts, columns, factors)

    def __call__(self, values: Floats) -> Floats:
        """Row sums of ``values``, shape [columns] or, of K vectors, [columns, K]; shape [rows] or [rows, K]."""
        summed = np.empty((self.count, *values.shape[1:]))

        def put(chunk: slice, sums: Floats) -> None:
            summed[chunk] = sums

        self.for_each_chunk(values, put)
        return summed

    def for_each_chunk(self, values: Floats, use: Callable[[slice, Floats], None]) -> None:
        """Calls ``use(chunk, sums)`` for chunk after chunk of the rows."""
        map_chunks(lambda chunk: use(chunk, self._sums(chunk, values)), self.count)


class _Counted:
    """Sums of a chunk of rows by ``numpy.bincount``."""

    def __init__(self, starts: Columns, columns: Columns, factors: Floats | None) -> None:
        self._starts, self._columns, self._factors = starts, columns, factors

    def __call__(self, chunk: slice, values: Floats) -> Floats:
        starts = self._starts[chunk.start : chunk.stop + 1]
        entries, count = slice(starts[0], starts[-1]), chunk.stop - chunk.start
        rows, columns = np.repeat(np.arange(count), np.diff(starts)), self._columns[entries]
        sums = np.empty((count, *values.shape[1:]))
        vectors, into = (each.reshape(len(each), int(np.prod(values.shape[1:]))).T for each in (values, sums))
        for vector, summed in zip(vectors, into, strict=True):
            added = vector.take(columns)
            if self._factors is not None:
                added *= self._factors[entries]
            summed[:] = np.bincount(rows, added, count)
        return sums


class _Compiled:
    """Sums of a chunk of rows by SciPy's product of a CSR matrix."""

    def __init__(self, tools: Any, starts: Columns, columns: Columns, factors: Floats | None) -> None:
        self._tools, self._starts = tools, starts.astype(np.int32)
        self._columns, self._width = columns.astype(np.int32), int(columns.max(initial=-1)) + 1
        self._factors = np.ones(len(columns)) if factors is None else np.ascontiguousarray(factors)

    def __call__(self, chunk: slice, values: Floats) -> Floats:
        # starts count from the first entry of all, so that all chunks have the same columns and factors
        size, starts, count = chunk.stop - chunk.start, self._starts[chunk.start : chunk.stop + 1], values[:1].size
        held, sums = np.ascontiguousarray(values), np.zeros((size, *values.shape[1:]))
        matrix = starts, self._columns, self._factors
        if values.ndim == 1:
            self._tools.csr_matvec(size, self._width, *matrix, held, sums)
        else:
            self._tools.csr_matvecs(size, self._width, count, *matrix, held.ravel(), sums.ravel())
        return sums


def sparse_tools() -> Any:
    """SciPy's compiled products of sparse matrices; None where they are not found."""
    return compiled_scipy("sparse", "_sparsetools", "csr_matvec", "csr_matvecs")


@functools.cache
def is_fused(tools: Any) -> bool:
    """Whether a product rounds each product with its sum only, unlike NumPy, so that bits differ."""
    number = 1.0 + 2.0**-30
    starts, columns, factors = np.array([0, 2], np.int32), np.array([0, 1], np.int32), np.array([-1.0, number])
    one, sums = np.array([number * number, number]), np.zeros((9,))
    tools.csr_matvec(1, 2, starts, columns, factors, one, sums[:1])
    tools.csr_matvecs(1, 2, 8, starts, columns, factors, np.repeat(one, 8), sums[1:])
    return bool(sums.any())

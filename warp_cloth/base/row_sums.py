"""Sparse row sums (a CSR matrix times vectors) in the order of ``numpy.bincount``, so with the same bits.

SciPy's CSR product gives these bits in a third of the time (all sums that fit the hinges of a T-shirt with 6,200
vertices: 16 and 45 ms), but importing ``scipy.sparse`` takes 0.14 to 0.3 s. So it is used for MANY entries, and where
something else has imported it already, as meshing a pattern has. Where its build rounds products and sums together
(fused multiply-add), it is not used for entries with factors.
"""

from __future__ import annotations

import functools
import importlib
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.chunks import map_chunks
from warp_cloth.base.topology import ragged_rows

Floats = NDArray[np.float64]
Columns = NDArray[np.integer]

# Starts of rows, shape [rows + 1], and the entries row by row, shape [N]; None: they are row by row already
Grouped = tuple[NDArray[np.integer], NDArray[np.integer] | None]

MANY = 600_000  # entries (of a T-shirt with 50,000 vertices), whose sums take longer than the import


@dataclass(frozen=True, eq=False)
class _Counted:
    """Rows that ``numpy.bincount`` sums: row, column and factor of each entry, row by row."""

    rows: Columns
    columns: Columns
    factors: Floats | None
    count: int

    def __matmul__(self, values: Floats) -> Floats:
        sums = np.empty((self.count, *values.shape[1:]))
        vectors, into = (each.reshape(len(each), int(np.prod(values.shape[1:]))).T for each in (values, sums))
        for vector, summed in zip(vectors, into, strict=True):
            entries = vector.take(self.columns)
            if self.factors is not None:
                entries *= self.factors
            summed[:] = np.bincount(self.rows, entries, self.count)
        return sums


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
        self._width = int(columns.max(initial=-1)) + 1
        matrix = _csr_array(len(columns), has_factors=factors is not None)

        def part(chunk: slice) -> tuple[int, Any]:
            first, end = starts[chunk.start], starts[chunk.stop]
            start, own = starts[chunk.start : chunk.stop + 1] - first, columns[first:end]
            size = chunk.stop - chunk.start
            weights = None if factors is None else factors[first:end]
            if matrix is None:
                return chunk.start, _Counted(np.repeat(np.arange(size), np.diff(start)), own, weights, size)
            entries = np.ones(len(own)) if weights is None else weights, own.astype(np.int32), start.astype(np.int32)
            return chunk.start, matrix(entries, shape=(size, self._width))

        self._parts = dict(map_chunks(part, count))  # by the first row of each

    def __call__(self, values: Floats) -> Floats:
        """Row sums of ``values``, shape [columns] or, of K vectors, [columns, K]; shape [rows] or [rows, K]."""
        summed = np.empty((self.count, *values.shape[1:]))

        def put(chunk: slice, sums: Floats) -> None:
            summed[chunk] = sums

        self.for_each_chunk(values, put)
        return summed

    def for_each_chunk(self, values: Floats, use: Callable[[slice, Floats], None]) -> None:
        """Calls ``use(chunk, sums)`` for chunk after chunk of the rows."""
        map_chunks(lambda chunk: use(chunk, self._parts[chunk.start] @ values[: self._width]), self.count)


def _csr_array(entries: int, *, has_factors: bool) -> Any:
    """SciPy's class of matrices; None where it is not worth its import, or would give other bits."""
    if entries >= MANY:
        importlib.import_module("scipy.sparse")
    found = getattr(sys.modules.get("scipy.sparse"), "csr_array", None)
    return None if not entries or (has_factors and found is not None and _is_fused(found)) else found


@functools.cache
def _is_fused(csr_array: type[Any]) -> bool:
    """Whether a product of SciPy's rounds each product with its sum only, unlike NumPy, so that bits differ."""
    number = 1.0 + 2.0**-30
    matrix, one = csr_array(([-1.0, number], [0, 1], [0, 2]), shape=(1, 2)), np.array([number * number, number])
    return bool((matrix @ one).any() or (matrix @ np.repeat(one[:, None], 8, axis=1)).any())

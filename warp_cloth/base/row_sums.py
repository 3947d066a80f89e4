"""Sparse row sums (a CSR matrix of ones times a vector) in the order of ``numpy.bincount``, so with the same bits.

Entry k of many rows is gathered and added at once. Rows of a regular mesh that share a stencil, the offsets of their
entries, are summed from contiguous memory without indices.

Own code, for speed: fitting the hinges of a T-shirt with 57,000 vertices takes 1.11 s of CPU time with it, 1.46 s with
``numpy.bincount`` (7,000 vertices: 0.13 s both). SciPy's CSR product gives the same bits four times as fast (7,000
vertices: 0.06 and 0.23 ms), but importing ``scipy.sparse`` takes 0.14 s, longer than all sums of a T-shirt: it is used
where something else has imported it already, as meshing a pattern has.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.chunks import map_chunks
from warp_cloth.base.topology import ragged_rows

Floats = NDArray[np.float64]
Columns = NDArray[np.intp]

LONGEST = 64  # entries of a row that is added entry by entry; longer rows are few
SAMPLED, COMMON = 64, 8  # rows sampled for stencils, and how many of these must share one for it to be used
SPREAD = 2_654_435_761  # stride of the sample: no regular mesh is as wide


@dataclass(frozen=True, eq=False)
class _Ranked:
    """Rows, longest first, and the columns of their first entries, of their second entries and so on."""

    rows: Columns
    columns: tuple[Columns, ...]

    def sums(self, values: Floats) -> Floats:
        total = np.zeros(len(self.rows))
        for columns in self.columns:
            total[: len(columns)] += values.take(columns)
        return total


@dataclass(frozen=True, eq=False)
class _Stencil:
    """Rows whose entries have the same offsets from the row's own number."""

    offsets: tuple[int, ...]
    flags: NDArray[np.bool_]  # which rows, shape [rows]


class RowSums:
    """Sums over the entries of every row."""

    def __init__(self, rows: NDArray[np.integer], columns: NDArray[np.integer], count: int) -> None:
        """Entry n adds the value at ``columns[n]`` to the sum of ``rows[n]``; shape [N] both; ``count`` rows."""
        self.count = count
        starts, order = ragged_rows(rows, count)
        self._start, self._column = starts.astype(np.intp), np.asarray(columns, dtype=np.intp)[order]
        self._width = int(self._column.max(initial=-1)) + 1
        self._products = self._csr_products()
        if self._products is not None:
            return
        self._length = np.diff(self._start)
        self._stencils = self._common_stencils()
        rest = np.ones(count, dtype=bool)
        for stencil in self._stencils:
            rest &= ~stencil.flags
        self._long = np.flatnonzero(rest & (self._length > LONGEST))
        rest[self._long] = False
        self._chunks = dict(map_chunks(lambda chunk: (chunk.start, self._ranked(chunk, rest[chunk])), count))
        self._entries = self._entries_of(self._long)
        del self._column

    def _csr_products(self) -> dict[int, Any] | None:
        """SciPy's matrix for each chunk, by its first row; None where SciPy's sparse matrices are not imported."""
        sparse = sys.modules.get("scipy.sparse")
        if sparse is None or not hasattr(sparse, "csr_array") or not self._width:
            return None

        def matrix(chunk: slice) -> tuple[int, Any]:
            first, end = self._start[chunk.start], self._start[chunk.stop]
            start, columns = self._start[chunk.start : chunk.stop + 1] - first, self._column[first:end]
            parts = (np.ones(len(columns)), columns.astype(np.int32), start.astype(np.int32))
            return chunk.start, sparse.csr_array(parts, shape=(chunk.stop - chunk.start, self._width))

        return dict(map_chunks(matrix, self.count))

    def _common_stencils(self) -> list[_Stencil]:
        """The stencils that many rows share, with these rows."""
        sample = (np.arange(SAMPLED) * SPREAD) % max(self.count, 1) if self.count else np.zeros(0, dtype=np.intp)
        kinds: dict[tuple[int, ...], int] = {}
        for row in sample.tolist():
            own = self._column[self._start[row] : self._start[row + 1]]
            kind = tuple((own - row).tolist()) if len(own) <= LONGEST else ()
            kinds[kind] = kinds.get(kind, 0) + 1
        found = []
        for kind in (kind for kind, often in kinds.items() if kind and often >= COMMON):
            flags = self._length == len(kind)
            rows = np.flatnonzero(flags)
            for rank, offset in enumerate(kind):
                rows = rows[self._column[self._start[rows] + rank] - rows == offset]
            flags[...] = False
            flags[rows] = True
            found.append(_Stencil(kind, flags))
        return found

    def _ranked(self, chunk: slice, rest: NDArray[np.bool_]) -> _Ranked:
        """The rows of a chunk that have no common stencil, numbered from the chunk's first."""
        rows = chunk.start + np.flatnonzero(rest)
        rows = rows[np.argsort(-self._length[rows], kind="stable")]
        start, length = self._start[rows], self._length[rows]
        ends = np.cumsum(np.bincount(length, minlength=1)[::-1])[::-1]  # how many rows have so many entries or more
        columns = (self._column[start[:end] + rank] for rank, end in enumerate(ends[1:].tolist()))
        return _Ranked(rows - chunk.start, tuple(columns))

    def _entries_of(self, rows: Columns) -> tuple[Columns, Columns]:
        """Number among ``rows``, and column, of all their entries."""
        own = [self._column[self._start[row] : self._start[row + 1]] for row in rows.tolist()]
        numbers = np.repeat(np.arange(len(rows)), self._length[rows])
        return numbers, np.concatenate([np.zeros(0, dtype=np.intp), *own])

    def __call__(self, values: Floats) -> Floats:
        """Row sums of ``values``, shape [columns]; shape [rows]."""
        summed = np.empty(self.count)

        def put(chunk: slice, sums: Floats) -> None:
            summed[chunk] = sums

        self.for_each_chunk(values, put)
        return summed

    def for_each_chunk(self, values: Floats, use: Callable[[slice, Floats], None]) -> None:
        """Calls ``use(chunk, sums)`` for chunk after chunk of the rows."""
        products = self._products
        if products is not None:
            map_chunks(lambda chunk: use(chunk, products[chunk.start] @ values[: self._width]), self.count)
            return
        long = np.bincount(self._entries[0], values[self._entries[1]], len(self._long))

        def work(chunk: slice) -> None:
            sums, ranked = np.empty(chunk.stop - chunk.start), self._chunks[chunk.start]
            if len(ranked.rows) < len(sums):
                self._add_stencils(values, sums, chunk)
            sums[ranked.rows] = ranked.sums(values)
            first, end = np.searchsorted(self._long, (chunk.start, chunk.stop))
            sums[self._long[first:end] - chunk.start] = long[first:end]
            use(chunk, sums)

        map_chunks(work, self.count)

    def _add_stencils(self, values: Floats, sums: Floats, chunk: slice) -> None:
        """Writes the sums of rows with a common stencil; other rows get arbitrary numbers."""
        for number, stencil in enumerate(self._stencils):
            first = max(chunk.start, -min(stencil.offsets))
            end = min(chunk.stop, len(values) - max(stencil.offsets))
            if first >= end:
                continue
            own = values[first + stencil.offsets[0] : end + stencil.offsets[0]] + 0.0
            for offset in stencil.offsets[1:]:
                own += values[first + offset : end + offset]
            inner = sums[first - chunk.start : end - chunk.start]
            inner[...] = own if number == 0 else np.where(stencil.flags[first:end], own, inner)

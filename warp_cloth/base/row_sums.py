"""Sums over rows of unequal length as numpy.bincount adds them, to the bit, but several times faster.

The numbers are fetched and added rank by rank, of many rows at once; and where rows of a regular mesh have entries at
the same distances from them, in one stretch of memory after another, without looking up where they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.chunks import in_parts
from warp_cloth.base.topology import ragged_rows

Floats = NDArray[np.float64]
Places = NDArray[np.intp]

LONGEST = 64  # entries of a row that are added rank by rank; longer rows are few
SAMPLED, COMMON = 64, 8  # rows that are looked at for distances, and how many of them must share theirs
SPREAD = 2_654_435_761  # steps from one of these to the next: no regular mesh is as wide


@dataclass(frozen=True, eq=False)
class _Ranked:
    """Some rows, longest first, and the places of their first entries, their second ones and so on."""

    rows: Places
    places: tuple[Places, ...]

    def sums(self, held: Floats) -> Floats:
        total = np.zeros(len(self.rows))
        for places in self.places:
            total[: len(places)] += held.take(places)
        return total


@dataclass(frozen=True, eq=False)
class _Alike:
    """Rows whose entries lie at the same distances from them."""

    distances: tuple[int, ...]
    flags: NDArray[np.bool_]  # which rows, shape [rows]


class RowSums:
    """Sums of what lies at some places, for every row."""

    def __init__(self, rows: NDArray[np.integer], places: NDArray[np.integer], count: int) -> None:
        """Entry n counts for ``rows``[n] what lies at ``places``[n]; shape [N] both."""
        self.count = count
        starts, order = ragged_rows(rows, count)
        self._start, self._place = starts.astype(np.intp), np.asarray(places, dtype=np.intp)[order]
        self._length = np.diff(self._start)
        self._alike = self._found_alike()
        rest = np.ones(count, dtype=bool)
        for alike in self._alike:
            rest &= ~alike.flags
        self._long = np.flatnonzero(rest & (self._length > LONGEST))
        rest[self._long] = False
        self._parts = dict(in_parts(lambda part: (part.start, self._ranked(part, rest[part])), count))
        self._entries = self._entries_of(self._long)
        del self._place

    def _found_alike(self) -> list[_Alike]:
        """Rows that are alike, of the kinds that are common."""
        sample = (np.arange(SAMPLED) * SPREAD) % max(self.count, 1) if self.count else np.zeros(0, dtype=np.intp)
        kinds: dict[tuple[int, ...], int] = {}
        for row in sample.tolist():
            own = self._place[self._start[row] : self._start[row + 1]]
            kind = tuple((own - row).tolist()) if len(own) <= LONGEST else ()
            kinds[kind] = kinds.get(kind, 0) + 1
        found = []
        for kind in (kind for kind, often in kinds.items() if kind and often >= COMMON):
            flags = self._length == len(kind)
            rows = np.flatnonzero(flags)
            for rank, distance in enumerate(kind):
                rows = rows[self._place[self._start[rows] + rank] - rows == distance]
            flags[...] = False
            flags[rows] = True
            found.append(_Alike(kind, flags))
        return found

    def _ranked(self, part: slice, rest: NDArray[np.bool_]) -> _Ranked:
        """Those of a part's rows that are not dealt with otherwise, counted from its first."""
        rows = part.start + np.flatnonzero(rest)
        rows = rows[np.argsort(-self._length[rows], kind="stable")]
        start, length = self._start[rows], self._length[rows]
        ends = np.cumsum(np.bincount(length, minlength=1)[::-1])[::-1]  # how many rows have so many entries or more
        places = (self._place[start[:end] + rank] for rank, end in enumerate(ends[1:].tolist()))
        return _Ranked(rows - part.start, tuple(places))

    def _entries_of(self, rows: Places) -> tuple[Places, Places]:
        """The numbers among ``rows``, and the places, of all entries of these."""
        own = [self._place[self._start[row] : self._start[row + 1]] for row in rows.tolist()]
        numbers = np.repeat(np.arange(len(rows)), self._length[rows])
        return numbers, np.concatenate([np.zeros(0, dtype=np.intp), *own])

    def __call__(self, held: Floats) -> Floats:
        """The sums of what is ``held`` at the places, shape [rows]."""
        summed = np.empty(self.count)

        def put(there: slice, sums: Floats) -> None:
            summed[there] = sums

        self.each(held, put)
        return summed

    def each(self, held: Floats, use: Callable[[slice, Floats], None]) -> None:
        """Has the sums used, part of the rows by part."""
        long = np.bincount(self._entries[0], held[self._entries[1]], len(self._long))

        def work(there: slice) -> None:
            sums, ranked = np.empty(there.stop - there.start), self._parts[there.start]
            if len(ranked.rows) < len(sums):
                self._put_alike(held, sums, there)
            sums[ranked.rows] = ranked.sums(held)
            first, end = np.searchsorted(self._long, (there.start, there.stop))
            sums[self._long[first:end] - there.start] = long[first:end]
            use(there, sums)

        in_parts(work, self.count)

    def _put_alike(self, held: Floats, sums: Floats, there: slice) -> None:
        """Writes the sums of rows that are alike, and of the others any numbers."""
        for number, alike in enumerate(self._alike):
            first = max(there.start, -min(alike.distances))
            end = min(there.stop, len(held) - max(alike.distances))
            if first >= end:
                continue
            own = held[first + alike.distances[0] : end + alike.distances[0]] + 0.0
            for distance in alike.distances[1:]:
                own += held[first + distance : end + distance]
            inner = sums[first - there.start : end - there.start]
            inner[...] = own if number == 0 else np.where(alike.flags[first:end], own, inner)

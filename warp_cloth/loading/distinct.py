"""Which rows of a table are the same."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warp_cloth.loading.raw import Ints


@dataclass(frozen=True, eq=False)
class Distinct:
    """The different rows of a table, in sorted order."""

    number: Ints  # of the different row that each row is, shape [N]
    first: Ints  # where each different row stands first, shape [D]
    count: Ints  # how often each different row stands there, shape [D]


def distinct(rows: np.ndarray) -> Distinct:
    """Different rows, shape [N, C] (many times faster than numpy.unique by rows)."""
    if not len(rows):
        nothing = np.zeros(0, dtype=np.int64)
        return Distinct(nothing, nothing, nothing)
    order = np.lexsort(rows.T[::-1])  # stable: equal rows stay in their order
    ordered = rows[order]
    new = np.concatenate([[True], (ordered[1:] != ordered[:-1]).any(axis=1)])
    number = np.empty(len(rows), dtype=np.int64)
    number[order] = np.cumsum(new) - 1
    starts = np.flatnonzero(new)
    return Distinct(number, order[starts], np.diff(np.append(starts, len(rows))))


def edges_of(triangles: Ints) -> Ints:
    """The three edges of every triangle, as they run, shape [3 F, 2]."""
    edges: Ints = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    return edges

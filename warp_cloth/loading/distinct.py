"""Which rows of a table are the same."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warp_cloth.base.topology import stable_argsort
from warp_cloth.loading.raw import Ints

LONGEST_KEY = 63  # bits of a whole row in one number


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
    key = _row_keys(rows)
    if key is None:
        order = np.lexsort(rows.T[::-1])  # stable: equal rows stay in their order
        ordered = rows[order]
        changes = (ordered[1:] != ordered[:-1]).any(axis=1)
    else:
        order = stable_argsort(key)
        ordered = key[order]
        changes = ordered[1:] != ordered[:-1]
    new = np.append(True, changes)
    number = np.empty(len(rows), dtype=np.int64)
    number[order] = np.cumsum(new) - 1
    starts = np.flatnonzero(new)
    return Distinct(number, order[starts], np.diff(np.append(starts, len(rows))))


def _row_keys(rows: np.ndarray) -> Ints | None:
    """A number for each row that sorts as the row does, None where they do not fit."""
    bits = int(rows.max()).bit_length() if rows.dtype.kind == "i" and rows.min() >= 0 else LONGEST_KEY
    if bits * rows.shape[1] > LONGEST_KEY:
        return None
    key = rows[:, 0].astype(np.int64)
    for column in rows.T[1:]:
        key = (key << bits) | column
    return key


def used_ids(ids: np.ndarray, count: int) -> Ints:
    """The different ones among ids below ``count``, in order."""
    used = np.zeros(count, dtype=bool)
    used[ids] = True
    return np.flatnonzero(used)


def edges_of(triangles: Ints) -> Ints:
    """The three edges of every triangle, as they run, shape [3 F, 2]."""
    edges: Ints = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    return edges

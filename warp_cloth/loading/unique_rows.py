"""Unique rows of integer or float tables, and edges of triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warp_cloth.base.topology import stable_argsort
from warp_cloth.loading.raw import Ints

LONGEST_KEY = 63  # bits of a row packed into one integer


@dataclass(frozen=True, eq=False)
class UniqueRows:
    """The unique rows of a table, in sorted order."""

    number: Ints  # number of each row among the unique ones, shape [N]
    first: Ints  # first occurrence of each unique row, shape [U]
    count: Ints  # occurrences of each unique row, shape [U]


def unique_rows(rows: np.ndarray) -> UniqueRows:
    """Unique rows of a table, shape [N, C] (many times faster than ``numpy.unique(axis=0)``)."""
    if not len(rows):
        nothing = np.zeros(0, dtype=np.int64)
        return UniqueRows(nothing, nothing, nothing)
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
    return UniqueRows(number, order[starts], np.diff(np.append(starts, len(rows))))


def _row_keys(rows: np.ndarray) -> Ints | None:
    """One integer per row that sorts as the row; None if a row does not fit one."""
    bits = int(rows.max()).bit_length() if rows.dtype.kind == "i" and rows.min() >= 0 else LONGEST_KEY
    if bits * rows.shape[1] > LONGEST_KEY:
        return None
    key = rows[:, 0].astype(np.int64)
    for column in rows.T[1:]:
        key = (key << bits) | column
    return key


def edges_of(triangles: Ints) -> Ints:
    """The three directed edges of every triangle, shape [3 F, 2]."""
    edges: Ints = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    return edges


def rim_edges(triangles: Ints) -> Ints:
    """The edges that one triangle has alone, each with its lower vertex first, shape [N, 2]."""
    edges, uses = np.unique(np.sort(edges_of(triangles), axis=1), axis=0, return_counts=True)
    rims: Ints = edges[uses == 1]
    return rims

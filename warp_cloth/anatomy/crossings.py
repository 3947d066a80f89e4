"""How often curves pass through triangles, by the signs of volumes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices, Points

Counts = NDArray[np.int64]
Floats = NDArray[np.float64]
Columns = tuple[Floats, ...]  # x, y and z of some points [m]
BLOCK = 6  # segments of a curve whose triangles are looked for together


def surface_crossings(points: Points, triangles: Indices, curves: Sequence[Points]) -> Counts:
    """How often each curve, shape [N, 3], passes through a surface [m], shape [curves]."""
    a, b, c = np.ascontiguousarray(triangles.T)
    low, high = zip(*(_range(column[a], column[b], column[c]) for column in _columns(points)), strict=True)
    starts, ends, hit, owner = [np.zeros((0, 3))], [np.zeros((0, 3))], [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    for number, curve in enumerate(curves):
        own = _overlapping(low, high, curve.min(axis=0), curve.max(axis=0))
        own_low, own_high = (tuple(column[own] for column in columns) for columns in (low, high))
        for first in range(0, len(curve) - 1 if len(own) else 0, BLOCK):
            part = curve[first : first + BLOCK + 1]
            near = own[_overlapping(own_low, own_high, part.min(axis=0), part.max(axis=0))]
            count = len(part) - 1
            starts.append(np.repeat(part[:-1], len(near), axis=0))
            ends.append(np.repeat(part[1:], len(near), axis=0))
            hit.append(np.tile(near, count))
            owner.append(np.full(count * len(near), number))
    faces = np.concatenate(hit)
    corners = (points[corner[faces]] for corner in (a, b, c))
    through = crossed(np.concatenate(starts), np.concatenate(ends), *corners)
    return np.bincount(np.concatenate(owner)[through], minlength=len(curves))


def cone_crossings(start: Points, end: Points, curves: Sequence[Points]) -> Counts:
    """How often each curve passes through the cone over a ring of segments, ``start`` to ``end`` [m], shape [S, 3]."""
    tip = start.mean(axis=0)
    low = np.minimum(np.minimum(start.min(axis=0), end.min(axis=0)), tip)
    high = np.maximum(np.maximum(start.max(axis=0), end.max(axis=0)), tip)
    a, b = np.concatenate([curve[:-1] for curve in curves]), np.concatenate([curve[1:] for curve in curves])
    owner = np.repeat(np.arange(len(curves)), [len(curve) - 1 for curve in curves])
    near = _overlapping(_columns(np.minimum(a, b)), _columns(np.maximum(a, b)), low, high)
    pair, face = np.repeat(near, len(start)), np.tile(np.arange(len(start)), len(near))
    through = crossed(a[pair], b[pair], np.broadcast_to(tip, (len(pair), 3)), start[face], end[face])
    return np.bincount(owner[pair[through]], minlength=len(curves))


def _columns(rows: Points) -> Columns:
    """The coordinates of points, shape [N, 3], each contiguous: comparing one of them then takes a third as long."""
    x, y, z = np.ascontiguousarray(rows.T)
    return x, y, z


def _range(a: Floats, b: Floats, c: Floats) -> tuple[Floats, Floats]:
    """The least and the largest of three values, element by element."""
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def _overlapping(low: Columns, high: Columns, lowest: Points, highest: Points) -> NDArray[np.int64]:
    """The boxes that meet one box; axis by axis, as most fail the first."""
    near = np.flatnonzero((high[1] >= lowest[1]) & (low[1] <= highest[1]))
    for axis in (0, 2):
        near = near[(high[axis][near] >= lowest[axis]) & (low[axis][near] <= highest[axis])]
    return near


def crossed(start: Points, end: Points, a: Points, b: Points, c: Points) -> NDArray[np.bool_]:
    """Whether each segment passes through its triangle; all shape [P, 3] [m]; result shape [P]."""
    along = end - start
    x, y, z = a - start, b - start, c - start
    volumes = [_volume(p, q, along) for p, q in ((x, y), (y, z), (z, x))]
    before = -_volume(b - a, c - a, x)
    after = _volume(b - a, c - a, end - a)
    inside = (volumes[0] > 0.0) & (volumes[1] > 0.0) & (volumes[2] > 0.0)
    inside |= (volumes[0] < 0.0) & (volumes[1] < 0.0) & (volumes[2] < 0.0)
    return np.asarray(inside & (before * after < 0.0))


def _volume(p: Points, q: Points, r: Points) -> NDArray[np.float64]:
    """The triple product (p x q) . r of rows, shape [P]."""
    (px, py, pz), (qx, qy, qz), (rx, ry, rz) = p.T, q.T, r.T
    return np.asarray((py * qz - pz * qy) * rx + (pz * qx - px * qz) * ry + (px * qy - py * qx) * rz)

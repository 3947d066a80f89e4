"""Delaunay triangulations kept up by flips (Lawson, 1977): after vertices have moved a little, or some were added.

Sides of outlines have one triangle each, and so are never flipped: the triangulation stays a constrained one. All flips
of a round are done at once, of quadrilaterals that share no triangle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.delaunay import next_of
from warp_cloth.pattern.lattice import tree_of

Ints = NDArray[np.int64]

ROUNDS = 60  # a vertex in a fan of n triangles takes log n
BEYOND = 1e-9  # sine of the angle by which two opposite angles exceed half a turn, for a flip
CANDIDATES = 12  # triangles with the nearest middles, among which the one about a new vertex is looked for


def flipped(points: Floats, triangles: Ints, touched: NDArray[np.bool_] | None = None) -> Ints:
    """Triangles, shape [F, 3], counter-clockwise, made Delaunay by flips of inner edges.

    ``touched``: vertices, shape [N], whose triangles alone may not be Delaunay; None: all of them.
    """
    triangles = triangles.copy()
    for _ in range(ROUNDS):
        active = np.arange(len(triangles)) if touched is None else _with_two(triangles, touched)
        one, other, corner, mate = _pairs(triangles[active])
        one, other = active[one], active[other]
        p, q = triangles[one, (corner + 2) % 3], triangles[other, (mate + 2) % 3]
        a, b = triangles[one, corner], triangles[one, (corner + 1) % 3]
        better = _not_delaunay(points, a, b, p, q)
        if not len(better):
            break
        first = np.full(len(triangles), len(better), dtype=np.int64)
        rank = np.arange(len(better))
        np.minimum.at(first, one[better], rank)
        np.minimum.at(first, other[better], rank)
        chosen = better[(first[one[better]] == rank) & (first[other[better]] == rank)]
        a, b, p, q, one, other = (each[chosen] for each in (a, b, p, q, one, other))
        triangles[one] = np.column_stack([a, q, p])
        triangles[other] = np.column_stack([q, b, p])
        touched = np.zeros(len(points), dtype=bool)  # what was not flipped shares a triangle with what was
        for each in (a, b, p, q):
            touched[each] = True
    return triangles


def _with_two(triangles: Ints, touched: NDArray[np.bool_]) -> Ints:
    """Triangles with two touched corners or more."""
    a, b, c = (touched[triangles[:, corner]] for corner in range(3))
    return np.flatnonzero((a & b) | (b & c) | (c & a))


def inserted(points: Floats, triangles: Ints, count: int) -> Ints | None:
    """Triangles with the last vertices of ``points``, from ``count`` on, put in; None where one lies in no triangle."""
    left = np.arange(count, len(points))
    while len(left):
        home = _homes(points, triangles, left)
        if (home < 0).any():
            return None
        _, firsts = np.unique(home, return_index=True)  # one in a triangle at a time
        vertices, at = left[firsts], home[firsts]
        a, b, c = triangles[at].T
        made = [np.column_stack(each) for each in ((a, b, vertices), (b, c, vertices), (c, a, vertices))]
        triangles = triangles.copy()
        triangles[at] = made[0]
        triangles = np.concatenate([triangles, *made[1:]])
        touched = np.zeros(len(points), dtype=bool)
        touched[np.concatenate([a, b, c, vertices])] = True
        triangles = flipped(points, triangles, touched)
        left = np.delete(left, firsts)
    return triangles


def _homes(points: Floats, triangles: Ints, vertices: Ints) -> Ints:
    """The triangle that each of these vertices lies in; -1: none that is near."""
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    near = tree_of((a + b + c) / 3.0).query(points[vertices], min(CANDIDATES, len(triangles)))[1]
    near = near.reshape(len(vertices), -1)
    spot = points[vertices][:, None]
    a, b, c = a[near], b[near], c[near]
    inside = np.minimum(np.minimum(_area(a, b, spot), _area(b, c, spot)), _area(c, a, spot))
    best = inside.argmax(axis=1)
    rows = np.arange(len(vertices))
    return np.asarray(np.where(inside[rows, best] >= 0.0, near[rows, best], -1), dtype=np.int64)


def _area(a: Floats, b: Floats, c: Floats) -> Floats:
    """Twice signed areas."""
    u, v = b - a, c - a
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def _pairs(triangles: Ints) -> tuple[Ints, Ints, Ints, Ints]:
    """Triangles on either side of each inner edge, and the corner of each that the edge begins at."""
    start, end = triangles.ravel(), next_of(triangles).ravel()
    key = np.minimum(start, end) << 32 | np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(key[order][1:] == key[order][:-1])
    one, other = order[same], order[same + 1]
    return one // 3, other // 3, one % 3, other % 3


def _not_delaunay(points: Floats, a: Ints, b: Ints, p: Ints, q: Ints) -> Ints:
    """Which edges a-b are not Delaunay: the angles at p and q over them are more than half a turn together."""
    to = [points.take(end, axis=0) - points.take(tip, axis=0) for tip in (p, q) for end in (a, b)]
    dots = [u[:, 0] * v[:, 0] + u[:, 1] * v[:, 1] for u, v in (to[:2], to[2:])]
    crosses = [u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] for u, v in (to[:2], to[3:1:-1])]
    excess = -(crosses[0] * dots[1] + dots[0] * crosses[1])  # minus the sine of their sum, times lengths
    maybe = np.flatnonzero(excess > 0.0)
    sizes = [np.hypot(dot[maybe], cross[maybe]) for dot, cross in zip(dots, crosses, strict=True)]
    return maybe[excess[maybe] / np.maximum(sizes[0] * sizes[1], 1e-300) > BEYOND]

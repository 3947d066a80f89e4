"""Constrained Delaunay triangulation of panels: SciPy's, with the outlines' sides put in and the outside cut away.

Of the libraries that mesh an outline by themselves, `triangle` and `meshpy` are Shewchuk's code, which may not be sold,
and `gmsh` and CGAL's mesher are under the GPL. SciPy is a dependency already.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.connected import connected_components
from warp_cloth.pattern.curve import Floats

Ints = NDArray[np.int64]

FLAT = 1e-3  # height of a triangle over its longest edge below which it is flat: three vertices of a straight side
FLIP_ROUNDS = 20


class OutlineError(Exception):
    """An outline that crosses or touches itself, at these places of its vertices."""

    def __init__(self, *places: int) -> None:
        super().__init__(places)
        self.places = places


def triangulated(points: Floats, sides: Ints, panel: Ints) -> Ints:
    """Counter-clockwise triangles that fill outlines, Delaunay but for the sides; shape [F, 3].

    ``points`` [m], shape [N, 2]; ``sides``, shape [n, 2]: vertices 0 to n - 1 in closed loops, the cloth to the left;
    ``panel`` of each point, shape [N].

    Raises:
        OutlineError: an outline crosses or touches itself.
    """
    triangles = _with_sides(points, _delaunay(points, panel), sides)
    return _without_flat(points, _inner(triangles, sides, len(points)), sides)


def _delaunay(points: Floats, panel: Ints) -> Ints:
    """Delaunay triangles panel by panel: in half of the time that all side by side take."""
    from scipy.spatial import Delaunay, QhullError  # imported where it is used: 0.36 s

    order = np.argsort(panel, kind="stable")
    found = []
    for mine in np.split(order, 1 + np.flatnonzero(np.diff(panel[order]))):
        try:
            made = Delaunay(points[mine])
        except QhullError:
            raise OutlineError(int(mine[0])) from None
        if len(made.coplanar):
            raise OutlineError(*(int(v) for v in mine[made.coplanar[0, [0, 2]]]))
        found.append(mine[made.simplices])  # counter-clockwise, flat ones by their neighbours
    return np.concatenate(found)


def doubled_areas(points: Floats, triangles: Ints) -> Floats:
    """Twice the signed areas of triangles [m^2], shape [F]."""
    x, y = corners_of(points, triangles)
    return np.asarray((x[1] - x[0]) * (y[2] - y[0]) - (y[1] - y[0]) * (x[2] - x[0]))


def corners_of(points: Floats, triangles: Ints) -> tuple[Floats, Floats]:
    """x and y of triangles' corners [m], one corner after another: shape [3, F] each."""
    corner = np.ascontiguousarray(triangles.T)
    return np.ascontiguousarray(points[:, 0]).take(corner), np.ascontiguousarray(points[:, 1]).take(corner)


def next_of(triangles: Ints) -> Ints:
    """The vertices after those of triangles, shape [F, 3]: ``numpy.roll`` takes five times as long."""
    return triangles[:, [1, 2, 0]]


def flat_ones(points: Floats, triangles: Ints) -> tuple[Ints, Floats]:
    """Triangles that are flat or turned over, shape [f], and the squares of their sides [m^2], shape [3, f]."""
    x, y = corners_of(points, triangles)
    aside, up = x[[1, 2, 0]] - x, y[[1, 2, 0]] - y
    length = aside * aside + up * up
    flat = np.flatnonzero(doubled_areas(points, triangles) <= FLAT * length.max(axis=0))
    return flat, length[:, flat]


def _keys(one: Ints, other: Ints, count: int) -> Ints:
    return np.minimum(one, other) * count + np.maximum(one, other)


def _with_sides(points: Floats, triangles: Ints, sides: Ints) -> Ints:
    """The triangulation with every side as an edge."""
    count = len(points)
    wanted = _keys(sides[:, 0], sides[:, 1], count)
    one, other = triangles.ravel(), next_of(triangles).ravel()
    on_rim = (one < len(sides)) & (other < len(sides))
    missing = sides[~np.isin(wanted, _keys(one[on_rim], other[on_rim], count))]
    if not len(missing):
        return triangles
    fixed = set(wanted.tolist())
    for a, b in missing.tolist():
        triangles = _with_side(points, triangles, a, b, fixed)
    return triangles


def _turn(points: Floats, a: int, b: int, at: NDArray[np.int64]) -> Floats:
    """Twice the signed areas of triangles over one edge."""
    start, along = points[a], points[b] - points[a]
    return np.asarray(along[0] * (points[at, 1] - start[1]) - along[1] * (points[at, 0] - start[0]))


def _with_side(points: Floats, triangles: Ints, a: int, b: int, fixed: set[int]) -> Ints:
    """The triangulation with one more edge, by Anglada's method: the triangles that it crosses are made anew."""
    count = len(points)
    one, other = triangles, next_of(triangles)
    if ((one == a) & (other == b)).any() or ((one == b) & (other == a)).any():
        return triangles
    beside = _turn(points, a, b, np.arange(count))  # which side of the line a-b each vertex is on
    over = (beside[one] > 0) != (beside[other] > 0)
    ends = (one == a) | (one == b) | (other == a) | (other == b)
    candidates = np.argwhere(over & ~ends)
    start, end = one[tuple(candidates.T)], other[tuple(candidates.T)]
    along = points[end] - points[start]
    to_a, to_b = points[a] - points[start], points[b] - points[start]
    crossed = (along[:, 0] * to_a[:, 1] - along[:, 1] * to_a[:, 0] > 0) != (
        along[:, 0] * to_b[:, 1] - along[:, 1] * to_b[:, 0] > 0
    )
    start, end = start[crossed], end[crossed]
    for key, vertex in zip(_keys(start, end, count).tolist(), start.tolist(), strict=True):
        if key in fixed:
            raise OutlineError(a, vertex)
    opened = np.unique(candidates[crossed, 0])
    if not len(opened):
        raise OutlineError(a, b)  # a vertex lies on it
    follow = {}  # the rim of the opened triangles, counter-clockwise
    inner = set(zip(start.tolist(), end.tolist(), strict=True))
    for triangle in triangles[opened].tolist():
        for corner in range(3):
            u, v = triangle[corner], triangle[(corner + 1) % 3]
            if (u, v) not in inner and (v, u) not in inner:
                follow[u] = v
    chains = []
    for first, last in ((a, b), (b, a)):
        chain: list[int] = []
        vertex = follow.get(first, last)
        while vertex != last and len(chain) <= len(follow):
            chain.append(vertex)
            vertex = follow.get(vertex, last)
        chains.append(chain)
    if len(chains[0]) + len(chains[1]) + 2 != len(follow) or not chains[0] or not chains[1]:
        raise OutlineError(a, b)
    made: list[tuple[int, int, int]] = []
    _fill(points, b, a, chains[0], made)  # the chain from a to b is on the right of a-b
    _fill(points, a, b, chains[1], made)
    kept = np.delete(triangles, opened, axis=0)
    made_now = np.array(made, dtype=np.int64)
    if (doubled_areas(points, made_now) <= 0.0).any():
        raise OutlineError(a, b)
    return np.concatenate([kept, made_now])


def _fill(points: Floats, a: int, b: int, chain: list[int], made: list[tuple[int, int, int]]) -> None:
    """Delaunay triangles between an edge a-b and the vertices on its left that lead from b to a."""
    todo = [(a, b, chain)]
    while todo:
        a, b, chain = todo.pop()
        if not chain:
            continue
        best = 0
        for place in range(1, len(chain)):
            if _in_circle(points[a], points[b], points[chain[best]], points[chain[place]]):
                best = place
        tip = chain[best]
        made.append((a, b, tip))
        todo += [(tip, b, chain[:best]), (a, tip, chain[best + 1 :])]


def _in_circle(a: Floats, b: Floats, c: Floats, d: Floats) -> bool:
    """Whether d lies within the circle through a, b, c, which are counter-clockwise."""
    rows = np.array([a - d, b - d, c - d])
    return bool(np.linalg.det(np.column_stack([rows, (rows**2).sum(axis=1)])) > 0.0)


def _inner(triangles: Ints, sides: Ints, count: int) -> Ints:
    """The triangles within the outlines.

    Vertices that are on no side are inside, and so is every triangle at one of them. Others are found by the sides: a
    triangle that has one in its own direction is inside, and one in the opposite direction outside.
    """
    rim = len(sides)
    open_ones = np.flatnonzero((triangles < rim).all(axis=1))
    if not len(open_ones):
        return triangles
    left = triangles[open_ones]
    one, other = left.ravel(), next_of(left).ravel()
    forward, backward = one * count + other, other * count + one
    side_keys = sides[:, 0] * count + sides[:, 1]
    is_inside, is_outside = np.isin(forward, side_keys), np.isin(backward, side_keys)
    owner = np.repeat(np.arange(len(left)), 3)
    order = np.argsort(forward, kind="stable")
    at = np.minimum(np.searchsorted(forward[order], backward), len(order) - 1)
    mate = np.where(forward[order][at] == backward, owner[order][at], -1)
    joined = (mate > owner) & ~is_inside & ~is_outside
    part = connected_components(len(left), owner[joined], mate[joined])
    outside = np.zeros(len(left), dtype=bool)
    outside[part[owner[is_outside]]] = True
    within = np.zeros(len(left), dtype=bool)
    within[part[owner[is_inside]]] = True
    touching = (mate < 0) & ~is_inside & ~is_outside  # beside an inner vertex, or beyond the hull
    start, end = triangles.ravel(), next_of(triangles).ravel()
    on_rim = (start < rim) & (end < rim)
    beside_inner = touching & np.isin(backward, start[on_rim] * count + end[on_rim])
    within[part[owner[beside_inner]]] = True
    both = within & outside
    if both.any():
        raise OutlineError(int(left[np.flatnonzero(both)[0], 0]))
    keep = np.ones(len(triangles), dtype=bool)
    keep[open_ones] = within[part]
    return triangles[keep]


def _without_flat(points: Floats, triangles: Ints, sides: Ints) -> Ints:
    """The triangles with flat ones joined to the neighbour over their longest edge, and both divided the other way.

    Vertices on a straight side are on it but for rounding, and so Delaunay's triangles may lie flat on it.
    """
    count = len(points)
    fixed = _keys(sides[:, 0], sides[:, 1], count)
    for _ in range(FLIP_ROUNDS):
        flat, length = flat_ones(points, triangles)
        if not len(flat):
            break
        long = length.argmax(axis=0)
        u, v = triangles[flat, long], triangles[flat, (long + 1) % 3]
        free = ~np.isin(_keys(u, v, count), fixed)
        forward = (triangles * count + next_of(triangles)).ravel()
        triangles, done = triangles.copy(), False
        touched: set[int] = set()
        for one, a, b in zip(flat[free].tolist(), u[free].tolist(), v[free].tolist(), strict=True):
            mates = np.flatnonzero(forward == b * count + a)
            if not len(mates) or one in touched or int(mates[0]) // 3 in touched:
                continue
            other = int(mates[0]) // 3
            touched |= {one, other}
            tip = int(triangles[one].sum()) - a - b
            far = int(triangles[other].sum()) - a - b
            triangles[one], triangles[other] = (tip, a, far), (tip, far, b)
            done = True
        if not done:
            break
    return triangles

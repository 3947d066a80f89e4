"""Mesh simplification by edge collapse in the rest shape: the same cloth with fewer vertices, and its prolongation.

The rest shape is a mesh of its own: panels in the plane (or the mesh as loaded), where a vertex on a seam has one
position in each panel, its *wedges* (Hoppe, "Progressive Meshes", 1996). A vertex is removed by moving it onto a
neighbour; on a seam or a hem only along it, at corners never. So panels keep their outlines, seams stay sewn, and the
coarse rest lengths are true ones. Between rounds of collapses edges are flipped (Delaunay).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices, face_normals
from warp_cloth.base.topology import ragged_rows
from warp_cloth.solver.implicit.sparse import Floats, Ints, entries_of

Flags = NDArray[np.bool_]

LEAST_QUALITY = 0.25  # 1: equilateral, 0: without area; thinner triangles make a coarse garment stiff
CORNER = np.radians(40.0)  # a seam or hem that bends by more keeps the vertex there
SPREAD = 0.3  # weights of positions outside the coarse outline are below 0 by no more than this
LEAST_FLIP_GAIN = 1e-6  # of the two cotangents' sum; below, four vertices lie on one circle
PASSES = 3  # of the search for independent vertices
ROUNDS = 24  # of collapses to a level, at most
MOST_LEFT = 0.67  # fraction of the vertices; a level that keeps more is not worth its cost


@dataclass(frozen=True, eq=False)
class Pattern:
    """A garment in its rest shape. W wedges, V vertices."""

    triangles: Indices  # wedge ids, shape [F, 3]
    place: Floats  # of each wedge in the rest shape [m], shape [W, 2 or 3]
    vertex: Indices  # of each wedge, shape [W]
    pinned: Flags  # shape [V]


@dataclass(frozen=True, eq=False)
class Coarsening:
    """A coarser garment and the prolongation to the finer one: x_fine = sum of weight * x_coarse over a row."""

    cloth: Pattern
    fine_vertex: Indices  # the finer garment's number of each vertex
    wedges: Indices  # the finer garment's number of each wedge
    start: Indices  # rows of the finer garment's vertices, shape [V_fine + 1]
    index: Indices  # coarse vertices
    weight: Floats  # which add up to 1 in a row


def rest_pattern(triangles: Indices, corners: Floats, pinned: Flags) -> Pattern:
    """The rest shape's wedges from each triangle's corners in it, shape [F, 3, 2 or 3]."""
    scale = float(np.abs(corners).max()) or 1.0
    place = corners.reshape(len(triangles) * 3, -1)
    key = np.column_stack([triangles.ravel(), np.round(place / scale * 2.0**24).astype(np.int64)])
    _, first, wedge = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return Pattern(
        wedge.reshape(-1, 3).astype(np.int32), place[first], triangles.ravel()[first].astype(np.int32), pinned
    )


def hash_fractions(ids: Ints) -> Floats:
    """A pseudo-random number in [0, 1) for each id, always the same (splitmix64)."""
    x = (ids.astype(np.uint64) + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
    x ^= x >> np.uint64(29)
    x *= np.uint64(0xBF58476D1CE4E5B9)
    x ^= x >> np.uint64(32)
    return (x >> np.uint64(11)).astype(np.float64) / 2.0**53


def quality(a: Floats, b: Floats, c: Floats) -> Floats:
    """Shape of triangles, 4 sqrt(3) area / sum of squared sides: 1 if equilateral; signed in the plane."""
    u, v = b - a, c - a
    flat = u.shape[1] == 2
    double = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] if flat else np.linalg.norm(np.cross(u, v), axis=1)
    total = (u**2).sum(1) + (v**2).sum(1) + ((c - b) ** 2).sum(1)
    return 2.0 * np.sqrt(3.0) * double / np.maximum(total, 1e-300)


def keeps_orientation(old: Floats, new: Floats) -> Flags:
    """Whether triangles [N, 3, d] keep their side up (in space, within some 80 degrees)."""
    if old.shape[2] == 2:
        return quality(old[:, 0], old[:, 1], old[:, 2]) * quality(new[:, 0], new[:, 1], new[:, 2]) > 0.0
    n = [face_normals(corners) for corners in (old, new)]
    return (n[0] * n[1]).sum(1) > 0.2 * np.linalg.norm(n[0], axis=1) * np.linalg.norm(n[1], axis=1)


class _Adjacency:
    """Neighbours and outlines of the mesh as one round finds it."""

    def __init__(self, cloth: Pattern, vertex_count: int) -> None:
        wedges = cloth.triangles.astype(np.int64)
        self.wedges = wedges
        self.corners = cloth.vertex[wedges].astype(np.int64)
        self.count = vertex_count
        wedge_count = len(cloth.vertex)
        # sides in both directions: equal wedge keys are one panel edge, equal vertex keys one edge
        w0, w1 = wedges.ravel(), np.roll(wedges, -1, axis=1).ravel()
        v0, v1 = self.corners.ravel(), np.roll(self.corners, -1, axis=1).ravel()
        side_key = np.minimum(w0, w1) * wedge_count + np.maximum(w0, w1)
        _, inverse, sides = np.unique(side_key, return_inverse=True, return_counts=True)
        outline = sides[inverse] == 1
        self.half_key = np.concatenate([v0 * vertex_count + v1, v1 * vertex_count + v0])
        order = np.argsort(self.half_key, kind="stable")
        key = self.half_key[order]
        first = np.concatenate([[True], key[1:] != key[:-1]])
        self.half_key = key[first]  # directed edges, sorted by start
        self.half_from, self.half_to = self.half_key // vertex_count, self.half_key % vertex_count
        group = np.cumsum(first) - 1
        both = np.concatenate([outline, outline])[order]
        self.half_outline = np.bincount(group, both, len(self.half_key)) > 0.0
        self.half_sides = np.bincount(group, minlength=len(self.half_key))
        # (wedge of start, end vertex) -> wedge of end
        pair = np.concatenate([w0 * vertex_count + v1, w1 * vertex_count + v0])
        self.pair_key, at = np.unique(pair, return_index=True)
        self.pair_wedge = np.concatenate([w1, w0])[at]
        self.half_start = np.searchsorted(self.half_from, np.arange(vertex_count + 1))
        self.corner_start, self.corner_order = ragged_rows(self.corners.ravel(), vertex_count)

    def half(self, start: Ints, end: Ints) -> Ints:
        """Index of a directed edge, -1 where there is none."""
        key = start * self.count + end
        at = np.minimum(np.searchsorted(self.half_key, key), len(self.half_key) - 1)
        return np.where(self.half_key[at] == key, at, -1)

    def wedge_at(self, wedge: Ints, end: Ints) -> Ints:
        """The wedge of vertex ``end`` that neighbours ``wedge`` in its panel, -1 where there is none."""
        key = wedge * self.count + end
        at = np.minimum(np.searchsorted(self.pair_key, key), len(self.pair_key) - 1)
        return np.where(self.pair_key[at] == key, self.pair_wedge[at], -1)

    def around(self, value: Floats) -> Floats:
        """Smallest of a vertex's and its neighbours' values, shape [V]."""
        least = np.full(self.count, np.inf)
        used = np.flatnonzero(self.half_start[1:] > self.half_start[:-1])
        least[used] = np.minimum.reduceat(value[self.half_to], self.half_start[used])
        return np.minimum(least, value)


def _removable(adjacency: _Adjacency, cloth: Pattern) -> Flags:
    """Vertices inside a panel, and those where a seam or hem runs straight."""
    points = cloth.place[adjacency.wedges]
    angle = np.zeros(len(cloth.vertex))
    for corner in range(3):
        u = points[:, (corner + 1) % 3] - points[:, corner]
        v = points[:, (corner + 2) % 3] - points[:, corner]
        size = np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1)
        cosine = np.clip((u * v).sum(1) / np.maximum(size, 1e-300), -1.0, 1.0)
        angle += np.bincount(adjacency.wedges[:, corner], np.arccos(cosine), len(angle))
    lines = np.bincount(adjacency.half_from, adjacency.half_outline, adjacency.count).astype(int)
    present = np.zeros(len(angle), dtype=bool)
    present[adjacency.wedges.ravel()] = True
    bent = present & (np.abs(angle - np.pi) > CORNER)
    corner_like = np.zeros(adjacency.count, dtype=bool)
    corner_like[cloth.vertex[bent]] = True
    alive = adjacency.half_start[1:] > adjacency.half_start[:-1]
    return alive & ((lines == 0) | ((lines == 2) & ~corner_like))


def _independent_vertices(adjacency: _Adjacency, cloth: Pattern, candidates: Flags) -> Ints:
    """Candidates to remove at once, no two of them neighbours, those with the smallest triangles first."""
    points = cloth.place[adjacency.wedges]
    area = np.abs(
        np.linalg.norm(points[:, 1] - points[:, 0], axis=1) * np.linalg.norm(points[:, 2] - points[:, 0], axis=1)
    )
    size = np.bincount(adjacency.corners.ravel(), np.repeat(area, 3), adjacency.count)
    lines = np.bincount(adjacency.half_from, adjacency.half_outline, adjacency.count) > 0
    shuffled = size * (1.0 + hash_fractions(np.arange(adjacency.count)))
    key = np.where(candidates, shuffled * np.where(lines, 2.0, 1.0), np.inf)
    chosen = np.zeros(adjacency.count, dtype=bool)
    for _ in range(PASSES):
        new = np.isfinite(key) & (adjacency.around(key) == key)
        chosen |= new
        near = adjacency.around(np.where(new, 0.0, 1.0)) == 0.0
        key = np.where(near, np.inf, key)
    found = np.flatnonzero(chosen)
    return found[np.argsort(size[found], kind="stable")]


def _collapse_qualities(adjacency: _Adjacency, cloth: Pattern, half: Ints) -> tuple[Floats, Ints, Ints, Ints]:
    """Worst triangle that each collapse half[i] leaves (-1: not allowed), and its changed corners.

    Returns:
        quality of each collapse; then of each changed corner its collapse, its flat index and its new wedge.
    """
    u, v = adjacency.half_from[half], adjacency.half_to[half]
    score = np.full(len(half), np.inf)
    owner, at = entries_of(adjacency.half_start, u)
    w = adjacency.half_to[at]
    shared = np.bincount(owner, adjacency.half(v[owner], w) >= 0, len(half))  # neighbours of both ends
    score[shared != adjacency.half_sides[half]] = -1.0
    owner, at = entries_of(adjacency.corner_start.astype(np.int64), u)
    corner = adjacency.corner_order[at]
    triangle = corner // 3
    stays = ~(adjacency.corners[triangle] == v[owner][:, None]).any(axis=1)
    owner, corner, triangle = owner[stays], corner[stays], triangle[stays]
    wedge = adjacency.wedge_at(adjacency.wedges.ravel()[corner], v[owner])
    score[owner[wedge < 0]] = -1.0
    old = cloth.place[adjacency.wedges[triangle]]
    new = old.copy()
    new[np.arange(len(corner)), corner % 3] = cloth.place[np.maximum(wedge, 0)]
    shape = np.abs(quality(new[:, 0], new[:, 1], new[:, 2]))
    shape[~keeps_orientation(old, new)] = -1.0
    np.minimum.at(score, owner, shape)
    return score, owner, corner, wedge


def _weights(adjacency: _Adjacency, cloth: Pattern, corner: Ints, wedge: Ints) -> Floats:
    """Barycentric weights of a corner's old position in its triangle, once it has moved to ``wedge``, shape [N, 3]."""
    rows = np.arange(len(corner))
    spot = cloth.place[adjacency.wedges.ravel()[corner]]
    new = cloth.place[adjacency.wedges[corner // 3]]
    new[rows, corner % 3] = cloth.place[wedge]
    u, v, d = new[:, 1] - new[:, 0], new[:, 2] - new[:, 0], spot - new[:, 0]
    uu, uv, vv = (u * u).sum(1), (u * v).sum(1), (v * v).sum(1)
    ud, vd = (u * d).sum(1), (v * d).sum(1)
    det = np.maximum(uu * vv - uv * uv, 1e-300)
    s, t = (ud * vv - vd * uv) / det, (vd * uu - ud * uv) / det
    return np.stack([1.0 - s - t, s, t], axis=1)


def _collapse_round(cloth: Pattern, blocked: Flags, most: int) -> tuple[Pattern, Ints, Ints, Floats, Flags]:
    """Removes up to ``most`` vertices by one round of independent collapses.

    Returns:
        the pattern, the removed vertices, the three that each is interpolated from, their weights, and
        flags of vertices that cannot be removed.
    """
    adjacency = _Adjacency(cloth, len(cloth.pinned))
    chosen = _independent_vertices(adjacency, cloth, _removable(adjacency, cloth) & ~blocked)[: 2 * most]
    owner, half = entries_of(adjacency.half_start, chosen)
    u, v = adjacency.half_from[half], adjacency.half_to[half]
    on_line = np.bincount(adjacency.half_from, adjacency.half_outline, adjacency.count) > 0
    allowed = (~on_line[u] | adjacency.half_outline[half]) & (~cloth.pinned[u] | cloth.pinned[v])
    half, owner = half[allowed], owner[allowed]
    score, collapse, corner, wedge = _collapse_qualities(adjacency, cloth, half)
    best = np.full(len(chosen), -1.0)
    np.maximum.at(best, owner, score)
    blocked = blocked.copy()
    blocked[chosen[best < LEAST_QUALITY]] = True
    winner = np.flatnonzero((score == best[owner]) & (score >= LEAST_QUALITY))
    _, first = np.unique(owner[winner], return_index=True)
    winner = winner[first][:most]
    won = np.isin(collapse, winner)
    collapse, corner, wedge = collapse[won], corner[won], wedge[won]
    valid = np.isin(collapse, np.setdiff1d(winner, _conflicting(adjacency, collapse, corner, adjacency.half_to[half])))
    collapse, corner, wedge = collapse[valid], corner[valid], wedge[valid]

    weights = _weights(adjacency, cloth, corner, wedge)
    order = np.lexsort((-weights.min(axis=1), collapse))
    _, first = np.unique(collapse[order], return_index=True)
    pick = order[first]
    weights = np.clip(weights[pick], -SPREAD, 1.0 + SPREAD)
    weights /= weights.sum(axis=1, keepdims=True)
    removed = adjacency.half_from[half][collapse[pick]]
    follows = adjacency.corners[corner[pick] // 3].copy()
    follows[np.arange(len(pick)), corner[pick] % 3] = adjacency.half_to[half][collapse[pick]]
    return _collapsed(cloth, adjacency, removed, corner, wedge), removed, follows, weights, blocked


def _conflicting(adjacency: _Adjacency, collapse: Ints, corner: Ints, end: Ints) -> Ints:
    """Those of the collapses that would make the same edge as an earlier one."""
    nexts = adjacency.corners.ravel()[corner // 3 * 3 + (corner % 3 + 1) % 3]
    lasts = adjacency.corners.ravel()[corner // 3 * 3 + (corner % 3 + 2) % 3]
    fresh, ends, collapses = np.concatenate([nexts, lasts]), np.tile(end[collapse], 2), np.tile(collapse, 2)
    key = np.minimum(fresh, ends) * adjacency.count + np.maximum(fresh, ends)
    pairs = np.unique(np.column_stack([key, collapses]), axis=0)
    twice = np.flatnonzero(pairs[1:, 0] == pairs[:-1, 0]) + 1
    return np.unique(pairs[twice, 1])


def _collapsed(cloth: Pattern, adjacency: _Adjacency, removed: Ints, corner: Ints, wedge: Ints) -> Pattern:
    """The pattern without the removed vertices, after these corners have moved to these wedges."""
    wedges = adjacency.wedges.copy().ravel()
    wedges[corner] = wedge
    wedges = wedges.reshape(-1, 3)
    out = np.zeros(adjacency.count, dtype=bool)
    out[removed] = True
    wedges = wedges[~out[cloth.vertex[wedges]].any(axis=1)]
    return Pattern(wedges.astype(np.int32), cloth.place, cloth.vertex, cloth.pinned)


def _flip_edges(cloth: Pattern, vertex_count: int) -> Pattern:
    """The pattern with edges inside panels flipped where that makes rounder triangles (Delaunay)."""
    wedges = cloth.triangles.astype(np.int64)
    count = len(cloth.vertex)
    starts, ends, tips = wedges.ravel(), np.roll(wedges, -1, axis=1).ravel(), np.roll(wedges, -2, axis=1).ravel()
    key = np.minimum(starts, ends) * count + np.maximum(starts, ends)
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(key[order][1:] == key[order][:-1])
    one, two = order[same], order[same + 1]
    opposed = (starts[one] == ends[two]) & (tips[one] != tips[two])
    one, two = one[opposed], two[opposed]
    a, b, c, d = (cloth.place[x] for x in (starts[one], ends[one], tips[one], tips[two]))
    gain = -(_cotangent(a - c, b - c) + _cotangent(a - d, b - d))
    old = np.stack([a, b, c], axis=1)
    rounder = gain > LEAST_FLIP_GAIN
    rounder &= keeps_orientation(old, np.stack([a, d, c], axis=1)) & keeps_orientation(old, np.stack([d, b, c], axis=1))

    def edge_key(first: Ints, second: Ints) -> Ints:
        v0, v1 = cloth.vertex[first].astype(np.int64), cloth.vertex[second].astype(np.int64)
        return np.asarray(np.minimum(v0, v1) * vertex_count + np.maximum(v0, v1))

    new = edge_key(tips[one], tips[two])
    rounder &= ~np.isin(new, np.unique(edge_key(starts, ends))) & (cloth.vertex[tips[one]] != cloth.vertex[tips[two]])
    # a triangle flips only the edge with the largest gain, and no edge is created twice
    gain = np.where(rounder, gain * (1.0 + 1e-9 * hash_fractions(np.arange(len(gain)))), -np.inf)
    best = np.full(len(wedges), -np.inf)
    np.maximum.at(best, one // 3, gain)
    np.maximum.at(best, two // 3, gain)
    go = np.flatnonzero(rounder & (best[one // 3] == gain) & (best[two // 3] == gain))
    go = go[np.unique(new[go], return_index=True)[1]]
    out = wedges.copy()
    out[one[go] // 3] = np.stack([starts[one[go]], tips[two[go]], tips[one[go]]], axis=1)
    out[two[go] // 3] = np.stack([tips[two[go]], ends[one[go]], tips[one[go]]], axis=1)
    return Pattern(out.astype(np.int32), cloth.place, cloth.vertex, cloth.pinned)


def _cotangent(u: Floats, v: Floats) -> Floats:
    """Cotangent of the angle between u and v."""
    dot = (u * v).sum(1)
    return np.asarray(dot / np.sqrt(np.maximum((u * u).sum(1) * (v * v).sum(1) - dot**2, 1e-300)))


def coarsen(cloth: Pattern, target: int) -> Coarsening | None:
    """The garment with about ``target`` vertices, or None if it cannot lose a third of them."""
    count = len(cloth.pinned)
    now = cloth
    row = column = np.arange(count)
    value = np.ones(count)
    left = count
    blocked = np.zeros(count, dtype=bool)
    for _ in range(ROUNDS):
        if left <= target:
            break
        now, removed, follows, weights, blocked = _collapse_round(now, blocked, left - target)
        if len(removed) == 0:
            break
        now = _flip_edges(now, count)
        left -= len(removed)
        place = np.full(count, -1)
        place[removed] = np.arange(len(removed))
        moves = place[column] >= 0
        at = place[column[moves]]
        row = np.concatenate([row[~moves], np.repeat(row[moves], 3)])
        column = np.concatenate([column[~moves], follows[at].ravel()])
        value = np.concatenate([value[~moves], (value[moves][:, None] * weights[at]).ravel()])
        key, number = np.unique(row * count + column, return_inverse=True)
        row, column = key // count, key % count
        value = np.bincount(number, value).astype(np.float64)
    if left > MOST_LEFT * count:
        return None
    return _renumbered(now, row, column, value, count)


def _renumbered(cloth: Pattern, row: Ints, col: Ints, value: Floats, count: int) -> Coarsening:
    """Numbers the coarse vertices and wedges from 0."""
    fine_vertex = np.unique(col)
    number = np.full(count, -1)
    number[fine_vertex] = np.arange(len(fine_vertex))
    used = np.unique(cloth.triangles)
    wedge = np.full(len(cloth.vertex), -1)
    wedge[used] = np.arange(len(used))
    coarse = Pattern(
        wedge[cloth.triangles].astype(np.int32),
        cloth.place[used],
        number[cloth.vertex[used]].astype(np.int32),
        cloth.pinned[fine_vertex],
    )
    start = np.searchsorted(row, np.arange(count + 1))
    return Coarsening(
        coarse,
        fine_vertex.astype(np.int32),
        used.astype(np.int32),
        start.astype(np.int32),
        number[col].astype(np.int32),
        value,
    )

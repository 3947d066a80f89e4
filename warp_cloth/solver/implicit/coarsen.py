"""Coarser versions of a garment: fewer vertices of the same cloth, by collapsing edges in its rest shape.

The rest shape is a mesh of its own: panels in the plane (or the mesh as loaded), where a vertex on a seam has one
place in each panel, its *wedges*. A vertex is taken out by moving it onto a neighbour; on a seam or a hem only along
it, at corners never. So panels keep their outlines, seams stay sewn, and the coarse rest lengths are true ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices
from warp_cloth.base.topology import ragged_rows
from warp_cloth.garment.rest import Floats

Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

LEAST_QUALITY = 0.25  # 1: equilateral, 0: without area; thinner triangles make a coarse garment stiff
CORNER = np.radians(40.0)  # a seam or hem that turns more keeps the vertex where it turns
SPREAD = 0.3  # places outside the coarse outline are extrapolated by no more than this share
LEAST_FLIP_GAIN = 1e-6  # of the two cotangents' sum; below, four vertices lie on one circle
PASSES = 3  # of the search for vertices that may go at once
ROUNDS = 24  # at most, to a level
MOST_LEFT = 0.67  # share of the vertices; a level that keeps more is not worth its while


@dataclass(frozen=True, eq=False)
class Pattern:
    """A garment in its rest shape. W wedges, V vertices."""

    triangles: Indices  # wedge ids, shape [F, 3]
    place: Floats  # of each wedge in the rest shape [m], shape [W, 2 or 3]
    vertex: Indices  # of each wedge, shape [W]
    pinned: Flags  # shape [V]


@dataclass(frozen=True, eq=False)
class Coarse:
    """A coarser garment and how the finer one follows it: x_fine = sum of weight * x_coarse over a row."""

    cloth: Pattern
    kept: Indices  # its vertices in the finer garment
    wedges: Indices  # its wedges in the finer garment
    start: Indices  # rows of the finer garment's vertices, shape [V_fine + 1]
    index: Indices  # coarse vertices
    weight: Floats


def rest_pattern(triangles: Indices, corners: Floats, pinned: Flags) -> Pattern:
    """The rest shape's wedges from each triangle's corners in it, shape [F, 3, 2 or 3]."""
    scale = float(np.abs(corners).max()) or 1.0
    place = corners.reshape(len(triangles) * 3, -1)
    key = np.column_stack([triangles.ravel(), np.round(place / scale * 2.0**24).astype(np.int64)])
    _, first, wedge = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return Pattern(
        wedge.reshape(-1, 3).astype(np.int32), place[first], triangles.ravel()[first].astype(np.int32), pinned
    )


def hashed(ids: Ints) -> Floats:
    """A number in [0, 1) for each id, always the same, without order."""
    x = (ids.astype(np.uint64) + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
    x ^= x >> np.uint64(29)
    x *= np.uint64(0xBF58476D1CE4E5B9)
    x ^= x >> np.uint64(32)
    return (x >> np.uint64(11)).astype(np.float64) / 2.0**53


def quality(a: Floats, b: Floats, c: Floats) -> Floats:
    """4 sqrt(3) area over the sum of the squared sides, signed in the plane."""
    u, v = b - a, c - a
    flat = u.shape[1] == 2
    double = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] if flat else np.linalg.norm(np.cross(u, v), axis=1)
    total = (u**2).sum(1) + (v**2).sum(1) + ((c - b) ** 2).sum(1)
    return 2.0 * np.sqrt(3.0) * double / np.maximum(total, 1e-300)


def faces_same_way(old: Floats, new: Floats) -> Flags:
    """Whether triangles [N, 3, d] keep their side up (within some 80 degrees in space)."""
    if old.shape[2] == 2:
        return quality(old[:, 0], old[:, 1], old[:, 2]) * quality(new[:, 0], new[:, 1], new[:, 2]) > 0.0
    n = [np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]) for t in (old, new)]
    return (n[0] * n[1]).sum(1) > 0.2 * np.linalg.norm(n[0], axis=1) * np.linalg.norm(n[1], axis=1)


class _Star:
    """What one round needs to know of the mesh as it stands."""

    def __init__(self, cloth: Pattern, vertex_count: int) -> None:
        wedges = cloth.triangles.astype(np.int64)
        self.wedges = wedges
        self.corners = cloth.vertex[wedges].astype(np.int64)
        self.count = vertex_count
        wedge_count = len(cloth.vertex)
        # sides both ways: wedge key tells panel edges, vertex key edges
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
        """The wedge of vertex ``end`` in the panel where ``wedge`` is its neighbour, -1 where there is none."""
        key = wedge * self.count + end
        at = np.minimum(np.searchsorted(self.pair_key, key), len(self.pair_key) - 1)
        return np.where(self.pair_key[at] == key, self.pair_wedge[at], -1)

    def around(self, value: Floats) -> Floats:
        """Least of a vertex's and its neighbours' values, shape [V]; inf where there are none."""
        least = np.full(self.count, np.inf)
        used = np.flatnonzero(self.half_start[1:] > self.half_start[:-1])
        least[used] = np.minimum.reduceat(value[self.half_to], self.half_start[used])
        return np.minimum(least, value)


def _expand(start: Ints, rows: Ints) -> tuple[Ints, Ints]:
    """For each of ``rows``: its place in ``rows``, repeated, and the entries start[row] .. start[row + 1]."""
    count = start[rows + 1] - start[rows]
    owner = np.repeat(np.arange(len(rows)), count)
    first = np.cumsum(count) - count
    return owner, start[rows][owner] + np.arange(len(owner)) - first[owner]


def _removable(star: _Star, cloth: Pattern) -> Flags:
    """Vertices inside a panel, and those on a seam or hem that runs straight on."""
    points = cloth.place[star.wedges]
    angle = np.zeros(len(cloth.vertex))
    for corner in range(3):
        u = points[:, (corner + 1) % 3] - points[:, corner]
        v = points[:, (corner + 2) % 3] - points[:, corner]
        size = np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1)
        cosine = np.clip((u * v).sum(1) / np.maximum(size, 1e-300), -1.0, 1.0)
        angle += np.bincount(star.wedges[:, corner], np.arccos(cosine), len(angle))
    lines = np.bincount(star.half_from, star.half_outline, star.count).astype(int)
    present = np.zeros(len(angle), dtype=bool)
    present[star.wedges.ravel()] = True
    bent = present & (np.abs(angle - np.pi) > CORNER)
    corner_like = np.zeros(star.count, dtype=bool)
    corner_like[cloth.vertex[bent]] = True
    alive = star.half_start[1:] > star.half_start[:-1]
    return alive & ((lines == 0) | ((lines == 2) & ~corner_like))


def _chosen(star: _Star, cloth: Pattern, open_: Flags) -> Ints:
    """Vertices to take out at once: no two are neighbours, those in dense places first."""
    points = cloth.place[star.wedges]
    area = np.abs(
        np.linalg.norm(points[:, 1] - points[:, 0], axis=1) * np.linalg.norm(points[:, 2] - points[:, 0], axis=1)
    )
    size = np.bincount(star.corners.ravel(), np.repeat(area, 3), star.count)
    lines = np.bincount(star.half_from, star.half_outline, star.count) > 0
    key = np.where(open_, size * (1.0 + hashed(np.arange(star.count))) * np.where(lines, 2.0, 1.0), np.inf)
    chosen = np.zeros(star.count, dtype=bool)
    for _ in range(PASSES):
        new = np.isfinite(key) & (star.around(key) == key)
        chosen |= new
        near = star.around(np.where(new, 0.0, 1.0)) == 0.0
        key = np.where(near, np.inf, key)
    found = np.flatnonzero(chosen)
    return found[np.argsort(size[found], kind="stable")]


def _judge(star: _Star, cloth: Pattern, half: Ints) -> tuple[Floats, Ints, Ints, Ints]:
    """How good each collapse half[i] is (-1: not allowed); and its changed corners: owner, flat corner, new wedge."""
    u, v = star.half_from[half], star.half_to[half]
    score = np.full(len(half), np.inf)
    owner, at = _expand(star.half_start, u)
    w = star.half_to[at]
    shared = np.bincount(owner, star.half(v[owner], w) >= 0, len(half))  # neighbours of both; v is none of its own
    score[shared != star.half_sides[half]] = -1.0
    owner, at = _expand(star.corner_start.astype(np.int64), u)
    corner = star.corner_order[at]
    triangle = corner // 3
    stays = ~(star.corners[triangle] == v[owner][:, None]).any(axis=1)
    owner, corner, triangle = owner[stays], corner[stays], triangle[stays]
    wedge = star.wedge_at(star.wedges.ravel()[corner], v[owner])
    score[owner[wedge < 0]] = -1.0
    old = cloth.place[star.wedges[triangle]]
    new = old.copy()
    new[np.arange(len(corner)), corner % 3] = cloth.place[np.maximum(wedge, 0)]
    good = np.abs(quality(new[:, 0], new[:, 1], new[:, 2]))
    good[~faces_same_way(old, new)] = -1.0
    np.minimum.at(score, owner, good)
    return score, owner, corner, wedge


def _weights(star: _Star, cloth: Pattern, corner: Ints, wedge: Ints) -> Floats:
    """Where a corner lies in its triangle once that corner has moved to ``wedge``: weights, shape [N, 3]."""
    rows = np.arange(len(corner))
    spot = cloth.place[star.wedges.ravel()[corner]]
    new = cloth.place[star.wedges[corner // 3]]
    new[rows, corner % 3] = cloth.place[wedge]
    u, v, d = new[:, 1] - new[:, 0], new[:, 2] - new[:, 0], spot - new[:, 0]
    uu, uv, vv = (u * u).sum(1), (u * v).sum(1), (v * v).sum(1)
    ud, vd = (u * d).sum(1), (v * d).sum(1)
    det = np.maximum(uu * vv - uv * uv, 1e-300)
    s, t = (ud * vv - vd * uv) / det, (vd * uu - ud * uv) / det
    return np.stack([1.0 - s - t, s, t], axis=1)


def _round(cloth: Pattern, blocked: Flags, most: int) -> tuple[Pattern, Ints, Ints, Floats, Flags]:
    """Takes out up to ``most`` vertices; returns them with the three that each follows, and their weights."""
    star = _Star(cloth, len(cloth.pinned))
    chosen = _chosen(star, cloth, _removable(star, cloth) & ~blocked)[: 2 * most]
    owner, half = _expand(star.half_start, chosen)
    u, v = star.half_from[half], star.half_to[half]
    on_line = np.bincount(star.half_from, star.half_outline, star.count) > 0
    allowed = (~on_line[u] | star.half_outline[half]) & (~cloth.pinned[u] | cloth.pinned[v])
    half, owner = half[allowed], owner[allowed]
    score, part, corner, wedge = _judge(star, cloth, half)
    best = np.full(len(chosen), -1.0)
    np.maximum.at(best, owner, score)
    blocked = blocked.copy()
    blocked[chosen[best < LEAST_QUALITY]] = True
    winner = np.flatnonzero((score == best[owner]) & (score >= LEAST_QUALITY))
    _, first = np.unique(owner[winner], return_index=True)
    winner = winner[first][:most]
    mine = np.isin(part, winner)
    part, corner, wedge = part[mine], corner[mine], wedge[mine]
    kept = np.isin(part, np.setdiff1d(winner, _clashing(star, part, corner, star.half_to[half])))
    part, corner, wedge = part[kept], corner[kept], wedge[kept]

    weights = _weights(star, cloth, corner, wedge)
    order = np.lexsort((-weights.min(axis=1), part))
    _, first = np.unique(part[order], return_index=True)
    pick = order[first]
    weights = np.clip(weights[pick], -SPREAD, 1.0 + SPREAD)
    weights /= weights.sum(axis=1, keepdims=True)
    gone = star.half_from[half][part[pick]]
    follows = star.corners[corner[pick] // 3].copy()
    follows[np.arange(len(pick)), corner[pick] % 3] = star.half_to[half][part[pick]]
    return _without(cloth, star, gone, corner, wedge), gone, follows, weights, blocked


def _clashing(star: _Star, part: Ints, corner: Ints, end: Ints) -> Ints:
    """Those of the collapses that would make an edge that an earlier one makes, too."""
    nexts = star.corners.ravel()[corner // 3 * 3 + (corner % 3 + 1) % 3]
    lasts = star.corners.ravel()[corner // 3 * 3 + (corner % 3 + 2) % 3]
    fresh, ends, parts = np.concatenate([nexts, lasts]), np.tile(end[part], 2), np.tile(part, 2)
    key = np.minimum(fresh, ends) * star.count + np.maximum(fresh, ends)
    pairs = np.unique(np.column_stack([key, parts]), axis=0)
    twice = np.flatnonzero(pairs[1:, 0] == pairs[:-1, 0]) + 1
    return np.unique(pairs[twice, 1])


def _without(cloth: Pattern, star: _Star, gone: Ints, corner: Ints, wedge: Ints) -> Pattern:
    """The pattern after these corners have moved to these wedges."""
    wedges = star.wedges.copy().ravel()
    wedges[corner] = wedge
    wedges = wedges.reshape(-1, 3)
    out = np.zeros(star.count, dtype=bool)
    out[gone] = True
    wedges = wedges[~out[cloth.vertex[wedges]].any(axis=1)]
    return Pattern(wedges.astype(np.int32), cloth.place, cloth.vertex, cloth.pinned)


def _flipped(cloth: Pattern, vertex_count: int) -> Pattern:
    """Edges inside panels turned where that makes rounder triangles (Delaunay)."""
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
    rounder &= faces_same_way(old, np.stack([a, d, c], axis=1)) & faces_same_way(old, np.stack([d, b, c], axis=1))

    def edge_key(first: Ints, second: Ints) -> Ints:
        v0, v1 = cloth.vertex[first].astype(np.int64), cloth.vertex[second].astype(np.int64)
        return np.asarray(np.minimum(v0, v1) * vertex_count + np.maximum(v0, v1))

    new = edge_key(tips[one], tips[two])
    rounder &= ~np.isin(new, np.unique(edge_key(starts, ends))) & (cloth.vertex[tips[one]] != cloth.vertex[tips[two]])
    # a triangle turns one edge at a time, the one that gains most, and no edge is made twice
    gain = np.where(rounder, gain * (1.0 + 1e-9 * hashed(np.arange(len(gain)))), -np.inf)
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
    """Of the angle between u and v."""
    dot = (u * v).sum(1)
    return np.asarray(dot / np.sqrt(np.maximum((u * u).sum(1) * (v * v).sum(1) - dot**2, 1e-300)))


def coarsen(cloth: Pattern, target: int) -> Coarse | None:
    """The garment with about ``target`` vertices, or None where it cannot lose a third of them."""
    count = len(cloth.pinned)
    now = cloth
    row = column = np.arange(count)
    value = np.ones(count)
    left = count
    blocked = np.zeros(count, dtype=bool)
    for _ in range(ROUNDS):
        if left <= target:
            break
        now, gone, follows, weights, blocked = _round(now, blocked, left - target)
        if len(gone) == 0:
            break
        now = _flipped(now, count)
        left -= len(gone)
        place = np.full(count, -1)
        place[gone] = np.arange(len(gone))
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
    return _relabelled(now, row, column, value, count)


def _relabelled(cloth: Pattern, row: Ints, col: Ints, value: Floats, count: int) -> Coarse:
    """Coarse vertices and wedges numbered from 0."""
    kept = np.unique(col)
    number = np.full(count, -1)
    number[kept] = np.arange(len(kept))
    used = np.unique(cloth.triangles)
    wedge = np.full(len(cloth.vertex), -1)
    wedge[used] = np.arange(len(used))
    coarse = Pattern(
        wedge[cloth.triangles].astype(np.int32),
        cloth.place[used],
        number[cloth.vertex[used]].astype(np.int32),
        cloth.pinned[kept],
    )
    start = np.searchsorted(row, np.arange(count + 1))
    return Coarse(
        coarse,
        kept.astype(np.int32),
        used.astype(np.int32),
        start.astype(np.int32),
        number[col].astype(np.int32),
        value,
    )

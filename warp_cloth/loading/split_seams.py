"""Joining seams whose two sides have vertices at different places: edges are split where the other side has one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from warp_cloth.base.connected import connected_components
from warp_cloth.loading.raw import Floats, Ints
from warp_cloth.loading.unique_rows import edges_of, unique_rows
from warp_cloth.loading.weld import NEAR, NEAR_FRACTION

BOWED = 0.05  # of an edge, that the other side of a curved seam may be off it: an edge of 30 mm round a waist has 0.02
LAYERED = 0.5  # cosine of the angle between two faces at a rim from which on they lie on each other
ROUNDS = 3  # of leaving out what joins no edge


@dataclass(frozen=True, eq=False)
class SplitSeams:
    """Triangles whose pieces are joined along their rims."""

    triangles: Ints  # vertices, shape [F, 3]
    source: Ints  # triangle that each comes from, ascending, shape [F]
    weights: Floats  # of that triangle's corners at each corner, shape [F, 3, 3]
    vertex: Ints  # lowest vertex joined with each, shape [V]
    joints: int  # vertices that lie on the other side of a seam


@dataclass(frozen=True, eq=False)
class _Touching:
    """Where vertices of rims lie on rims of other pieces."""

    sides: Ints  # three times the triangle plus the side's number, shape [N]
    vertices: Ints  # that lie on them, shape [N]
    along: Floats  # where, from 0 at the side's start to 1, shape [N]

    def without(self, vertices: Ints) -> _Touching:
        kept = ~np.isin(self.vertices, vertices)
        return _Touching(self.sides[kept], self.vertices[kept], self.along[kept])


def split_seams(points: Floats, triangles: Ints) -> SplitSeams | None:
    """Separate pieces joined where their rims run along each other; None: they do so nowhere.

    As near as vertices are that are welded. Rims that only touch at a point stay apart, and all do where more than two
    would meet, and where one lies on the other: those are layers. A piece is not joined with itself: a slit is open.

    Args:
        points: [m], shape [V, 3].
        triangles: welded, shape [F, 3].
    """
    piece = connected_components(len(points), *edges_of(triangles).T)
    if len(np.unique(piece[triangles[:, 0]])) < 2:
        return None
    touching = _touching(points, triangles, piece)
    for _ in range(ROUNDS):
        if not len(touching.vertices):
            return None
        split = _split(triangles, touching, len(points))
        if split is None:
            return None
        idle = np.setdiff1d(touching.vertices, _joined(split, points, piece[triangles[:, 0]]))
        if not len(idle):
            return split
        touching = touching.without(idle)
    return None


def _touching(points: Floats, triangles: Ints, piece: Ints) -> _Touching:
    from scipy.spatial import cKDTree

    edges = edges_of(triangles)
    found = unique_rows(np.sort(edges, axis=1))
    rim = np.flatnonzero(found.count[found.number] == 1)
    if not len(rim):
        return _Touching(rim, rim, np.zeros(0))
    rim_vertices = np.unique(edges[rim])
    start, along = points[edges[rim, 0]], points[edges[rim, 1]] - points[edges[rim, 0]]
    length = np.linalg.norm(along, axis=1)
    reach = 0.5 * length + NEAR
    near = cKDTree(points[rim_vertices]).query_ball_point(start + 0.5 * along, reach).tolist()
    row = np.repeat(np.arange(len(rim)), [len(each) for each in near])
    vertex = rim_vertices[np.array([number for each in near for number in each], dtype=np.int64)]
    others = piece[vertex] != piece[edges[rim[row], 0]]
    row, vertex = row[others], vertex[others]
    off = points[vertex] - start[row]
    place = np.clip(np.einsum("ij,ij->i", off, along[row]) / np.maximum(length[row] ** 2, 1e-30), 0.0, 1.0)
    away = np.linalg.norm(off - place[:, None] * along[row], axis=1)
    tolerance = np.minimum(NEAR, NEAR_FRACTION * length[row])
    on = away <= np.minimum(NEAR, BOWED * length[row])
    row, vertex, place, tolerance = row[on], vertex[on], place[on], tolerance[on]
    place = np.where(place * length[row] <= tolerance, 0.0, place)
    place = np.where((1.0 - place) * length[row] <= tolerance, 1.0, place)
    return _Touching(rim[row], vertex, place)


def _split(triangles: Ints, touching: _Touching, vertex_count: int) -> SplitSeams | None:
    """The triangles with their sides split at what lies on them; None: more than two would meet at an edge."""
    edges = edges_of(triangles)
    at_end = (touching.along == 0.0) | (touching.along == 1.0)
    ends = edges[touching.sides[at_end], touching.along[at_end].astype(np.int64)]
    vertex = connected_components(vertex_count, touching.vertices[at_end], ends)
    inserted: dict[int, dict[int, float]] = {}
    for side, own, along in zip(
        touching.sides[~at_end], touching.vertices[~at_end], touching.along[~at_end], strict=True
    ):
        inserted.setdefault(int(side), {})[int(vertex[own])] = float(along)
    whole = np.ones(len(triangles), dtype=bool)
    whole[[side // 3 for side in inserted]] = False
    parts = [vertex[triangles[whole]]]
    sources, weights = [np.flatnonzero(whole)], [np.tile(np.eye(3), (int(whole.sum()), 1, 1))]
    for number in np.flatnonzero(~whole).tolist():
        corners = [(int(v), tuple(row)) for v, row in zip(vertex[triangles[number]], np.eye(3).tolist(), strict=True)]
        sides = {side: inserted[3 * number + side] for side in range(3) if 3 * number + side in inserted}
        for cut in _cut(corners, sides):
            parts.append(np.array([[v for v, _ in cut]]))
            sources.append(np.array([number]))
            weights.append(np.array([[row for _, row in cut]]))
    source = np.concatenate(sources)
    order = np.argsort(source, kind="stable")
    joined = np.concatenate(parts)[order]
    before = unique_rows(np.sort(edges, axis=1)).count.max()
    new = np.sort(edges_of(joined), axis=1)
    if unique_rows(new).count.max() > max(before, 2) or (new[:, 0] == new[:, 1]).any():
        return None
    joints = len(np.unique(touching.vertices))
    return SplitSeams(joined, source[order], np.concatenate(weights)[order], vertex, joints)


_Corner = tuple[int, tuple[float, ...]]  # a vertex, and the weights of the triangle's corners there


def _cut(corners: list[_Corner], sides: Mapping[int, Mapping[int, float]]) -> Iterator[list[_Corner]]:
    """A triangle cut into several, whose sides are split at vertices: for each side, where along it they lie."""
    if not sides:
        yield corners
        return
    side = min(sides)
    a, b, c = (corners[(side + turn) % 3] for turn in range(3))
    along = [a]
    for vertex, share in sorted(sides[side].items(), key=lambda item: item[1]):
        mixed = tuple((1.0 - share) * p + share * q for p, q in zip(a[1], b[1], strict=True))
        along.append((vertex, mixed))
    along.append(b)
    last = len(along) - 2
    for number, (first, second) in enumerate(pairwise(along)):
        # the first keeps the side from c to a, and the last that from b to c
        rest = {}
        if number == last and (side + 1) % 3 in sides:
            rest[1] = sides[(side + 1) % 3]
        if number == 0 and (side + 2) % 3 in sides:
            rest[2] = sides[(side + 2) % 3]
        yield from _cut([first, second, c], rest)


def _joined(split: SplitSeams, points: Floats, piece: Ints) -> Ints:
    """The vertices at edges that faces of two pieces share, with all that are joined with them.

    ``piece``: of each triangle before, shape [F].
    """
    edges = edges_of(split.triangles)
    found = unique_rows(np.sort(edges, axis=1))
    order = np.argsort(found.number, kind="stable")
    first = (np.cumsum(found.count) - found.count)[found.count == 2]
    own = piece[split.source[order // 3]]
    first = first[own[first] != own[first + 1]]
    start, end = np.moveaxis(points[edges[order[first]]], 1, 0)
    unit = (end - start) / np.maximum(np.linalg.norm(end - start, axis=1, keepdims=True), 1e-30)

    def inwards(side: Ints) -> Floats:
        """Unit vectors from the edge into the face on one side of it, shape [N, 3]."""
        third = split.triangles.reshape(-1)[side // 3 * 3 + (side % 3 + 2) % 3]
        off = points[third] - start
        off = off - np.einsum("ij,ij->i", off, unit)[:, None] * unit
        return np.asarray(off / np.maximum(np.linalg.norm(off, axis=1, keepdims=True), 1e-30))

    along = np.einsum("ij,ij->i", inwards(order[first]), inwards(order[first + 1])) > LAYERED
    return np.flatnonzero(np.isin(split.vertex, edges[order[first[~along]]]))

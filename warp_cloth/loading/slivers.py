"""Needle-thin faces of a garment, as booleans and decimation leave them.

Cloth so thin is so stiff for its mass that forces never balance. Short edges are drawn together; a face that is flat
without one, as its corner lies on its longest side, has its four corners joined the other way across that side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import face_normals
from warp_cloth.loading.raw import Floats, Ints, counted
from warp_cloth.loading.unique_rows import edges_of, unique_rows

# An edge is too short below this length [m], and below this part of the longest of each of its faces: needles.
SHORT, SHORT_PART = 2e-3, 0.15
FLAT = 0.05  # height of a face over its longest side, below which it is joined the other way, if so low and below
ROUNDS = 8  # in each of which edges are changed that are no neighbours


@dataclass(frozen=True, eq=False)
class WithoutSlivers:
    """A garment's faces where no more can be done about needles."""

    vertex: Ints  # that each became, shape [V]
    triangles: Ints  # shape [F, 3]
    corners: Ints  # of the raw mesh, which hold texture coordinates, shape [F, 3]
    source: Ints  # the face that each was, shape [F]
    gone: int  # vertices
    joined: int  # pairs of faces that were joined the other way

    @property
    def note(self) -> str:
        """What was done, for the report."""
        gone = f"{counted(self.gone, 'vertex')} of needle-thin faces joined with neighbours" if self.gone else ""
        joined = f"{counted(self.joined, 'needle-thin face')} joined with the next across the longest side"
        return " and ".join(each for each in (gone, joined if self.joined else "") if each)


def without_slivers(points: Floats, triangles: Ints, corners: Ints, texcoords: Floats | None) -> WithoutSlivers | None:
    """A garment without the needles that can go; None: it has none.

    Of the ends of a short edge the one with fewer neighbours goes, unless it is on a rim, or at a seam of the texture.
    None goes where faces would lie on each other or turn over, nor where the edge is longer in the texture: panels may
    start so.

    Args:
        points: [m], shape [V, 3].
        triangles: shape [F, 3].
        corners: of the raw mesh at each of theirs, shape [F, 3].
        texcoords: at each of the raw mesh's, shape [C, 2].
    """
    vertex, source = np.arange(len(points)), np.arange(len(triangles))
    chart = None if texcoords is None else np.column_stack([texcoords, np.zeros(len(texcoords))])
    for _ in range(ROUNDS):
        sides = edges_of(triangles)
        is_short = _are_short(np.linalg.norm(points[sides[:, 1]] - points[sides[:, 0]], axis=1))
        if not is_short.any():
            break
        found = unique_rows(np.sort(sides, axis=1))
        fixed = np.zeros(len(points), dtype=bool)
        fixed[sides[found.count[found.number] != 2]] = True
        if texcoords is not None:
            _fix_seams(fixed, triangles, texcoords[corners], is_short)
        short = found.first[np.bincount(found.number, ~is_short) == 0.0]
        lengths = np.linalg.norm(points[sides[short, 1]] - points[sides[short, 0]], axis=1)
        places = [points[triangles], *([] if chart is None else [chart[corners]])]
        gone = _chosen(places, triangles, sides[short[np.argsort(lengths, kind="stable")]], fixed)
        if not gone:
            break
        became = np.arange(len(points))
        became[list(gone)] = list(gone.values())
        held = np.full(len(points), -1)  # the corner that a vertex which goes has from then on
        for shift in (1, 2):
            other = np.roll(triangles, -shift, axis=1)
            at = (became[triangles] == other) & (became[triangles] != triangles)
            held[triangles[at]] = np.roll(corners, -shift, axis=1)[at]
        corners = np.where(held[triangles] >= 0, held[triangles], corners)
        triangles, vertex = became[triangles], became[vertex]
        kept = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
        triangles, corners, source = triangles[kept], corners[kept], source[kept]
    gone_ones = int((vertex != np.arange(len(vertex))).sum())
    triangles, corners, joined = _joined_across(points, triangles, corners, chart)
    return WithoutSlivers(vertex, triangles, corners, source, gone_ones, joined) if gone_ones or joined else None


def _joined_across(points: Floats, triangles: Ints, corners: Ints, chart: Floats | None) -> tuple[Ints, Ints, int]:
    """The faces and their corners with flat ones joined the other way across their longest sides, and how many were."""
    joined = 0
    triangles, corners = triangles.copy(), corners.copy()
    for _ in range(ROUNDS):
        pairs = _flat_pairs(points, triangles, corners, chart)
        if not len(pairs):
            break
        joined += len(pairs)
        one, other, side, across = pairs.T
        for table in (triangles, corners):
            a, b, c = (table[one, (side + shift) % 3] for shift in range(3))
            d = table[other, (across + 2) % 3]
            table[one], table[other] = np.stack([a, d, c], axis=1), np.stack([d, b, c], axis=1)
    return triangles, corners, joined


def _flat_pairs(points: Floats, triangles: Ints, corners: Ints, texcoords: Floats | None) -> Ints:
    """Faces that are flat, the others at their longest sides, and which side that is of each, shape [N, 4].

    Only where the corners joined the other way make better faces, on the same side of the cloth and in the texture.
    """
    heights, longest = _heights(points[triangles])
    is_flat = (heights < FLAT * longest) & (heights < SHORT)
    if texcoords is not None:  # where panels start, a seam's faces may be drawn out, which are none at rest
        there, along = _heights(texcoords[corners])
        is_flat &= there < FLAT * along
    flat = np.flatnonzero(is_flat)
    if not len(flat):
        return np.zeros((0, 4), dtype=np.int64)
    flat = flat[np.argsort(heights[flat] / longest[flat], kind="stable")]
    sides = np.sort(edges_of(triangles), axis=1)
    found = unique_rows(sides)
    at = points[triangles[flat]]
    here = 3 * flat + np.linalg.norm(np.roll(at, -1, axis=1) - at, axis=2).argmax(axis=1)
    here = here[found.count[found.number[here]] == 2]
    order = np.argsort(found.number, kind="stable")
    first = (np.cumsum(found.count) - found.count)[found.number[here]]
    across = order[first] + order[first + 1] - here
    near, far = (_turned_to(triangles, each) for each in (here, across))
    is_alike = near[:, 0] == far[:, 1]  # in winding
    crossing = np.stack([near[:, 2], far[:, 2]], axis=1)
    may = is_alike & ~_are_edges(crossing, sides[found.first]) & _may_join(points[near], points[far])
    if texcoords is not None:
        charts = [texcoords[_turned_to(corners, each)] for each in (here, across)]
        is_seam = (charts[0][:, :2] != charts[1][:, 1::-1]).any(axis=(1, 2))
        may &= ~is_seam & _may_join(*charts)
    chosen: list[int] = []
    touched: set[int] = set()
    for place, own in zip(np.flatnonzero(may).tolist(), np.column_stack([near, far[:, 2]])[may].tolist(), strict=True):
        if touched.isdisjoint(own):
            touched.update(own)
            chosen.append(place)
    here, across = here[chosen], across[chosen]
    return np.stack([here // 3, across // 3, here % 3, across % 3], axis=1)


def _turned_to(table: Ints, sides: Ints) -> Ints:
    """The rows that have these sides, three a row in turn, each from its side's first corner on, shape [N, 3]."""
    turned: Ints = table[(sides // 3)[:, None], (sides[:, None] + np.arange(3)) % 3]
    return turned


def _are_edges(pairs: Ints, edges: Ints) -> NDArray[np.bool_]:
    """Which pairs of vertices are among edges, which are sorted rows with their lower vertex first; shape [N]."""
    count = int(max(pairs.max(initial=0), edges.max())) + 1
    keys, wanted = edges @ [count, 1], np.sort(pairs, axis=1) @ [count, 1]
    there: NDArray[np.bool_] = keys[np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)] == wanted
    return there


def _may_join(near: Floats, far: Floats) -> NDArray[np.bool_]:
    """Whether two faces are better joined the other way: neither turns over, and the flatter one is less flat.

    The first side of each is the one between them; shape [N, 3, 3] each.
    """
    (a, b, c), d = np.moveaxis(near, 1, 0), far[:, 2]
    before, after = [near, far], [np.stack(each, axis=1) for each in ((a, d, c), (d, b, c))]
    normal = sum(face_normals(each) for each in before)
    facing = [np.einsum("ij,ij->i", face_normals(each), normal) > 0.0 for each in after]
    least = [np.minimum(*(heights / longest for heights, longest in map(_heights, each))) for each in (before, after)]
    better: NDArray[np.bool_] = facing[0] & facing[1] & (least[1] > least[0])
    return better


def _heights(corners: Floats) -> tuple[Floats, Floats]:
    """The least height of each triangle, and its longest side, shape [F] each."""
    area = np.linalg.norm(face_normals(corners), axis=1)
    longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
    return area / np.maximum(longest, np.finfo(np.float64).tiny), longest


def _are_short(lengths: Floats) -> NDArray[np.bool_]:
    """Whether sides are, of lengths [m], three of a face in turn; shape [3 F] each."""
    longest = lengths.reshape(-1, 3).max(axis=1)
    short: NDArray[np.bool_] = lengths < np.minimum(SHORT, SHORT_PART * np.repeat(longest, 3))
    return short


def _fix_seams(fixed: NDArray[np.bool_], triangles: Ints, texcoords: Floats, is_short: NDArray[np.bool_]) -> None:
    """Marks the vertices at seams of the texture, and of edges that are short only in space; texcoords [F, 3, 2]."""
    place = unique_rows(texcoords.reshape(-1, 2) + 0.0).number
    first = np.full(len(fixed), -1)
    first[triangles.ravel()] = place
    fixed[triangles.ravel()[first[triangles.ravel()] != place]] = True
    lengths = np.linalg.norm(np.roll(texcoords, -1, axis=1) - texcoords, axis=2).ravel()
    fixed[edges_of(triangles)[is_short & (lengths >= SHORT_PART * np.median(lengths))]] = True


def _chosen(places: list[Floats], triangles: Ints, short: Ints, fixed: NDArray[np.bool_]) -> dict[int, int]:
    """The vertices that go and what they become, of edges from the shortest on, no two of which are near each other.

    ``places``: of the faces' corners, in space and in the texture, shape [F, 3, 3] each.
    """
    near = np.flatnonzero(np.isin(triangles, short).any(axis=1))
    own = triangles[near]
    by_vertex = np.argsort(own.ravel(), kind="stable")  # corners of faces, those of a vertex together
    start = np.searchsorted(own.ravel()[by_vertex], np.arange(len(fixed) + 1))
    ways = np.stack([short, short[:, ::-1]], axis=1)  # either end may go, into the other
    turns = _turning([each[near] for each in places], own, by_vertex, start, ways.reshape(-1, 2)).reshape(-1, 2)
    rows, first, held = own[by_vertex // 3].tolist(), start.tolist(), fixed.tolist()

    def ring_of(vertex: int) -> set[int]:
        return {each for row in rows[first[vertex] : first[vertex + 1]] for each in row} - {vertex}

    gone: dict[int, int] = {}
    touched: set[int] = set()
    for (a, b), turning in zip(short.tolist(), turns.tolist(), strict=True):
        ring = {a: ring_of(a), b: ring_of(b)}
        area = ring[a] | ring[b]
        if not area.isdisjoint(touched) or len(ring[a] & ring[b]) != 2:
            continue
        ends = sorted(((a, b, turning[0]), (b, a, turning[1])), key=lambda end: len(ring[end[0]]))
        chosen = next(((goes, stays) for goes, stays, turned in ends if not (held[goes] or turned)), None)
        if chosen is not None:
            gone[chosen[0]] = chosen[1]
            touched |= area
    return gone


def _turning(places: list[Floats], triangles: Ints, by_vertex: Ints, start: Ints, ways: Ints) -> NDArray[np.bool_]:
    """Whether a face turns over, or becomes a line, where a vertex goes into another, shape [N].

    Args:
        places: of the faces' corners, shape [F, 3, 3] each.
        triangles: shape [F, 3].
        by_vertex: their corners, three a face, in the order of their vertices.
        start: of each vertex's own in that order, shape [V + 1].
        ways: the vertex that goes, and the other one, shape [N, 2].
    """
    goes, stays = ways.T
    count = start[goes + 1] - start[goes]
    way = np.repeat(np.arange(len(ways)), count)
    corner = by_vertex[np.arange(len(way)) - np.repeat(np.cumsum(count) - count, count) + start[goes][way]]
    is_other = triangles[corner // 3] == stays[way, None]
    shared = np.flatnonzero(is_other.any(axis=1))
    ways_shared, first = np.unique(way[shared], return_index=True)
    to = np.zeros((len(ways), 2), dtype=np.int64)  # the face that shows where the other one is, and its corner
    to[ways_shared] = np.stack([corner[shared] // 3, is_other[shared].argmax(axis=1)], axis=1)[first]
    moved = np.flatnonzero(~is_other.any(axis=1))
    face, of_face, way = corner[moved] // 3, corner[moved] % 3, way[moved]
    turning = np.zeros(len(ways), dtype=bool)
    for each in places:
        before = each[face]
        after = before.copy()
        after[np.arange(len(face)), of_face] = each[to[way, 0], to[way, 1]]
        turned = np.einsum("ij,ij->i", face_normals(before), face_normals(after)) <= 0.0
        turning[way[turned]] = True
    return turning

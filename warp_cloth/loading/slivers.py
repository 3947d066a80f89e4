"""Needle-thin faces of a garment, as booleans and decimation leave them.

Cloth so thin is so stiff for its mass that forces never balance. Short edges are drawn together; a face that is flat
without one, as its corner lies on its longest side, has its four corners joined the other way across that side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
        gone = _chosen(points, triangles, sides[short[np.argsort(lengths, kind="stable")]], fixed)
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
    joined = 0
    solid = None if texcoords is None else np.column_stack([texcoords, np.zeros(len(texcoords))])
    for _ in range(ROUNDS):
        pairs = _flat_pairs(points, triangles, corners, solid)
        if not len(pairs):
            break
        joined += len(pairs)
        triangles, corners = triangles.copy(), corners.copy()
        one, other, side, across = pairs.T
        for table in (triangles, corners):
            a, b, c = (table[one, (side + shift) % 3] for shift in range(3))
            d = table[other, (across + 2) % 3]
            table[one], table[other] = np.stack([a, d, c], axis=1), np.stack([d, b, c], axis=1)
    return WithoutSlivers(vertex, triangles, corners, source, gone_ones, joined) if gone_ones or joined else None


def _flat_pairs(points: Floats, triangles: Ints, corners: Ints, texcoords: Floats | None) -> Ints:
    """Faces that are flat, the others at their longest sides, and which side that is of each, shape [N, 4].

    Only where the corners joined the other way make better faces, on the same side of the cloth and in the texture.
    """
    sides = edges_of(triangles)
    heights, longest = _heights(points[triangles])
    is_flat = (heights < FLAT * longest) & (heights < SHORT)
    if texcoords is not None:  # where panels start, a seam's faces may be drawn out, which are none at rest
        there, along = _heights(texcoords[corners])
        is_flat &= there < FLAT * along
    flat = np.flatnonzero(is_flat)
    flat = flat[np.argsort(heights[flat] / longest[flat], kind="stable")]
    if not len(flat):
        return np.zeros((0, 4), dtype=np.int64)
    found = unique_rows(np.sort(sides, axis=1))
    every = {(int(a), int(b)) for a, b in np.sort(sides, axis=1)[found.first]}
    ends = points[sides]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).reshape(-1, 3)
    order = np.argsort(found.number, kind="stable")
    starts = np.cumsum(found.count) - found.count
    pairs: list[tuple[int, int, int, int]] = []
    touched: set[int] = set()
    for one in flat.tolist():
        side = int(lengths[one].argmax())
        edge = found.number[3 * one + side]
        if found.count[edge] != 2:
            continue
        two = order[starts[edge] : starts[edge] + 2].tolist()
        place = two[0] + two[1] - (3 * one + side)
        other, across = place // 3, place % 3
        a, b, c = (int(triangles[one, (side + shift) % 3]) for shift in range(3))
        d = int(triangles[other, (across + 2) % 3])
        if touched & {a, b, c, d} or int(triangles[other, across]) != b or (min(c, d), max(c, d)) in every:
            continue
        before, after = np.array([[a, b, c], [b, a, d]]), np.array([[a, d, c], [d, b, c]])
        if not _may_join(points[before], points[after]):
            continue
        if texcoords is not None:
            at = [corners[one, (side + shift) % 3] for shift in range(3)]
            far = [corners[other, (across + shift) % 3] for shift in range(3)]
            if (texcoords[at[:2]] != texcoords[far[1::-1]]).any():
                continue  # a seam of the texture
            if not _may_join(texcoords[[at, far]], texcoords[[[at[0], far[2], at[2]], [far[2], at[1], at[2]]]]):
                continue
        touched |= {a, b, c, d}
        pairs.append((one, other, side, across))
    return np.array(pairs, dtype=np.int64).reshape(-1, 4)


def _may_join(before: Floats, after: Floats) -> bool:
    """Whether two faces are better joined the other way: neither turns over, and the flatter one is less flat."""
    normals = [np.cross(each[:, 1] - each[:, 0], each[:, 2] - each[:, 0]) for each in (before, after)]
    facing = normals[1] @ normals[0].sum(axis=0)
    least = [float((heights / longest).min()) for heights, longest in (_heights(before), _heights(after))]
    return bool((facing > 0.0).all()) and least[1] > least[0]


def _heights(corners: Floats) -> tuple[Floats, Floats]:
    """The least height of each triangle, and its longest side, shape [F] each."""
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
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


def _chosen(points: Floats, triangles: Ints, short: Ints, fixed: NDArray[np.bool_]) -> dict[int, int]:
    """The vertices that go and what they become, of edges from the shortest on, no two of which are near each other."""
    near = np.isin(triangles, short).any(axis=1)
    faces: dict[int, list[tuple[int, int, int]]] = {}
    for a, b, c in triangles[near].tolist():
        for corner in (a, b, c):
            faces.setdefault(corner, []).append((a, b, c))
    ring = {corner: {each for face in own for each in face} - {corner} for corner, own in faces.items()}
    gone: dict[int, int] = {}
    touched: set[int] = set()
    for a, b in short.tolist():
        for goes, stays in sorted(((a, b), (b, a)), key=lambda pair: len(ring[pair[0]])):
            area = ring[goes] | ring[stays]
            if fixed[goes] or area & touched or len(ring[goes] & ring[stays]) != 2:
                continue
            if not any(_turns(points, face, goes, stays) for face in faces[goes] if stays not in face):
                gone[goes] = stays
                touched |= area
                break
    return gone


def _turns(points: Floats, face: tuple[int, int, int], goes: int, stays: int) -> bool:
    """Whether a face turns over, or becomes a line, where one of its corners becomes another vertex."""
    before, after = points[list(face)], points[[stays if corner == goes else corner for corner in face]]
    normals = [np.cross(each[1] - each[0], each[2] - each[0]) for each in (before, after)]
    return float(normals[0] @ normals[1]) <= 0.0

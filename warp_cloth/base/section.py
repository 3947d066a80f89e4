"""Plane sections of a triangle mesh, around which girths are measured."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.connected import connected_components
from warp_cloth.base.mesh import Indices, Points

Floats = NDArray[np.float64]
Sides = tuple[NDArray[np.int64], NDArray[np.int64]]  # of triangles, 0 from the first corner to the second, and so on


@dataclass(frozen=True, eq=False)
class Section:
    """Segments along which a plane cuts triangles."""

    ends: Floats  # of each segment, in the plane's two coordinates [m], shape [S, 2, 2]
    faces: NDArray[np.int64]  # triangle of each segment, shape [S]
    weights: Floats  # of the triangle's corners at both ends, shape [S, 2, 3]
    part: NDArray[np.int64]  # connected part of each segment, shape [S]
    open_parts: frozenset[int]  # those that are not closed loops

    @property
    def part_count(self) -> int:
        return int(self.part.max()) + 1 if len(self.part) else 0

    def parts(self) -> list[Floats]:
        """The ends of each part's segments [m], shape [N, 2, 2] each."""
        order = np.argsort(self.part, kind="stable")
        count = np.bincount(self.part, minlength=self.part_count)
        return np.split(self.ends[order], np.cumsum(count)[:-1]) if len(order) else []

    def girth(self, part: int) -> float:
        """Length of a tape around a part [m]."""
        return convex_girth(self.ends[self.part == part].reshape(-1, 2))

    def length_on(self, corners: Floats, chosen: NDArray[np.bool_]) -> float:
        """Length of chosen segments, shape [S], where triangles have other ``corners`` [m], shape [F, 3, 2]."""
        ends = np.einsum("sek,skd->sed", self.weights[chosen], corners[self.faces[chosen]])
        return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())


def cut(points: Points, triangles: Indices, height: float) -> Section:
    """Section of the mesh at a height [m], in (x, z); a vertex at exactly that height counts as above it."""
    return section_at(points[:, 1] - height, points[:, [0, 2]], triangles)


class Sections:
    """Horizontal sections of one mesh at many heights: how low and high each triangle reaches is found once."""

    def __init__(self, points: Points, triangles: Indices) -> None:
        """``points`` [m], shape [V, 3]; ``triangles``, shape [F, 3]."""
        self._points, self._triangles = points, triangles
        heights = points[:, 1][triangles]
        self._low, self._high = heights.min(axis=1), heights.max(axis=1)

    def at(self, height: float) -> Section:
        """The section at a height [m], which is that of ``cut``."""
        crossed = np.flatnonzero((self._low < height) & (self._high >= height))
        section = cut(self._points, self._triangles[crossed], height)
        return replace(section, faces=crossed[section.faces])


def section_at(level: Floats, flat: Floats, triangles: NDArray[np.integer]) -> Section:
    """Section of a mesh by the plane where ``level`` is 0.

    Args:
        level: height of each vertex above the plane [m], shape [V]; 0 counts as above.
        flat: its two coordinates along the plane [m], shape [V, 2].
        triangles: shape [F, 3].
    """
    faces, corners, sides = _cut_faces(level, triangles)
    rows = np.arange(len(faces))
    weights = np.zeros((len(faces), 2, 3))
    keys = np.zeros((len(faces), 2), dtype=np.int64)
    for end, side in enumerate(sides):
        a, b = corners[rows, side], corners[rows, (side + 1) % 3]
        t = level[a] / (level[a] - level[b])
        weights[rows, end, side] = 1.0 - t
        weights[rows, end, (side + 1) % 3] = t
        keys[:, end] = np.minimum(a, b) * len(level) + np.maximum(a, b)
    ends = np.einsum("sek,skd->sed", weights, flat[corners])
    unique, node = np.unique(keys, return_inverse=True)
    node = node.reshape(-1, 2)
    label = connected_components(len(unique), node[:, 0], node[:, 1])
    _, part = np.unique(label[node[:, 0]], return_inverse=True) if len(faces) else (None, np.zeros(0, dtype=np.int64))
    ending = np.bincount(node.ravel(), minlength=len(unique)) != 2
    open_parts = frozenset(part.ravel()[ending[node].any(axis=1)].tolist())
    return Section(ends, faces, weights, part.ravel(), open_parts)


def segments_at(level: Floats, flat: Floats, triangles: NDArray[np.integer]) -> Floats:
    """The ends of a section's segments alone [m], shape [S, 2, 2], in a third of the time; as of ``section_at``."""
    faces, corners, sides = _cut_faces(level, triangles)
    rows = np.arange(len(faces))
    ends = np.empty((len(faces), 2, 2))
    for end, side in enumerate(sides):
        a, b = corners[rows, side], corners[rows, (side + 1) % 3]
        t = (level[a] / (level[a] - level[b]))[:, None]
        ends[:, end] = (1.0 - t) * flat[a] + t * flat[b]
    return ends


def _cut_faces(level: Floats, triangles: NDArray[np.integer]) -> tuple[NDArray[np.int64], NDArray[np.int64], Sides]:
    """The triangles that a plane cuts, their corners, shape [S, 3], and the two sides of each that it cuts."""
    above = level >= 0.0
    a, b, c = (above[triangles[:, corner]] for corner in range(3))
    faces = np.flatnonzero((a | b | c) & ~(a & b & c))
    corners = triangles[faces].astype(np.int64)
    up = above[corners]
    crossed = up != np.roll(up, -1, axis=1)  # sides (0,1), (1,2), (2,0): two of the three
    return faces, corners, (np.argmax(crossed, axis=1), 2 - np.argmax(crossed[:, ::-1], axis=1))


def encloses(ends: Floats, point: Floats) -> bool:
    """Whether closed lines, shape [S, 2, 2], enclose a point: a ray from it crosses them an odd number of times."""
    x, z = ends[..., 0] - point[0], ends[..., 1] - point[1]
    across = (z[:, 0] < 0.0) != (z[:, 1] < 0.0)
    rise = np.where(across, z[:, 1] - z[:, 0], 1.0)
    crossing = x[:, 0] - z[:, 0] * (x[:, 1] - x[:, 0]) / rise
    return bool((across & (crossing > 0.0)).sum() % 2)


def convex_hull(points: Points) -> list[tuple[float, ...]]:
    """Corners of the convex hull of 2-D points, shape [N, 2], in order (Andrew's monotone chain)."""
    spots = sorted(map(tuple, points.tolist()))
    hull: list[tuple[float, ...]] = []
    for ordered in (spots, spots[::-1]):
        chain: list[tuple[float, ...]] = []
        for p in ordered:
            while len(chain) > 1 and (chain[-1][0] - chain[-2][0]) * (p[1] - chain[-2][1]) <= (
                chain[-1][1] - chain[-2][1]
            ) * (p[0] - chain[-2][0]):
                chain.pop()
            chain.append(p)
        hull += chain[:-1]
    return hull


def convex_girth(points: Points) -> float:
    """Length of a tape round 2-D points [m]: the perimeter of their convex hull."""
    hull = convex_hull(points)
    return sum(math.dist(p, q) for p, q in zip(hull, hull[1:] + hull[:1], strict=True))


def first_crossing(segments: NDArray[np.float64], height: float) -> float | None:
    """The least first coordinate at which segments, shape [S, 2, 2], have this second coordinate; None: nowhere."""
    low, high = segments[:, 0], segments[:, 1]
    across = (low[:, 1] < height) != (high[:, 1] < height)
    low, high = low[across], high[across]
    share = (height - low[:, 1]) / (high[:, 1] - low[:, 1])
    found = low[:, 0] + share * (high[:, 0] - low[:, 0])
    return float(found.min()) if len(found) else None

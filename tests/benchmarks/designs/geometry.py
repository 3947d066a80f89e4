"""Geometry for a judge that shares no code with what it judges: crossings, inside tests, distances, mesh files.

Everything is float64 and NumPy or SciPy; nothing is imported from warp_cloth.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CHUNK = 2_000_000  # candidate pairs held at once
RAY_CELL = 0.008  # [m] of the grid over which rays find their triangles
NEAREST = 16  # triangles whose centres are nearest, among which the closest point is sought
# Rays start off the samples by so little that none meets an edge of the body exactly; irrational, so that no grid fits.
RAY_SHIFT = np.array([1.0e-7 * np.sqrt(2.0), 1.0e-7 * np.sqrt(3.0)])


@dataclass(frozen=True)
class Mesh:
    """Triangles with optional panels: ``points`` [m] [V, 3], ``triangles`` [F, 3], ``panels`` [m] [F, 3, 2]."""

    points: Floats
    triangles: Ints
    panels: Floats | None = None

    @cached_property
    def edges(self) -> tuple[Ints, Ints, Ints]:
        """Edges [E, 2] (lower vertex first), of each triangle's side its edge [F, 3], faces of each edge [E]."""
        sides = np.stack([self.triangles, np.roll(self.triangles, -1, axis=1)], axis=2).reshape(-1, 2)
        sides.sort(axis=1)
        key, edge, count = np.unique(
            sides[:, 0] * len(self.points) + sides[:, 1], return_inverse=True, return_counts=True
        )
        return np.column_stack(np.divmod(key, len(self.points))), edge.reshape(-1, 3), count


def read_obj(path: Path) -> Mesh:
    """Reads an OBJ; polygons become fans, panels stay in the units of the texture coordinates."""
    rows: dict[str, list[list[str]]] = {"v": [], "vt": [], "f": []}
    for line in path.read_text(encoding="utf-8").splitlines():
        word, *rest = line.split() or [""]
        if word in rows:
            rows[word].append(rest)
    corners = [[corner.split("/") for corner in face] for face in rows["f"]]
    fans = [(face[0], face[k], face[k + 1]) for face in corners for k in range(1, len(face) - 1)]
    points = np.array([row[:3] for row in rows["v"]], dtype=np.float64)
    triangles = np.array([[int(corner[0]) for corner in fan] for fan in fans], dtype=np.int64)
    triangles = np.where(triangles < 0, triangles + len(points), triangles - 1)
    if not rows["vt"] or len(fans[0][0]) < 2 or not fans[0][0][1]:
        return Mesh(points, triangles)
    places = np.array([row[:2] for row in rows["vt"]], dtype=np.float64)
    chosen = np.array([[int(corner[1]) for corner in fan] for fan in fans], dtype=np.int64)
    return Mesh(points, triangles, places[np.where(chosen < 0, chosen + len(places), chosen - 1)])


def components(count: int, pairs: Ints) -> Ints:
    """The component of each of ``count`` nodes, which ``pairs`` [N, 2] join."""
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def cross(a: Floats, b: Floats) -> Floats:
    """Cross products along the last axis; much faster than NumPy's."""
    x, y, z = np.moveaxis(a, -1, 0)
    u, v, w = np.moveaxis(b, -1, 0)
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


def dot(a: Floats, b: Floats) -> Floats:
    """Dot products along the last axis."""
    return np.asarray(np.einsum("...i,...i->...", a, b))


def repeated(counts: Ints) -> tuple[Ints, Ints]:
    """For counts (2, 0, 3): owners 0 0 2 2 2, and each one's number within its owner, 0 1 0 1 2."""
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)


def _cells(low: Floats, high: Floats, origin: Floats, size: float) -> tuple[Ints, Ints]:
    """Owners and integer cells [N, dimensions] that boxes touch."""
    first, last = (np.floor((corner - origin) / size).astype(np.int64) for corner in (low, high))
    spans = last - first + 1
    owner, number = repeated(spans.prod(axis=1))
    cell = np.empty((len(owner), low.shape[1]), dtype=np.int64)
    for axis in range(low.shape[1]):
        number, step = np.divmod(number, spans[owner, axis])
        cell[:, axis] = first[owner, axis] + step
    return owner, cell


def _keys(cell: Ints, extent: Ints) -> Ints:
    key = cell[:, 0]
    for axis in range(1, cell.shape[1]):
        key = key * extent[axis] + cell[:, axis]
    return key


def box_pairs(low_a: Floats, high_a: Floats, low_b: Floats, high_b: Floats, size: float) -> tuple[Ints, Ints]:
    """Pairs of boxes of two sets that overlap, by a grid of cells of ``size`` [m]; each pair once."""
    if not len(low_a) or not len(low_b):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    origin = np.minimum(low_a.min(axis=0), low_b.min(axis=0))
    top = np.maximum(high_a.max(axis=0), high_b.max(axis=0))
    extent = np.floor((top - origin) / size).astype(np.int64) + 1
    owner_a, cell_a = _cells(low_a, high_a, origin, size)
    owner_b, cell_b = _cells(low_b, high_b, origin, size)
    key_a, key_b = _keys(cell_a, extent), _keys(cell_b, extent)
    order = np.argsort(key_b, kind="stable")
    begin, end = (np.searchsorted(key_b[order], key_a, side) for side in ("left", "right"))
    found: list[Ints] = []
    bounds = np.concatenate([[0], np.flatnonzero(np.diff(np.cumsum(end - begin) // CHUNK)) + 1, [len(key_a)]])
    for start, stop in pairwise(bounds):
        which, number = repeated((end - begin)[start:stop])
        a, b = owner_a[start + which], owner_b[order[begin[start + which] + number]]
        # a pair is taken in the first cell that both touch, hence once
        meet = np.floor((np.maximum(low_a[a], low_b[b]) - origin) / size).astype(np.int64)
        touch = (_keys(meet, extent) == key_a[start + which]) & (low_a[a] <= high_b[b]).all(1)
        touch &= (low_b[b] <= high_a[a]).all(1)
        found.append(np.column_stack([a[touch], b[touch]]))
    pairs = np.concatenate(found)
    return pairs[:, 0], pairs[:, 1]


def crossings(mesh: Mesh, points: Floats) -> tuple[Ints, Ints]:
    """Edges and triangles that cross one another and share no vertex: indices of both, pair by pair."""
    edges, _, _ = mesh.edges
    ends, corners = points[edges], points[mesh.triangles]
    size = 2.0 * float(np.median(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))) + 1e-9
    edge, face = box_pairs(ends.min(1), ends.max(1), corners.min(1), corners.max(1), size)
    apart = (edges[edge][:, :, None] != mesh.triangles[face][:, None, :]).all((1, 2))
    edge, face = edge[apart], face[apart]
    hit = segments_hit(ends[edge, 0], ends[edge, 1], corners[face])
    return edge[hit], face[hit]


def segments_hit(start: Floats, end: Floats, corners: Floats) -> NDArray[np.bool_]:
    """Whether each segment [N, 3] passes through its triangle [N, 3, 3], by the signs of volumes."""
    a, b, c = (corners[:, k] - start for k in range(3))
    way = end - start
    volumes = np.stack([dot(way, cross(a, b)), dot(way, cross(b, c)), dot(way, cross(c, a))], axis=1)
    normal = cross(b - a, c - a)
    before, after = dot(-a, normal), dot(end - corners[:, 0], normal)
    return (before * after < 0.0) & ((volumes > 0.0).all(1) | (volumes < 0.0).all(1))


class Body:
    """A closed mesh that answers what lies inside it and how deep."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self.corners = mesh.points[mesh.triangles]
        self.tree = cKDTree(self.corners.mean(axis=1))
        self.low, self.high = mesh.points.min(axis=0), mesh.points.max(axis=0)
        self.closed = bool((mesh.edges[2] == 2).all())
        self._rays: dict[int, tuple[Any, ...]] = {}

    def hits(self, places: Floats, axis: int) -> tuple[Ints, Floats, Ints]:
        """Where lines along an axis through places [N, 2] pass the surface: the line, the height [m], the turn +-1.

        A winding number is the sum of the turns above a sample. ``places`` are coordinates along the other two axes.
        """
        others = [k for k in range(3) if k != axis]
        if axis not in self._rays:
            flat = self.corners[:, :, others]
            owner, cell = _cells(flat.min(1), flat.max(1), self.low[others], RAY_CELL)
            extent = np.floor((self.high - self.low)[others] / RAY_CELL).astype(np.int64) + 1
            key = _keys(cell, extent)
            order = np.argsort(key, kind="stable")
            self._rays[axis] = owner[order], key[order], extent
        owner, key, extent = self._rays[axis]
        place = places + RAY_SHIFT
        cell = np.floor((place - self.low[others]) / RAY_CELL).astype(np.int64)
        wanted = np.where(((cell >= 0) & (cell < extent)).all(1), _keys(cell, extent), -1)
        begin, end = (np.searchsorted(key, wanted, side) for side in ("left", "right"))
        line, number = repeated(end - begin)
        corners = self.corners[owner[begin[line] + number]]
        flat = corners[:, :, others] - place[line, None]
        following = np.roll(flat, -1, axis=1)
        areas = flat[..., 0] * following[..., 1] - flat[..., 1] * following[..., 0]  # side k lies opposite corner k + 2
        met = (areas > 0.0).all(1) | (areas < 0.0).all(1)
        total = areas[met].sum(axis=1)
        height = (areas[met] * np.roll(corners[met][:, :, axis], -2, axis=1)).sum(axis=1) / total
        handed = -1 if axis == 1 else 1  # x and z are a left-handed pair about y
        return line[met], height, handed * np.sign(total).astype(np.int64)

    def windings(self, samples: Floats, axis: int) -> Ints:
        """How often the surface winds round each sample, by a ray along an axis."""
        line, height, turn = self.hits(samples[:, [k for k in range(3) if k != axis]], axis)
        above = height > samples[line, axis]
        found = np.bincount(line[above], weights=turn[above], minlength=len(samples))
        return np.rint(found).astype(np.int64)

    def inside(self, samples: Floats) -> NDArray[np.bool_]:
        """Whether samples lie inside: by one ray where the body is closed, else by the majority of three."""
        found = np.zeros(len(samples), dtype=bool)
        near = np.flatnonzero(((samples >= self.low) & (samples <= self.high)).all(1))
        if len(near):
            votes = [self.windings(samples[near], axis) != 0 for axis in ((2,) if self.closed else (0, 1, 2))]
            found[near] = 2 * np.sum(votes, axis=0) > len(votes)
        return found

    def closest(self, samples: Floats) -> Floats:
        """The distance [m] from the surface, among the triangles whose centres are nearest."""
        if not len(samples):
            return np.zeros(0)
        _, near = self.tree.query(samples, k=min(NEAREST, len(self.corners)))
        near = near.reshape(len(samples), -1)
        flat = triangle_distance(np.repeat(samples, near.shape[1], axis=0), self.corners[near.ravel()])
        return np.asarray(flat.reshape(near.shape).min(axis=1))

    def depth(self, samples: Floats) -> Floats:
        """How deep [m] samples lie inside the body; 0 outside."""
        deep = np.zeros(len(samples))
        within = np.flatnonzero(self.inside(samples))
        deep[within] = self.closest(samples[within])
        return deep


def triangle_distance(samples: Floats, corners: Floats) -> Floats:
    """The distance [m] of samples [N, 3] from their triangles [N, 3, 3]."""
    normal = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    square = np.maximum(dot(normal, normal), 1e-300)
    over, best = np.ones(len(samples), dtype=bool), np.full(len(samples), np.inf)
    for k in range(3):
        start, along = corners[:, k], corners[:, (k + 1) % 3] - corners[:, k]
        out = samples - start
        share = np.clip(dot(out, along) / np.maximum(dot(along, along), 1e-300), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(out - share[:, None] * along, axis=1))
        over &= dot(cross(along, out), normal) >= 0.0
    flat = np.abs(dot(samples - corners[:, 0], normal)) / np.sqrt(square)
    return np.where(over, flat, best)

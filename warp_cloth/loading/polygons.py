"""Triangulation of polygons: fans if convex, ear clipping otherwise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.loading.raw import Floats, Ints, RawMesh, counted
from warp_cloth.loading.unique_rows import unique_rows

EAR_LIMIT = 1000  # corners of a non-convex face; ear clipping takes n^2 steps
FLATNESS = 1e-3  # of a quad's size: out of plane by more than this, its shorter diagonal is the better fold


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangles, and the polygons that they come from."""

    corners: Ints  # corner of the raw mesh at each triangle's corner, shape [F, 3]
    faces: Ints  # polygon of the raw mesh, shape [F]
    notes: tuple[str, ...] = ()


def triangulated(raw: RawMesh) -> Triangles:
    """All polygons as triangles, in the file's order; those with fewer than three vertices are dropped."""
    starts = np.cumsum(raw.counts) - raw.counts
    triangle_faces = np.flatnonzero(raw.counts == 3)
    corners = [starts[triangle_faces, None] + np.arange(3)]
    faces = [triangle_faces]

    rings = starts[raw.counts == 4, None] + np.arange(4)
    vertices = raw.corners[rings]
    clean = (vertices != np.roll(vertices, 1, axis=1)).all(axis=1)
    quad_faces, rings = np.flatnonzero(raw.counts == 4)[clean], rings[clean]
    first = np.sort(unique_rows(np.sort(vertices[clean], axis=1)).first)
    doubles = len(rings) - len(first)
    corners.append(_split_quads(raw.points, raw.corners, rings[first]).reshape(-1, 3))
    faces.append(np.repeat(quad_faces[first], 2))

    usual = raw.counts == 3
    usual[quad_faces] = True
    polygons, shortened, more_doubles = _odd_polygons(raw, starts, np.flatnonzero(~usual))
    for face, ring in polygons:
        cut = ring[_cut(raw, face, raw.points[raw.corners[ring]])]
        corners.append(cut)
        faces.append(np.full(len(cut), face))
    all_faces = np.concatenate(faces).astype(np.int64)
    order = np.argsort(all_faces, kind="stable")
    notes = []
    if split := len(first) + sum(len(ring) > 3 for _, ring in polygons):
        notes.append(f"{counted(split, 'polygon')} (quads or larger) cut into triangles")
    if shortened:
        notes.append(f"{counted(shortened, 'polygon')} that repeat a vertex shortened or dropped")
    if doubles + more_doubles:
        notes.append(f"{counted(doubles + more_doubles, 'duplicate polygon')} dropped")
    return Triangles(np.concatenate(corners).astype(np.int64)[order], all_faces[order], tuple(notes))


def _odd_polygons(raw: RawMesh, starts: Ints, faces: Ints) -> tuple[list[tuple[int, Ints]], int, int]:
    """Rings of corners of all faces but triangles and clean quads: without repeats in a row, without doubles.

    With how many were shortened or dropped for repeats, and how many were doubles (whose triangles need not
    coincide: so they are found here).
    """
    shortened = doubles = 0
    seen: set[tuple[int, ...]] = set()
    polygons = []
    for face in faces.tolist():
        ring = np.arange(starts[face], starts[face] + raw.counts[face])
        shorter_ring = ring[raw.corners[ring] != np.roll(raw.corners[ring], 1)]
        shortened += len(shorter_ring) < max(len(ring), 3)
        key = tuple(sorted(raw.corners[shorter_ring].tolist()))
        doubles += key in seen
        if len(shorter_ring) >= 3 and key not in seen:
            polygons.append((face, shorter_ring))
        seen.add(key)
    return polygons, shortened, doubles


def _split_quads(points: Floats, corners: Ints, rings: Ints) -> Ints:
    """Triangles of each quad: by diagonal 0-2, unless that runs outside, or 1-3 is shorter in a bent quad.

    Shapes: ``rings`` [Q, 4], result [Q, 2, 3].
    """
    p = points[corners[rings]]
    first, second = p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]
    normal = np.cross(first, second)
    inside_first = _agree(p[:, 0], p[:, 1], p[:, 2], normal) & _agree(p[:, 0], p[:, 2], p[:, 3], normal)
    inside_second = _agree(p[:, 1], p[:, 2], p[:, 3], normal) & _agree(p[:, 1], p[:, 3], p[:, 0], normal)
    reach = np.maximum(np.linalg.norm(first, axis=1), np.linalg.norm(second, axis=1))
    lift = np.abs(np.einsum("ij,ij->i", p[:, 1] - p[:, 0], normal))
    bent = lift > FLATNESS * reach * np.linalg.norm(normal, axis=1)
    shorter = np.linalg.norm(second, axis=1) < np.linalg.norm(first, axis=1)
    swap = inside_second & (~inside_first | (bent & shorter))
    cut = np.where(swap[:, None], [[1, 2, 3, 1, 3, 0]], [[0, 1, 2, 0, 2, 3]])
    split: Ints = np.take_along_axis(rings, cut, axis=1).reshape(-1, 2, 3)
    return split


def _agree(a: Floats, b: Floats, c: Floats, normal: Floats) -> np.ndarray:
    """Whether triangles a b c have the orientation of their polygons."""
    agree: np.ndarray = np.einsum("ij,ij->i", np.cross(b - a, c - a), normal) > 0
    return agree


def _cut(raw: RawMesh, face: int, points: Floats) -> Ints:
    """Triangles of one polygon as positions in its ring, shape [n - 2, 3]."""
    count = len(points)
    fan = np.stack([np.zeros(count - 2, dtype=np.int64), np.arange(1, count - 1), np.arange(2, count)], axis=1)
    flat = _in_plane(points)
    if flat is None or count == 3:
        return fan
    steps = np.roll(flat, -1, axis=0) - flat
    crosses = _cross(np.roll(steps, 1, axis=0), steps)
    fan_crosses = _cross(flat[fan[:, 1]] - flat[0], flat[fan[:, 2]] - flat[0])
    if (crosses >= 0).all() and (fan_crosses > 0).all():
        return fan
    if count > EAR_LIMIT:
        problem = f"face {face} has {count:,} corners and is not convex"
        raise InputError(raw.face_place(face), problem, "triangulate the mesh on export")
    return _ears(flat)


def _in_plane(points: Floats) -> Floats | None:
    """Polygon in its own plane (Newell's normal), turning to the left; None if it spans no area."""
    shifted = points - points.mean(axis=0)
    normal = np.cross(shifted, np.roll(shifted, -1, axis=0)).sum(axis=0)
    size = float(np.linalg.norm(normal))
    if size == 0.0:
        return None
    normal = normal / size
    helper = np.eye(3)[np.argmin(np.abs(normal))]
    right = np.cross(helper, normal)
    right /= np.linalg.norm(right)
    plane: Floats = np.stack([shifted @ right, shifted @ np.cross(normal, right)], axis=1)
    return plane


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _ears(flat: Floats) -> Ints:
    """Ear clipping; the rest of a polygon without ears (one that crosses itself) becomes a fan."""
    ring = list(range(len(flat)))
    cut: list[tuple[int, int, int]] = []
    while len(ring) > 3:
        for position in range(len(ring)):
            before, tip, after = ring[position - 1], ring[position], ring[(position + 1) % len(ring)]
            if _is_ear(flat, before, tip, after, ring):
                cut.append((before, tip, after))
                del ring[position]
                break
        else:
            break
    cut.extend((ring[0], ring[index], ring[index + 1]) for index in range(1, len(ring) - 1))
    return np.array(cut, dtype=np.int64)


def _is_ear(flat: Floats, before: int, tip: int, after: int, ring: list[int]) -> bool:
    a, b, c = flat[before], flat[tip], flat[after]
    if _cross(b - a, c - b) <= 0:
        return False
    others = flat[[vertex for vertex in ring if vertex not in (before, tip, after)]]
    inside = (_cross(b - a, others - a) >= 0) & (_cross(c - b, others - b) >= 0) & (_cross(a - c, others - c) >= 0)
    corner = (others == a).all(axis=1) | (others == b).all(axis=1) | (others == c).all(axis=1)
    return not bool((inside & ~corner).any())

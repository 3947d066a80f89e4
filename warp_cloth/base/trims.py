"""Trims of a garment: buttons and other loose parts that lie on its cloth and go wherever that goes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.connected import mesh_parts
from warp_cloth.base.mesh import Indices, Mesh, Points

TRIMS = "trims"  # end of the name of their mesh in a written file, after the garment's and _
RIGID = 0.05  # [m]; parts up to this extent, such as buttons, keep their shape. Longer ones, such as zips, bend
CANDIDATES = 16  # triangles with the nearest middles, among which the nearest one is sought


@dataclass(frozen=True, eq=False)
class Trims:
    """The trims of a garment, T vertices, each held by the triangle of the cloth that is nearest at the start."""

    start: Points  # [m], shape [T, 3]
    triangles: Indices  # shape [K, 3]
    part: NDArray[np.int64]  # that a vertex belongs to, shape [T]
    holders: Indices  # corners of the triangle that holds a vertex, shape [T, 3]
    offsets: Points  # from its first corner, in its frame [m], shape [T, 3]

    @classmethod
    def of(cls, mesh: Mesh) -> Trims | None:
        """None: the garment has no trims."""
        if mesh.trim_points is None or mesh.trim_triangles is None:
            return None
        start, triangles = mesh.trim_points, mesh.trim_triangles
        faces, _ = nearest_faces(start, mesh.points, mesh.triangles)
        holders = mesh.triangles[faces]
        away = start - mesh.points[holders[:, 0]]
        offsets = np.einsum("tij,tj->ti", _frames(mesh.points[holders]), away)
        part = mesh_parts(len(start), triangles)
        return cls(start, triangles, part, holders, offsets)

    @property
    def mesh(self) -> Mesh:
        """As they are placed."""
        return Mesh(TRIMS, self.start, self.triangles)

    def at(self, cloth: Any) -> Points:
        """The trims' vertices [m], shape [T, 3], where the garment's own are at ``cloth`` [m], shape [V, 3]."""
        corners = np.asarray(cloth, dtype=np.float64)[self.holders]
        moved: Points = corners[:, 0] + np.einsum("tij,ti->tj", _frames(corners), self.offsets)
        for part in np.unique(self.part):
            own = np.flatnonzero(self.part == part)
            if np.ptp(self.start[own], axis=0).max() <= RIGID:
                moved[own] = _as_one(self.start[own], moved[own])
        return moved


def nearest_faces(places: Points, points: Points, triangles: Any) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The triangle that is nearest to each place, and its distance [m], both shape [N].

    ``places`` [m], shape [N, 3]; ``points`` of a mesh [m], shape [V, 3], with ``triangles``, shape [F, 3].
    """
    from scipy.spatial import cKDTree
    from trimesh.triangles import closest_point

    corners = points[triangles]
    count = min(CANDIDATES, len(corners))
    _, near = cKDTree(corners.mean(axis=1)).query(places, k=np.arange(1, count + 1))
    sought = np.repeat(places, count, axis=0)
    away = np.linalg.norm(closest_point(corners[near.ravel()], sought) - sought, axis=1).reshape(len(places), count)
    best = away.argmin(axis=1)
    row = np.arange(len(places))
    return near[row, best], away[row, best]


def _frames(corners: Points) -> Points:
    """Orthonormal axes of triangles, along the first side, across it and along the normal; shape [N, 3, 3]."""
    along = _unit(corners[:, 1] - corners[:, 0])
    normal = _unit(np.cross(along, corners[:, 2] - corners[:, 0]))
    return np.stack([along, np.cross(normal, along), normal], axis=1)


def _unit(vectors: Points) -> Points:
    """Of length 1; zero where a triangle has no such direction, so that its trims lie on its first corner."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(length > 0.0, length, 1.0)


def _as_one(start: Points, moved: Points) -> Points:
    """A part turned and moved as a whole, nearest to where its vertices went (Kabsch, 1976); shape [N, 3]."""
    middle, there = start.mean(axis=0), moved.mean(axis=0)
    left, _, right = np.linalg.svd((start - middle).T @ (moved - there))
    mirrored = np.sign(np.linalg.det(left) * np.linalg.det(right))
    turn = (left * [1.0, 1.0, mirrored]) @ right
    return there + (start - middle) @ turn

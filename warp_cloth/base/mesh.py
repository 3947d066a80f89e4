"""A triangle mesh in metres: what loaders and shape generators return."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Points = NDArray[np.float64]
Indices = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Folds:
    """Rest angles stated by a USD stage for pairs of faces; others are flat, or as in the rest shape."""

    faces: NDArray[np.int64]  # pairs of faces of the file, shape [N, 2]
    angles: Points  # between their normals [rad], shape [N]
    by_shape: bool = False  # whether all other angles are those of the rest shape

    def among(self, faces: NDArray[np.int64], face_count: int) -> Folds:
        """The rest angles between ``faces``, shape [K], which become faces 0 to K - 1."""
        number = np.full(face_count, -1, dtype=np.int64)
        number[faces] = np.arange(len(faces))
        faces = number[self.faces]
        there = (faces >= 0).all(axis=1)
        return Folds(faces[there], self.angles[there], self.by_shape)


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles over welded vertices, in metres, y up.

    ``vertex_map`` and ``triangle_source`` are None where loading changed nothing; otherwise they say which vertex of
    this mesh each vertex of the file became (-1: dropped), and which face of the file each triangle comes from.
    """

    name: str
    points: Points  # [m], shape [V, 3]
    triangles: Indices  # vertex indices, shape [F, 3]
    texcoords: NDArray[np.float64] | None = None  # per corner, in the file's own unit, shape [F, 3, 2]
    panels: Indices | None = None  # panel of each triangle, shape [F]
    panel_names: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()  # what was guessed or repaired, one sentence each, for the report
    unit: str = "m"  # the file's length unit, stated or guessed
    vertex_map: NDArray[np.int64] | None = None  # shape [vertices of the file]
    triangle_source: NDArray[np.int64] | None = None  # shape [F]
    rest_corners: Points | None = None  # corners at rest, as a stage states them [m], shape [F, 3, 3]
    folds: Folds | None = None  # rest angles, as a stage states them
    trim_points: Points | None = None  # of loose parts that lie on the cloth, and are none [m], shape [T, 3]
    trim_triangles: Indices | None = None  # of these, shape [K, 3]
    trim_map: NDArray[np.int64] | None = None  # which of these each vertex of the file became, -1: none of them
    materials: Indices | None = None  # material of each triangle, where the file has several, shape [F]
    material_names: tuple[str, ...] = ()

    @property
    def vertex_count(self) -> int:
        return len(self.points)

    @property
    def triangle_count(self) -> int:
        return len(self.triangles)

    def bounds(self) -> tuple[Points, Points]:
        """Lowest and highest corner of the bounding box [m], each shape [3]."""
        return self._box

    @cached_property
    def _box(self) -> tuple[Points, Points]:
        return self.points.min(axis=0), self.points.max(axis=0)

    @cached_property
    def inside_out(self) -> bool:
        """Whether the triangles face inwards as a whole: the signed volume, about the box's centre, is negative."""
        low, high = self.bounds()
        local = self.points - 0.5 * (low + high)
        a, b, c = (local[self.triangles[:, corner]] for corner in range(3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c))) < 0.0

    @cached_property
    def closed(self) -> bool:
        """Whether the surface is watertight: triangles use every edge equally often in both directions.

        Then a ray leaves as often as it enters. False without triangles.
        """
        start, end = (np.concatenate(np.roll(self.triangles, -shift, axis=1).T.astype(np.int64)) for shift in (0, 1))
        count = self.vertex_count
        return len(start) > 0 and np.array_equal(np.sort(start * count + end), np.sort(end * count + start))

    def arrays(self) -> dict[str, Any]:
        """What loading changed, by the fields' names, as stored with a result, and how many vertices trims have."""
        found = {
            "vertex_map": self.vertex_map,
            "triangle_source": self.triangle_source,
            "trim_map": self.trim_map,
            "trim_count": None if self.trim_points is None else np.array(len(self.trim_points)),
        }
        return {name: array for name, array in found.items() if array is not None}


def face_normals(corners: Points) -> Points:
    """Normals of triangles [m], shape [F, 3, 3], as long as twice their areas [m2], shape [F, 3]."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def signed_volumes(corners: Points) -> NDArray[np.float64]:
    """Volume between each triangle, shape [F, 3, 3], and the origin [m3], shape [F]; below 0 where it faces that."""
    return np.asarray(np.einsum("ij,ij->i", corners[:, 0], face_normals(corners)) / 6.0)


def vertex_normals(points: ArrayLike, triangles: Indices) -> NDArray[np.float32]:
    """Unit vertex normals, triangles weighted by area, shape [V, 3]; up (0, 1, 0) where no area meets."""
    corners = np.asarray(points, dtype=np.float64)[triangles]
    doubled = face_normals(corners)
    count = len(np.asarray(points))
    # bincount sums in a fixed order and is ten times faster than np.add.at
    spread = np.repeat(doubled, 3, axis=0)
    total = np.stack([np.bincount(triangles.ravel(), spread[:, axis], count) for axis in range(3)], axis=1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    smallest = np.finfo(np.float64).tiny ** 0.5  # below it the squares under the root are lost
    unit = np.where(length > smallest, total / np.maximum(length, smallest), (0.0, 1.0, 0.0))
    return unit.astype(np.float32)

"""Polygons as a mesh file has them, before any repair, with the lines or numbers that messages name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Folds

Role = Literal["garment", "avatar"]
Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

EXPORT_AGAIN = "export the mesh again"
CUT_OFF = "the file is cut off or damaged: export it again"
LISTED = 6  # names in a message
AGREE, MOST = 0.05, 0.5  # of sides of polygons in texture space: how near their scales are, and of what fraction
POSED = "skeleton and blend shapes are not applied: the mesh is used as stored"  # a note


@dataclass(frozen=True, eq=False)
class RawMesh:
    """Polygons of a mesh file, y up, in the file's unit.

    ``corners`` lists the vertices of polygon 0, then those of polygon 1, and so on; ``counts`` has their numbers.
    Text formats also give the line of every vertex and polygon, and may number them from 1.
    """

    file: str
    points: Floats  # [file unit], shape [V, 3]
    counts: Ints  # corners of each polygon, shape [P]
    corners: Ints  # vertex of each corner, shape [sum of counts]
    texcoords: Floats | None = None  # of each corner, NaN where it has none, shape [sum of counts, 2]
    panels: Ints | None = None  # panel of each polygon, shape [P]
    panel_names: tuple[str, ...] = ()
    materials: Ints | None = None  # material of each polygon, shape [P]
    material_names: tuple[str, ...] = ()
    metres_per_unit: float | None = None  # as the file declares
    vertex_lines: Ints | None = None  # shape [V]
    face_lines: Ints | None = None  # shape [P]
    first_index: int = 0  # number of the first vertex in the file
    notes: tuple[str, ...] = ()
    rest: Floats | None = None  # rest position of each corner, from a USD stage, shape [sum of counts, 3]
    folds: Folds | None = None  # rest angles between faces, from a USD stage
    axis_unknown: bool = False  # whether the format does not state the up axis
    doubt: Floats | None = None  # rounding error of each stored coordinate [file unit], shape [V, 3]

    def texture_scale(self) -> float | None:
        """Lengths in texture space over those of the mesh, where most sides of its polygons agree in it; else None."""
        if self.texcoords is None or len(self.texcoords) != len(self.corners):
            return None
        following = np.arange(1, len(self.corners) + 1)
        ends = np.cumsum(self.counts)
        following[ends - 1] = ends - self.counts
        place = self.points[self.corners]
        length = np.linalg.norm(place[following] - place, axis=1)
        drawn = np.linalg.norm(self.texcoords[following] - self.texcoords, axis=1)
        known = np.isfinite(drawn) & (drawn > 0.0) & (length > 0.0)
        if not known.any():
            return None
        ratio = drawn[known] / length[known]
        middle = float(np.median(ratio))
        return middle if np.mean(np.abs(ratio / middle - 1.0) < AGREE) > MOST else None

    def vertex_name(self, vertex: int) -> str:
        """Number of a vertex in the file."""
        return str(vertex + self.first_index)

    def face_name(self, face: int) -> str:
        """A face by its line, or by its number from 0."""
        return f"line {self.face_lines[face]}" if self.face_lines is not None else f"face {face}"

    def vertex_place(self, vertex: int) -> str:
        """The file, with the line of a vertex where known."""
        return f"{self.file}:{self.vertex_lines[vertex]}" if self.vertex_lines is not None else self.file

    def face_place(self, face: int) -> str:
        """The file, with the line of a face where known."""
        return f"{self.file}:{self.face_lines[face]}" if self.face_lines is not None else self.file

    def polygon_of_corner(self, corner: int) -> int:
        """Polygon that a corner belongs to."""
        return int(np.searchsorted(np.cumsum(self.counts), corner, side="right"))


def counted(number: int, what: str) -> str:
    """A number with its noun: "1 vertex", "2 vertices"."""
    if number != 1:
        what = what.removesuffix("ex") + "ices" if what.endswith("vertex") else what + "s"
    return f"{number:,} {what}"


def joined(parts: Sequence[RawMesh], file: str, names: Sequence[str]) -> RawMesh:
    """The meshes of a file joined to one, in order; each becomes a panel."""
    if len(parts) == 1:
        return parts[0]
    offsets = np.cumsum([0] + [len(part.points) for part in parts])
    texcoords = None
    if any(part.texcoords is not None for part in parts):
        texcoords = np.concatenate(
            [
                part.texcoords if part.texcoords is not None else np.full((len(part.corners), 2), np.nan)
                for part in parts
            ]
        )
    return RawMesh(
        file=file,
        points=np.concatenate([part.points for part in parts]),
        counts=np.concatenate([part.counts for part in parts]),
        corners=np.concatenate([part.corners + offset for part, offset in zip(parts, offsets[:-1], strict=True)]),
        texcoords=texcoords,
        panels=np.repeat(np.arange(len(parts)), [len(part.counts) for part in parts]),
        panel_names=tuple(names),
        metres_per_unit=parts[0].metres_per_unit,
        notes=(*(note for part in parts for note in part.notes), f"{len(parts)} meshes of the file joined"),
        doubt=np.concatenate([np.zeros_like(p.points) if p.doubt is None else p.doubt for p in parts]),
    )


def check(raw: RawMesh) -> None:
    """Refuses what cannot be repaired: an empty mesh, non-finite coordinates, indices out of range.

    Raises:
        InputError: with the file, and the line where known.
    """
    if not len(raw.points):
        raise InputError(raw.file, "the mesh has no vertices", EXPORT_AGAIN)
    if not len(raw.counts):
        raise InputError(raw.file, "the mesh has no faces, only points or lines", "export its surface as polygons")
    if (raw.counts < 0).any() or raw.counts.sum() != len(raw.corners):
        problem = f"face sizes add up to {raw.counts.sum():,} corners, but there are {len(raw.corners):,}"
        raise InputError(raw.file, problem, EXPORT_AGAIN)
    wild = np.flatnonzero(~np.isfinite(raw.points).all(axis=1))
    if len(wild):
        vertex = int(wild[0])
        x, y, z = raw.points[vertex]
        more = f" (and {len(wild) - 1:,} more)" if len(wild) > 1 else ""
        problem = f"vertex {raw.vertex_name(vertex)} is not finite: ({x:g}, {y:g}, {z:g}){more}"
        raise InputError(raw.vertex_place(vertex), problem, "repair the mesh in the modelling tool")
    lost = np.flatnonzero((raw.corners < 0) | (raw.corners >= len(raw.points)))
    if len(lost):
        face = raw.polygon_of_corner(int(lost[0]))
        problem = (
            f"face {face} refers to vertex {raw.corners[lost[0]]}, but there are only {len(raw.points):,} "
            f"vertices (0 to {len(raw.points) - 1})"
        )
        raise InputError(raw.face_place(face), problem, f"{EXPORT_AGAIN}: its face list does not fit its vertices")

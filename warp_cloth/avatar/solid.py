"""Mesh repair of the avatar: the solid that its surface encloses, holes closed, loose sheets left out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warp_cloth.avatar.clothes import worn_parts
from warp_cloth.base.connected import mesh_parts
from warp_cloth.base.lids import cones, with_tips
from warp_cloth.base.mesh import Indices, Mesh, Points, face_normals
from warp_cloth.base.stored_value import stored_value

THINNEST = 1e-3  # [m]; a part with less volume over area is a sheet: thinner than the offset of cloth
MOSTLY_OPEN = 0.75  # a part whose lids are larger than this fraction of its area is a sheet: a lock of hair, a cape


@dataclass(frozen=True, eq=False)
class Closing:
    """How a surface becomes a solid: a cone over each of its holes, parts oriented outwards, loose sheets left out.

    The tip of each cone is an additional vertex, the middle of the hole's rim; it follows the rim's vertices.
    """

    triangles: Indices  # of the closed surface, shape [F, 3]
    rims: tuple[NDArray[np.int64], ...]  # vertices round each hole, those of sheets too
    holes: int  # closed, without those of sheets
    lid_area: float  # of the cones over them [m2]
    sheets: int  # parts left out
    encloses: bool  # whether there is a solid at all
    worn: int = 0  # parts of the solid that another part wears: clothes

    def points(self, vertices: Points) -> Points:
        """The avatar's vertices [m], shape [V, 3], and the tips."""
        return with_tips(vertices, self.rims)

    def closed(self, mesh: Mesh) -> Mesh:
        """The mesh as a solid; without data of single triangles."""
        return replace(
            mesh,
            points=self.points(mesh.points),
            triangles=self.triangles,
            texcoords=None,
            panels=None,
            panel_names=(),
            materials=None,
            material_names=(),
        )

    def surface(self, mesh: Mesh) -> Mesh:
        """The surface that cloth lies on, without holes and loose sheets: distances and girths are measured on it."""
        if not self.encloses or not (self.sheets or self.holes):
            return mesh
        used, corners = np.unique(self.triangles, return_inverse=True)
        solid = self.closed(mesh)
        triangles = corners.reshape(-1, 3).astype(np.int32)
        return replace(solid, points=solid.points[used], triangles=triangles)


def closing_of(mesh: Mesh) -> Closing:
    """How a mesh becomes a solid, from the disk where it has been closed before."""
    return stored_value("closing", ("avatar", "base"), _closing_of, mesh)


def _closing_of(mesh: Mesh) -> Closing:
    """How a mesh becomes a solid.

    Cones over its holes close it. A part that then encloses hardly anything, or is mostly lid, is a sheet and left out,
    unless all parts are.
    """
    covers, rims = cones(mesh.triangles.astype(np.int64), mesh.vertex_count)
    triangles = np.concatenate([mesh.triangles.astype(np.int64), covers])
    points = with_tips(mesh.points, rims)
    part = _parts(triangles, len(points))
    corners = points[triangles] - points[part][:, None]  # about the part's own vertex: it may be far from the origin
    normal = face_normals(corners)
    face_area = 0.5 * np.linalg.norm(normal, axis=1)

    def of_parts(values: NDArray[np.float64], first: int = 0) -> NDArray[np.float64]:
        sums = np.bincount(part[first:], weights=values[first:], minlength=len(points))
        return np.asarray(sums[part], dtype=np.float64)

    volume = of_parts(np.einsum("ij,ij->i", corners[:, 0], normal) / 6.0)
    area, lids = of_parts(face_area), of_parts(face_area, mesh.triangle_count)
    sheet = (np.abs(volume) <= THINNEST * area) | (lids > MOSTLY_OPEN * (area - lids))
    encloses = not sheet.all()
    included = ~sheet if encloses else np.ones(len(triangles), dtype=bool)
    lid = included & (np.arange(len(triangles)) >= mesh.triangle_count)
    oriented = np.where((volume < 0.0)[:, None], triangles[:, ::-1], triangles)[included]
    return Closing(
        np.ascontiguousarray(oriented, dtype=np.int32),
        rims,
        holes=len(np.unique(triangles[lid, 2])),
        lid_area=float(face_area[lid].sum()),
        sheets=len(np.unique(part[~included])),
        encloses=encloses,
        worn=worn_parts(points, triangles[included], part[included], rims),
    )


@dataclass(frozen=True, eq=False)
class Solid:
    """An avatar as a closed solid, or as loaded where it encloses nothing."""

    closing: Closing
    mesh: Mesh


def solid_of(avatar: Mesh) -> Solid:
    """The avatar with its holes closed; a sheet stays as it is, for the collider that can handle one."""
    closing = closing_of(avatar)
    return Solid(closing, closing.closed(avatar) if closing.encloses else avatar)


def _parts(triangles: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Lowest vertex of each triangle's connected component."""
    return mesh_parts(count, triangles)[triangles[:, 0]]

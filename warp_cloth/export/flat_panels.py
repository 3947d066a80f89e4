"""A worn garment's panels laid flat: the mesh of its pattern, each vertex with the garment's vertex that it became."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom, Vt

from warp_cloth.base.mesh import Indices, Points
from warp_cloth.export.fields import Ranges, author_fields, contiguous
from warp_cloth.model.result import WornGarment

VERTEX = "garment_vertex"  # primvar: the vertex of the garment that each vertex of the panels became


@dataclass(frozen=True, eq=False)
class FlatPanels:
    """Panels side by side, as cut: seams are open, so that a vertex of the garment is there once for each side."""

    points: Points  # [m], shape [N, 2]
    triangles: Indices  # those of the garment, in its order, shape [F, 3]
    vertex: NDArray[np.int64]  # of the garment, shape [N]
    panels: NDArray[np.int32]  # of each triangle, shape [F]
    names: tuple[str, ...]

    def of_vertices(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Values of the garment's vertices at those of the panels."""
        return values[self.vertex]


def flat_panels(worn: WornGarment) -> FlatPanels | None:
    """The panels of a garment in metres; None if its rest shape is not made of panels."""
    corners = None if worn.rest is None else worn.rest.corners
    if corners is None or corners.shape[2] != 2 or worn.mesh.panels is None:
        return None
    points, first, inverse = np.unique(corners.reshape(-1, 2), axis=0, return_index=True, return_inverse=True)
    triangles = inverse.reshape(-1, 3).astype(np.int32)
    vertex = worn.mesh.triangles.ravel().astype(np.int64)[first]
    return FlatPanels(points, triangles, vertex, worn.mesh.panels, worn.mesh.panel_names)


def author_flat_panels(part: Usd.Prim, worn: WornGarment, ranges: Ranges) -> UsdGeom.Mesh | None:
    """The panels as a mesh next to the garment's, with its maps, in the plane z = 0; a guide, which is not rendered."""
    flat = flat_panels(worn)
    if flat is None:
        return None
    surface = UsdGeom.Mesh.Define(part.GetStage(), part.GetPath().AppendChild(f"{part.GetName()}_panels"))
    surface.CreatePurposeAttr(UsdGeom.Tokens.guide)
    surface.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    surface.CreateDoubleSidedAttr(True)
    surface.CreateFaceVertexCountsAttr(Vt.IntArray(len(flat.triangles), 3))
    surface.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(contiguous(flat.triangles.ravel(), np.int32)))
    points = contiguous(np.column_stack([flat.points, np.zeros(len(flat.points))]), np.float32)
    surface.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    surface.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack([points.min(axis=0), points.max(axis=0)])))
    api = UsdGeom.PrimvarsAPI(surface)
    place = api.CreatePrimvar(VERTEX, Sdf.ValueTypeNames.IntArray, UsdGeom.Tokens.vertex)
    place.Set(Vt.IntArray.FromNumpy(contiguous(flat.vertex, np.int32)))
    author_fields(surface, {name: flat.of_vertices(values) for name, values in worn.fields.items()}, ranges)
    return surface

"""Layers of a garment that meet at edges: the ruffles of a skirt at its waist, pockets, doubled hems and collars."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.connected import connected_components
from warp_cloth.base.mesh import face_normals
from warp_cloth.base.trims import nearest_faces
from warp_cloth.loading.raw import Floats, Ints
from warp_cloth.loading.unique_rows import edges_of

# A smaller sheet lies on the others if its rims are no farther off [m]: a bellows pocket's mouth, a flap, a lapel.
ON_OTHERS = 0.05


@dataclass(frozen=True, eq=False)
class _Sheets:
    """What a mesh falls into where it is cut along all edges that have three faces or more."""

    points: Floats  # [m], shape [V, 3]
    triangles: Ints  # shape [F, 3]
    edge_of_side: Ints  # the edge of the sides (0,1), (1,2), (2,0) of each face, shape [3 F]
    count: Ints  # faces of each edge
    sheet: Ints  # of each face, shape [F]

    def area(self) -> Floats:
        """Of each sheet, by its number, twice."""
        twice = np.linalg.norm(face_normals(self.points[self.triangles]), axis=1)
        return np.bincount(self.sheet, twice).astype(np.float64)

    def lies_on_others(self, sheet: int) -> bool:
        """Whether its rims are all near other sheets, as those of what is sewn onto cloth; or it has none."""
        own = self.sheet == sheet
        rim = np.unique(edges_of(self.triangles)[(self.count[self.edge_of_side] == 1) & np.repeat(own, 3)])
        if not len(rim):
            return True
        _, away = nearest_faces(self.points[rim], self.points, self.triangles[~own])
        return bool((away <= ON_OTHERS).all())


def layers_meet(points: Floats, triangles: Ints, edge_of_side: Ints, edges: Ints) -> NDArray[np.bool_]:
    """At which of the edges that have three faces or more only layers of cloth meet, shape [N].

    Cut along all such edges, the mesh falls into sheets. Whole layers meet where each face belongs to another sheet,
    which goes on behind it. Else the smaller ones must lie on the others: a pocket does, which ends within its sheet,
    and a hem folded double, which has two faces at its stitches. So may one sheet pinched at an edge. A fin, a slip of
    the modeller's, stands off.

    Args:
        points: [m], shape [V, 3].
        triangles: shape [F, 3].
        edge_of_side: the edge of the sides (0,1), (1,2), (2,0) of each face, shape [3 F].
        edges: those with three faces or more, shape [N].
    """
    count = np.bincount(edge_of_side)
    order = np.argsort(edge_of_side, kind="stable")
    first = np.cumsum(count) - count
    inner = first[count == 2]
    faces = len(triangles)
    sheets = _Sheets(
        points,
        triangles,
        edge_of_side,
        count,
        connected_components(faces, order[inner] // 3, order[inner + 1] // 3),
    )
    at_seam = (count[edge_of_side] > 2).reshape(-1, 3).any(axis=1)
    goes_on = np.bincount(sheets.sheet, weights=~at_seam, minlength=faces) > 0
    area = sheets.area()
    sewn_on: dict[int, bool] = {}

    def lies_on_others(sheet: int) -> bool:
        if sheet not in sewn_on:
            sewn_on[sheet] = sheets.lies_on_others(sheet)
        return sewn_on[sheet]

    def is_layered(edge: int) -> bool:
        own = sheets.sheet[order[first[edge] : first[edge] + count[edge]] // 3]
        there = np.unique(own)
        if len(there) == len(own) and bool(goes_on[own].all()):
            return True
        smaller = there[np.argsort(area[there], kind="stable")][:-1].tolist()
        return all(lies_on_others(sheet) for sheet in smaller)

    return np.array([is_layered(edge) for edge in edges.tolist()], dtype=bool)

"""The solid that an avatar's surface encloses: holes closed, so that every ray leaves as often as it enters."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warp_cloth.connected import lowest_connected
from warp_cloth.mesh import Indices, Mesh, Points

THINNEST = 1e-3  # [m]; a solid of less volume over area is a sheet: thinner than the offset that cloth keeps


@dataclass(frozen=True, eq=False)
class Closing:
    """What makes a surface a solid: a cone over each of its holes, and parts turned outwards.

    The tip of each cone is one more vertex, the middle of the hole's rim, wherever the vertices move.
    """

    triangles: Indices  # of the closed surface, shape [F, 3]
    rims: tuple[NDArray[np.int64], ...]  # vertices round each hole
    thickness: float  # volume over area of the whole [m]

    def points(self, vertices: Points) -> Points:
        """The avatar's vertices [m], shape [V, 3], and the tips."""
        tips = [vertices[rim].mean(axis=0) for rim in self.rims]
        return np.concatenate([vertices, np.reshape(tips, (-1, 3))])

    @property
    def encloses(self) -> bool:
        """Whether there is a solid at all, and not only a sheet."""
        return self.thickness > THINNEST

    def closed(self, mesh: Mesh) -> Mesh:
        """The mesh as a solid; without what belongs to single triangles."""
        return replace(
            mesh, points=self.points(mesh.points), triangles=self.triangles, texcoords=None, panels=None, panel_names=()
        )


def closing_of(mesh: Mesh) -> Closing:
    """How a mesh becomes a solid.

    An edge that its triangles run along more often one way than the other gets that many triangles of a cone the
    other way. Where the triangles are wound alike these are the rims of holes, and the cones close them.
    """
    triangles, count = mesh.triangles.astype(np.int64), mesh.vertex_count
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    edges, edge = np.unique(np.minimum(start, end) * count + np.maximum(start, end), return_inverse=True)
    excess = np.zeros(len(edges), dtype=np.int64)
    np.add.at(excess, edge.ravel(), np.where(start < end, 1, -1))
    open_edges = np.repeat(np.flatnonzero(excess), np.abs(excess[excess != 0]))
    low, high = edges[open_edges] // count, edges[open_edges] % count
    forward = excess[open_edges] > 0
    rim = lowest_connected(count, low, high)[low]
    _, tip = np.unique(rim, return_inverse=True)
    cones = np.stack([np.where(forward, high, low), np.where(forward, low, high), count + tip.ravel()], axis=1)
    order = np.argsort(tip.ravel(), kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(tip.ravel()[order])) + 1) if len(order) else []
    rims = tuple(np.unique(np.concatenate([low[part], high[part]])) for part in parts)
    closing = Closing(np.concatenate([triangles, cones]).astype(np.int32), rims, 0.0)
    return _turned_outwards(closing, closing.points(mesh.points))


def _turned_outwards(closing: Closing, points: Points) -> Closing:
    """With every part that encloses a negative volume turned round."""
    triangles = closing.triangles
    a, b, c = (triangles[:, corner].astype(np.int64) for corner in range(3))
    part = lowest_connected(len(points), np.concatenate([a, b]), np.concatenate([b, c]))[a]
    # about the part's own vertex: a part far from the origin keeps its sign
    x, y, z = points[a] - points[part], points[b] - points[part], points[c] - points[part]
    volume = np.bincount(part, weights=np.einsum("ij,ij->i", x, np.cross(y, z)) / 6.0, minlength=len(points))
    inside_out = volume[part] < 0.0
    turned = np.where(inside_out[:, None], triangles[:, ::-1], triangles)
    area = 0.5 * np.linalg.norm(np.cross(y - x, z - x), axis=1).sum()
    thickness = float(np.abs(volume).sum() / area) if area > 0.0 else 0.0
    return replace(closing, triangles=np.ascontiguousarray(turned, dtype=np.int32), thickness=thickness)

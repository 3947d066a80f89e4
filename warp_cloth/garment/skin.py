"""How high garments lie above the skin of the body that they were modelled on, by its nearest vertices."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from warp_cloth.anatomy.geodesics import nearest_points
from warp_cloth.base.mesh import Mesh, Points, vertex_normals


@dataclass(frozen=True, eq=False)
class Skin:
    """The vertices of a body; their normals are computed once, when they are first needed."""

    body: Mesh

    @cached_property
    def _normals(self) -> NDArray[np.float32]:
        return vertex_normals(self.body.points, self.body.triangles)

    def heights(self, points: Points) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Heights of points [m], shape [N, 3], above the vertex that is nearest to each, below 0 within; that vertex.

        Shape [N] each.
        """
        nearest = nearest_points(self.body.points, points)
        return np.einsum("ij,ij->i", points - self.body.points[nearest], self._normals[nearest]), nearest

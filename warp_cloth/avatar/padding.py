"""Padding of an avatar where it would show through large faces, as a nose does whose tip lies between vertices."""

from __future__ import annotations

import numpy as np

from warp_cloth.avatar.penetration import Overlap
from warp_cloth.base.mesh import Indices, Mesh, Points, vertex_normals

SPARE = 0.5e-3  # [m] more than what shows, as faces tilt when their corners are pushed out
WHOLE, FADED = 0.006, 0.031  # [m] from a face: where the padding is whole, and where it has ended


def padded(body: Mesh, worn: Points, triangles: Indices, overlap: Overlap) -> Points:
    """The body's vertices [m], shape [V, 3], moved out under the faces of worn cloth that it shows through.

    Args:
        body: the contact surface.
        worn: vertices of all garments [m], shape [N, 3].
        triangles: of them, shape [F, 3].
        overlap: what shows.
    """
    from scipy.spatial import cKDTree
    from trimesh.triangles import closest_point

    out = np.zeros(len(body.points))
    tree = cKDTree(body.points)
    for corners, depth in zip(worn[triangles[overlap.faces]], overlap.face_depths.tolist(), strict=True):
        middle = corners.mean(axis=0)
        reach = FADED + float(np.linalg.norm(corners - middle, axis=1).max())
        near = np.array(tree.query_ball_point(middle, reach), dtype=np.int64)
        own = body.points[near]
        away = np.linalg.norm(own - closest_point(np.broadcast_to(corners, (len(near), 3, 3)), own), axis=1)
        share = np.clip((FADED - away) / (FADED - WHOLE), 0.0, 1.0)
        out[near] = np.maximum(out[near], share * (depth + SPARE))
    moved: Points = body.points + out[:, None] * vertex_normals(body.points, body.triangles)
    return moved

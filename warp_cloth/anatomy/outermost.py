"""How far out a surface reaches along rays from within it."""

from __future__ import annotations

import numpy as np

from warp_cloth.anatomy.geodesics import Floats
from warp_cloth.base.mesh import Indices, Points

FAR = 2.0  # box diagonals of the surface, beyond which nothing of it is seen from a point near it


def outermost_distances(points: Points, triangles: Indices, start: Points, out: Points) -> Floats:
    """Where each ray leaves a surface for good [m], shape [N]; 0 where it does not meet the surface.

    On the CPU, so that the bits are the same whatever device the fit runs on.

    Args:
        points: vertices of the surface [m], shape [V, 3].
        triangles: of the surface, shape [F, 3].
        start: of the rays, within its box or near it [m], shape [N, 3].
        out: their directions, unit vectors, shape [N, 3].
    """
    import warp as wp

    from warp_cloth.kernels.anatomy.outermost import find_outermost

    if not len(triangles) or not len(start):
        return np.zeros(len(start))
    corners = points[triangles].reshape(-1, 3)
    far = FAR * float(np.linalg.norm(np.ptp(np.concatenate([corners, start]), axis=0)))
    vertices, rays, ways = (wp.array(rows, dtype=wp.vec3f, device="cpu") for rows in (points, start, out))
    mesh = wp.Mesh(vertices, wp.array(triangles.ravel(), dtype=wp.int32, device="cpu"))
    distances = wp.empty(len(start), dtype=wp.float32, device="cpu")
    wp.launch(find_outermost, len(start), inputs=[mesh.id, rays, ways, far], outputs=[distances], device="cpu")
    return distances.numpy().astype(np.float64)

"""Loose parts of a garment's mesh that its cloth carries: buttons, zips, patches, scraps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.connected import mesh_parts
from warp_cloth.base.mesh import face_normals
from warp_cloth.base.trims import RIGID, nearest_faces
from warp_cloth.loading.raw import Floats, Ints
from warp_cloth.loading.unique_rows import rim_edges

# A part is a trim if its area is less than this share of the largest part's, and all of it is nearer to cloth than
# NEAR [m]: a button's top is 4 mm above the shirt, a collar stands farther off. The lining of a coat is no smaller.
SHARE, NEAR = 0.1, 0.01
# Or if it is too small to be held by anything, up to RIGID across, and stands off that far [m] at most, such as a
# toggle, a pompom, or the scrap of a chin that was left where a neckline was cut from a body.
SCRAP_SHARE, SCRAP_NEAR = 0.01, 0.25
# The same of what is closed, such as a hanger or a brooch, where the cloth is open sheets: a solid is none.
# Or if this share of the corners along its rims lie on the cloth, as those of a patch pocket do, and it bulges no more
# than that [m]. The upper rim of a collar, or the end of a cuff, does not.
ON_CLOTH, BULGE = 0.9, 0.05


def trims_among(points: Floats, triangles: Ints) -> NDArray[np.bool_]:
    """Whether each triangle belongs to a trim, shape [F]; ``points`` [m], shape [V, 3].

    Nothing connects a trim with the cloth, so that as cloth it would fall off.
    """
    vertex_part = mesh_parts(len(points), triangles)
    _, part = np.unique(vertex_part[triangles[:, 0]], return_inverse=True)
    if part.max() == 0:
        return np.zeros(len(triangles), dtype=bool)
    corners = points[triangles]
    area = np.linalg.norm(face_normals(corners), axis=1)
    total = np.bincount(part, area)
    shares = total / total.max()
    loose = (shares < SHARE)[part]
    if not loose.any():
        return loose
    _, away = nearest_faces(corners[loose].reshape(-1, 3), points, triangles[~loose])
    farthest = np.zeros(len(total))
    of_corner = np.repeat(part[loose], 3)
    np.maximum.at(farthest, of_corner, away)
    low, high = np.full((len(total), 3), np.inf), np.full((len(total), 3), -np.inf)
    np.minimum.at(low, part, corners.min(axis=1))
    np.maximum.at(high, part, corners.max(axis=1))
    is_scrap = (shares < SCRAP_SHARE) & ((high - low).max(axis=1) <= RIGID)
    on_rim = np.isin(triangles[loose].ravel(), _rim(triangles[loose]))
    rims, near = (np.bincount(of_corner[chosen], minlength=len(total)) for chosen in (on_rim, on_rim & (away <= NEAR)))
    is_patch = (rims > 0) & (near >= ON_CLOTH * rims)
    is_solid = (rims == 0) & (len(rim_edges(triangles[~loose])) > 0)
    limits = np.select([is_scrap | is_solid, is_patch], [SCRAP_NEAR, BULGE], NEAR)
    return loose & (farthest <= limits)[part]


def _rim(triangles: Ints) -> Ints:
    """The vertices on the boundaries of a mesh, shape [B]."""
    vertices: Ints = np.unique(rim_edges(triangles))
    return vertices

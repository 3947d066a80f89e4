"""What vertices' depth does not tell: edges drawn through a limb, faces so large that the avatar shows through."""

from __future__ import annotations

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.collide.exact import ExactCollider, signed_distances
from warp_cloth.mesh import Mesh, Points

STRETCHED = 0.2  # strain of an edge from which on it is asked for: one through a limb is longer than the limb is thick
DEEP = 0.2  # of an edge's length, that it runs under the skin: over a round limb a long edge dips less than that
PLACES = np.linspace(0.0, 1.0, 9)[1:-1]  # along an edge
LARGE = 0.018  # [m]; over a nose or a finger, 14 mm in radius, a shorter edge at the usual offset stays outside
WITHIN = np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4], [1, 1, 0], [0, 1, 1], [1, 0, 1], [1, 1, 1]])  # of a face


def piercing(
    points: Points,
    edges: NDArray[np.int32],
    strains: NDArray[np.float64],
    avatar: Mesh,
    device: wp.DeviceLike = None,
    exact: ExactCollider | None = None,
) -> tuple[int, float]:
    """How many of the edges are drawn through the avatar, and how deep [mm].

    ``points`` [m], shape [V, 3]; ``edges`` are pairs of them, shape [E, 2]; ``strains`` are theirs, shape [E].
    ``exact`` is of that avatar, where there is one already.
    """
    asked = edges[strains > STRETCHED]
    if not len(asked) or not np.isfinite(points).all():
        return 0, 0.0
    first, last = points[asked[:, 0], None], points[asked[:, 1], None]
    along = (first + (last - first) * PLACES[:, None]).reshape(-1, 3)
    depth = np.nan_to_num(-signed_distances(along, avatar, device, exact)).reshape(len(asked), -1).max(axis=1)
    through = depth > DEEP * np.linalg.norm(last - first, axis=2)[:, 0]
    return int(through.sum()), 1e3 * float(depth[through].max(initial=0.0))


def showing(
    points: Points,
    triangles: NDArray[np.int32],
    avatar: Mesh,
    device: wp.DeviceLike = None,
    exact: ExactCollider | None = None,
) -> tuple[int, float]:
    """Through how many of the triangles the avatar shows, and how deep they lie under its skin [mm].

    ``points`` [m], shape [V, 3]; only triangles large enough for that are asked for.
    """
    corners = points[triangles]
    large = corners[np.ptp(corners, axis=1).max(axis=1) > LARGE]
    if not len(large) or not np.isfinite(large).all():
        return 0, 0.0
    places = ((WITHIN / WITHIN.sum(axis=1, keepdims=True)) @ large).reshape(-1, 3)
    depth = np.nan_to_num(-signed_distances(places, avatar, device, exact)).reshape(len(large), -1).max(axis=1)
    return int((depth > 0.0).sum()), 1e3 * float(depth.max(initial=0.0))

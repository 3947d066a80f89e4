"""A body that was given as a garment, perhaps with the garment as the body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warp_cloth.anatomy.skeleton import skeleton_of
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.topology import build_topology
from warp_cloth.loading.repair import CLOSED

# Volume over area, relative to the extent: 0.02 in people; of cloth modelled with its thickness far less than 0.005.
SOLID = 0.005
# Length of all rims over the root of the area: 2.2 in a T-shirt, 0.4 in a body whose feet were not scanned.
OPEN = 1.0


def refuse_bodies(garments: Sequence[tuple[str, Mesh]], avatar: Mesh | None) -> None:
    """Refuses a person's closed body as a garment.

    Args:
        garments: scene key ("garment", "garment[1]") and mesh of each.
        avatar: what wears them.

    Raises:
        InputError: a garment is a body; where the avatar looks like a garment, with the advice to exchange them.
    """
    for key, garment in garments:
        if CLOSED in garment.notes and _is_solid(garment) and skeleton_of(garment) is not None:
            problem = "is a body: a closed surface with a head, arms and legs"
            if avatar is not None and _rims(avatar) > OPEN:
                raise InputError(key, f'"{garment.name}" {problem}', f'exchange it and "{avatar.name}", which is open')
            raise InputError(key, f'"{garment.name}" {problem}', "give the mesh of the garment")


def _is_solid(mesh: Mesh) -> bool:
    a, b, c = np.moveaxis(mesh.points[mesh.triangles] - mesh.points.mean(axis=0), 1, 0)
    normal = np.cross(b - a, c - a)
    area = 0.5 * float(np.linalg.norm(normal, axis=1).sum())
    volume = abs(float(np.einsum("ij,ij->", a, normal))) / 6.0
    return volume > SOLID * float(np.ptp(mesh.points, axis=0).max()) * area


def _rims(mesh: Mesh) -> float:
    """Length of the boundary over the root of the area."""
    topology = build_topology(mesh.triangles, mesh.vertex_count)
    uses = np.bincount(topology.triangle_edges.ravel(), minlength=len(topology.edges))
    ends = mesh.points[topology.edges[uses == 1]]
    a, b, c = np.moveaxis(mesh.points[mesh.triangles], 1, 0)
    area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()) / max(area, np.finfo(float).tiny) ** 0.5

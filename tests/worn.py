"""Small worn garments and an avatar for the tests of what is written."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from cloths import grid
from meshfiles import box

from warp_cloth.base.mesh import Mesh
from warp_cloth.model.result import WornGarment

FRAME_COUNT = 4
RNG_SEED = 5


def worn(name: str = "shirt", *, frame_count: int = 0, height: float = 1.0, toward: float = 0.3) -> WornGarment:
    """A bulging vertical square with texture coordinates, panels and a field, ``toward`` the viewer [m]."""
    random = np.random.default_rng(RNG_SEED)
    mesh = grid(7, 0.6)
    points = mesh.points + np.array([-0.3, height - 0.3, toward])
    points[:, 2] += 0.05 * np.cos(5.0 * points[:, 0])
    panels = np.arange(mesh.triangle_count, dtype=np.int32) * 3 // mesh.triangle_count
    mesh = replace(
        mesh,
        name=name,
        texcoords=mesh.points[mesh.triangles][:, :, :2],
        panels=panels.astype(np.int32),
        panel_names=("front", "back"),  # the third has no name
    )
    steps = np.linspace(0.2, 0.0, frame_count)
    frames = (
        np.stack([points + np.array([0.0, step, 0.0]) for step in steps]).astype(np.float32) if frame_count else None
    )
    strain = random.normal(size=len(points)).astype(np.float32)
    return WornGarment(name, mesh, points, thickness=5e-4, frames=frames, fields={"strain": strain})


def box_avatar(name: str = "body") -> Mesh:
    """A box 0.4 m wide and deep and 1.6 m high, standing on the ground."""
    return Mesh(name, *box((-0.2, 0.0, -0.2), (0.2, 1.6, 0.2)))

"""Coarse bodies with their triangles divided: level lines between a few vertices cannot be told apart."""

from __future__ import annotations

import numpy as np

from warp_cloth.base.mesh import Indices, Points
from warp_cloth.base.topology import mesh_edges


def divided(points: Points, triangles: Indices) -> tuple[Points, Indices]:
    """A mesh with each triangle in four: its points, the middles of its edges after them [m], and its triangles."""
    edges = mesh_edges(triangles, len(points)).astype(np.int64)
    keys = edges.min(axis=1) * len(points) + edges.max(axis=1)
    order = np.argsort(keys, kind="stable")
    sides = np.stack([triangles, np.roll(triangles, -1, axis=1)]).astype(np.int64)
    middle = (
        len(points) + order[np.searchsorted(keys, sides.min(axis=0) * len(points) + sides.max(axis=0), sorter=order)]
    )
    (a, b, c), (x, y, z) = triangles.T, middle.T
    corners = [(a, x, z), (x, b, y), (z, y, c), (x, y, z)]
    finer = np.concatenate([np.stack(each, axis=1) for each in corners]).astype(np.int32)
    return np.vstack([points, points[edges].mean(axis=1)]), finer

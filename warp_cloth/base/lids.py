"""Hole filling: a cone over each hole of a surface, whose tip is the middle of the hole's rim."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.connected import connected_components
from warp_cloth.base.mesh import Points

Rims = Sequence[NDArray[np.int64]]  # the vertices round each hole


def with_tips(vertices: Points, rims: Rims) -> Points:
    """The vertices [m], shape [V, 3], and after them the tip over each rim."""
    tips = [vertices[rim].mean(axis=0) for rim in rims]
    return np.concatenate([vertices, np.reshape(tips, (-1, 3))])


def cones(triangles: NDArray[np.int64], count: int) -> tuple[NDArray[np.int64], tuple[NDArray[np.int64], ...]]:
    """Triangles, shape [N, 3], that close a surface of ``count`` vertices, with tips numbered from there on, and rims.

    ``triangles`` of the surface have shape [F, 3]; each rim's vertices have shape [R].

    An edge along which its triangles run more often in one direction gets as many cone triangles in the other. Where
    triangles are wound consistently these edges are the rims of holes, and the cones close them.
    """
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    edges, edge = np.unique(np.minimum(start, end) * count + np.maximum(start, end), return_inverse=True)
    excess = np.zeros(len(edges), dtype=np.int64)
    np.add.at(excess, edge.ravel(), np.where(start < end, 1, -1))
    open_edges = np.repeat(np.flatnonzero(excess), np.abs(excess[excess != 0]))
    low, high = edges[open_edges] // count, edges[open_edges] % count
    forward = excess[open_edges] > 0
    rim = connected_components(count, low, high)[low]
    _, tip = np.unique(rim, return_inverse=True)
    found = np.stack([np.where(forward, high, low), np.where(forward, low, high), count + tip.ravel()], axis=1)
    order = np.argsort(tip.ravel(), kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(tip.ravel()[order])) + 1) if len(order) else []
    return found, tuple(np.unique(np.concatenate([low[part], high[part]])) for part in parts)

"""How far one worn shape is from another of the same garment, on the same mesh or on a finer or coarser one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Mesh, Points

CHUNK = 2_000_000  # pairs of a place and a triangle that are tested at once


def distances(mesh: Mesh, points: Points, other: Mesh, worn: Points) -> NDArray[np.float64] | None:
    """Distance [m] of every vertex to the same place of the other garment, shape [V].

    On meshes that differ the same place is that of the same texture coordinates in the same panel; None where there
    are none.
    """
    if np.array_equal(mesh.triangles, other.triangles):
        return np.asarray(np.linalg.norm(points - worn, axis=1))
    if mesh.texcoords is None or other.texcoords is None or mesh.panel_names != other.panel_names:
        return None
    first = np.full(len(points), -1)
    first[mesh.triangles.ravel()[::-1]] = np.arange(mesh.triangles.size)[::-1]  # any corner at each vertex
    places = mesh.texcoords.reshape(-1, 2)[first]
    panels, others = _panels(mesh)[first // 3], _panels(other)
    found = np.empty_like(points)
    for panel in np.unique(panels):
        here = np.flatnonzero(panels == panel)
        there = np.flatnonzero(others == panel)
        if not len(there):
            return None
        found[here] = _worn_at(places[here], other.texcoords[there], worn[other.triangles[there]])
    return np.asarray(np.linalg.norm(points - found, axis=1))


def _panels(mesh: Mesh) -> NDArray[np.int32]:
    return mesh.panels if mesh.panels is not None else np.zeros(len(mesh.triangles), dtype=np.int32)


def _worn_at(places: Points, flat: Points, worn: Points) -> Points:
    """Worn positions at places in the panel, shape [P, 3]; outside all triangles, those of the nearest edge.

    ``flat`` are the triangles' corners in the panel, shape [T, 3, 2], ``worn`` as worn, shape [T, 3, 3].
    """
    origin, sides = flat[:, 0], np.swapaxes(flat[:, 1:] - flat[:, :1], 1, 2)
    sound = np.abs(np.linalg.det(sides)) > 0.0
    origin, sides, worn = origin[sound], np.linalg.inv(sides[sound]), worn[sound]
    result = np.empty((len(places), 3))
    for part in _chunks(len(places), len(origin)):
        weights = np.einsum("tij,ptj->pti", sides, places[part, None] - origin)
        weights = np.concatenate([1.0 - weights.sum(axis=2, keepdims=True), weights], axis=2)
        best = np.argmax(weights.min(axis=2), axis=1)
        weight = np.maximum(weights[np.arange(len(best)), best], 0.0)
        weight /= weight.sum(axis=1, keepdims=True)
        result[part] = np.einsum("pi,pij->pj", weight, worn[best])
    return result


def _chunks(places: int, triangles: int) -> Iterator[slice]:
    step = max(CHUNK // max(triangles, 1), 1)
    for start in range(0, places, step):
        yield slice(start, start + step)

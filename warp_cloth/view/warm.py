"""Warm starts: the worn shape of one garment taken over by another size or mesh of it."""

from __future__ import annotations

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.kernels.nearest import find_nearest
from warp_cloth.mesh import Mesh, Points

PANEL_GAP = 10.0  # between panels, which are brought to the unit square


def carried_over(old: Mesh, worn: Points, new: Mesh, device: str = "cpu") -> Points | None:
    """Where the new garment's vertices lie on the old one as worn [m], shape [V, 3]; None where nothing tells.

    The same triangles keep their vertices. Otherwise a place is told by its panel's name and by where it lies in that
    panel's box: sizes of one pattern correspond like that.
    """
    if old.vertex_count == new.vertex_count and np.array_equal(old.triangles, new.triangles):
        return worn.copy()
    shared = set(old.panel_names) == set(new.panel_names) and len(old.panel_names) > 0
    if not shared or old.texcoords is None or new.texcoords is None or old.panels is None or new.panels is None:
        return None
    places, wanted = _boxed(old, old.panel_names), _boxed(new, old.panel_names)
    surface = wp.Mesh(
        points=wp.array(places.reshape(-1, 3), dtype=wp.vec3f, device=device),
        indices=wp.array(np.arange(3 * len(places), dtype=np.int32), dtype=wp.int32, device=device),
    )
    asked = wp.array(wanted.reshape(-1, 3), dtype=wp.vec3f, device=device)
    face = wp.empty(len(asked), dtype=wp.int32, device=device)
    weight = wp.zeros(len(asked), dtype=wp.vec3f, device=device)
    wp.launch(find_nearest, dim=len(asked), inputs=[surface.id, asked, face, weight], device=device)
    corners = worn[old.triangles[face.numpy()]]
    found = (corners * weight.numpy()[:, :, None]).sum(axis=1)
    vertex = new.triangles.ravel()
    count = np.bincount(vertex, minlength=new.vertex_count)
    means = [np.bincount(vertex, found[:, axis], new.vertex_count) / count for axis in range(3)]
    return np.column_stack(means)


def _boxed(mesh: Mesh, names: tuple[str, ...]) -> NDArray[np.float32]:
    """Panel coordinates of every corner, each panel in a unit square of its own; shape [F, 3, 3]."""
    boxed = np.zeros((mesh.triangle_count, 3, 3), dtype=np.float32)
    if mesh.texcoords is None or mesh.panels is None:
        return boxed
    for number, name in enumerate(mesh.panel_names):
        inside = mesh.panels == number
        if inside.any():
            corners = mesh.texcoords[inside]
            low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
            boxed[inside, :, :2] = (corners - low) / np.maximum(high - low, 1e-9)
            boxed[inside, :, 2] = PANEL_GAP * names.index(name)
    return boxed

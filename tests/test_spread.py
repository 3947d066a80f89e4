"""Vertices count as near where few edges lie between them, wherever the cloth was put."""

from __future__ import annotations

import numpy as np
from cloths import grid

from warp_cloth.base.mesh import Points
from warp_cloth.base.topology import build_topology
from warp_cloth.garment.elements import garment_elements
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.kernels.base.options import Terms
from warp_cloth.material.fabric import resolve_fabric
from warp_cloth.model.patches.cutting import cut_patches
from warp_cloth.model.patches.spread import spread_places

COUNT = 40  # vertices a side
FABRIC = resolve_fabric({"stretch": 20e3, "bending": 1e-5})


def folded(points: Points) -> Points:
    """Cloth folded in half onto itself, without room between."""
    middle = points[:, 0].mean()
    return np.stack([np.abs(points[:, 0] - middle), points[:, 1], points[:, 2]], axis=1)


def vertices_in_patches(points: Points) -> int:
    """Vertices that the patches of a square read, those of others twice."""
    mesh = grid(COUNT)
    elements = garment_elements(mesh.triangles, build_rest_shape(mesh, FABRIC, rest="mesh"))
    tables = cut_patches([elements], [points], Terms(True, True, False), precision="mixed", own_memory=True)
    return len(tables.vertex)


def test_folding_cloth_does_not_change_how_it_is_cut() -> None:
    points = grid(COUNT).points
    assert vertices_in_patches(folded(points)) == vertices_in_patches(points)


def test_sheets_that_lie_on_each_other_are_far_apart() -> None:
    mesh = grid(COUNT)
    ends = build_topology(mesh.triangles, mesh.vertex_count).edges
    places = spread_places(ends, folded(mesh.points))
    along = np.linalg.norm(places[ends[:, 0]] - places[ends[:, 1]], axis=1).max()
    left = np.arange(0, COUNT * COUNT, COUNT)  # one side, which lies on the other
    across = np.linalg.norm(places[left] - places[left + COUNT - 1], axis=1).min()
    assert across > 0.5 * COUNT * along / np.sqrt(2.0)


def test_pieces_that_nothing_joins_are_told_apart_by_where_they_are() -> None:
    far = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [5.0, 0.0, 0.0], [5.1, 0.0, 0.0], [9.0, 0.0, 0.0]])
    places = spread_places(np.array([[0, 1], [2, 3]], dtype=np.int32), far)
    assert np.isfinite(places).all()
    assert len(np.unique(places, axis=0)) == len(far)

"""Coarser garments: what follows whom, on a square, on panels with a seam, and where nothing can go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cloths import grid

from warp_cloth.base.mesh import Mesh
from warp_cloth.scene.shapes import TshirtShape
from warp_cloth.shapes import build_garment
from warp_cloth.solver.implicit.coarsen import Coarsening, coarsen, rest_pattern

ROUNDING = 1e-12
MESH = grid(21, 1.0)
PANEL = MESH.points[MESH.triangles][:, :, :2]
NO_PINS = np.zeros(MESH.vertex_count, dtype=bool)


def followed(found: Coarsening, values: np.ndarray) -> np.ndarray:
    """Coarse values, shape [C, 3], carried to the finer vertices."""
    row = np.repeat(np.arange(len(found.start) - 1), np.diff(found.start))
    out = np.zeros((len(found.start) - 1, values.shape[1]))
    np.add.at(out, row, found.weight[:, None] * values[found.index])
    return out


@pytest.mark.parametrize("corners", [PANEL, MESH.points[MESH.triangles]], ids=["panel", "mesh"])
def test_a_flat_square_is_carried_over_exactly(corners: np.ndarray) -> None:
    found = coarsen(rest_pattern(MESH.triangles, corners, NO_PINS), 110)
    assert abs(len(found.fine_vertex) - 110) <= 2
    assert followed(found, MESH.points[found.fine_vertex]) == pytest.approx(MESH.points, abs=ROUNDING)
    place = np.pad(found.cloth.place, ((0, 0), (0, 3 - found.cloth.place.shape[1])))
    first, second, third = (place[found.cloth.triangles[:, corner]] for corner in range(3))
    areas = 0.5 * np.linalg.norm(np.cross(second - first, third - first), axis=1)
    assert areas.sum() == pytest.approx(1.0, rel=ROUNDING)


def test_pinned_vertices_stay() -> None:
    pinned = NO_PINS.copy()
    pinned[[0, 20, 200, 201, 202]] = True
    found = coarsen(rest_pattern(MESH.triangles, PANEL, pinned), 110)
    kept = np.flatnonzero(pinned)
    carried = followed(found, np.concatenate([MESH.points, MESH.points[:, :1]], axis=1)[found.fine_vertex])[:, :3]
    assert carried[kept] == pytest.approx(MESH.points[kept], abs=ROUNDING)


def test_a_sewn_garment_keeps_its_seams_and_loses_no_place() -> None:
    mesh: Mesh = build_garment(TshirtShape(kind="tshirt"), body=None)
    assert mesh.texcoords is not None
    cloth = rest_pattern(mesh.triangles, mesh.texcoords, np.zeros(mesh.vertex_count, dtype=bool))
    found = coarsen(cloth, mesh.vertex_count // 4)
    assert len(found.fine_vertex) <= 0.3 * mesh.vertex_count
    weights = followed(found, np.ones((len(found.fine_vertex), 1)))
    assert weights == pytest.approx(np.ones_like(weights), abs=1e-9)
    seams = len(cloth.vertex) - mesh.vertex_count  # vertices with more than one place
    assert len(found.cloth.vertex) - len(found.fine_vertex) > 0.25 * seams


def test_the_same_garment_is_coarsened_the_same_way_twice() -> None:
    first, second = (coarsen(rest_pattern(MESH.triangles, PANEL, NO_PINS), 110) for _ in range(2))
    assert (first.fine_vertex == second.fine_vertex).all()
    assert (first.weight == second.weight).all()


def test_a_garment_of_corners_only_is_left_as_it_is() -> None:
    strip = np.array([[k // 2 * 1.0, k % 2 * 1.0, 0.0] for k in range(4)])
    mesh = replace(MESH, points=strip, triangles=np.array([[0, 2, 1], [1, 2, 3]], dtype=np.int32))
    assert coarsen(rest_pattern(mesh.triangles, strip[mesh.triangles], np.zeros(4, dtype=bool)), 1) is None

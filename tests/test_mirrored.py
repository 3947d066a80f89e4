"""Half a garment, as a modelling tool's mirror leaves it in a file, is completed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cloths import tube
from meshfiles import written_garment

from warp_cloth.base.mesh import Mesh
from warp_cloth.base.topology import build_topology
from warp_cloth.loading.placement import Placement

AROUND = 24
SKIRT = tube(0.15, 0.4, 0.8, AROUND)


def half(mesh: Mesh, side: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """The part of a mesh on one side of x = 0, where it has vertices."""
    chosen = mesh.triangles[(side * mesh.points[mesh.triangles][..., 0] > -1e-9).all(axis=1)]
    used, faces = np.unique(chosen, return_inverse=True)
    return mesh.points[used], faces.reshape(-1, 3)


def is_completed(mesh: Mesh) -> bool:
    return any("completed with its mirror image" in note for note in mesh.notes)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("options", [{}, {"placement": Placement(rotate=(0.0, 60.0, 0.0), scale=2.0)}])
def test_half_a_skirt_becomes_the_whole_one(tmp_path: Path, side: float, options: dict[str, Any]) -> None:
    whole = written_garment(tmp_path / "whole.obj", SKIRT.points, SKIRT.triangles, **options)
    mesh = written_garment(tmp_path / "half.obj", *half(SKIRT, side), **options)
    assert is_completed(mesh)
    assert not is_completed(whole)
    assert mesh.triangle_count == whole.triangle_count
    order = [np.lexsort(each.points.round(6).T) for each in (mesh, whole)]
    np.testing.assert_allclose(mesh.points[order[0]], whole.points[order[1]], atol=1e-9)
    assert [len(loop) for loop in build_topology(mesh.triangles, mesh.vertex_count).boundary_loops] == [AROUND, AROUND]


def test_vertices_and_faces_of_the_file_are_found_in_the_whole_garment(tmp_path: Path) -> None:
    points, faces = half(SKIRT)
    mesh = written_garment(tmp_path / "half.obj", points, faces)
    assert mesh.vertex_map is not None
    assert mesh.triangle_source is not None
    np.testing.assert_array_equal(mesh.points[mesh.vertex_map], points)
    assert np.bincount(mesh.triangle_source).tolist() == [2] * len(faces)


def test_a_glove_that_ends_at_the_plane_is_whole(tmp_path: Path) -> None:
    sleeve = SKIRT.points[:, [1, 0, 2]] - [0.4, 0.0, 0.0]
    assert not is_completed(written_garment(tmp_path / "sleeve.obj", sleeve, SKIRT.triangles))


@pytest.mark.parametrize("bend", [0.0, 0.01])
def test_a_scarf_on_one_side_is_whole(tmp_path: Path, bend: float) -> None:
    x, y = np.meshgrid(np.linspace(0.0, 0.3, 7), np.linspace(0.0, 0.9, 19))
    points = np.stack([x, y, bend * np.sin(20.0 * x)], axis=2).reshape(-1, 3)
    a = (np.arange(18)[:, None] * 7 + np.arange(6)).ravel()
    faces = np.concatenate([np.stack([a, a + 1, a + 8], 1), np.stack([a, a + 8, a + 7], 1)])
    assert not is_completed(written_garment(tmp_path / "scarf.obj", points, faces))


def test_a_button_of_half_a_garment_is_mirrored_and_counted(tmp_path: Path) -> None:
    points, faces = half(SKIRT)
    button = np.array([[0.10, 0.6, 0.115], [0.11, 0.6, 0.115], [0.10, 0.61, 0.115]])
    both = np.concatenate([points, button]), np.concatenate([faces, [len(points) + np.arange(3)]])
    mesh = written_garment(tmp_path / "half.obj", *both)
    assert mesh.trim_points is not None
    assert len(mesh.trim_points) == 6
    assert mesh.arrays()["trim_count"] == 6

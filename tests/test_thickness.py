"""Cloth that was modelled with its thickness: one of its sides is the cloth, which carries the other."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh
from cloths import tube
from meshfiles import written_garment

from warp_cloth.base.mesh import Mesh
from warp_cloth.base.topology import build_topology
from warp_cloth.shapes import SIZE_BODIES
from warp_cloth.shapes.mannequin import mannequin

AROUND, ROWS = 48, 12
INNER = tube(0.15, 0.4, 0.8, AROUND, ROWS)


def solidified(sheet: Mesh, thickness: float, steps: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """A sheet and a second one outside, wound the other way, with rims of some steps, the more of them the rounder."""
    points, faces = sheet.points, sheet.triangles.astype(np.int64)
    outwards = trimesh.Trimesh(points, faces, process=False).vertex_normals
    count, layers, walls = len(points), [points, points + thickness * outwards], []
    for loop in build_topology(sheet.triangles, count).boundary_loops:
        rims = [loop, loop + count]
        for step in range(1, steps):
            turn = np.pi * step / steps
            away = np.sign(points[loop, 1:2] - points[:, 1].mean()) * [[0.0, 1.0, 0.0]]
            out = 0.5 * (1.0 - np.cos(turn)) * outwards[loop] + 0.5 * np.sin(turn) * away
            rims.insert(-1, sum(map(len, layers)) + np.arange(len(loop)))
            layers.append(points[loop] + thickness * out)
        for low, high in pairwise(rims):
            after, above = np.roll(low, -1), np.roll(high, -1)
            walls += [np.stack([low, after, above], axis=1), np.stack([low, above, high], axis=1)]
    return np.concatenate(layers), np.concatenate([faces[:, ::-1], faces + count, *walls])


@pytest.mark.parametrize("steps", [1, 2, 4, 6])
@pytest.mark.parametrize("thickness", [0.001, 0.01])
def test_the_inner_side_of_thick_cloth_is_the_cloth(tmp_path: Path, thickness: float, steps: int) -> None:
    points, faces = solidified(INNER, thickness, steps)
    mesh = written_garment(tmp_path / "skirt.obj", points, faces)
    is_side = np.isin(mesh.points, INNER.points).all(axis=1)
    assert is_side.sum() == len(INNER.points)
    np.testing.assert_allclose(np.hypot(*mesh.points[:, ::2].T), 0.15, atol=0.5 * thickness)
    assert [len(loop) for loop in build_topology(mesh.triangles, mesh.vertex_count).boundary_loops] == [AROUND, AROUND]
    assert mesh.trim_triangles is not None
    assert mesh.triangle_count + len(mesh.trim_triangles) == len(faces)
    assert f"modelled with its thickness ({1e3 * thickness:.2g} mm)" in " ".join(mesh.notes)
    assert not any("closed surface" in note for note in mesh.notes)


def test_every_vertex_of_thick_cloth_is_cloth_or_carried(tmp_path: Path) -> None:
    points, faces = solidified(INNER, 0.002)
    mesh = written_garment(tmp_path / "skirt.obj", points, faces)
    assert mesh.vertex_map is not None
    assert mesh.trim_map is not None
    assert ((mesh.vertex_map >= 0) | (mesh.trim_map >= 0)).all()


def test_each_part_of_thick_cloth_is_told_by_itself(tmp_path: Path) -> None:
    """A pair of socks in one file, one of them a sheet."""
    thick, faces = solidified(INNER, 0.002)
    points = np.concatenate([thick, INNER.points + 0.5])
    mesh = written_garment(tmp_path / "socks.obj", points, np.concatenate([faces, INNER.triangles + len(thick)]))
    assert mesh.triangle_count == 2 * len(INNER.triangles)


@pytest.mark.parametrize("kind", ["thick", "body", "ball", "sheets"])
def test_what_is_no_thick_cloth_stays(tmp_path: Path, kind: str) -> None:
    if kind == "thick":
        points, faces = solidified(INNER, 0.05)
    elif kind == "body":
        body = mannequin(SIZE_BODIES["M"])
        points, faces = body.points, body.triangles
    elif kind == "ball":
        ball = trimesh.creation.icosphere(3, 0.1)
        points, faces = ball.vertices, ball.faces
    else:  # a shirt and its lining
        points = np.concatenate([INNER.points, INNER.points * [1.02, 1.0, 1.02]])
        faces = np.concatenate([INNER.triangles, INNER.triangles + len(INNER.points)])
    mesh = written_garment(tmp_path / "other.obj", points, faces)
    assert mesh.triangle_count == len(faces)
    assert mesh.trim_triangles is None

"""Garments of a few large faces are divided before a body shows through them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cloths import tube
from meshfiles import obj_text

from warp_cloth.base.division import refined
from warp_cloth.base.mesh import face_normals
from warp_cloth.base.topology import build_topology
from warp_cloth.fitting.judge import judge
from warp_cloth.garment.coarse import COARSE, FINE_MM
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.scene import load_scene

FINEST = 1e-3 * FINE_MM
LOW = tube(0.25, 0.6, 0.9, 24, 2)  # a skirt of 24 quads, 30 cm high


def outfit_of(path: Path, text: str, **keys: object):  # type: ignore[no-untyped-def]
    path.write_text(text)
    return load_outfit(load_scene({"garment": {"mesh": str(path), **keys}, "avatar": {"shape": {"kind": "mannequin"}}}))


def longest(points: np.ndarray) -> float:
    return float(np.linalg.norm(np.roll(points, -1, axis=1) - points, axis=2).max())


def test_a_skirt_of_a_few_faces_is_divided_and_its_own_vertices_stay_first(tmp_path: Path) -> None:
    outfit = outfit_of(tmp_path / "skirt.obj", obj_text(LOW.points, LOW.triangles))
    (mesh,) = outfit.meshes
    assert [choice.key for choice in outfit.readings] == ["garment.edge_mm"]
    np.testing.assert_allclose(mesh.points[: len(LOW.points)], LOW.points)
    assert longest(mesh.points[mesh.triangles]) <= FINEST
    assert mesh.triangle_source is not None
    areas = [np.linalg.norm(np.cross(b - a, c - a), axis=1) for a, b, c in (
        np.moveaxis(each.points[each.triangles], 1, 0) for each in (LOW, mesh)
    )]  # fmt: skip
    np.testing.assert_allclose(np.bincount(mesh.triangle_source, areas[1]), areas[0])
    assert len(build_topology(mesh.triangles, mesh.vertex_count).boundary_loops) == 2  # no edge is divided on one side
    assert mesh.vertex_map is not None
    assert len(mesh.vertex_map) == len(LOW.points)


def test_usual_faces_stay(tmp_path: Path) -> None:
    skirt = tube(0.25, 0.6, 0.9, 48, 8)
    assert FINEST < longest(skirt.points[skirt.triangles]) <= COARSE
    outfit = outfit_of(tmp_path / "skirt.obj", obj_text(skirt.points, skirt.triangles))
    assert not outfit.readings
    assert outfit.meshes[0].triangle_count == skirt.triangle_count


def test_a_stated_length_is_kept(tmp_path: Path) -> None:
    outfit = outfit_of(tmp_path / "skirt.obj", obj_text(LOW.points, LOW.triangles), edge_mm=50)
    assert not outfit.readings
    assert FINEST < longest(outfit.meshes[0].points[outfit.meshes[0].triangles]) <= 0.05


@pytest.mark.parametrize("limit", [0.9, 0.11, 0.02])
def test_parts_hold_what_lies_at_their_corners(limit: float) -> None:
    corners = LOW.points[LOW.triangles]
    points, parts = refined(LOW.points, LOW.triangles, corners, limit)
    np.testing.assert_allclose(parts.held(corners), points[parts.triangles], atol=1e-12)
    a, b, c = np.moveaxis(points[parts.triangles], 1, 0)
    p, q, r = np.moveaxis(corners[parts.source], 1, 0)
    assert (np.einsum("fi,fi->f", np.cross(b - a, c - a), np.cross(q - p, r - p)) > 0.0).all()  # none turned over


@pytest.mark.parametrize("width", [0.1, 0.3, 1.0])
def test_narrow_faces_become_no_narrower_and_mostly_wider(width: float) -> None:
    """All long sides were halved at once, so that a waistband's faces kept their shape down to the smallest."""
    quad = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, width, 0.0], [0.0, width, 0.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    before = narrowness(quad[faces])
    points, parts = refined(quad, faces, quad[faces], FINEST)
    after = narrowness(points[parts.triangles])
    assert longest(points[parts.triangles]) < FINEST + 1e-9  # rounded
    assert after.min() > 0.99 * before.min()
    assert np.median(after) > min(0.49, 1.6 * before.min())


def narrowness(corners: np.ndarray) -> np.ndarray:
    """The least height of triangles over their longest side, shape [F]."""
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
    return np.linalg.norm(face_normals(corners), axis=1) / sides**2


def test_a_shape_of_the_files_own_vertices_is_judged(tmp_path: Path) -> None:
    path = tmp_path / "skirt.obj"
    path.write_text(obj_text(LOW.points, LOW.triangles))
    scene = {"garment": {"mesh": str(path)}, "avatar": {"shape": {"kind": "mannequin"}}}
    assert judge(scene, LOW.points, device="cpu").message

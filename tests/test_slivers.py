"""Needle-thin faces of a garment are joined with their neighbours, where that changes nothing else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cloths import tube
from meshfiles import obj_text
from scipy.spatial import Delaunay

from warp_cloth.base.mesh import Mesh
from warp_cloth.base.topology import build_topology
from warp_cloth.loading import load_mesh
from warp_cloth.loading.slivers import _turning, without_slivers

AROUND = 48
SKIRT = tube(0.15, 0.4, 0.8, AROUND, 24)


def load(path: Path, text: str) -> Mesh:
    path.write_text(text)
    return load_mesh(path, role="garment", key="garment", units="m")


def with_needles(share: float, corner: float = 0.94) -> tuple[np.ndarray, np.ndarray]:
    """A skirt, some of whose faces are divided near one of their corners."""
    points, faces = SKIRT.points, SKIRT.triangles.astype(np.int64)
    divided = np.random.default_rng(0).random(len(faces)) < share
    a, b, c = faces[divided].T
    new = len(points) + np.arange(len(a))
    within = np.einsum("c,fcx->fx", [corner, (1.0 - corner) / 2, (1.0 - corner) / 2], points[faces[divided]])
    thin = [np.stack(each, axis=1) for each in ((a, b, new), (b, c, new), (c, a, new))]
    return np.concatenate([points, within]), np.concatenate([faces[~divided], *thin])


def test_needles_go_and_what_they_divided_is_whole_again(tmp_path: Path) -> None:
    mesh = load(tmp_path / "skirt.obj", obj_text(*with_needles(0.1)))
    np.testing.assert_array_equal(mesh.points, SKIRT.points)
    assert {frozenset(face) for face in mesh.triangles.tolist()} == {frozenset(f) for f in SKIRT.triangles.tolist()}
    assert any("needle-thin faces joined" in note for note in mesh.notes)
    assert mesh.vertex_map is not None
    assert mesh.vertex_map.min() == 0


def test_texture_coordinates_are_those_of_the_vertices_that_stay(tmp_path: Path) -> None:
    points, faces = with_needles(0.1)
    flat = np.stack([points[:, 0] + points[:, 2], points[:, 1]], axis=1)  # one chart: each vertex has one place in it
    corners = [" ".join(f"{v}/{v}" for v in face) for face in (faces + 1).tolist()]
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()] + [f"vt {u!r} {v!r}" for u, v in flat.tolist()]
    mesh = load(tmp_path / "skirt.obj", "\n".join([*lines, *(f"f {face}" for face in corners), ""]))
    assert mesh.vertex_count == len(SKIRT.points)
    assert mesh.texcoords is not None
    np.testing.assert_allclose(mesh.texcoords, flat[: len(SKIRT.points)][mesh.triangles])


def test_no_face_turns_over_in_the_texture() -> None:
    """What is drawn out where it starts, as panels are, has edges that would go in space alone."""
    turned = 0
    for seed in range(60):
        random = np.random.default_rng(seed)
        x, y = np.meshgrid(*[np.linspace(0.0, 0.5, 30)] * 2, indexing="ij")
        flat = np.stack([x, y], axis=-1).reshape(-1, 2) + random.normal(0.0, 0.002, (900, 2))
        flat = np.concatenate([flat, flat[random.integers(0, 900, 60)] + random.normal(0.0, 6e-4, (60, 2))])
        faces = Delaunay(flat).simplices.astype(np.int64)
        faces = np.where((signed_areas(flat[faces]) < 0.0)[:, None], faces[:, ::-1], faces)
        faces = faces[signed_areas(flat[faces]) > 1e-12]
        points, texcoords = np.column_stack([flat, 0.05 * np.sin(8.0 * flat[:, 0])]), flat * [1.0, 1.3]
        found = without_slivers(points, faces, faces, texcoords)
        turned += 0 if found is None else int((signed_areas(texcoords[found.corners]) <= 0.0).sum())
    assert turned == 0


def signed_areas(corners: np.ndarray) -> np.ndarray:
    """Twice the areas of flat faces, negative where they turn the other way; corners [F, 3, 2]."""
    a, b, c = np.moveaxis(corners, 1, 0)
    return (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]


@pytest.mark.parametrize("corner", [0.5, 0.85])
def test_faces_that_are_small_but_no_needles_stay(tmp_path: Path, corner: float) -> None:
    points, faces = with_needles(0.1, corner)
    assert load(tmp_path / "skirt.obj", obj_text(points, faces)).triangle_count == len(faces)


def test_a_rim_stays_where_it_is(tmp_path: Path) -> None:
    """A vertex 0.5 mm from the next one along a hem, and so one within the cloth."""
    points = SKIRT.points.copy()
    points[1] = points[0] + 0.03 * (points[1] - points[0])
    mesh = load(tmp_path / "skirt.obj", obj_text(points, SKIRT.triangles))
    assert [len(loop) for loop in build_topology(mesh.triangles, mesh.vertex_count).boundary_loops] == [AROUND, AROUND]


@pytest.mark.parametrize("has_texture", [False, True])
def test_a_corner_on_the_longest_side_is_joined_with_the_face_across(tmp_path: Path, has_texture: bool) -> None:
    points, faces = SKIRT.points, SKIRT.triangles.astype(np.int64)
    flat = np.stack([0.15 * np.arctan2(points[:, 2], points[:, 0]), points[:, 1]], axis=1)
    (a, b, c), new = faces[500], len(points)
    points, flat = (np.concatenate([each, [[0.495, 0.495, 0.01] @ each[[b, c, a]]]]) for each in (points, flat))
    faces = np.concatenate([np.delete(faces, 500, axis=0), [[a, b, new], [b, c, new], [c, a, new]]])
    text = obj_text(points, faces)
    if has_texture:
        lines = [f"vt {u!r} {v!r}" for u, v in flat.tolist()]
        rows = [" ".join(f"{v}/{v}" for v in face) for face in (faces + 1).tolist()]
        kept = [line for line in text.splitlines() if not line.startswith("f ")]
        text = "\n".join([*kept, *lines, *(f"f {row}" for row in rows), ""])
    mesh = load(tmp_path / "skirt.obj", text)
    assert mesh.triangle_count == len(faces)
    a, b, c = np.moveaxis(mesh.points[mesh.triangles], 1, 0)
    longest = np.linalg.norm(np.stack([b - a, c - b, a - c]), axis=2).max(axis=0)
    height = np.linalg.norm(np.cross(b - a, c - a), axis=1) / longest
    assert (height / longest).min() > 0.2
    assert any("1 needle-thin face joined with the next" in note for note in mesh.notes)
    if has_texture:
        assert mesh.texcoords is not None
        np.testing.assert_allclose(mesh.texcoords, flat[mesh.triangles])


def test_turning_faces_are_those_found_one_by_one() -> None:
    points, faces = with_needles(0.1, corner=0.7)
    points = points + np.random.default_rng(1).normal(scale=0.004, size=points.shape)  # so that some turn
    edges = np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    ways = np.concatenate([edges, edges[:, ::-1]])
    by_vertex = np.argsort(faces.ravel(), kind="stable")
    start = np.searchsorted(faces.ravel()[by_vertex], np.arange(len(points) + 1))
    found = _turning([points[faces]], faces, by_vertex, start, ways)
    expected = []
    for goes, stays in ways.tolist():
        own = [face for face in faces[by_vertex[start[goes] : start[goes + 1]] // 3] if stays not in face]
        moved = [np.where(face == goes, stays, face) for face in own]
        pairs = zip(own, moved, strict=True)
        expected.append(any(normal_of(points[one]) @ normal_of(points[other]) <= 0.0 for one, other in pairs))
    assert 0.1 < np.mean(expected) < 0.9
    np.testing.assert_array_equal(found, expected)


def normal_of(corners: np.ndarray) -> np.ndarray:
    return np.cross(corners[1] - corners[0], corners[2] - corners[0])

"""Buttons and other loose parts that lie on the cloth: told from cloth, left out of the mesh, carried along with it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from meshfiles import box, obj_text

from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.base.trims import Trims
from warp_cloth.export.meshes import write_obj
from warp_cloth.loading import load_mesh
from warp_cloth.model.result import WornGarment
from warp_cloth.shapes.simple import square

Part = tuple[np.ndarray, np.ndarray]

ROUNDING = 1e-9  # [m], of turning a place there and back


def sheet(height: float = 0.0, side: float = 1.0) -> Part:
    """A level sheet of edges of 5 cm."""
    mesh = square(side=side, vertices_per_side=round(20 * side) + 1)
    return mesh.points - mesh.points.mean(axis=0) + np.array([0.0, height, 0.0]), mesh.triangles


def cube(middle: tuple[float, float, float], size: float = 0.008) -> Part:
    points, triangles = box(np.full(3, -0.5), np.full(3, 0.5))
    return size * points + middle, triangles


def open_box(middle: tuple[float, float, float], size: float) -> Part:
    points, triangles = cube(middle, size)
    return points, triangles[(points[triangles, 1].min(axis=1) < points[:, 1].max())]


def loaded(tmp_path: Path, *parts: Part) -> Mesh:
    starts = np.cumsum([0, *(len(points) for points, _ in parts)])
    points = np.concatenate([points for points, _ in parts])
    triangles = np.concatenate([faces + start for (_, faces), start in zip(parts, starts[:-1], strict=True)])
    path = tmp_path / "shirt.obj"
    path.write_text(obj_text(points, triangles))
    return load_mesh(path, role="garment", key="garment", units="m")


def trims_of(mesh: Mesh) -> Trims:
    trims = Trims.of(mesh)
    assert trims is not None
    return trims


def test_button_is_left_out_of_the_cloth_and_told(tmp_path: Path) -> None:
    button, cloth = cube((0.2, 0.005, 0.1)), sheet()
    mesh = loaded(tmp_path, button, cloth)
    np.testing.assert_allclose(mesh.points, cloth[0], atol=ROUNDING)
    assert mesh.triangle_count == len(cloth[1])
    np.testing.assert_allclose(trims_of(mesh).start, button[0], atol=1e-6)
    assert mesh.trim_map is not None
    assert mesh.vertex_map is not None
    np.testing.assert_array_equal(mesh.trim_map >= 0, mesh.vertex_map < 0)
    assert any("1 loose part" in note for note in mesh.notes)
    assert not any("isolated" in note or "separate" in note for note in mesh.notes)


@pytest.mark.parametrize(
    "other",
    [sheet(0.005), cube((0.0, 0.3, 0.0)), open_box((0.0, 0.01, 0.0), 0.06)],
    ids=["lining", "far from the cloth", "stands off it"],
)
def test_other_parts_are_cloth(tmp_path: Path, other: Part) -> None:
    mesh = loaded(tmp_path, sheet(), other)
    assert Trims.of(mesh) is None
    assert any("2 separate pieces" in note for note in mesh.notes)


@pytest.mark.parametrize("scrap", [cube((0.0, 0.1, 0.0)), cube((0.0, 0.01, 0.0), 0.03)], ids=["scrap", "toggle"])
def test_what_is_too_small_to_be_held_is_carried(tmp_path: Path, scrap: Part) -> None:
    cloth = sheet()
    mesh = loaded(tmp_path, cloth, scrap)
    np.testing.assert_allclose(mesh.points, cloth[0], atol=ROUNDING)
    np.testing.assert_allclose(trims_of(mesh).start, scrap[0], atol=1e-6)


def test_a_solid_is_carried_by_open_cloth_alone(tmp_path: Path) -> None:
    """A hanger, a bar of 36 cm through the shoulders, took part in the fit as cloth."""
    points, faces = cube((0.0, 0.0, 0.0), 0.02)
    bar = points * [18.0, 1.0, 1.0] + [0.0, 0.05, 0.0], faces
    assert Trims.of(loaded(tmp_path, sheet(), bar)) is not None
    points, faces = cube((0.0, 0.0, 0.0), 1.0)
    cushion = points * [1.0, 0.04, 1.0], faces
    assert Trims.of(loaded(tmp_path, cushion, bar)) is None  # may all be modelled with its thickness


def bulging(rise: float, rim: float = 0.0) -> Part:
    """A patch of 20 cm whose middle stands off the cloth by ``rise``, and half of whose rim by ``rim`` [m]."""
    points, faces = sheet(side=0.2)
    inner = np.abs(points[:, [0, 2]]).max(axis=1) < 0.09
    points[:, 1] = 0.004 + rise * inner + rim * (points[:, 0] > 0.01)
    return points, faces


@pytest.mark.parametrize(("patch", "carried"), [(bulging(0.03), True), (bulging(0.03, 0.02), False)])
def test_a_pocket_lies_on_the_cloth_by_its_rim(tmp_path: Path, patch: Part, carried: bool) -> None:
    assert (Trims.of(loaded(tmp_path, sheet(), patch)) is not None) == carried


def turned(points: Points) -> Points:
    """Turned and moved as a whole."""
    a, b = 0.7, 1.9
    about_x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    about_y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    moved: Points = points @ (about_x @ about_y).T + [0.3, -0.2, 0.5]
    return moved


def test_trims_turn_with_the_cloth(tmp_path: Path) -> None:
    mesh = loaded(tmp_path, sheet(), cube((0.2, 0.005, 0.1)), cube((-0.3, -0.005, 0.0)))
    trims = trims_of(mesh)
    np.testing.assert_allclose(trims.at(mesh.points), trims.start, atol=ROUNDING)
    np.testing.assert_allclose(trims.at(turned(mesh.points)), turned(trims.start), atol=ROUNDING)


def test_button_keeps_its_shape_where_cloth_bends_and_a_zip_bends_with_it(tmp_path: Path) -> None:
    points, faces = sheet(0.002, 0.2)
    tape = points * [0.05, 1.0, 3.0], faces  # 1 cm wide and 60 cm long
    mesh = loaded(tmp_path, sheet(), tape, cube((0.2, 0.005, 0.1)))
    trims = trims_of(mesh)
    round_a_tube = np.stack(
        [mesh.points[:, 0], 0.1 * np.cos(mesh.points[:, 2] / 0.1), 0.1 * np.sin(mesh.points[:, 2] / 0.1)], axis=1
    )
    worn = trims.at(round_a_tube)
    button = trims.start[:, 0] > 0.1
    before, after = (np.linalg.norm(p[button][:, None] - p[button][None], axis=2) for p in (trims.start, worn))
    np.testing.assert_allclose(after, before, atol=ROUNDING)
    from_axis = np.hypot(*worn[~button, 1:].T)
    assert np.abs(from_axis - 0.102).max() < 0.005  # over the flat faces of a tube of 10 cm


def test_written_file_holds_them_and_loads_as_it_was(tmp_path: Path) -> None:
    mesh = loaded(tmp_path, sheet(), cube((0.2, 0.005, 0.1)))
    path = tmp_path / "worn.obj"
    write_obj(path, garments=[WornGarment("shirt", mesh, turned(mesh.points), thickness=1e-3)])
    again = load_mesh(path, role="garment", key="start", units="m")
    np.testing.assert_array_equal(again.triangles, mesh.triangles)
    np.testing.assert_allclose(trims_of(again).start, turned(trims_of(mesh).start), atol=1e-6)

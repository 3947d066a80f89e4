"""Length units: stated, declared or guessed, and what cannot be."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from meshfiles import sheet, write_obj

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.loading import check_sizes, load_mesh


def load(tmp_path: Path, extent: float, role: str = "garment", units: str | None = None, low: float = 0.0) -> Mesh:
    """A rectangle as tall as the extent."""
    path = tmp_path / f"{role}.obj"
    path.write_text(
        "".join(f"v {x * extent} {y * extent + low} 0\n" for x, y in ((0, 0), (0.5, 0), (0.5, 1), (0, 1))) + "f 1 2 3 4"
    )
    return load_mesh(path, role=role, key=role, units=units)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("role", "extent", "unit", "metres"),
    [
        ("avatar", 1.72, "m", 1.72),
        ("avatar", 172.0, "cm", 1.72),
        ("avatar", 1720.0, "mm", 1.72),
        ("avatar", 0.6, "m", 0.6),
        ("garment", 0.723, "m", 0.723),
        ("garment", 72.3, "cm", 0.723),
        ("garment", 723.0, "mm", 0.723),
        ("garment", 1.0, "m", 1.0),
        ("garment", 4.556, "m", 4.556),  # with a train
        ("garment", 455.6, "mm", 0.4556),  # rather a child's shirt than a train in cm
        ("garment", 0.194, "m", 0.194),  # a glove
        ("garment", 19.4, "cm", 0.194),
        ("garment", 7.0, "in", 0.1778),  # no other unit gives a garment
    ],
)
def test_unit_is_guessed_from_the_size_and_said(
    tmp_path: Path, role: str, extent: float, unit: str, metres: float
) -> None:
    mesh = load(tmp_path, extent, role)
    assert mesh.unit == unit
    assert mesh.bounds()[1][1] == pytest.approx(metres)
    assert any("units not stated" in note and f"{extent:g}" in note for note in mesh.notes)


def test_size_that_may_be_in_inches_is_noted(tmp_path: Path) -> None:
    assert any("in inches" in note for note in load(tmp_path, 68.0, "avatar").notes)
    assert any("in inches" in note for note in load(tmp_path, 29.6, "garment").notes)
    assert not any("inches" in note for note in load(tmp_path, 75.0, "garment").notes)


@pytest.mark.parametrize(("units", "metres"), [("m", 0.7), ("cm", 0.7), ("mm", 0.7), ("in", 0.7)])
def test_stated_unit_is_taken_without_a_note(tmp_path: Path, units: str, metres: float) -> None:
    per = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}[units]
    mesh = load(tmp_path, metres / per, units=units)
    assert mesh.bounds()[1][1] == pytest.approx(metres)
    assert not any("units" in note for note in mesh.notes)


@pytest.mark.parametrize(
    ("extent", "units", "remedy"),
    [
        (72.3, "m", 'look like centimetres: set garment.units = "cm"'),
        (723.0, "m", 'look like millimetres: set garment.units = "mm"'),
        (0.723, "cm", 'look like metres: set garment.units = "m"'),
        (1e9, "m", "scale the mesh"),
        (28.0, "m", 'set garment.units = "cm"'),
    ],
)
def test_absurd_stated_size_names_the_likely_unit_and_the_key(
    tmp_path: Path, extent: float, units: str, remedy: str
) -> None:
    with pytest.raises(InputError) as caught:
        load(tmp_path, extent, units=units)
    assert remedy in caught.value.remedy
    assert "not a possible garment" in caught.value.problem
    assert caught.value.place.endswith("garment.obj")


@pytest.mark.parametrize("extent", [1e-9, 0.001, 0.07, 5e4, 1e30, 1e308])
def test_size_of_no_unit_is_refused_with_the_key(tmp_path: Path, extent: float) -> None:
    with pytest.raises(InputError) as caught:
        load(tmp_path, extent)
    assert "no unit gives" in caught.value.problem
    assert "garment.units" in caught.value.remedy


@pytest.mark.parametrize("factor", [0.0254, 0.001, 2e4])
@pytest.mark.parametrize("per_metre", [1.0, 100.0])
def test_panels_show_the_size_of_what_was_scaled_where_they_were_not(
    tmp_path: Path, factor: float, per_metre: float
) -> None:
    corners = [(0.0, 0.0), (0.4, 0.0), (0.4, 0.8), (0.0, 0.8)]
    lines = [f"v {x * factor} {y * factor} 0\nvt {x * per_metre} {y * per_metre}\n" for x, y in corners]
    path = tmp_path / "scaled.obj"
    path.write_text("".join(lines) + "f 1/1 2/2 3/3 4/4")
    mesh = load_mesh(path, role="garment", key="garment")
    assert mesh.bounds()[1][1] == pytest.approx(0.8)
    assert any("panels in texture space" in note for note in mesh.notes)


@pytest.mark.parametrize(
    ("per_unit", "unit"), [(0.0254, "in"), (2.54, "in"), (25.4, "in"), (0.01, "cm"), (1.0, "cm"), (1 / 32, "cm")]
)
def test_panels_in_a_metric_unit_show_that_the_mesh_is_in_inches(tmp_path: Path, per_unit: float, unit: str) -> None:
    """A shirt of 30 inches, or one for a child of 30 cm; the last is in an atlas from 0 to 1."""
    corners = [(0, 0), (16, 0), (16, 30), (0, 30)]
    path = tmp_path / "shirt.obj"
    lines = [f"v {x} {y} 0\nvt {x * per_unit} {y * per_unit}\n" for x, y in corners]
    path.write_text("".join(lines) + "f 1/1 2/2 3/3 4/4")
    mesh = load_mesh(path, role="garment", key="garment")
    assert mesh.unit == unit
    assert any("inches assumed, as the panels" in note for note in mesh.notes) == (unit == "in")


def test_doll_is_possible_when_stated(tmp_path: Path) -> None:
    body, dress = load(tmp_path, 12.0, "avatar", "cm"), load(tmp_path, 6.0, "garment", "cm")
    check_sizes([("garment", dress)], body)


def test_garment_and_avatar_that_agree_pass(tmp_path: Path) -> None:
    for scale in (1.0, 100.0, 1000.0):
        check_sizes([("garment", load(tmp_path, 0.7 * scale, low=0.8 * scale))], load(tmp_path, 1.7 * scale, "avatar"))
    check_sizes([("garment", load(tmp_path, 70.0, low=80.0))], load(tmp_path, 1.7, "avatar"))
    check_sizes([("garment", load(tmp_path, 70.0))], None)


def test_cloth_larger_than_the_ball_under_it_passes(tmp_path: Path) -> None:
    check_sizes([("garment", load(tmp_path, 1.0, low=0.7))], load(tmp_path, 0.6, "avatar"))


def test_guess_that_contradicts_the_avatar_is_refused(tmp_path: Path) -> None:
    """Inches: the avatar's numbers pass for a small one in cm, the garment's (also inches) are stated."""
    garment = load(tmp_path, 28.0, units="in", low=35.0)
    with pytest.raises(InputError) as caught:
        check_sizes([("garment[1]", garment)], load(tmp_path, 68.0, "avatar"))
    assert caught.value.place == 'garment[1] "garment"'
    assert "guessed" in caught.value.problem
    assert caught.value.remedy == 'likely inches: set avatar.units = "in"'


def test_wrongly_stated_unit_is_found_against_the_avatar(tmp_path: Path) -> None:
    garment = load(tmp_path, 72.3, units="mm", low=80)
    with pytest.raises(InputError, match=r'likely centimetres: set garment.units = "cm"'):
        check_sizes([("garment", garment)], load(tmp_path, 1.72, "avatar"))


def test_only_units_that_were_guessed_are_asked_for(tmp_path: Path) -> None:
    """A newborn in a grown-up's T-shirt, whose unit is none to be set, as it is drafted."""
    garment = load(tmp_path, 0.7, units="m", low=1.0)
    with pytest.raises(InputError) as caught:
        check_sizes([("garment", garment)], load(tmp_path, 0.65, "avatar"))
    assert caught.value.remedy.startswith('if these sizes are meant, set avatar.units = "m"; or place the garment')


def test_garment_far_away_is_refused(tmp_path: Path) -> None:
    garment = load(tmp_path, 0.7)
    far = replace(garment, points=garment.points + np.array([50.0, 0, 0]))
    with pytest.raises(InputError, match="away from the avatar"):
        check_sizes([("garment", far)], load(tmp_path, 1.7, "avatar", "m"))


def test_a_place_where_stored_numbers_are_too_coarse_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"lies 1e\+03 km from the origin, at \(0.175, 1e\+06, 0\) m; move garment"):
        load(tmp_path, 0.7, units="m", low=1e6)
    assert load(tmp_path, 0.7, units="m", low=900.0).bounds()[0][1] == 900.0


@pytest.mark.parametrize("lying", ["garment", "avatar"])
def test_what_lies_beside_the_other_may_have_z_up(tmp_path: Path, lying: str) -> None:
    meshes = {"garment": load(tmp_path, 60.0, low=80.0), "avatar": load(tmp_path, 1.7, "avatar")}
    check_sizes([("garment", meshes["garment"])], meshes["avatar"])
    points = meshes[lying].points[:, [0, 2, 1]] * np.array([1.0, -1.0, 1.0])
    meshes[lying] = replace(meshes[lying], points=points)
    with pytest.raises(InputError, match=f'if its file is z up, set {lying}.up = "z"'):
        check_sizes([("garment", meshes["garment"])], meshes["avatar"])


def test_a_body_in_inches_that_lies_down_is_told_both(tmp_path: Path) -> None:
    garment, body = load(tmp_path, 0.6, low=0.8), load(tmp_path, 66.0, "avatar")
    lying = replace(body, points=body.points[:, [0, 2, 1]] * np.array([1.0, -1.0, 1.0]))
    with pytest.raises(InputError, match=r'likely inches: set avatar\.units = "in", and z up: set avatar\.up = "z"'):
        check_sizes([("garment", garment)], lying)


@pytest.mark.parametrize("units", [None, "m"])
def test_a_vertex_far_from_all_others_is_named_instead_of_a_unit(tmp_path: Path, units: str | None) -> None:
    points, faces = sheet(count=12)
    points[-1] = 1e30, 0.0, 0.0
    write_obj(tmp_path / "shirt.obj", points, faces)
    with pytest.raises(InputError, match=r"1 vertex far from all others, the farthest at \(1e\+30, 0, 0\); remove"):
        load_mesh(tmp_path / "shirt.obj", role="garment", key="garment", units=units)  # type: ignore[arg-type]

"""A tape's length on shapes with closed forms; measures and pose of bodies whose measures are known."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from meshfiles import write_usd
from numpy.typing import NDArray
from typer.testing import CliRunner

from warp_cloth.anatomy.measures import DEFINITIONS, measures_of
from warp_cloth.anatomy.person import Person, understand
from warp_cloth.anatomy.skeleton import LEFT_ARM, RIGHT_ARM
from warp_cloth.anatomy.tape import tape_round
from warp_cloth.base.mesh import Mesh
from warp_cloth.cli.main import app
from warp_cloth.cli.terminal import NOT_WORN
from warp_cloth.loading import load_mesh
from warp_cloth.shapes import MannequinMeasures, mannequin, sphere

Floats = NDArray[np.float64]

GIRTH = 0.005  # [m] a tailor's tape is read to this
KNOWN = MannequinMeasures()


@pytest.fixture(scope="module")
def person() -> Person:
    """The shipped mannequin, arms 45 degrees from the vertical."""
    return understand(mannequin(KNOWN))


def values(person: Person) -> dict[str, float]:
    return {each.name: each.value for each in person.measures if each.value is not None}


def joined(*meshes: Mesh) -> Mesh:
    """Several meshes in one file."""
    starts = np.cumsum([0, *(mesh.vertex_count for mesh in meshes)])
    triangles = [mesh.triangles + start for mesh, start in zip(meshes, starts, strict=False)]
    return Mesh("scan", np.vstack([mesh.points for mesh in meshes]), np.vstack(triangles).astype(np.int32))


def floor(half: float) -> Mesh:
    """A square under the feet; ``half``: of its side [m]."""
    corners = half * np.array([[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]])
    return Mesh("floor", corners - [0.0, 0.01, 0.0], np.array([[0, 2, 1], [0, 3, 2]], dtype=np.int32))


def bent_aside(person: Person, degrees: float) -> Mesh:
    """A body whose waist is bent to its left, from 0.5 to 0.7 of its height; the arms go with the shoulders."""
    assert person.skeleton is not None
    (x, y, z), angle = person.body.points.T, np.radians(degrees)
    low, high = 0.5 * y.max(), 0.7 * y.max()
    share = np.where(np.isin(person.skeleton.limb, (RIGHT_ARM, LEFT_ARM)), 1.0, np.clip((y - low) / (high - low), 0, 1))
    radius, beyond = (high - low) / angle, y - low - share * (high - low)
    above, turn = np.where(share > 0.0, beyond, 0.0), share * angle
    across = radius - (radius - x) * np.cos(turn) + above * np.sin(turn)
    up = low + (radius - x) * np.sin(turn) + above * np.cos(turn) + (beyond - above)
    return Mesh("bent", np.stack([across, up, z], axis=1), person.body.triangles)


def test_a_neck_is_measured_on_who_bends_to_a_side() -> None:
    """Level sections cut the raised shoulder there."""
    upright = understand(mannequin(KNOWN, edge=0.015))
    bent = understand(bent_aside(upright, 40.0))
    assert values(bent)["neck"] == pytest.approx(values(upright)["neck"], abs=GIRTH)


def test_a_floor_or_another_person_is_left_out() -> None:
    """A floor has more area than the person on it."""
    person = understand(mannequin(KNOWN, edge=0.015))
    beside = Mesh("other", person.body.points + np.array([1.6, 0.0, 0.0]), person.body.triangles)
    for further in (floor(2.0), beside):
        found = understand(joined(further, person.body))
        assert values(found) == pytest.approx(values(person), abs=1e-9)
        assert len(found.notes) == 1
        assert found.notes[0].startswith("a further part")
    assert person.notes == ()


def test_a_flat_body_is_no_person(person: Person) -> None:
    found = understand(Mesh("drawing", person.body.points * [1.0, 1.0, 0.0], person.body.triangles))
    assert found.reason == "its trunk is flat"


def prism(outline: Floats, height: float) -> tuple[Floats, NDArray[np.int32]]:
    """An upright tube over a closed outline in (x, z): points [m] and triangles."""
    count = len(outline)
    rings = [np.stack([outline[:, 0], np.full(count, y), outline[:, 1]], axis=1) for y in (0.0, height)]
    here = np.arange(count)
    right = (here + 1) % count
    lower, upper = np.stack([here, right, right + count], axis=1), np.stack([here, right + count, here + count], axis=1)
    return np.concatenate(rings), np.concatenate([lower, upper]).astype(np.int32)


def test_tape_across_a_tilted_cylinder_is_an_ellipse() -> None:
    angle = 2.0 * np.pi * np.arange(2000) / 2000
    points, triangles = prism(0.1 * np.stack([np.cos(angle), np.sin(angle)], axis=1), 1.0)
    tape = tape_round(points, triangles, np.array([0.0, 0.5, 0.0]), np.array([0.0, 1.0, 1.0]))
    assert tape is not None
    half, longer = np.linspace(0.0, 2.0 * np.pi, 100_001)[:-1], np.sqrt(2.0)
    perimeter = 0.1 * np.hypot(np.sin(half), longer * np.cos(half)).mean() * 2.0 * np.pi
    assert tape.length == pytest.approx(perimeter, rel=1e-5)
    assert tape.line[0] == pytest.approx(tape.line[-1])


def test_tape_spans_hollows() -> None:
    notched = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.5, 0.1], [0.0, 1.0]]) - [0.5, 0.3]
    points, triangles = prism(notched, 1.0)
    tape = tape_round(points, triangles, np.array([0.0, 0.5, -0.25]), np.array([0.0, 1.0, 0.0]))
    assert tape is not None
    assert tape.length == pytest.approx(4.0)


def test_tape_goes_round_the_part_round_its_origin() -> None:
    square = np.array([[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]])
    one, triangles = prism(square, 1.0)
    points = np.concatenate([one, 3.0 * one + [1.0, -1.0, 0.0]])
    both = np.concatenate([triangles, triangles + len(one)])
    up = np.array([0.0, 1.0, 0.0])
    lengths = [tape_round(points, both, np.array([x, 0.5, 0.0]), up) for x in (0.05, 1.2)]
    assert [each.length for each in lengths if each is not None] == pytest.approx([0.8, 2.4])
    assert tape_round(points, both, np.array([0.0, 5.0, 0.0]), up) is None


def test_measures_of_the_mannequin_are_those_it_was_made_with(person: Person) -> None:
    found = values(person)
    assert tuple(found) == tuple(DEFINITIONS)
    assert found["stature"] == pytest.approx(KNOWN.stature, abs=0.01)
    for name in ("chest", "waist"):
        assert found[name] == pytest.approx(getattr(KNOWN, name), abs=GIRTH)
    assert found["hip"] == pytest.approx(KNOWN.hip, abs=0.02)  # the fullest of the seat is a little below its level


def test_measures_are_in_the_order_of_a_body(person: Person) -> None:
    found = values(person)
    assert found["waist"] <= found["under_bust"] <= found["chest"]
    assert found["ankle"] < found["calf"] < found["thigh"] < found["hip"]
    assert found["wrist"] < found["elbow"] <= found["upper_arm"]
    assert 0.4 < found["inside_leg_length"] / found["stature"] < 0.5


def test_measures_do_not_mind_how_the_body_lies(person: Person) -> None:
    """Lying, facing x, a quarter smaller: with its vertical along z, and mirrored."""
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    mirror = np.diag([-1.0, 1.0, 1.0])
    for change in (turn, mirror):
        moved = replace(person.body, points=0.75 * person.body.points @ change.T + [3.0, -2.0, 1.0])
        found = understand(moved)
        for name, value in values(person).items():
            assert values(found)[name] == pytest.approx(0.75 * value, abs=GIRTH)


def test_a_line_is_as_long_as_its_measure(person: Person) -> None:
    for each in person.measures:
        length = np.linalg.norm(np.diff(each.line, axis=0), axis=1).sum()
        assert each.value == pytest.approx(length, abs=1e-9)


def test_pose_is_told_in_words(person: Person) -> None:
    assert person.stance is not None
    assert person.stance.in_words() == "stands; arms 45 degrees below the horizontal"


def test_what_cannot_be_measured_says_why(shared_data: Path) -> None:
    body = load_mesh(shared_data / "anny/female_avg_T_pose.obj", role="avatar", key="avatar")
    raised = understand(body)
    assert raised.stance is not None
    assert raised.stance.in_words() == "stands; arms horizontal"
    assert all((each.value is None) == bool(each.reason) for each in raised.measures)
    assert understand(sphere(radius=0.4)).measures == ()


def test_real_bodies_have_the_measures_of_their_makers(shared_data: Path) -> None:
    """mean_all: GarmentCode states 99.8, 84.3, 103.5, 86.2 (bust, waist, hips, under the bust) and arms of 54.0 cm."""
    body = load_mesh(shared_data / "garmentcode/mean_all.obj", role="avatar", key="avatar")
    found = values(understand(body))
    stated = {"stature": 1.7199, "waist": 0.8433, "hip": 1.0348, "wrist": 0.1659, "shoulder_width": 0.3646}
    for name, value in stated.items():
        assert found[name] == pytest.approx(value, abs=GIRTH)
    for name, value in {"chest": 0.9984, "under_bust": 0.8625, "thigh": 0.6020, "arm_length": 0.5397}.items():
        assert found[name] == pytest.approx(value, abs=0.01)


def test_poses_of_one_body_have_one_measure(shared_data: Path) -> None:
    poses = [
        values(understand(load_mesh(shared_data / f"anny/female_avg_{pose}.obj", role="avatar", key="avatar")))
        for pose in ("A_pose", "T_pose", "arms_down")
    ]
    for name in ("neck", "waist", "hip", "calf", "ankle", "wrist", "upper_arm", "elbow", "knee", "thigh"):
        assert np.ptp([found[name] for found in poses]) < 0.005


def run(*arguments: str) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, ["avatar", *arguments, "--device", "cpu"])
    return result.exit_code, result.stdout, result.stderr


def test_command_prints_measures_and_writes_picture_and_json(tmp_path: Path, person: Person) -> None:
    code, said, _ = run("tshirt", "--measures", "--out", str(tmp_path))
    assert code == 0
    assert "stands; arms 45 degrees below the horizontal" in said
    assert "back length" in said
    assert (tmp_path / "tshirt_body.png").stat().st_size > 10_000
    told = json.loads((tmp_path / "tshirt_body.json").read_text())
    assert told["measures_m"]["waist"] == pytest.approx(values(person)["waist"], abs=1e-5)
    assert told["not_measured"] == {}


def test_command_takes_a_mesh_in_any_unit(tmp_path: Path, person: Person) -> None:
    rows = [*(f"v {x:.3f} {y:.3f} {z:.3f}" for x, y, z in 100.0 * person.body.points), ""]
    faces = "\n".join("f {} {} {}".format(*face) for face in person.body.triangles + 1)
    (tmp_path / "body.obj").write_text("\n".join(rows) + faces)
    code, said, _ = run(str(tmp_path / "body.obj"), "--measures", "--out", str(tmp_path))
    assert code == 0
    assert f"{100 * values(person)['hip']:.1f}" in said
    code, said, _ = run(str(tmp_path / "body.obj"), "--measures", "--out", str(tmp_path), "--set", "avatar.units=in")
    assert code == 2 or "no limbs" in said or "m tall" in said


def test_command_takes_a_stage_without_garments_for_a_body(tmp_path: Path, person: Person) -> None:
    write_usd(tmp_path / "body.usda", person.body.points, person.body.triangles)
    code, said, _ = run(str(tmp_path / "body.usda"), "--measures", "--out", str(tmp_path))
    assert code == 0
    assert f"{100 * values(person)['hip']:.1f}" in said
    garment = "--set", "garment.prim=/cloth", "--set", "avatar.prim=/body"
    code, _, said = run(str(tmp_path / "body.usda"), "--out", str(tmp_path), *garment)
    assert code == 2
    assert "there is no prim /body" in said


def test_command_names_the_formats_of_bodies(tmp_path: Path) -> None:
    (tmp_path / "body.off").write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    code, _, said = run(str(tmp_path / "body.off"))
    assert code == 2
    assert ".off is not a supported mesh format; use one of .obj" in " ".join(said.split())


def test_command_says_that_a_ball_has_no_limbs(tmp_path: Path) -> None:
    ball = sphere(radius=0.4)
    rows = [*(f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in ball.points), ""]
    faces = "\n".join("f {} {} {}".format(*face) for face in ball.triangles + 1)
    (tmp_path / "ball.obj").write_text("\n".join(rows) + faces)
    code, said, _ = run(str(tmp_path / "ball.obj"), "--measures", "--out", str(tmp_path))
    assert code == NOT_WORN  # what was asked for is not there
    assert "no limbs can be identified" in said
    assert (tmp_path / "ball_body.png").exists()


@pytest.mark.parametrize("content", ["", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "f 1 2 3\n"])
def test_command_refuses_a_broken_mesh_in_one_line(tmp_path: Path, content: str) -> None:
    (tmp_path / "body.obj").write_text(content)
    code, _, said = run(str(tmp_path / "body.obj"), "--out", str(tmp_path / "out"))
    assert code == 2
    assert len([line for line in said.splitlines() if line.startswith("error:")]) == 1
    assert not (tmp_path / "out").exists()


def test_measures_are_the_same_bits_again(person: Person) -> None:
    assert person.skeleton is not None
    again = measures_of(Mesh("again", person.body.points.copy(), person.body.triangles), person.skeleton)
    assert [each.value for each in again] == [each.value for each in person.measures]


def leaning_to_the_side(person: Person, degrees: float) -> Mesh:
    """A body bent at its waist, to its right; its arms move with its shoulders."""
    assert person.skeleton is not None
    body, hinge, soft = person.body, np.array([0.0, 1.0, 0.0]), 0.1
    share = np.clip((body.points[:, 1] - hinge[1]) / soft + 0.5, 0.0, 1.0)
    angle = np.radians(degrees) * np.where(np.isin(person.skeleton.limb, (RIGHT_ARM, LEFT_ARM)), 1.0, share)
    x, y, z = (body.points - hinge).T
    turned = np.stack([x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle), z], axis=1)
    return Mesh("leans", hinge + turned, body.triangles)


def test_shoulders_of_who_leans_to_the_side_are_not_on_the_head(person: Person) -> None:
    upright = values(person)
    for degrees in (-25.0, 25.0):
        found = values(understand(leaning_to_the_side(person, degrees)))
        for name in ("shoulder_width", "arm_length"):
            assert found[name] == pytest.approx(upright[name], abs=0.03)

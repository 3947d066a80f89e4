"""Dress forms on stands, busts, and hips with their legs are understood and measured by what is there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from meshfiles import write_obj

import warp_cloth
from warp_cloth.anatomy.person import Person, understand
from warp_cloth.anatomy.skeleton import HEAD, LEFT_ARM, LEFT_LEG, RIGHT_ARM, RIGHT_LEG, skeleton_of
from warp_cloth.avatar.solid import closing_of
from warp_cloth.base.mesh import Indices, Mesh, Points
from warp_cloth.contact.garments import placed
from warp_cloth.garment.outfit import MeshCache, load_outfit
from warp_cloth.model.fit_problem import ProblemCode
from warp_cloth.scene import Scene, load_scene
from warp_cloth.shapes import mannequin

NEAR = 0.015  # [m] by which a girth may differ, as edges are that long
STANDING_HIP = 0.025  # [m]: the stature, by which the hip is searched, is that of a plain head and trunk
HIPS, WAIST, NECK = 0.45, 0.62, 0.87  # of the stature: where bodies are cut
LOWER = 0.06  # [m] by which a form is lower than a garment's own body
ARMS, LEGS = (RIGHT_ARM, LEFT_ARM), (RIGHT_LEG, LEFT_LEG)


@pytest.fixture(scope="module")
def person() -> Person:
    return understand(mannequin(edge=0.015))


def cut(person: Person, low: float, high: float) -> tuple[Points, Indices]:
    """What is between two heights, in parts of the stature, without arms, its cuts level and closed."""
    skeleton, body = person.skeleton, person.body
    assert skeleton is not None
    floor, top = (float(height) for height in (body.points[:, 1].min(), body.points[:, 1].max()))
    is_arm = np.isin(skeleton.limb, ARMS) & (skeleton.station > 0.4)
    height = (body.points[:, 1] - floor) / (top - floor)
    kept = ((height > low) & (height < high) & ~is_arm)[body.triangles].all(axis=1)
    used, corners = np.unique(body.triangles[kept], return_inverse=True)
    form = Mesh("form", body.points[used], corners.reshape(-1, 3).astype(np.int32))
    closed = closing_of(form).surface(form)
    return closed.points, closed.triangles


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> tuple[Points, Indices]:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float64)
    sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    triangles = np.array([half for a, b, c, d in sides for half in ((a, b, c), (a, c, d))], dtype=np.int32)
    return np.array(low) + corners * (np.array(high) - np.array(low)), triangles


def joined(*parts: tuple[Points, Indices]) -> Mesh:
    starts = np.cumsum([0, *(len(points) for points, _ in parts)])
    triangles = [corners + start for (_, corners), start in zip(parts, starts, strict=False)]
    return Mesh("body", np.vstack([points for points, _ in parts]), np.vstack(triangles).astype(np.int32))


def values(person: Person) -> dict[str, float | None]:
    return {each.name: each.value for each in person.measures}


def on_stand(form: tuple[Points, Indices], gap: float) -> Mesh:
    """A form on a pole that ends so far below it [m]."""
    bottom, depth = float(form[0][:, 1].min()), float(form[0][:, 2].mean())
    pole = box((-0.015, 0.02, depth - 0.015), (0.015, bottom - gap, depth + 0.015))
    return joined(form, pole, box((-0.2, 0.0, depth - 0.2), (0.2, 0.03, depth + 0.2)))


@pytest.mark.parametrize("gap", [0.02, -0.05])
def test_a_dress_form_is_understood_without_its_stand(person: Person, gap: float) -> None:
    form = cut(person, HIPS, NECK)
    found = understand(on_stand(form, gap))
    assert found.skeleton is not None, found.reason
    assert found.skeleton.lacks == (HEAD, *ARMS, *LEGS)  # a foot of the stand is none of the body
    assert float(found.body.points[found.skeleton.own, 1].min()) >= float(form[0][:, 1].min())
    whole, own = values(person), values(found)
    for name in ("chest", "waist", "hip", "neck"):
        assert own[name] == pytest.approx(whole[name], abs=NEAR), name


def test_a_dress_form_on_a_stand_may_face_another_way(person: Person) -> None:
    """Its sections are those of who faces +z, turned."""
    body = on_stand(cut(person, HIPS, NECK), 0.02)
    found = skeleton_of(Mesh("turned", body.points[:, [2, 1, 0]] * [1.0, 1.0, -1.0], body.triangles))
    assert found is not None
    assert found.lacks == (HEAD, *ARMS, *LEGS)
    assert found.forward[0] > 0.9


def test_hips_with_legs_are_understood_and_have_no_waist_where_they_end(person: Person) -> None:
    found = understand(joined(cut(person, -1.0, WAIST)))
    assert found.skeleton is not None, found.reason
    assert found.skeleton.lacks == (HEAD, *ARMS)
    whole, own = values(person), values(found)
    assert own["hip"] == pytest.approx(whole["hip"], abs=STANDING_HIP)
    assert own["inside_leg_length"] == pytest.approx(whole["inside_leg_length"], abs=NEAR)
    assert own["waist"] is None
    assert own["chest"] is None


@pytest.fixture(scope="module")
def skirt_on_hips(person: Person, tmp_path_factory: pytest.TempPathFactory) -> Scene:
    path = tmp_path_factory.mktemp("hips") / "hips.obj"
    write_obj(path, *cut(person, -1.0, WAIST))
    return load_scene("skirt", on=path)


def test_a_skirt_starts_below_the_end_of_hips(skirt_on_hips: Scene) -> None:
    outfit = load_outfit(skirt_on_hips)
    wearing = outfit.wearing[0]
    assert wearing is not None
    assert wearing.over_end(wearing.start) > 0.0
    assert wearing.over_end(wearing.onto) == pytest.approx(0.0, abs=1e-9)  # where it is dressed
    (sewn,) = placed([skirt_on_hips], [outfit], "cpu", MeshCache())
    assert wearing.over_end(sewn.garments[0].points) == pytest.approx(0.0, abs=1e-9)
    assert any("above the avatar's end" in note for note in sewn.meshes[0].notes)


def test_a_shirt_starts_on_the_shoulders_of_a_form(person: Person, tmp_path: Path) -> None:
    """Falling onto them, its neckline would hook on the stump of the neck."""
    form = cut(person, HIPS, NECK)
    write_obj(tmp_path / "form.obj", form[0] - [0.0, LOWER, 0.0], form[1])
    scene = load_scene("tshirt", on=tmp_path / "form.obj")
    outfit = load_outfit(scene)
    wearing = outfit.wearing[0]
    assert wearing is not None
    assert wearing.over_shoulders(wearing.start) > 0.5 * LOWER
    assert wearing.over_shoulders(wearing.onto) == pytest.approx(0.0, abs=NEAR)  # where it is dressed
    (sewn,) = placed([scene], [outfit], "cpu", MeshCache())
    assert wearing.over_shoulders(sewn.garments[0].points) < NEAR


@pytest.mark.parametrize("name", ["tshirt", "shirt", "skirt", "trousers"])
def test_a_body_may_be_padded_under_shipped_garments(name: str) -> None:
    """A stated offset would forbid it, and a cut rim show through them."""
    assert "offset_mm" not in load_scene(name).collision.model_fields_set


def test_a_waist_that_stands_above_the_body_is_not_worn(skirt_on_hips: Scene) -> None:
    points = load_outfit(skirt_on_hips).garments[0].points
    found = warp_cloth.judge(skirt_on_hips, points, device="cpu")
    over = [each for each in found.problems if "over_mm" in each.figures]
    assert [each.code for each in over] == [ProblemCode.EMPTY_OPENING]
    lowered = warp_cloth.judge(skirt_on_hips, points - [0.0, 1e-3 * over[0].figures["over_mm"], 0.0], device="cpu")
    assert not any("over_mm" in each.figures for each in lowered.problems)


@pytest.mark.parametrize("top", [NECK, 2.0])
def test_a_bust_is_understood_and_has_no_waist_where_it_ends(person: Person, top: float) -> None:
    found = understand(joined(cut(person, WAIST, top)))
    assert found.skeleton is not None, found.reason
    assert found.skeleton.lacks == ((HEAD, *ARMS, *LEGS) if top == NECK else (*ARMS, *LEGS))
    whole, own = values(person), values(found)
    assert own["chest"] == pytest.approx(whole["chest"], abs=NEAR)
    assert own["waist"] is None
    assert own["hip"] is None


def test_a_table_and_a_lamp_on_a_pole_are_no_bodies() -> None:
    legs = [box((x - 0.04, 0.0, z - 0.04), (x + 0.04, 0.7, z + 0.04)) for x in (-0.4, 0.4) for z in (-0.25, 0.25)]
    assert skeleton_of(joined(box((-0.5, 0.7, -0.3), (0.5, 0.75, 0.3)), *legs)) is None
    pole, lamp = box((-0.02, 0.0, -0.02), (0.02, 1.2, 0.02)), box((-0.2, 1.2, -0.2), (0.2, 1.5, 0.2))
    assert skeleton_of(joined(pole, lamp, box((-0.15, 0.0, -0.15), (0.15, 0.02, 0.15)))) is None

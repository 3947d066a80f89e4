"""Problems of tubes of cloth around a post: openings, what slid off, what is too small."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from cloths import grid, tube
from judging import judge, loaded
from meshfiles import write_obj


def on_post(tmp_path: Path) -> dict[str, Any]:
    """A tube 0.1 m in radius and 0.3 m long, upright, around a post 1.6 m high."""
    sleeve = tube(0.1, 0.7, 1.0, around=36, rows=13)
    write_obj(tmp_path / "tube.obj", sleeve.points, sleeve.triangles)
    post = trimesh.creation.cylinder(0.08, 1.6, sections=48)
    post.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (1.0, 0.0, 0.0)))
    write_obj(tmp_path / "post.obj", post.vertices + np.array([0.0, 0.8, 0.0]), post.faces)
    return {
        "garment": {"mesh": str(tmp_path / "tube.obj"), "units": "m"},
        "avatar": {"mesh": str(tmp_path / "post.obj"), "units": "m"},
    }


def test_a_tube_around_a_post_has_no_problem(tmp_path: Path) -> None:
    assert judge(*loaded(on_post(tmp_path))) == {}


@pytest.mark.parametrize(("shift", "told"), [(0.14, True), (0.01, False)])
def test_a_tube_beside_its_post_has_empty_openings(tmp_path: Path, shift: float, told: bool) -> None:
    """It still reaches over the post's box, so that it has not fallen off."""
    scene, outfit = loaded(on_post(tmp_path))
    worn = outfit.garments[0].points + np.array([shift, 0.0, shift])
    problem = judge(scene, outfit, worn).get("empty_opening")
    assert (problem is not None) == told
    if problem is not None:
        assert problem.figures["openings"] == 2
        assert "no limbs of the body can be identified: fewer than five parts stick out" in problem.message
        assert problem.figures["girth_mm"] == pytest.approx(2e2 * np.pi, rel=0.01)
        assert len(problem.vertices) == 72


@pytest.mark.parametrize(
    ("top", "arm", "told"), [(1.05, 0.0, False), (1.6, 0.0, True), (1.05, 0.5, True)], ids=("form", "head", "arm")
)
def test_sleeves_hang_empty_on_a_dress_form(tmp_path: Path, top: float, arm: float, told: bool) -> None:
    """A trunk on a post up to ``top``, and a sleeve 0.25 m to one side of it; an arm stands as far out as ``arm``."""
    trunk, sleeve = tube(0.1, 0.7, 1.0, around=36, rows=13), tube(0.05, 0.8, 0.9, around=36)
    both = np.concatenate([trunk.points, sleeve.points + np.array([0.25, 0.0, 0.0])])
    write_obj(tmp_path / "shirt.obj", both, np.concatenate([trunk.triangles, sleeve.triangles + len(trunk.points)]))
    body = trimesh.creation.box((0.14, top, 0.14))
    body.apply_translation((0.0, 0.5 * top, 0.0))
    if arm:
        limb = trimesh.creation.box((0.05, 0.6, 0.05))
        limb.apply_translation((arm, 0.7, 0.0))
        body = trimesh.util.concatenate([body, limb])
    write_obj(tmp_path / "form.obj", body.vertices, body.faces)
    scene = {
        "garment": {"mesh": str(tmp_path / "shirt.obj"), "units": "m"},
        "avatar": {"mesh": str(tmp_path / "form.obj"), "units": "m"},
    }
    assert ("empty_opening" in judge(*loaded(scene))) == told


@pytest.mark.parametrize(("up", "told"), [(0.87, False), (1.15, True)])
def test_an_opening_just_beyond_the_end_of_a_limb_is_filled(tmp_path: Path, up: float, told: bool) -> None:
    """The post's end, at 1.6 m, lies in the tube within a radius of its upper opening, or below the tube."""
    scene, outfit = loaded(on_post(tmp_path))
    scaled = outfit.garments[0].points * [1.0, 0.2, 1.0] + np.array([0.0, up + 0.56, 0.0])  # 6 cm high
    assert ("empty_opening" in judge(scene, outfit, scaled)) == told


@pytest.mark.parametrize(("down", "told"), [(0.16, True), (0.13, False)])
def test_a_top_opening_that_came_down_far_has_slid_off(tmp_path: Path, down: float, told: bool) -> None:
    """The limit is 9 % of 1.6 m."""
    scene, outfit = loaded(on_post(tmp_path))
    problem = judge(scene, outfit, outfit.garments[0].points - np.array([0.0, down, 0.0])).get("slid_off")
    assert (problem is not None) == told
    if problem is not None:
        assert problem.figures["slid_mm"] == pytest.approx(1e3 * down)
        assert len(problem.vertices) == 36


def test_a_scrap_that_fell_inside_does_not_tell_that_the_garment_slid(tmp_path: Path) -> None:
    """It started higher than the tube, and its rim was the top opening."""
    values, scrap = on_post(tmp_path), grid(3, 0.07)
    post_tube = loaded(values)[1].garments[0]
    start = scrap.points + np.array([0.0, 1.05, 0.1])
    faces = np.concatenate([post_tube.triangles, scrap.triangles + len(post_tube.points)])
    write_obj(tmp_path / "tube.obj", np.concatenate([post_tube.points, start]), faces)
    scene, outfit = loaded(values)
    worn = outfit.garments[0].points.copy()
    worn[len(post_tube.points) :, 1] -= 0.3
    found = judge(scene, outfit, worn)
    assert "slid_off" not in found
    assert "1 of the 2 pieces" in found["detached_piece"].message


@pytest.mark.parametrize(("down", "told"), [(0.25, False), (0.4, True)])
def test_a_strapless_top_that_leaves_the_bust_has_slid_off(tmp_path: Path, down: float, told: bool) -> None:
    """It comes down by this part of the way from the shoulders to the waist, less than what is started higher may."""
    top = tube(0.19, 1.0, 1.28)
    write_obj(tmp_path / "top.obj", top.points, top.triangles)
    garment = {"mesh": str(tmp_path / "top.obj"), "units": "m"}
    scene, outfit = loaded({"garment": garment, "avatar": {"shape": {"kind": "mannequin"}}})
    (wearing,) = outfit.wearing
    assert wearing is not None
    assert wearing.hangs_from_bust
    way = wearing.skeleton.shoulders - wearing.skeleton.waist
    worn = outfit.garments[0].points - down * float(way @ wearing.skeleton.up) * wearing.skeleton.up
    assert ("slid_off" in judge(scene, outfit, worn)) == told


@pytest.mark.parametrize(("wider", "told"), [(1.35, True), (1.25, False)])
def test_a_tube_stretched_all_around_is_too_small(tmp_path: Path, wider: float, told: bool) -> None:
    scene, outfit = loaded(on_post(tmp_path))
    problem = judge(scene, outfit, outfit.garments[0].points * [wider, 1.0, wider]).get("too_small")
    assert (problem is not None) == told
    if problem is not None:
        assert problem.figures["strain_p50"] == pytest.approx(wider - 1.0, abs=0.1)
        assert "at the hip" in problem.message  # half the post's height


@pytest.mark.parametrize(("inwards", "told"), [(0.15, False), (0.5, True)], ids=("blunt", "sharp"))
def test_blunt_triangles_do_not_tell_that_cloth_is_stretched(tmp_path: Path, inwards: float, told: bool) -> None:
    """A vertex in each triangle is so far from its longest edge, and 40 % farther as worn; the tube is as it was."""
    scene, whole = on_post(tmp_path), tube(0.1, 0.7, 1.0, around=36, rows=13)
    points, triangles = whole.points, whole.triangles
    lengths = np.linalg.norm(points[np.roll(triangles, -1, axis=1)] - points[triangles], axis=2)
    a, b, c = np.take_along_axis(triangles, (lengths.argmax(axis=1)[:, None] + np.arange(3)) % 3, axis=1).T
    middle, inner = 0.5 * (points[a] + points[b]), len(points) + np.arange(len(a))
    cut = np.concatenate([np.stack([*ends, inner], axis=1) for ends in ((a, b), (b, c), (c, a))])
    at_rest, worn = (middle + share * (points[c] - middle) for share in (inwards, 1.4 * inwards))
    write_obj(tmp_path / "tube.obj", np.concatenate([points, at_rest]), cut)
    found = judge(*loaded(scene), 1.001 * np.concatenate([points, worn]))
    assert ("too_small" in found) == told

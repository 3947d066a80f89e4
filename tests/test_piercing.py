"""Cloth that is drawn through the avatar is told of, with what to change; cloth that lies on it is not."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from cloths import grid
from meshfiles import write_obj

import warp_cloth
from warp_cloth import ProblemCode
from warp_cloth.avatar.exact import signed_distances
from warp_cloth.avatar.padding import FADED, SPARE, WHOLE, padded
from warp_cloth.avatar.penetration import VISIBLE, Overlap, edge_places, face_places, may_show, pierced, shown
from warp_cloth.model.result import Penetration
from warp_cloth.report.body import finer_edge
from warp_cloth.shapes import sphere

BALL = sphere(radius=0.05, centre=(0.0, 0.0, 0.0), edge=0.01)


def measured(found: tuple[np.ndarray, np.ndarray]) -> tuple[int, float]:
    """How many elements, and the greatest depth [mm]."""
    elements, depths = found
    return len(elements), 1e3 * float(depths.max(initial=0.0))


def through(first: tuple[float, float, float], last: tuple[float, float, float], strain: float) -> tuple[int, float]:
    samples = edge_places(np.array([first, last]), np.array([[0, 1]], dtype=np.int32), np.array([strain]))
    return measured(pierced(samples, -signed_distances(samples.points, BALL, "cpu")))


def showing(points: np.ndarray, triangles: np.ndarray) -> tuple[int, float]:
    samples = face_places(points, triangles)
    return measured(shown(samples, -signed_distances(samples.points, BALL, "cpu")))


def test_an_edge_through_the_middle_is_as_deep_as_the_ball() -> None:
    count, deep = through((-0.053, 0.0, 0.0), (0.053, 0.0, 0.0), 3.0)
    assert count == 1
    assert deep == pytest.approx(50.0, abs=1.0)


def test_a_long_edge_round_the_skin_and_a_short_one_inside_are_not_drawn_through() -> None:
    half = 0.02  # its middle dips 1 mm under the skin
    assert through((-half, 0.049, 0.0), (half, 0.049, 0.0), 1.0) == (0, 0.0)
    assert through((-0.053, 0.0, 0.0), (0.053, 0.0, 0.0), 0.0) == (0, 0.0)
    assert through((-np.inf, 0.0, 0.0), (0.053, 0.0, 0.0), np.inf) == (0, 0.0)


@pytest.mark.parametrize(("off_side", "told"), [(0.002, True), (0.0, False)])
def test_a_fit_on_both_sides_of_the_body_says_so(tmp_path: Path, off_side: float, told: bool) -> None:
    """A sheet before a ball, or whose rows begin before and behind its middle in turn."""
    mesh = grid(9, 0.2)
    points = mesh.points - [0.1, 0.1, 0.0]
    points[:, 2] = 0.06 if not off_side else off_side * np.where(np.arange(81) // 9 % 2, 1.0, -1.0)
    write_obj(tmp_path / "sheet.obj", points, mesh.triangles)
    write_obj(tmp_path / "ball.obj", BALL.points, BALL.triangles)
    scene = {
        "garment": {"mesh": str(tmp_path / "sheet.obj"), "units": "m", "pin": {"loop": 0}},
        "avatar": {"mesh": str(tmp_path / "ball.obj"), "units": "m"},
        "solver": {"iterations": 300},
    }
    worn = warp_cloth.fit(scene, device="cpu")
    assert (worn.report["penetration_mm"]["edges"] > 0) == told
    assert (ProblemCode.THROUGH_BODY in [problem.code for problem in worn.problems]) == told


def test_a_flat_triangle_over_a_ball_lies_as_deep_as_its_middle() -> None:
    ring = 0.05 * np.array([[0.6, np.cos(turn) * 0.8, np.sin(turn) * 0.8] for turn in (0.0, 2.1, 4.2)])
    face = np.array([[0, 1, 2]], dtype=np.int32)
    count, deep = showing(1.02 * ring, face)
    assert count == 1
    assert deep == pytest.approx(1e3 * 0.05 * (1.0 - 1.02 * 0.6), abs=0.5)
    assert showing(2.0 * ring, face) == (0, 0.0)
    assert showing(0.2 * ring, face) == (0, 0.0)  # too small to be asked for


COARSE = {
    "garment": {"shape": {"kind": "square", "side": 0.3, "vertices_per_side": 8, "height": 0.7}},
    "avatar": {"shape": {"kind": "sphere", "radius": 0.06}},
}


def test_a_body_that_shows_through_coarse_cloth_is_padded_until_it_does_not() -> None:
    worn = warp_cloth.fit(COARSE, device="cpu")
    assert worn.worn, worn.message
    assert worn.report["penetration_mm"]["face_max"] < VISIBLE
    assert {"key": "collision.offset_mm", "value": "raised"}.items() <= worn.report["choices"][-1].items()
    last, before = worn.report["attempts"][-1], worn.report["attempts"][-2]
    assert (last["start"], last["chosen"], before["chosen"]) == ("earlier attempt", True, False)


def test_where_the_offset_is_stated_cloth_too_coarse_for_the_body_says_so() -> None:
    worn = warp_cloth.fit({**COARSE, "collision": {"offset_mm": 3}}, device="cpu")
    assert worn.report["penetration_mm"]["max"] == 0.0
    assert worn.report["penetration_mm"]["face_max"] > VISIBLE
    (problem,) = (problem for problem in worn.problems if problem.code is ProblemCode.SHOWN_THROUGH)
    assert "Divide these faces to edges of 15 mm" in problem.remedy
    assert not worn.worn


@pytest.mark.parametrize(("side", "told"), [(0.04, 15.0), (0.016, 8.0), (0.0, 1.0)])
def test_faces_that_the_body_shows_through_are_to_have_usual_edges_or_half_their_own(side: float, told: float) -> None:
    points = side * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.75**0.5, 0.0]])
    judged: Any = SimpleNamespace(points=points, garment=SimpleNamespace(triangles=np.array([[0, 1, 2]])))
    assert finer_edge(judged, np.zeros(1, dtype=np.int64)) == pytest.approx(told)


def test_padding_moves_the_skin_near_what_shows_and_no_other() -> None:
    middle = BALL.points[0] / np.linalg.norm(BALL.points[0])
    face = 0.046 * middle + 1e-3 * np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    none = np.zeros(0, dtype=np.int64)
    faces, depths = np.zeros(1, dtype=np.int64), np.array([4e-3], dtype=np.float32)
    overlap = Overlap(Penetration(0.0, 0.0, 0.0), none, none, none, faces, depths)
    moved = padded(BALL, face, np.array([[0, 1, 2]], dtype=np.int32), overlap)
    out = np.linalg.norm(moved - BALL.points, axis=1)
    away = np.linalg.norm(BALL.points - face.mean(axis=0), axis=1)
    assert out[away < WHOLE] == pytest.approx(4e-3 + SPARE)
    assert not out[away > FADED].any()
    assert ((moved - BALL.points) @ middle)[away < WHOLE].min() > 0.0


def test_where_all_edges_are_short_no_face_is_asked_for() -> None:
    for size, asked in ((0.0095, False), (0.03, True)):
        mesh = grid(5, 4.0 * size)
        longest = float(np.linalg.norm(np.ptp(mesh.points[mesh.triangles], axis=1), axis=1).max())
        assert may_show(longest) == asked
        assert (len(face_places(mesh.points, mesh.triangles).elements) > 0) == asked

"""What a fit ends with: rest or not, the same bits, pins, precisions, directions, avatars that are not met."""

from __future__ import annotations

import json
import math
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from meshfiles import ball, sheet, write_obj
from quick import SMALL, hanging, quick

from warp_cloth.avatar import contact as avatar_contact
from warp_cloth.fitting import problem
from warp_cloth.model.fit_problem import ProblemCode
from warp_cloth.model.result import Status
from warp_cloth.solver.step_options import StepOptions

# Both are within the tolerance of 1 mm from the true rest shape, on either side of it.
PRECISIONS_APART = 2e-3  # [m]
# Where both stop after the same iterations, what a turned scene differs by is float64 rounding, grown with the
# iterations from 1e-16 m: some ten-million-fold in 300 of a falling sheet. What counted one axis for more would show in
# millimetres.
TURN_APART = 1e-8  # [m]


def test_at_rest_and_out_of_iterations_are_told_with_a_sentence() -> None:
    rested = quick("hanging", *SMALL)
    assert rested.status is Status.AT_REST
    assert rested.message == rested.report["message"]
    assert rested.message.startswith("At rest after ")
    assert rested.report["residual"]["relative_rms"] <= 0.01
    assert rested.report["rest_error_mm"] <= 1.0
    stopped = quick("hanging", *SMALL, "solver.iterations=60")
    assert stopped.status is Status.ITERATION_LIMIT
    assert stopped.report["iterations"] == 60
    assert stopped.message.startswith("Not at rest after 60 iterations: ")
    assert "Raise solver.iterations (now 60)" in stopped.message
    assert (rested.worn, stopped.worn) == (True, False)
    assert [problem.code for problem in rested.problems] == []
    (problem,) = stopped.problems
    assert problem.code is ProblemCode.NOT_AT_REST
    assert problem.garment == "square"
    assert stopped.report["problems"] == [problem.as_json()]


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        ({"garment": {"name": "rag", "shape": {"kind": "square", "vertices_per_side": 5}}}, 'Nothing holds "rag"'),
        (
            {
                "garment": {"shape": {"kind": "square", "vertices_per_side": 5, "height": 0.25, "side": 0.2}},
                "avatar": {"shape": {"kind": "sphere", "edge_mm": 100}, "friction": 0},
                "solver": {"cap": 0.05},
            },
            '"square" has fallen past the avatar',
        ),
        (
            {
                "garment": {"shape": {"kind": "square", "vertices_per_side": 5, "side": 0.2}},
                "avatar": {"shape": {"kind": "sphere", "edge_mm": 100, "centre": [0.6, 0.8, 0.0]}},
            },
            '"square" is beside the avatar, which cannot hold it. Place it around or above the avatar',
        ),
    ],
)
def test_a_garment_that_falls_for_ever_is_told_of(scene: dict[str, Any], words: str) -> None:
    worn = quick(scene, "solver.iterations=100")
    assert worn.status is Status.ITERATION_LIMIT
    assert words in worn.message


def test_numbers_that_run_away_are_diverged_with_the_last_finite_shape(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(problem, "StepOptions", partial(StepOptions, momentum=math.nan))
    coarse = "garment.shape.vertices_per_side=5", "avatar.shape.edge_mm=100", "collision.cloth=false"
    worn = quick("sphere", *coarse, frames=3)
    assert worn.status is Status.DIVERGED
    assert "solver.cap" in worn.message
    assert np.isfinite(worn.garments[0].points).all()
    assert np.isfinite(worn.garments[0].frames).all()
    names = sorted(path.name for path in worn.save(tmp_path))
    assert names == ["preview.png", "report.html", "report.json", "sphere.usdc"]
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert report["status"] == "diverged"
    assert report["residual"]["rms"] is None
    assert math.isfinite(report["strain"]["max"])


@pytest.mark.parametrize("scene", ["hanging", "sphere"])
def test_the_papers_rule_runs_and_moves_no_vertex_further_than_its_cap(scene: str) -> None:
    size = "garment.shape.vertices_per_side=9"
    worn = quick(scene, size, "solver.method=direct", "solver.iterations=50", "solver.cap=2e-4")
    assert worn.status is Status.ITERATION_LIMIT
    assert "Leave solver.method out" in worn.message
    moved = np.linalg.norm(worn.garments[0].points - worn.garments[0].mesh.points, axis=1)
    assert 1e-3 < moved.max() <= 50 * 2e-4 * (1 + 1e-9)


def test_precisions_agree_on_the_rest_shape() -> None:
    shapes = {name: quick("hanging", *SMALL, f"solver.precision={name}") for name in ("float32", "mixed", "float64")}
    for name, worn in shapes.items():
        assert worn.status is Status.AT_REST
        assert worn.report["precision"] == name
        apart = worn.garments[0].points - shapes["float64"].garments[0].points
        assert np.abs(apart).max() < PRECISIONS_APART


@pytest.mark.parametrize("collision", ["depth", "mesh"])
def test_two_runs_give_the_same_bits(collision: str) -> None:
    scene = {
        "garment": {"shape": {"kind": "square", "vertices_per_side": 9, "height": 0.91}},
        "avatar": {"shape": {"kind": "sphere", "edge_mm": 60}},
        "collision": {"avatar": collision, "pixel_mm": 5},
        "solver": {"iterations": 300},
    }
    first, second = (quick(scene).garments[0].points for _ in range(2))
    assert np.array_equal(first, second)


def test_garments_of_one_scene_are_as_if_fitted_alone() -> None:
    one = {"name": "one", "shape": {"kind": "square", "vertices_per_side": 7, "plane": "vertical", "side": 0.6}}
    two = {"name": "two", "shape": {"kind": "square", "vertices_per_side": 9, "height": 1.3}, "fabric": "denim"}
    one["pin"] = {"vertices": [42]}
    two["pin"] = {"vertices": [0, 8]}
    solver = {"iterations": 400, "tolerance_mm": 1e-6}
    both = quick({"garment": [one, two], "collision": {"cloth": False}, "solver": solver})
    for worn, alone in zip(both.garments, (one, two), strict=True):
        assert worn.name == alone["name"]
        assert np.array_equal(
            worn.points, quick({"garment": alone, "collision": {"cloth": False}, "solver": solver}).garments[0].points
        )
    assert both.report["vertices"] == 7 * 7 + 9 * 9


def test_garments_on_the_exact_avatar_are_as_if_fitted_alone() -> None:
    low, high = ({"shape": {"kind": "square", "vertices_per_side": 9, "height": height}} for height in (0.91, 0.95))
    rest = {
        "avatar": {"shape": {"kind": "sphere", "edge_mm": 60}},
        "collision": {"avatar": "mesh", "cloth": False},
        "solver": {"iterations": 200},
    }
    both = quick({"garment": [low, high], **rest})
    for worn, alone in zip(both.garments, (low, high), strict=True):
        assert np.array_equal(worn.points, quick({"garment": alone, **rest}).garments[0].points)


def test_pinned_vertices_stay_where_they_start() -> None:
    worn = quick("hanging", *SMALL, "garment.pin=[{vertices=[0, 7]}, {loop=0}, {vertices=[40]}]").garments[0]
    edge = np.isclose(np.abs(worn.mesh.points[:, 0]), 0.5) | (np.abs(worn.mesh.points[:, 1] - 0.5) > 0.499)
    edge[40] = True
    assert np.array_equal(worn.points[edge], worn.mesh.points[edge])
    assert (np.abs(worn.points - worn.mesh.points).max(axis=1)[~edge] > 0.0).all()


@pytest.mark.parametrize("degrees", [90.0, 37.0])
def test_a_scene_turned_about_gravity_gives_the_turned_result(tmp_path: Path, degrees: float) -> None:
    angle = math.radians(degrees)
    turn = np.array([[math.cos(angle), 0, math.sin(angle)], [0, 1, 0], [-math.sin(angle), 0, math.cos(angle)]])
    points, faces = sheet(9)
    points = points + [0.0, 0.0, 0.02] * np.cos(7.0 * points[:, :1])  # so that folds know where to go
    shapes = []
    for name, start in (("as_is", points), ("turned", points @ turn.T)):
        write_obj(tmp_path / f"{name}.obj", start, faces)
        scene = hanging(tmp_path / f"{name}.obj", 72, 80, iterations=300, precision="float64", tolerance_mm=1e-6)
        shapes.append(quick(scene).garments[0].points)
    assert np.abs(shapes[0] - points).max() > 0.01
    assert np.abs(shapes[1] - shapes[0] @ turn.T).max() < TURN_APART


@pytest.mark.parametrize("scene", ["no avatar", "collision none"])
def test_a_scene_without_contact_builds_none(scene: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def never(*_: Any, **__: Any) -> None:
        raise AssertionError("built")

    for name in ("build_depth_buffers", "build_contact_field", "build_exact_collider"):
        monkeypatch.setattr(avatar_contact, name, never)
    values = hanging(tmp_path / "sheet.obj", 20, iterations=20)
    write_obj(tmp_path / "sheet.obj", *sheet())
    if scene == "collision none":
        write_obj(tmp_path / "ball.obj", *ball())
        values |= {"avatar": {"mesh": str(tmp_path / "ball.obj")}, "collision": {"avatar": "none"}}
    worn = quick(values)
    used = {term["name"]: term["used"] for term in worn.report["plan"]}
    assert used == {
        "tension": False,
        "weave": True,
        "bending": True,
        "rest angles": False,
        "bending friction": False,
        "shear friction": False,
        "pins": True,
        "momentum": True,
        "avatar contact": False,
        "avatar friction": False,
        "cloth contact": False,
    }
    # what is measured against an avatar is measured, whether or not the cloth meets it
    assert (worn.report["penetration_mm"] is None) == (scene == "no avatar")

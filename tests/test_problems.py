"""Every problem has a stable code: found where it is, not found next to it, and explained on one page."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from cloths import grid, tube
from judging import judge, loaded
from meshfiles import sheet, write_obj

import warp_cloth
from warp_cloth import ProblemCode
from warp_cloth.base.choice import Choice
from warp_cloth.fitting.fit import fit
from warp_cloth.fitting.judge import STILL, measured_shape
from warp_cloth.model.result import Residual, Status
from warp_cloth.report.notes import notes_of
from warp_cloth.report.problems import find_problems
from warp_cloth.scene import load_scene
from warp_cloth.shapes import sphere
from warp_cloth.solver.certificate.certifier import Check, Tolerance
from warp_cloth.solver.goal import Outcome

PAGE = Path(warp_cloth.__file__).parent / "report" / "README.md"
BALL = sphere(radius=0.05, centre=(0.0, 0.0, 0.0), edge=0.01)
SMALL_BALL = {"shape": {"kind": "sphere", "edge_mm": 100}}
CREASED = {"garment": {"shape": {"kind": "square", "vertices_per_side": 5}}}


def hanging(**collision: Any) -> dict[str, Any]:
    """A square of 81 vertices, 0.8 m a side, in the plane z = 0, that hangs from its top edge."""
    shape = {"kind": "square", "vertices_per_side": 9, "plane": "vertical", "side": 0.8}
    return {"garment": {"shape": shape, "pin": {"loop": "top"}}, "collision": collision}


def on_ball(tmp_path: Path, points: np.ndarray, count: int = 9) -> dict[str, Any]:
    """A sheet of count x count vertices that starts at these points, on a ball of 5 cm at the origin."""
    write_obj(tmp_path / "sheet.obj", points, grid(count, 0.2).triangles)
    write_obj(tmp_path / "ball.obj", BALL.points, BALL.triangles)
    return {
        "garment": {"mesh": str(tmp_path / "sheet.obj"), "units": "m", "pin": {"loop": 0}},
        "avatar": {"mesh": str(tmp_path / "ball.obj"), "units": "m"},
    }


def test_the_page_explains_exactly_the_codes_there_are() -> None:
    explained = re.findall(r"^\| `(\w+)` \| .* \| .* \| .* \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    codes = [code.value for code in ProblemCode]
    assert [name for name in explained if name not in ("code", "message", "remedy", "garment", "figures")] == codes
    assert [code.name.lower() for code in ProblemCode] == codes


def test_the_page_marks_the_notes() -> None:
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        for code in ProblemCode:
            if line.startswith(f"| `{code.value}` |"):
                assert ("*a note*" in line) == code.is_note


def test_a_sheet_that_hangs_without_an_avatar_has_no_problem() -> None:
    assert judge(*loaded(hanging())) == {}


def test_what_diverged_says_nothing_else() -> None:
    scene, outfit = loaded(CREASED)
    (code,) = judge(scene, outfit, 9.0 * outfit.garments[0].points, status=Status.DIVERGED)
    assert code == "diverged"


@pytest.mark.parametrize("lower", [False, True])
def test_what_still_moves_is_told_by_part_share_and_distance(lower: bool) -> None:
    scene, outfit = loaded(hanging())
    height = outfit.garments[0].points[:, 1]
    moved = np.where(height <= height.min() + 0.15, 2e-3, 1e-5) if lower else np.full(81, 2e-3)
    check = Check(100, Residual(0.0, 0.0, 0.0, 0.02, 0.01), 7e-3, True)
    problem = judge(scene, outfit, status=Status.ITERATION_LIMIT, check=check, moved=moved)["not_at_rest"]
    assert "relative residual 0.02 (limit 0.01), rest error 7 mm (limit 1 mm)" in problem.message
    assert ('the lower half of "square"' in problem.message) == lower
    assert problem.figures["moved_mm"] == pytest.approx(2.0)
    assert problem.figures["moving_fraction"] == pytest.approx(18 / 81 if lower else 1.0)
    assert len(problem.vertices) == (18 if lower else 81)
    assert "multilevel" not in problem.remedy


@pytest.mark.parametrize(("scale", "told"), [(1.2, False), (1.4, True), (0.6, True)])
def test_cloth_far_from_its_natural_size_has_the_wrong_scale(scale: float, told: bool) -> None:
    scene, outfit = loaded(hanging())
    assert ("wrong_scale" in judge(scene, outfit, scale * outfit.garments[0].points)) == told


def test_a_cloth_that_nothing_holds_is_unsupported_while_it_moves() -> None:
    scene, outfit = loaded({"garment": {"name": "rag", "shape": {"kind": "square", "vertices_per_side": 5}}})
    moving = judge(scene, outfit, status=Status.ITERATION_LIMIT, moved=np.ones(25))
    assert moving["unsupported"].message.startswith('Nothing holds "rag"')
    assert "unsupported" not in judge(*loaded(hanging()), status=Status.ITERATION_LIMIT, moved=np.ones(81))


@pytest.mark.parametrize(
    ("shift", "words"),
    [
        ((0.9, 0.0, 0.0), "beside the avatar"),
        ((0.0, -2.0, 0.0), "fallen past the avatar"),
        ((0.2, 0.0, 0.0), ""),
    ],
)
def test_a_garment_beside_or_below_its_body_fell_off(shift: tuple[float, float, float], words: str) -> None:
    square = {"kind": "square", "vertices_per_side": 5, "side": 0.4, "height": 0.95}
    scene, outfit = loaded({"garment": {"shape": square}, "avatar": {"shape": {"kind": "sphere", "edge_mm": 100}}})
    problem = judge(scene, outfit, outfit.garments[0].points + np.array(shift)).get("fell_off")
    assert (problem is not None) == bool(words)
    if problem is not None:
        assert words in problem.message
        assert max(problem.figures.values()) > 100.0


@pytest.mark.parametrize(
    ("bottom", "down", "top", "pins", "told"),
    [
        (0.02, 0.01, 0.0, {}, False),
        (0.02, 0.10, 0.0, {}, True),
        (-0.12, 0.02, 0.0, {}, False),
        (0.02, 0.10, 0.45, {}, False),
        (0.02, 0.10, 0.0, {"pin": {"vertices": [0]}}, False),
    ],
)
def test_a_garment_has_slid_off_when_it_is_at_the_feet(
    bottom: float, down: float, top: float, pins: dict[str, Any], told: bool
) -> None:
    """But not one that hangs below a bust from the start, whose top is still worn, or that is pinned."""
    square = {"kind": "square", "vertices_per_side": 5, "side": 0.2, "plane": "vertical"}
    values = {"garment": {"shape": square, **pins}, "avatar": SMALL_BALL}
    scene, outfit = loaded(values)
    began = outfit.garments[0].points
    floor = outfit.avatar.points[:, 1].min()
    began = began + np.array([0.0, floor + bottom - began[:, 1].min(), 0.0])
    scene, outfit = loaded(values, began)
    worn = began - np.array([0.0, down, 0.0])
    worn[np.argmax(worn[:, 1]), 1] += top
    assert ("slid_off" in judge(scene, outfit, worn)) == told


def test_a_button_that_falls_is_a_detached_piece(tmp_path: Path) -> None:
    points, faces = sheet()
    button = np.array([[0.0, 1.2, 0.32], [0.06, 1.2, 0.32], [0.0, 1.26, 0.32]])  # too large to be carried so far off
    write_obj(tmp_path / "coat.obj", np.concatenate([points, button]), np.concatenate([faces, [[25, 26, 27]]]))
    scene, outfit = loaded({"garment": {"mesh": str(tmp_path / "coat.obj"), "units": "m", "pin": {"vertices": [0]}}})
    worn = outfit.garments[0].points - np.array([0.0, 0.3, 0.0])  # all of it came down, the button not farther
    assert "detached_piece" not in judge(scene, outfit, worn)
    worn[25:] -= [0.0, 0.2, 0.0]
    problem = judge(scene, outfit, worn)["detached_piece"]
    assert problem.message.startswith('1 of the 2 pieces of "coat" fall off')
    assert problem.figures["fallen_mm"] == pytest.approx(200.0)
    assert problem.vertices == (25, 26, 27)


def test_a_largest_piece_that_falls_past_all_is_compared_with_those_that_stay(tmp_path: Path) -> None:
    """A skirt beside its band, which sits on a ball."""
    band, skirt = grid(9, 0.2).points - np.array([0.1, 0.1, 0.0]), grid(12, 0.3).points + np.array([0.35, -0.25, 0.0])
    faces = np.concatenate([grid(9, 0.2).triangles, grid(12, 0.3).triangles + len(band)])
    values = on_ball(tmp_path, band)
    write_obj(tmp_path / "sheet.obj", np.concatenate([band, skirt]), faces)
    values["garment"] = {"mesh": str(tmp_path / "sheet.obj"), "units": "m"}
    scene, outfit = loaded(values)
    worn = outfit.garments[0].points.copy()
    worn[len(band) :, 1] -= 0.5
    problem = judge(scene, outfit, worn, status=Status.ITERATION_LIMIT, moved=np.ones(len(worn)))["detached_piece"]
    assert problem.figures == {"pieces": 1, "fallen_mm": pytest.approx(500.0)}
    assert min(problem.vertices) == len(band)


@pytest.mark.parametrize(("shift", "told"), [(0.0, True), (0.07, False)])
def test_edges_drawn_through_a_ball_pass_through_the_body(tmp_path: Path, shift: float, told: bool) -> None:
    """Every other row of a sheet lies before the ball, the others behind it; or all of it before."""
    points = grid(9, 0.2).points - [0.1, 0.1, 0.0]
    scene, outfit = loaded(on_ball(tmp_path, points + np.array([0.0, 0.0, 0.06])))
    points[:, 2] = np.where(np.arange(81) // 9 % 2, 0.06, -0.06) if told else shift
    problem = judge(scene, outfit, points).get("through_body")
    assert (problem is not None) == told
    if problem is not None:
        assert 30.0 < problem.figures["depth_mm"] <= 50.0
        assert "avatar.poses" in problem.remedy
        assert set(problem.vertices) <= set(range(81))


@pytest.mark.parametrize(("depth", "told"), [(1.5e-3, True), (0.5e-3, False)])
def test_vertices_a_millimetre_under_the_skin_are_inside_the_body(tmp_path: Path, depth: float, told: bool) -> None:
    points = grid(9, 0.2).points - [0.1, 0.1, 0.0] + [0.0, 0.0, 0.06]
    scene, outfit = loaded(on_ball(tmp_path, points))
    points[40] = [0.0, 0.0, 0.05 - depth]
    problem = judge(scene, outfit, points).get("inside_body")
    assert (problem is not None) == told
    if problem is not None:
        assert problem.vertices == (40,)
        assert problem.figures["depth_mm"] == pytest.approx(1e3 * depth, abs=0.3)


@pytest.mark.parametrize(("height", "told"), [(0.051, True), (0.075, False)])
def test_a_ball_that_bulges_through_a_large_face_is_shown_through(tmp_path: Path, height: float, told: bool) -> None:
    """Three corners of the sheet's faces are outside the ball; the middles of some are not."""
    points = grid(5, 0.2).points - [0.1, 0.1, 0.0]
    from_middle = np.linalg.norm(points[:, :2], axis=1)
    points[:, 2] = np.sqrt(np.maximum(height**2 - from_middle**2, 0.0))
    problem = judge(*loaded(on_ball(tmp_path, points, count=5))).get("shown_through")
    assert (problem is not None) == told
    if problem is not None:
        assert problem.figures["depth_mm"] > 1.0
        assert "15 mm" in problem.remedy


@pytest.mark.parametrize(("open_by", "told"), [(0.07, True), (0.03, False)])
def test_an_edge_twice_as_long_as_it_is_cut_is_an_open_seam(open_by: float, told: bool) -> None:
    """The lower half of a square of faces 0.1 m high hangs away from the upper half."""
    scene, outfit = loaded(hanging())
    points = outfit.garments[0].points.copy()
    low = points[:, 1] < points[:, 1].max() - 0.45
    points[low, 1] -= open_by
    problem = judge(scene, outfit, points).get("seam_open")
    assert (problem is not None) == told
    if problem is not None:
        assert problem.figures["strain_max"] == pytest.approx(0.7, abs=0.01)
        assert problem.figures["longest_mm"] > 150.0
        assert len(problem.vertices) == 18


@pytest.mark.parametrize(("folded", "told"), [(1.0, True), (0.1, False)])
def test_a_cloth_folded_like_a_fan_is_bunched_up(folded: float, told: bool) -> None:
    """Every other row of a part of the square stands out by so much that its strips lie nearly on one another."""
    scene, outfit = loaded(hanging())
    points = outfit.garments[0].points.copy()
    rows = np.unique(points[:, 1].round(6))
    row = np.searchsorted(rows, points[:, 1].round(6))
    some = row < folded * len(rows)
    points[some, 1] = rows[0] + 0.002 * row[some]
    points[some, 2] += 0.1 * (row[some] % 2)
    problem = judge(scene, outfit, points).get("bunched_up")
    assert (problem is not None) == told
    if problem is not None:
        assert problem.figures["sharp_fraction"] > 0.1


def crossed(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Two sheets of count x count vertices, an even number, that cross like a plus seen from above."""
    points, faces = sheet(count=count)
    other = points[:, [2, 1, 0]] + np.array([-0.3, 0.0, 0.3])
    return np.concatenate([points, other]), np.concatenate([faces, faces + len(points)])


@pytest.mark.parametrize(("cloth", "count"), [(True, 8), (False, 8), (True, 60), (False, 60)])
def test_cloth_through_cloth_is_a_crossing(tmp_path: Path, cloth: bool, count: int) -> None:
    """Without contact of cloth, too."""
    write_obj(tmp_path / "cross.obj", *crossed(count))
    garment = {"mesh": str(tmp_path / "cross.obj"), "units": "m", "pin": {"loop": 0}}
    problem = judge(*loaded({"garment": garment, "collision": {"cloth": cloth}}))["crossing"]
    assert problem.figures["faces"] == len(problem.faces) > 0
    assert ("collision.cloth" in problem.remedy) == (not cloth)
    assert problem.figures["faces_in_file"] == problem.figures["faces"]


def test_contact_that_the_program_left_out_is_not_asked_of_the_user(tmp_path: Path) -> None:
    """Gloves that crossed were said to need collision.cloth left out, which their scene had."""
    write_obj(tmp_path / "cross.obj", *crossed(8))
    scene, outfit = loaded({"garment": {"mesh": str(tmp_path / "cross.obj"), "units": "m"}})
    assert scene.collision.cloth is False
    points = outfit.garments[0].points
    chosen = replace(measured_shape(outfit, points, "cpu"), choices=(Choice("collision.cloth", False, "none crosses"),))
    outcome = Outcome(Status.AT_REST, STILL, points, 0, 0.0)
    problems = find_problems(scene, outfit, outcome, chosen, Tolerance())
    assert [("collision.cloth" in each.remedy) for each in problems if each.code is ProblemCode.CROSSING] == [False]


@pytest.mark.parametrize("in_file", [False, True])
def test_what_crosses_in_the_file_already_is_told_as_its_modellers(tmp_path: Path, in_file: bool) -> None:
    """Gloves whose fingers were modelled through each other stayed so, and nothing said that the file has it."""
    points, faces = crossed(8)
    apart = points + np.repeat([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0]], len(points) // 2, axis=0)
    write_obj(tmp_path / "cross.obj", points if in_file else apart, faces)
    garment = {"mesh": str(tmp_path / "cross.obj"), "units": "m"}
    problem = judge(*loaded({"garment": garment, "collision": {"cloth": True}}), points)["crossing"]
    assert ("in its file already" in problem.message) == ("Mend the mesh" in problem.remedy) == in_file
    assert (problem.figures["faces_in_file"] > 0) == in_file


def contact(p99: float) -> dict[str, Any]:
    return {"error_mm": {"p50": 0.0, "p99": p99, "p999": 50.0, "max": 60.0}}


@pytest.mark.parametrize(
    ("kind", "error", "remedy"),
    [
        ("depth", 12.0, "Leave collision.avatar out"),
        ("auto", 12.0, '"mesh"'),
        ("mesh", 12.0, ""),
        ("depth", 1.0, ""),
    ],
)
def test_views_that_miss_the_body_are_a_note(kind: str, error: float, remedy: str) -> None:
    square = {"kind": "square", "vertices_per_side": 9, "side": 0.4, "height": 0.95}
    values = {"garment": {"shape": square}, "avatar": SMALL_BALL, "collision": {"avatar": kind}}
    problem = judge(*loaded(values), contact=contact(error)).get("views_insufficient")
    assert (problem is not None) == bool(remedy)
    if problem is not None:
        assert problem.code.is_note
        assert remedy in problem.remedy


def test_a_gap_that_no_view_shows_is_noted_until_all_layers_are_drawn(tmp_path: Path) -> None:
    boxes = [((0.6, 0.6, 0.1), (0, 1.2, 0.12)), ((0.6, 0.6, 0.1), (0, 1.2, -0.12)), ((0.6, 0.1, 0.4), (0, 1.6, 0))]
    parts = [trimesh.creation.box(size, trimesh.transformations.translation_matrix(at)) for size, at in boxes]
    trimesh.util.concatenate(parts).export(tmp_path / "niche.obj")  # open to the sides only
    write_obj(tmp_path / "sheet.obj", *sheet(height=1.0, toward=0.0))
    scene = {
        "garment": {"mesh": str(tmp_path / "sheet.obj"), "units": "m"},
        "avatar": {"mesh": str(tmp_path / "niche.obj"), "units": "m"},
        "solver": {"iterations": 20},
    }
    for kind, told in (("depth", True), ("auto", False)):
        worn = fit({**scene, "collision": {"avatar": kind, "pixel_mm": 5}}, device="cpu")
        codes = [problem.code.value for problem in worn.problems]
        assert ("views_insufficient" in codes) == told


@pytest.mark.parametrize(
    ("garment", "told"),
    [
        ({"shape": {"kind": "tshirt"}, "rest": "mesh"}, "panels as they are placed"),
        ({"shape": {"kind": "tshirt"}, "rest": "uv"}, ""),
        ({"shape": {"kind": "square"}, "rest": "mesh", "uv_units": "cm"}, "uv_units is not used"),
        ({"shape": {"kind": "square"}}, ""),
    ],
)
def test_panels_that_are_not_taken_though_something_speaks_for_them_are_noted(
    garment: dict[str, Any], told: str
) -> None:
    notes = notes_of({"settings": load_scene({"garment": garment}).settings()})
    assert len(notes) == bool(told)
    assert told in "".join(notes)


@pytest.fixture
def skirt(tmp_path: Path) -> tuple[Any, Any]:
    """A tube of 48 edges around, 0.5 m wide, on a mannequin, and its outfit."""
    tube_of_cloth = tube(0.25, 0.6, 1.0, around=48, rows=16)
    write_obj(tmp_path / "tube.obj", tube_of_cloth.points, tube_of_cloth.triangles)
    garment = {"mesh": str(tmp_path / "tube.obj"), "units": "m"}
    return loaded({"garment": garment, "avatar": {"shape": {"kind": "mannequin"}}})


def widened(outfit: Any, strain: float) -> Any:
    """The tube's points with its lower rim stretched so far, and less above."""
    points = outfit.garments[0].points.copy()
    low = np.clip(0.08 - (points[:, 1] - 0.6), 0.0, 0.08) / 0.08
    points[:, [0, 2]] *= (1.0 + strain * low)[:, None]
    return points


def test_an_opening_that_is_stretched_all_around_is_too_small_and_no_open_seam(skirt: tuple[Any, Any]) -> None:
    scene, outfit = skirt
    found = judge(scene, outfit, widened(outfit, 0.8))
    assert "seam_open" not in found
    problem = found["too_small"]
    assert "its opening for the right leg and left leg" in problem.message
    assert problem.figures["worn_girth_mm"] == pytest.approx(1.8 * problem.figures["girth_mm"])
    torn = outfit.garments[0].points.copy()
    torn[np.argmin(np.abs(torn[:, 1] - 0.8))] += [0.0, 0.05, 0.0]
    assert "seam_open" in judge(scene, outfit, torn)


def test_cloth_that_is_stretched_all_around_behind_its_opening_is_too_small_and_no_open_seam(
    skirt: tuple[Any, Any],
) -> None:
    scene, outfit = skirt
    points = outfit.garments[0].points.copy()
    near = np.clip(1.0 - np.abs(points[:, 1] - 0.75) / 0.06, 0.0, 1.0)
    points[:, [0, 2]] *= (1.0 + 0.8 * near)[:, None]
    found = judge(scene, outfit, points)
    assert "seam_open" not in found
    problem = found["too_small"]
    assert "its cloth 16 cm behind the opening for the right leg and left leg" in problem.message  # between two rows
    assert problem.figures["worn_girth_mm"] == pytest.approx(1.7 * problem.figures["girth_mm"], rel=0.03)
    points = outfit.garments[0].points.copy()
    points[np.argmin(np.abs(points[:, 1] - 0.75))] *= [1.3, 1.0, 1.3]  # one vertex: nothing is tight all round
    assert "seam_open" in judge(scene, outfit, points)


@pytest.mark.parametrize(("strain", "code"), [(0.12, "too_small"), (0.06, "seam_open")])
def test_a_tight_rim_of_which_one_edge_looks_torn_is_no_open_seam(
    skirt: tuple[Any, Any], strain: float, code: str
) -> None:
    scene, outfit = skirt
    points = widened(outfit, strain)
    rim = np.flatnonzero(np.abs(points[:, 1] - 0.6) < 1e-6)
    first, second = rim[np.argsort(np.arctan2(points[rim, 2], points[rim, 0]))][:2]
    points[first] += 0.45 * (points[first] - points[second])
    found = judge(scene, outfit, points)
    assert {"too_small", "seam_open"} & found.keys() == {code}

"""A scene to a worn garment, end to end: what is written, what stays as it was, what two runs have in common."""

from __future__ import annotations

import json
import math
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from meshfiles import ball, sheet, write_obj
from PIL import Image
from pxr import Usd, UsdGeom

import warp_cloth
from warp_cloth import set_up
from warp_cloth.collide import avatar as avatar_contact
from warp_cloth.errors import InputError
from warp_cloth.export import preview
from warp_cloth.fitting import Fit, Progress
from warp_cloth.result import Status
from warp_cloth.scene import load_scene
from warp_cloth.solver.relax import StepOptions

SMALL = ("garment.shape.vertices_per_side=9",)  # the shipped hanging square, 81 vertices: at rest in 0.02 s
# Both are within the tolerance of 1 mm from the true rest shape, on either side of it.
PRECISIONS_APART = 2e-3  # [m]
# Where both stop after the same iterations, what a turned scene differs by is float64 rounding, grown with the
# iterations from 1e-16 m.
TURN_APART = 1e-9  # [m]


def quick(source: Any, *overrides: str, **options: Any) -> Fit:
    return warp_cloth.fit(source, device="cpu", overrides=overrides, **options)


def hanging(mesh: Path, *pins: int, **solver: Any) -> dict[str, Any]:
    """A scene of one mesh that hangs by some of its vertices."""
    return {"garment": {"mesh": str(mesh), "units": "m", "pin": {"vertices": list(pins)}}, "solver": solver}


def opened(path: Path, scene: str, part: str) -> tuple[Usd.Stage, UsdGeom.Mesh]:
    """A written stage and one part's surface; the surface lives as long as the stage."""
    stage = Usd.Stage.Open(str(path))
    return stage, UsdGeom.Mesh(stage.GetPrimAtPath(f"/{scene}/{part}/{part}_mesh"))


@pytest.fixture
def no_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawing takes most of the time of a small fit; tests that are not about the picture leave it out."""

    def write_nothing(path: Path, **_: Any) -> None:
        path.touch()

    monkeypatch.setattr(preview, "write_preview", write_nothing)


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> tuple[Fit, Path]:
    """A T-shirt of few vertices, a few iterations on its way onto the mannequin, saved with three frames."""
    folder = tmp_path_factory.mktemp("fit") / "new folder" / "out"
    # the rest error is known from 900 iterations on
    few = ("garment.shape.edge_mm=40", "collision.pixel_mm=8", "solver.iterations=1000")
    worn = quick("tshirt", *few, frames=3)
    assert sorted(path.name for path in worn.save(folder)) == [
        "preview.png",
        "report.html",
        "report.json",
        "tshirt.usdc",
    ]
    return worn, folder


def test_three_files_are_written_and_nothing_else(saved: tuple[Fit, Path]) -> None:
    worn, folder = saved
    assert sorted(path.name for path in folder.iterdir()) == [
        "preview.png",
        "report.html",
        "report.json",
        "tshirt.usdc",
    ]
    with Image.open(folder / "preview.png") as picture:
        assert min(picture.size) > 400
        assert len(picture.convert("RGB").getcolors(2**24)) > 500  # shaded, not blank
    _stage, mesh = opened(folder / "tshirt.usdc", "tshirt", "tshirt")
    points = np.array(mesh.GetPointsAttr().Get())
    assert np.array_equal(points, worn.garments[0].points.astype(np.float32))


KINDS: dict[str, Any] = {
    "status": str,
    "message": str,
    "vertices": int,
    "faces": int,
    "edges": int,
    "hinges": int,
    "iterations": int,
    "seconds": dict.fromkeys(("load", "compile", "build", "relax", "export"), float),
    "iterations_per_second": float,
    "device": str,
    "precision": str,
    "residual": dict.fromkeys(("rms", "p99", "max", "relative_rms", "relative_p99"), float),
    "rest_error_mm": float,
    "strain": dict.fromkeys(("p50", "p99", "max", "min"), float),
    "penetration_mm": dict.fromkeys(("max", "p999", "fraction"), float),
    "crossings": dict.fromkeys(("pairs", "between_garments", "faces"), int),
    "settings": dict,
}


def assert_kinds(values: dict[str, Any], kinds: dict[str, Any]) -> None:
    for key, kind in kinds.items():
        if isinstance(kind, dict):
            assert_kinds(values[key], kind)
        else:
            allowed = (int, float) if kind is float else kind  # JSON writes 0.0 as it likes
            assert isinstance(values[key], allowed), (key, values[key])


def test_report_has_every_stable_key_with_its_type(saved: tuple[Fit, Path]) -> None:
    worn, folder = saved
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert_kinds(report, KINDS)
    mesh = worn.garments[0].mesh
    assert report["status"] in [status.value for status in Status]
    assert (report["vertices"], report["faces"]) == (mesh.vertex_count, mesh.triangle_count)
    assert report["vertices"] - report["edges"] + report["faces"] == -2  # a sphere with four openings
    assert report["seconds"]["relax"] > 0.0
    assert report["seconds"]["export"] > 0.0
    assert report["device"] == "cpu"


@pytest.mark.parametrize(
    ("source", "overrides"),
    [
        ("tshirt", ()),
        ("sphere", ("solver.cap=0.00123456789", "garment.fabric=denim", "avatar.friction=0.25")),
        ("hanging", ("garment.fabric.weight=0.123456789", "garment.uv_units=0.0254", "collision.offset_mm=1")),
    ],
)
@pytest.mark.usefixtures("no_picture")
def test_settings_give_the_same_scene_again(source: str, overrides: tuple[str, ...], tmp_path: Path) -> None:
    worn = quick(source, *overrides, "solver.iterations=0", *(SMALL if source == "hanging" else ()))
    worn.save(tmp_path)
    settings = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))["settings"]
    again = load_scene(settings)
    assert again.settings() == settings == worn.report["settings"]
    assert again.model_dump() == worn.scene.model_dump()


def test_frames_are_exactly_as_many_samples_from_the_start_to_the_worn_shape(saved: tuple[Fit, Path]) -> None:
    worn, folder = saved
    _stage, mesh = opened(folder / "tshirt.usdc", "tshirt", "tshirt")
    points = mesh.GetPointsAttr()
    assert points.GetTimeSamples() == [1.0, 2.0, 3.0]
    assert np.array_equal(np.array(points.Get(1.0)), worn.garments[0].mesh.points.astype(np.float32))
    assert np.array_equal(np.array(points.Get(3.0)), worn.garments[0].points.astype(np.float32))
    assert not np.array_equal(np.array(points.Get(2.0)), np.array(points.Get(3.0)))


@pytest.mark.parametrize("iterations", [0, 1, 30, 200])
@pytest.mark.parametrize("frames", [0, 1, 2, 7, 50])
def test_any_number_of_frames_is_met_whatever_the_iterations(frames: int, iterations: int) -> None:
    worn = quick("hanging", *SMALL, f"solver.iterations={iterations}", frames=frames).garments[0]
    if frames == 0:
        assert worn.frames is None
    else:
        assert worn.frames is not None
        assert worn.frames.shape == (frames, 81, 3)
        assert np.array_equal(worn.frames[-1], worn.points.astype(np.float32))


@pytest.mark.parametrize("frames", [-1, 10**6])
def test_a_number_of_frames_that_makes_no_sense_is_refused(frames: int) -> None:
    with pytest.raises(InputError, match=f"frames: {frames} shapes"):
        quick("hanging", frames=frames)


@pytest.mark.usefixtures("no_picture")
def test_vertices_faces_and_texture_coordinates_stay_in_the_files_order(tmp_path: Path) -> None:
    points, faces = sheet(6)
    shuffle = np.random.default_rng(3)
    order = shuffle.permutation(len(points))
    place = np.argsort(order)  # of each old vertex
    points, faces = points[order], shuffle.permutation(place[faces])
    texcoords = 0.9 * points[:, :2] + 0.1
    write_obj(tmp_path / "sheet.obj", points, faces, texcoords)
    top = int(points[:, 1].argmax())
    worn = quick(hanging(tmp_path / "sheet.obj", top, iterations=40), frames=2)
    assert len(worn.save(tmp_path / "out")) == 4  # and no map
    _stage, mesh = opened(tmp_path / "out" / "scene.usdc", "scene", "sheet")
    assert np.array_equal(np.array(mesh.GetPointsAttr().Get(1.0)), points.astype(np.float32))
    assert np.array_equal(np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3), faces)
    st = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").Get()).reshape(-1, 3, 2)
    assert np.array_equal(st, texcoords.astype(np.float32)[faces])


@pytest.mark.usefixtures("no_picture")
def test_a_map_leads_from_the_files_vertices_and_faces_to_the_results(tmp_path: Path) -> None:
    points, faces = sheet(4)
    apart = points[faces].reshape(-1, 3)  # every triangle has vertices of its own
    triangles = np.arange(len(apart)).reshape(-1, 3)
    with_double = np.concatenate([triangles[:5], triangles[:1], triangles[5:]])
    write_obj(tmp_path / "apart.obj", apart, with_double)
    worn = quick(hanging(tmp_path / "apart.obj", 0, iterations=20))
    files = worn.save(tmp_path / "out")
    assert [path.name for path in files[4:]] == ["scene_apart_map.npz"]
    mesh = worn.garments[0].mesh
    with np.load(files[4]) as maps:
        assert np.array_equal(mesh.points[maps["vertex_map"]], apart)
        assert np.array_equal(maps["vertex_map"][with_double[maps["triangle_source"]]], mesh.triangles)
    assert mesh.vertex_count == 16
    told = " ".join(worn.report["garments"][0]["notes"])
    assert "welded" in told
    assert "duplicate" in told


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
    assert stopped.message.endswith("raise solver.iterations.")


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        ({"garment": {"name": "rag", "shape": {"kind": "square", "vertices_per_side": 5}}}, 'nothing holds "rag"'),
        (
            {
                "garment": {"shape": {"kind": "square", "vertices_per_side": 5, "height": 0.25, "side": 0.2}},
                "avatar": {"shape": {"kind": "sphere", "edge_mm": 100}, "friction": 0},
                "solver": {"cap": 0.05},
            },
            '"square" has fallen past the avatar',
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
    monkeypatch.setattr(set_up, "StepOptions", partial(StepOptions, momentum=math.nan))
    worn = quick("sphere", "garment.shape.vertices_per_side=5", "avatar.shape.edge_mm=100", frames=3)
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
    assert worn.message.endswith('use solver.method = "accelerated".')
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
    both = quick({"garment": [one, two], "solver": solver})
    for worn, alone in zip(both.garments, (one, two), strict=True):
        assert worn.name == alone["name"]
        assert np.array_equal(worn.points, quick({"garment": alone, "solver": solver}).garments[0].points)
    assert both.report["vertices"] == 7 * 7 + 9 * 9


def test_garments_on_the_exact_avatar_are_as_if_fitted_alone() -> None:
    low, high = ({"shape": {"kind": "square", "vertices_per_side": 9, "height": height}} for height in (0.91, 0.95))
    rest = {
        "avatar": {"shape": {"kind": "sphere", "edge_mm": 60}},
        "collision": {"avatar": "mesh"},
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
        "pins": True,
        "momentum": True,
        "avatar contact": False,
        "avatar friction": False,
        "cloth contact": False,
    }
    # what is measured against an avatar is measured, whether or not the cloth meets it
    assert (worn.report["penetration_mm"] is None) == (scene == "no avatar")


@pytest.mark.usefixtures("no_picture")
def test_python_names_do_what_the_readme_says(tmp_path: Path) -> None:
    told: list[Progress] = []
    few = ["garment.shape.size=L", "garment.shape.edge_mm=60", "garment.fabric=cotton", "solver.iterations=100"]
    worn = warp_cloth.fit("tshirt", device="cpu", overrides=few, progress=told.append)
    assert isinstance(worn, warp_cloth.Fit)
    assert worn.status is warp_cloth.Status.ITERATION_LIMIT
    assert worn.scene.garments[0].fabric.name == "cotton"
    (garment,) = worn.garments
    assert garment.points.shape == (garment.mesh.vertex_count, 3)
    assert garment.points.dtype == np.float64
    assert set(worn.report["strain"]) == {"p50", "p99", "max", "min", "warp", "weft", "bias"}
    assert set(worn.report["strain"]["bias"]) == {"p50", "p99", "max", "min"}
    written = [path.name for path in worn.save(str(tmp_path / "out"))]
    assert written == ["tshirt.usdc", "preview.png", "report.json", "report.html"]
    assert [step.stage for step in told] == ["load", "compile", "build", "compile", "relax", "relax"]
    assert told[-1].iteration == 100
    scene = warp_cloth.load_scene({"garment": {"shape": {"kind": "square"}, "pin": {"loop": "top"}}})
    assert isinstance(scene, warp_cloth.Scene)


@pytest.mark.usefixtures("no_picture")
def test_saving_again_replaces_the_files(saved: tuple[Fit, Path], tmp_path: Path) -> None:
    (tmp_path / "hanging_square_map.npz").write_bytes(b"of an older run")
    (tmp_path / "report.json").write_text("older")
    quick("hanging", *SMALL, "solver.iterations=0").save(tmp_path)
    assert json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))["vertices"] == 81
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "hanging.usdc",
        "preview.png",
        "report.html",
        "report.json",
    ]

"""A scene to a worn garment, end to end: what is written, and what stays as it was."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import warp as wp
from meshfiles import sheet, write_obj
from PIL import Image
from pxr import Usd, UsdGeom
from quick import SMALL, hanging, quick

import warp_cloth
from warp_cloth.base.clock import STAGES
from warp_cloth.base.errors import InputError
from warp_cloth.export import save
from warp_cloth.fitting.fit import Fit, Progress
from warp_cloth.model.result import Status
from warp_cloth.scene import load_scene

WRITTEN = ["preview.png", "report.html", "report.json", "tshirt.usdc"]


def opened(path: Path, scene: str, part: str) -> tuple[Usd.Stage, UsdGeom.Mesh]:
    """A written stage and one part's surface; the surface lives as long as the stage."""
    stage = Usd.Stage.Open(str(path))
    return stage, UsdGeom.Mesh(stage.GetPrimAtPath(f"/{scene}/{part}/{part}_mesh"))


@pytest.fixture
def no_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawing takes most of the time of a small fit; tests that are not about the picture leave it out."""

    monkeypatch.setattr(save, "write_preview", lambda path, _: path.touch())


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> tuple[Fit, Path]:
    """A T-shirt of few vertices, a few iterations on its way onto the mannequin, saved with three frames."""
    folder = tmp_path_factory.mktemp("fit") / "new folder" / "out"
    # the rest error is known from 900 iterations on
    few = ("garment.shape.edge_mm=40", "collision.pixel_mm=8", "solver.iterations=1000")
    worn = quick("tshirt", *few, frames=3)
    assert sorted(path.name for path in worn.save(folder)) == WRITTEN
    return worn, folder


def test_three_files_are_written_and_nothing_else(saved: tuple[Fit, Path]) -> None:
    worn, folder = saved
    assert sorted(path.name for path in folder.iterdir()) == WRITTEN
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
    "seconds": dict.fromkeys(STAGES, float),
    "iterations_per_second": float,
    "device": str,
    "precision": str,
    "residual": dict.fromkeys(("rms", "p99", "max", "relative_rms", "relative_p99"), float),
    "rest_error_mm": float,
    "growing_mm": float,
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
        (
            "hanging",
            (
                "garment.fabric.weight=0.123456789",
                "garment.rest=mesh",
                "garment.uv_units=0.0254",
                "collision.offset_mm=1",
            ),
        ),
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
        assert worn.frames.shape == (frames, 81, 3)
        assert np.array_equal(worn.frames[-1], worn.points.astype(np.float32))


@pytest.mark.parametrize("frames", [-1, 10**6, 2.5, "2"])
def test_a_number_of_frames_that_makes_no_sense_is_refused(frames: Any) -> None:
    with pytest.raises(InputError, match=f"frames: must be an integer from 0 to 10000, not {frames}"):
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


@pytest.mark.usefixtures("no_picture")
def test_python_names_do_what_the_readme_says(tmp_path: Path) -> None:
    told: list[Progress] = []
    few = ["garment.shape.size=L", "garment.shape.edge_mm=60", "garment.fabric=cotton", "solver.iterations=100"]
    worn = warp_cloth.fit("tshirt", device="cpu", overrides=few, progress=told.append)
    assert worn.status is warp_cloth.Status.ITERATION_LIMIT
    assert worn.scene.garments[0].fabric.name == "cotton"
    (garment,) = worn.garments
    assert garment.points.shape == (garment.mesh.vertex_count, 3)
    assert garment.points.dtype == np.float64
    assert set(worn.report["strain"]) == {"p50", "p99", "max", "min", "warp", "weft", "bias"}
    assert set(worn.report["strain"]["bias"]) == {"p50", "p99", "max", "min"}
    written = [path.name for path in worn.save(str(tmp_path / "out"))]
    assert written == ["tshirt.usdc", "preview.png", "report.json", "report.html"]
    assert [step.stage for step in told] == ["load", "build", "compile", "relax", "relax", "measure"]
    assert told[-2].iteration == 100
    scene = warp_cloth.load_scene({"garment": {"shape": {"kind": "square"}, "pin": {"loop": "top"}}})
    assert isinstance(scene, warp_cloth.Scene)


@pytest.mark.usefixtures("no_picture")
def test_saving_again_replaces_the_files(saved: tuple[Fit, Path], tmp_path: Path) -> None:
    (tmp_path / "hanging_square_map.npz").write_bytes(b"of an older run")
    (tmp_path / "report.json").write_text("older")
    quick("hanging", *SMALL, "solver.iterations=0").save(tmp_path)
    assert json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))["vertices"] == 81
    assert {path.name for path in tmp_path.iterdir()} == {"hanging.usdc", *WRITTEN[:3]}


def test_an_older_report_does_not_stand_for_what_a_killed_run_leaves(
    saved: tuple[Fit, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    saved[0].save(tmp_path)

    def killed(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("warp_cloth.export.save.write_preview", killed)
    with pytest.raises(KeyboardInterrupt):
        saved[0].save(tmp_path)
    assert not (tmp_path / "report.json").exists()
    with pytest.raises(InputError, match="is not a supported format"):  # a refused one changes nothing
        saved[0].save(saved[1], formats=["fbx"])
    assert (saved[1] / "report.json").exists()


def test_what_python_asks_for_in_vain_is_refused(tmp_path: Path) -> None:
    scene = warp_cloth.load_scene(Path("hanging"), ["solver.iterations=2", "garment.shape.vertices_per_side=5"])
    with pytest.raises(InputError, match="overrides: the scene is loaded already"):
        warp_cloth.fit(scene, device="cpu", overrides=["solver.iterations=3"])
    with pytest.raises(InputError, match='there is no device "0" on this machine'):
        warp_cloth.fit(scene, device=0)  # type: ignore[arg-type]
    worn = warp_cloth.fit(scene, device=wp.get_device("cpu"))
    with pytest.raises(InputError, match='formats: "fbx" is not a supported format'):
        worn.save(tmp_path, formats=["fbx"])
    with pytest.raises(InputError, match='colour: there is no map "gold"'):
        worn.save(tmp_path, colour="gold")
    with pytest.raises(InputError, match='colour: "gap,strain" names several maps; choose one'):
        worn.save(tmp_path, colour="gap,strain")
    with pytest.raises(InputError, match='colour: the fit has no maps; fit with maps="gap"'):
        worn.save(tmp_path, colour="gap")
    assert worn.save(tmp_path, formats="glb")[0] == tmp_path / "hanging.glb"


def test_fits_of_several_threads_wait_for_one_another() -> None:
    alone = quick("hanging", *SMALL, "solver.iterations=60").garments[0].points
    with ThreadPoolExecutor(3) as pool:
        fits = list(pool.map(lambda _: quick("hanging", *SMALL, "solver.iterations=60"), range(3)))
    assert all(np.array_equal(each.garments[0].points, alone) for each in fits)


def test_seconds_of_a_command_add_up_to_its_wall_time(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "warp_cloth", "fit", "hanging", "--device", "cpu", "--out", str(tmp_path)]
    words += ["--set", "solver.iterations=20"]
    began = time.perf_counter()
    subprocess.run(words, capture_output=True, check=False)
    wall = time.perf_counter() - began
    seconds = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))["seconds"]
    assert list(seconds) == list(STAGES)
    assert all(spent >= 0.0 for spent in seconds.values())
    assert min(seconds[stage] for stage in ("import", "load", "build", "relax", "picture")) > 0.0
    assert 0.8 * wall < sum(seconds.values()) < wall + 0.02  # the start is known to 10 ms


def test_the_time_of_a_predrape_is_its_own() -> None:
    fitted = quick("tshirt", "garment.shape.edge_mm=60", "solver.start=dressed", "solver.iterations=20")
    assert fitted.report["seconds"]["dress"] > 0.0

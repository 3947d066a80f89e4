"""Size runs: one body for all sizes, more ease in larger ones, the recommendation's rule."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from meshfiles import ball, sheet, write_obj
from PIL import Image
from typer.testing import CliRunner

from warp_cloth.base.errors import InputError
from warp_cloth.batch.sizes import LevelFit, SizeFit, fit_sizes, recommendation
from warp_cloth.cli.main import app
from warp_cloth.export.size_picture import COLUMN
from warp_cloth.garment.outfit import avatar_recipe
from warp_cloth.scene import TshirtShape, load_scene
from warp_cloth.shapes import SIZE_BODIES, mannequin_measures

QUICK = ["garment.shape.edge_mm=55", "solver.iterations=600", "collision.pixel_mm=10"]


def sized(size: str, ease: float, strain: float = 0.02, *, status: str = "at_rest") -> SizeFit:
    level = LevelFit(1.2, 1.0, 1.0 + ease, 0.0)
    fit = object() if status != "invalid" else None
    return SizeFit(size, status, "", {"chest": level} if fit else {}, 0.01, strain, fit)  # type: ignore[arg-type]


def test_the_smallest_size_with_ease_enough_is_taken() -> None:
    taken, reason = recommendation([sized("S", 0.01), sized("M", 0.05), sized("L", 0.09)], 0.04)
    assert taken == "M"
    told = "it leaves 5.0 cm at the chest, where it is closest"
    assert reason == f"{told}; S is too tight: 1.0 cm of ease at the chest (wanted 4.0)."


def test_a_size_whose_cloth_is_strained_too_far_is_too_tight() -> None:
    assert recommendation([sized("S", 0.05, strain=0.3), sized("M", 0.08)], 0.04)[0] == "M"


def test_no_size_fits_is_said() -> None:
    taken, reason = recommendation([sized("S", -0.02), sized("M", 0.01)], 0.04)
    assert taken == "M"
    assert reason.startswith("it is the largest size, though too tight")
    assert recommendation([sized("S", 0.0, status="invalid")], 0.04)[0] is None


def test_a_size_that_slides_down_is_not_taken_and_one_still_moving_is_told_of() -> None:
    """A skirt that is too wide is loose enough everywhere, as it is nowhere."""
    lost = replace(sized("L", 0.2, status="iteration_limit"), held=False, levels={})
    moving = sized("M", 0.01, status="iteration_limit")
    taken, reason = recommendation([sized("S", -0.01), moving, lost], 0.04)
    assert taken == "M"
    assert reason.startswith("it is the largest size that stays up, though too tight: 1.0 cm")
    assert reason.endswith("did not come to rest, so its ease may still change.")
    _, reason = recommendation([replace(sized("M", 0.05), worn=False)], 0.04)
    assert reason.endswith("It is not worn as it should be: its report says why.")
    assert recommendation([lost], 0.04) == (
        None,
        "No size stays up on this body: each falls off, or slides down to the feet.",
    )


def test_a_size_of_the_garment_leaves_the_body_alone() -> None:
    scenes = [load_scene("tshirt", {"garment.shape.size": size}) for size in ("s", "M", "L")]
    assert scenes[0].garments[0].shape == TshirtShape(kind="tshirt", size="S")
    assert len({avatar_recipe(scene)[0].key for scene in scenes}) == 1
    small, large = (load_scene("tshirt", {"avatar.shape.size": size}).avatar for size in "SL")
    assert mannequin_measures(small.shape) == SIZE_BODIES["S"]
    assert mannequin_measures(large.shape) == SIZE_BODIES["L"]


def test_all_sizes_meet_the_same_body_and_larger_ones_leave_more() -> None:
    run = fit_sizes("tshirt", ["s", "m", "L"], overrides=QUICK, device="cpu")
    assert [each.size for each in run.sizes] == ["S", "M", "L"]
    avatars = [each.fit.avatar.points for each in run.sizes if each.fit and each.fit.avatar]
    assert len(avatars) == 3
    assert all(np.array_equal(points, avatars[0]) for points in avatars)
    waists = [each.levels["waist"] for each in run.sizes]
    assert len({level.body for level in waists}) == 1
    assert all(a.ease < b.ease for a, b in itertools.pairwise(waists))


def test_a_scene_may_say_itself_what_depends_on_the_size(tmp_path: Path) -> None:
    for size, half in (("S", 0.4), ("M", 0.5)):
        corners = [(x, 0.95, z) for x in (-half, half) for z in (-half, half)]
        lines = [f"v {x} {y} {z}" for x, y, z in corners]
        (tmp_path / f"cloth_{size}.obj").write_text("\n".join([*lines, "f 1 2 4 3"]))
    scene = tmp_path / "scene.toml"
    scene.write_text('garment = {mesh = "cloth_{size}.obj", units = "m"}\navatar.shape.kind = "sphere"\n')
    run = fit_sizes(scene, ["S", "M"], overrides=["solver.iterations=5", "collision.pixel_mm=10"], device="cpu")
    names = [each.fit.scene.garments[0].mesh for each in run.sizes if each.fit is not None]
    assert names == [tmp_path / "cloth_S.obj", tmp_path / "cloth_M.obj"]


def test_the_command_writes_a_page_a_picture_and_a_folder_for_each_size(tmp_path: Path) -> None:
    changes = [word for change in QUICK for word in ("--set", change)]
    few = ["--size", "s, M", "--maps", "gap", "--device", "cpu"]
    done = CliRunner().invoke(app, ["sizes", "tshirt", *changes, *few, "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    assert "take M: " in done.stdout
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"S", "M", "sizes.html", "sizes.png", "sizes.json"}
    assert 'href="M/report.html"' in (tmp_path / "out/sizes.html").read_text()
    made = json.loads((tmp_path / "out/M/report.json").read_text())["made"]
    assert set(made) == {"command", "date"}
    with Image.open(tmp_path / "out/sizes.png") as picture:
        assert picture.width == 2 * COLUMN[0]
    folders = [str(tmp_path / "out" / size) for size in "SM"]
    compared = CliRunner().invoke(app, ["compare", *folders, "--out", str(tmp_path / "larger")])
    assert compared.exit_code == 0, compared.output
    assert (tmp_path / "larger/gap_difference.png").is_file()


def test_meshes_of_several_sizes_need_no_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for size, side in (("S", 0.6), ("M", 0.7)):
        points, faces = sheet(count=5, side=side)
        write_obj(tmp_path / f"cloth_{size}.obj", points[:, [0, 2, 1]] + [0.0, 1.3, 0.0], faces)
    write_obj(tmp_path / "ball.obj", *ball())
    monkeypatch.chdir(tmp_path)
    few = ["solver.iterations=5", "collision.pixel_mm=10"]
    run = fit_sizes("cloth_{size}.obj", ["S", "M"], on="ball.obj", fabric="silk", overrides=few, device="cpu")
    assert run.name == "cloth"
    scenes = [each.fit.scene for each in run.sizes if each.fit is not None]
    assert [scene.garments[0].mesh for scene in scenes] == [Path("cloth_S.obj"), Path("cloth_M.obj")]
    assert {scene.garments[0].fabric.name for scene in scenes} == {"silk"}


@pytest.mark.parametrize(
    ("scene", "sizes", "overrides", "told"),
    [
        ("sphere", ["S"], [], "the garment comes in one size"),
        ("hanging", ["S"], [], "has no avatar"),
        ("tshirt", [], ["garment.mesh=shirt_{size}.obj"], "no sizes are named"),
        ("tshirt", ["S", "XXL"], [], "size"),
        ("tshirt", ["S", "men/S"], ["garment.mesh={size}.obj"], '"men/S" names a folder'),
        ("shirt_{size}.obj", [], [], "no sizes are named"),
    ],
)
def test_what_has_no_sizes_is_refused(scene: str, sizes: list[str], overrides: list[str], told: str) -> None:
    fitted: list[str] = []
    with pytest.raises(InputError, match=told):
        fit_sizes(scene, sizes, overrides=overrides, progress=fitted.append)
    assert not fitted


def test_a_size_that_is_none_and_a_body_that_is_none_are_refused_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='"Q" is no size of the T-shirt; use S, M, L'):
        fit_sizes("tshirt", ["q"])
    (tmp_path / "body.obj").write_text("v 0 0 0\nv 0 0 nan\nv 0 1 0\nf 1 2 3\n")
    result = CliRunner().invoke(
        app, ["sizes", "tshirt", "--on", str(tmp_path / "body.obj"), "--out", str(tmp_path / "o")]
    )
    assert result.exit_code == 2
    assert result.stderr.splitlines()[-1].startswith(f"error: {tmp_path / 'body.obj'}:2: vertex 2 is not finite")
    assert not (tmp_path / "o").exists()

"""Fabrics from drapes: outlines, the table, rendered photographs, refusals."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from drape_photos import View, photograph
from PIL import Image
from typer.testing import CliRunner

from warp_cloth.base.errors import InputError
from warp_cloth.bench.trials import drape_disc
from warp_cloth.cli.main import app
from warp_cloth.drape import refine
from warp_cloth.drape.outline import ANGLES, Outline, outline_of_drape, outline_of_points
from warp_cloth.drape.reading import Setting, read_drape
from warp_cloth.drape.refine import starts_of
from warp_cloth.drape.simulated import Trial, bending_lengths, hanging, random_start, simulate, with_bending_lengths
from warp_cloth.drape.table import KNOWN_CLASS, drapes_of_ratio, estimate
from warp_cloth.material.fabric import fabric_named, load_fabric, resolve_fabric
from warp_cloth.material.laboratory import KES_BENDING

SETTING = Setting()
READ_WITHIN = 1.0  # [points], of a drape coefficient in a photograph
TURN = 2.0 * np.pi * np.arange(ANGLES) / ANGLES


def wave(folds: int, mean: float = 1.35, depth: float = 0.12) -> Outline:
    return Outline(mean + depth * np.cos(folds * TURN))


def surface(outline: Outline) -> tuple[np.ndarray, np.ndarray]:
    """Points and triangles of cloth hanging from the support to an outline."""
    part = np.linspace(0.0, 1.0, 6)[:, None]
    radius = SETTING.support * (1.0 + part * (outline.radius - 1.0))
    drop = SETTING.support * part * np.sqrt(np.maximum((SETTING.ratio - 1.0) ** 2 - (outline.radius - 1.0) ** 2, 0.0))
    points = np.stack([radius * np.cos(TURN), -drop, -radius * np.sin(TURN)], axis=-1).reshape(-1, 3)
    here = np.arange(5 * ANGLES).reshape(5, ANGLES)
    side, down = np.roll(here, -1, axis=1), here + ANGLES
    across = np.roll(down, -1, axis=1)
    triangles = np.concatenate(
        [np.stack(each, axis=-1).reshape(-1, 3) for each in ((here, down, side), (side, down, across))]
    )
    return points, triangles


def photo(tmp_path: Path, view: View, outline: Outline | None = None) -> Path:
    pytest.importorskip("skimage")
    name = tmp_path / "drape.jpg"
    return photograph(*surface(outline or wave(7)), view, SETTING.support, SETTING.disc, name)


@pytest.mark.parametrize("folds", [3, 7, 12])
def test_an_outline_tells_its_area_its_folds_and_their_depth(folds: int) -> None:
    outline = wave(folds)
    assert outline.coefficient(5.0 / 3.0) == pytest.approx(100.0 * (1.35**2 + 0.5 * 0.12**2 - 1.0) / (25.0 / 9.0 - 1.0))
    assert outline.folds == folds
    assert outline.depths == pytest.approx([0.24] * folds, rel=1e-3)
    assert outline.elongation == pytest.approx(0.0, abs=1e-12)


def test_steep_flanks_do_not_widen_an_outline() -> None:
    turn = 2.0 * np.pi * np.arange(3000) / 3000
    radius = 1.35 + 0.15 * np.cos(12 * turn)
    found = outline_of_points(radius * np.cos(turn), radius * np.sin(turn))
    assert found.coefficient(5.0 / 3.0) == pytest.approx(wave(12, depth=0.15).coefficient(5.0 / 3.0), abs=0.01)


def test_an_even_circle_has_no_folds() -> None:
    assert wave(5, depth=0.0).folds == 0


def test_cloth_that_stands_out_along_its_warp_is_elongated() -> None:
    assert Outline(1.3 - 0.1 * np.cos(2.0 * TURN)).elongation > 0.1


def test_of_an_overhanging_fold_the_farthest_counts() -> None:
    angle = np.array([0.0, 0.5, 0.3, 0.8, *np.linspace(1.0, 6.0, 60)])
    radius = np.array([1.2, 1.5, 1.3, 1.2, *np.full(60, 1.2)])
    outline = outline_of_points(radius * np.cos(angle), radius * np.sin(angle))
    assert outline.radius[int(np.degrees(0.5))] == pytest.approx(1.5, abs=0.02)


@pytest.mark.parametrize(
    "view",
    [
        View(),
        View(side=256, quality=70),
        View(side=1000, tilt=10.0, toward=35.0, shadow=0.3, check=40, light=0.2),
        View(plate=(225, 225, 230), background=(230, 230, 235), shadow=0.2),  # a plate of the background's colour
        View(camera=1.0),
        # cloth of the check's own brown, in the shadow of a lamp from one side
        View(side=600, cloth=(170, 140, 90), background=(240, 225, 190), check=40, shadow=0.3, light=0.2),
        View(side=320, quality=82, cloth=(170, 140, 90), background=(240, 225, 190), check=40, shadow=0.3, light=0.2),
    ],
)
def test_a_photograph_gives_the_coefficient(tmp_path: Path, view: View) -> None:
    setting = replace(SETTING, camera=view.camera)
    reading = read_drape(photo(tmp_path, view), setting)
    assert reading.coefficient == pytest.approx(wave(7).coefficient(SETTING.ratio), abs=READ_WITHIN)
    assert reading.outline.folds == 7


def test_a_notch_may_reach_a_plate_of_the_backgrounds_colour(tmp_path: Path) -> None:
    """The cloth is seen as a ring that is open there."""
    notched = Outline(np.where(np.abs(TURN - 3.0) < 0.15, 1.005, wave(7).radius))
    view = View(side=400, plate=(225, 225, 230), background=(215, 222, 228), check=40, noise=0.5)
    reading = read_drape(photo(tmp_path, view, notched), SETTING)
    assert reading.coefficient == pytest.approx(notched.coefficient(SETTING.ratio), abs=1.5 * READ_WITHIN)


def test_the_warps_direction_turns_the_outline(tmp_path: Path) -> None:
    long = Outline(1.35 + 0.08 * np.cos(2.0 * TURN) + 0.05 * np.cos(7 * TURN))  # from left to right
    path = photo(tmp_path, View(), long)
    assert read_drape(path, replace(SETTING, warp_degrees=0.0)).outline.elongation == pytest.approx(0.117, abs=0.01)
    assert read_drape(path, SETTING).outline.elongation == pytest.approx(-0.117, abs=0.01)


BLACK = View(cloth=(0, 0, 0), plate=(0, 0, 0), background=(255, 255, 255), noise=0.0)
DEEP = Outline(1.355 + 0.215 * np.cos(8 * TURN) + 0.02 * np.cos(16 * TURN))  # as deep as measured drapes of 48 %


def test_a_silhouettes_scale_is_stated_or_guessed(tmp_path: Path) -> None:
    path = photo(tmp_path, BLACK, DEEP)
    scale = 2.0 * SETTING.disc / (BLACK.fills * BLACK.side)
    true = DEEP.coefficient(SETTING.ratio)
    reading = read_drape(path, replace(SETTING, metres_per_pixel=scale))
    assert reading.coefficient == pytest.approx(true, abs=READ_WITHIN)
    guessed = read_drape(path, SETTING)
    assert "guessed" in guessed.notes[0]
    assert guessed.error > 3.0
    assert guessed.coefficient == pytest.approx(true, abs=2.0 * guessed.error)


def test_a_silhouette_may_be_cropped_white_on_black_or_of_one_bit(tmp_path: Path) -> None:
    path = photo(tmp_path, BLACK, DEEP)
    scaled = replace(SETTING, metres_per_pixel=2.0 * SETTING.disc / (BLACK.fills * BLACK.side))
    whole = Image.open(path).convert("L").point(lambda value: 255 if value > 127 else 0)
    cropped = whole.crop(whole.point(lambda value: 255 - value).getbbox())
    pictures = {
        "white.png": cropped.point(lambda value: 255 - value),
        "bit.png": cropped.convert("1"),
        "zero_one.png": cropped.point(lambda value: value // 255),
    }
    for name, picture in pictures.items():
        picture.save(tmp_path / name)
        reading = read_drape(tmp_path / name, scaled)
        assert reading.coefficient == pytest.approx(DEEP.coefficient(SETTING.ratio), abs=READ_WITHIN), name


def _bad_pictures(tmp_path: Path) -> dict[str, str]:
    whole = Image.open(photo(tmp_path, View()))
    width, height = whole.size
    two = Image.new("RGB", (2 * width, height))
    two.paste(whole, (0, 0))
    two.paste(whole, (width, 0))
    two.save(tmp_path / "two.png")
    whole.crop((width // 3, 0, width, height)).save(tmp_path / "cut.png")
    Image.new("RGB", (400, 400), "grey").save(tmp_path / "empty.png")
    Image.new("1", (10_000, 10_000)).save(tmp_path / "huge.png")
    Image.new("RGB", (60, 60)).save(tmp_path / "small.png")
    (tmp_path / "short.jpg").write_bytes((tmp_path / "drape.jpg").read_bytes()[:9000])
    (tmp_path / "text.jpg").write_text("no picture")
    return {
        "two.png": "shows 2 things",
        "cut.png": "cut off",
        "empty.png": "no cloth stands out",
        "huge.png": "100 megapixels",
        "small.png": "60 x 60 pixels",
        "short.jpg": "truncated",
        "text.jpg": "cannot be read as a picture",
        "missing.jpg": "no such photograph",
    }


def test_a_picture_without_one_whole_drape_is_refused(tmp_path: Path) -> None:
    for name, problem in _bad_pictures(tmp_path).items():
        with pytest.raises(InputError, match=problem):
            read_drape(tmp_path / name, SETTING)


def test_an_outline_shorter_than_the_rim_is_refused(tmp_path: Path) -> None:
    """Cloth does not shrink: a circle close round the support is the plate's edge, or its shadow."""
    pixels = np.full((300, 300, 3), 230, dtype=np.uint8)
    y, x = np.mgrid[:300, :300]
    pixels[np.hypot(x - 150, y - 150) < 1.1 * 1e3 * SETTING.support] = 20
    Image.fromarray(pixels).save(tmp_path / "circle.png")
    with pytest.raises(InputError, match="cloth does not shrink"):
        read_drape(tmp_path / "circle.png", replace(SETTING, metres_per_pixel=1e-3))


def test_the_table_rises_with_the_bending_length() -> None:
    for ratio in (4.0 / 3.0, 1.5, 5.0 / 3.0, 2.0):
        assert (np.diff(drapes_of_ratio(ratio).coefficient) > 0.0).all()
    with pytest.raises(InputError, match="discs usually have 240, 300 or 360 mm"):
        drapes_of_ratio(3.0)


def test_more_drapes_tell_more_and_stiffer_cloth_drapes_less() -> None:
    drapes = drapes_of_ratio(5.0 / 3.0)

    def found(*coefficients: float) -> tuple[float, float]:
        count = len(coefficients)
        each = estimate(
            drapes, np.array(coefficients), np.full(count, 0.3), np.zeros(count), "", rest_error=KNOWN_CLASS
        )
        return each.length, each.length_error

    assert found(40.0)[0] < found(60.0)[0]
    assert found(59.5, 60.0, 60.5)[1] < found(60.0)[1]
    with pytest.raises(InputError, match="beyond the table"):
        found(1.5)


def test_a_drape_has_no_size() -> None:
    cloth = with_bending_lengths(replace(fabric_named("felt"), shear=None), 0.03, 0.03)
    small = with_bending_lengths(
        replace(cloth, stretch_warp=cloth.stretch_warp / 2, stretch_weft=cloth.stretch_weft / 2), 0.015, 0.015
    )
    (large,) = simulate([Trial(cloth, random_start(0))], 0.09, 5.0 / 3.0, rings=8)
    (half,) = simulate([Trial(small, random_start(0))], 0.045, 5.0 / 3.0, rings=8)
    assert half.outline.radius == pytest.approx(large.outline.radius, abs=1e-4)


def test_a_disc_starts_in_the_folds_of_an_outline() -> None:
    hangs = wave(6)
    mesh = drape_disc(30, SETTING.disc)
    points = hanging(mesh, SETTING.ratio, hangs)
    assert outline_of_drape(mesh, points, SETTING.support).radius == pytest.approx(hangs.radius, abs=0.01)
    edges = mesh.points[mesh.triangles] - np.roll(mesh.points[mesh.triangles], 1, axis=1)
    now = points[mesh.triangles] - np.roll(points[mesh.triangles], 1, axis=1)
    stretched = np.linalg.norm(now, axis=2) / np.linalg.norm(edges, axis=2)
    assert np.median(stretched) == pytest.approx(1.0, abs=0.1)  # the wave is not quite one that cloth could take


def test_of_many_drapes_low_ones_and_high_ones_are_simulated() -> None:
    outlines = [wave(7, mean) for mean in (1.5, 1.2, 1.3, 1.4, 1.25, 1.35, 1.45)]  # from 1.2 to 1.5
    assert list(starts_of(outlines, SETTING.ratio)) == [0, 1, 2, 3]
    assert list(starts_of(outlines[:2], SETTING.ratio)) == [0, 1]


def test_the_command_makes_a_fabric_that_loads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(refine, "simulate", partial(simulate, rings=8))
    out = tmp_path / "made.toml"
    options = ["--weight-gsm", "160", "--base", "wool", "--out", str(out)]
    result = CliRunner().invoke(
        app, ["fabric", "--from-drape", str(photo(tmp_path, View(), wave(6, 1.5, 0.06))), *options]
    )
    assert result.exit_code == 0, result.output
    fabric = load_fabric(out)
    assert fabric.weight == pytest.approx(0.16)
    assert "drape.jpg" in fabric.source
    assert 0.01 < min(bending_lengths(fabric)) < max(bending_lengths(fabric)) < 0.06
    assert Image.open(tmp_path / "made_drape.png").height == 800


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        (["--drape-coefficient", "47"], "--weight-gsm: is missing"),
        (["--drape-coefficient", "nan", "--weight-gsm", "59"], "--drape-coefficient: must be a number from 1 to 100"),
        (["--drape-coefficient", "47", "--weight-gsm", "1e300"], "--weight-gsm: must be a number"),
        (["--drape-coefficient", "47", "--weight-gsm", "59", "--disc-mm", "900"], "--disc-mm: must be"),
        (["--drape-coefficient", "47", "--weight-gsm", "59", "--out", "x.txt"], "--out: must be a fabric file"),
        ([], "fabric: needs one fabric"),
        (["compare", "wool"], "fabric compare: takes two fabrics"),
        (["wool", "silk"], "fabric: takes one fabric"),
    ],
)
def test_a_wrong_option_is_refused_in_one_line(options: list[str], problem: str) -> None:
    result = CliRunner().invoke(app, ["fabric", *options])
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1
    assert problem in result.stderr


def test_two_fabrics_stand_side_by_side() -> None:
    result = CliRunner().invoke(app, ["fabric", "compare", "wool", "silk"])
    assert result.exit_code == 0
    assert "B warp" in result.stdout
    assert "bending length weft" in result.stdout


def test_formability_states_the_stretch() -> None:
    # FAST: B 6.57 uN m and (E20 - E5) 0.5 % are a formability of 0.2235 mm2
    table = {"weight_gsm": 160, "bending_B_warp": 6.57e-6 / KES_BENDING, "formability_warp": 0.5 * 6.57 / 14.7}
    assert resolve_fabric(table).stretch_warp == pytest.approx(5 * 0.980665 / 0.005**2, rel=1e-6)
    with pytest.raises(InputError, match="formability_weft: needs the bending"):
        resolve_fabric({"formability_weft": 0.3})
    both = resolve_fabric({"weight_gsm": 160, "bending_length_mm": 16})
    assert bending_lengths(both) == pytest.approx((0.016, 0.016))

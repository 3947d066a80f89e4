"""Maps in files: primvars with units and ranges, colours, legends, and the difference between two fits."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from meshfiles import BOX_SIDES
from PIL import Image
from pxr import Usd, UsdGeom, UsdShade, UsdValidation
from worn import box_avatar, worn

from warp_cloth.base.errors import InputError
from warp_cloth.export.comparison import comparison_lines, save_comparison
from warp_cloth.export.map_picture import MapPictures, ticks
from warp_cloth.export.stage import write_stage
from warp_cloth.export.surface import linear
from warp_cloth.maps import MAPS
from warp_cloth.maps.colour import colours, shown_value
from warp_cloth.maps.compare import compare_fits
from warp_cloth.maps.read import WrittenFit, read_fit
from warp_cloth.model.result import WornGarment

RANGES = {"pressure": (0.0, 2.0), "strain_warp": (-0.1, 0.1)}


def mapped(name: str = "shirt") -> WornGarment:
    """A garment with a pressure that grows with height and a strain that grows to the side."""
    garment = worn(name)
    low = garment.points.min(axis=0)
    up, aside = ((garment.points - low) / np.maximum(np.ptp(garment.points, axis=0), 1e-9))[:, [1, 0]].T
    fields = {"pressure": (2.0 * up).astype(np.float32), "strain_warp": (0.2 * aside - 0.1).astype(np.float32)}
    return replace(garment, fields=fields)


def staged(path: Path, *garments: WornGarment, colour: str = "pressure") -> Usd.Stage:
    write_stage(path, garments=garments, avatar=box_avatar(), name="fit", ranges=RANGES, colour=colour)
    return Usd.Stage.Open(str(path))


def test_a_map_is_a_float_primvar_with_its_unit_and_ranges(tmp_path: Path) -> None:
    garment = mapped()
    stage = staged(tmp_path / "fit.usda", garment)
    primvar = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/fit/shirt/shirt_mesh")).GetPrimvar("pressure")
    assert np.array_equal(primvar.Get(), garment.fields["pressure"])
    about = primvar.GetAttr().GetCustomData()
    assert about == {"unit": "kPa", "minimum": 0.0, "maximum": 2.0, "range_low": 0.0, "range_high": 2.0}
    assert primvar.GetAttr().GetDocumentation() == MAPS["pressure"].about


def test_the_chosen_map_is_the_display_colour_and_the_material_reads_it(tmp_path: Path) -> None:
    garment = mapped()
    stage = staged(tmp_path / "fit.usda", garment)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/fit/shirt/shirt_mesh"))
    shown = np.array(mesh.GetDisplayColorAttr().Get())
    expected = linear(colours(MAPS["pressure"], garment.fields["pressure"], RANGES["pressure"]))
    assert np.allclose(shown, expected, atol=1e-7)
    assert mesh.GetDisplayColorPrimvar().GetInterpolation() == UsdGeom.Tokens.vertex
    reader = UsdShade.Shader(stage.GetPrimAtPath("/fit/materials/shirt/colour"))
    assert (reader.GetShaderId(), reader.GetInput("varname").Get()) == ("UsdPrimvarReader_float3", "displayColor")
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert [f.GetMessage() for f in UsdValidation.ValidationContext(validators).Validate(stage)] == []


def test_a_stage_reads_back_as_the_fit_that_wrote_it(tmp_path: Path) -> None:
    garment = mapped()
    staged(tmp_path / "fit.usdc", garment)
    (tmp_path / "report.json").write_text(json.dumps({"status": "at_rest"}))
    for place in (tmp_path, tmp_path / "fit.usdc"):
        fit = read_fit(place)
        assert np.array_equal(fit.garments[0].fields["pressure"], garment.fields["pressure"])
        assert np.array_equal(fit.garments[0].mesh.triangles, garment.mesh.triangles)
        assert fit.avatar is not None
        assert fit.report == {"status": "at_rest"}


def test_a_legend_names_round_values() -> None:
    assert ticks(MAPS["strain"], (0.0, 0.025)) == pytest.approx([0.025, 0.02, 0.015, 0.01, 0.005, 0.0])
    assert ticks(MAPS["gap"], (0.0, 40.0)) == pytest.approx([40.0, 30.0, 20.0, 10.0, 0.0])
    assert ticks(MAPS["strain_warp"], (-0.025, 0.025))[2] == 0.0


def test_colours_run_from_end_to_end_and_stay_there_beyond() -> None:
    kind = MAPS["pressure"]
    low, high = colours(kind, [0.0, 2.0], (0.0, 2.0))
    below, above = colours(kind, [-5.0, 7.0], (0.0, 2.0))
    assert np.array_equal(low, below)
    assert np.array_equal(high, above)
    light = colours(kind, np.linspace(0, 2, 64), (0.0, 2.0)) @ (0.2126, 0.7152, 0.0722)
    assert (np.diff(light) > 0.0).all()  # a perceptual table: more is lighter


def test_legend_values_have_their_unit() -> None:
    assert shown_value(MAPS["strain"], 0.025) == "2.5 %"
    assert shown_value(MAPS["pressure"], 0.03) == "0.03 kPa"
    assert shown_value(MAPS["shear"], -2.0) == "-2 °"


def test_picture_shows_the_map_and_its_legend(tmp_path: Path) -> None:
    kind, garment = MAPS["pressure"], mapped()
    path = tmp_path / "map.png"
    MapPictures([garment], None, size=(400, 240)).write(path, kind, (0.0, 2.0))
    image = np.asarray(Image.open(path)).astype(int)
    first, last = (np.round(255 * colours(kind, value, (0.0, 2.0))).astype(int) for value in (0.0, 2.0))
    assert (np.abs(image[:, 348:] - last).max(axis=-1) < 6).any()
    assert (np.abs(image[:, 348:] - first).max(axis=-1) < 6).any()
    front = image[:, :116]
    rows = [front[row][np.ptp(front[row], axis=-1) > 40] for row in (80, 170)]  # of colour, not of grey
    assert rows[0].mean(axis=0)[0] > rows[1].mean(axis=0)[0] + 20  # yellow over violet


def test_a_picture_is_the_same_whatever_was_drawn_before(tmp_path: Path) -> None:
    drawer = MapPictures([mapped()], box_avatar(), size=(400, 240))
    for name in ("first.png", "again.png"):
        drawer.write(tmp_path / name, MAPS["pressure"], (0.0, 2.0))
        drawer.write(tmp_path / "other.png", MAPS["strain_warp"], (-0.1, 0.1))
    first, again, other = ((tmp_path / name).read_bytes() for name in ("first.png", "again.png", "other.png"))
    assert first == again != other


def test_a_fit_less_itself_is_zero(tmp_path: Path) -> None:
    fit = WrittenFit("one", (mapped(),), box_avatar(), {})
    found = compare_fits(fit, fit)
    assert set(found.ranges) == {"pressure_difference", "strain_warp_difference"}
    assert all(not values.any() for values in found.garments[0].fields.values())


def test_another_mesh_is_compared_where_it_lies_nearest() -> None:
    one = mapped()
    mesh = replace(one.mesh, triangles=one.mesh.triangles[::-1].copy())
    lifted = {"pressure": one.fields["pressure"] + np.float32(0.25)}
    other = WrittenFit("two", (replace(one, mesh=mesh, fields=lifted),), None, {})
    found = compare_fits(WrittenFit("one", (one,), None, {}), other)
    assert np.allclose(found.garments[0].fields["pressure_difference"], 0.25, atol=1e-4)


def test_garments_are_compared_by_their_names_and_strangers_are_told_of() -> None:
    shirt, skirt = mapped("shirt"), mapped("skirt")
    raised = replace(skirt, fields={"pressure": skirt.fields["pressure"] + np.float32(1.0)})
    row = {"level": "waist", "body_girth": 1.0, "garment_girth": 1.0, "natural_girth": 1.0, "ease": 1.0}
    first = WrittenFit("a", (shirt, raised), None, {"girths_mm": [{**row, "garment": "shirt"}]})
    turned = compare_fits(first, WrittenFit("b", (raised, shirt), None, {}))
    assert not any(worn.fields["pressure_difference"].any() for worn in turned.garments)
    mesh = replace(shirt.mesh, triangles=shirt.mesh.triangles[::-1].copy(), panels=None, panel_names=())
    other = replace(shirt, name="shirt_L", mesh=mesh)
    found = compare_fits(
        WrittenFit("a", (shirt,), None, first.report),
        WrittenFit("b", (other,), None, {"girths_mm": [{**row, "garment": "shirt_L"}]}),
    )
    assert found.notes[0].startswith('"shirt" of a and "shirt_L" of b have neither mesh nor panels in common')
    (girth,) = found.girths  # of one garment under two names
    assert girth["first"] == girth["second"]
    panelled = [replace(worn, mesh=replace(worn.mesh, panel_names=("front",))) for worn in (shirt, other)]
    assert not compare_fits(*(WrittenFit("a", (worn,), None, {}) for worn in panelled)).notes


def test_unrelated_garments_are_refused_with_the_reason() -> None:
    shirt = mapped("shirt")
    mesh = replace(shirt.mesh, triangles=shirt.mesh.triangles[::-1].copy(), panels=None, panel_names=())
    below = replace(shirt, name="skirt", mesh=mesh, points=shirt.points - np.array([0.0, 0.5, 0.0]))
    with pytest.raises(InputError, match=r'^a, b: "shirt" and "skirt" are not one garment: they share neither'):
        compare_fits(WrittenFit("a", (shirt,), None, {}), WrittenFit("b", (below,), None, {}))


def test_a_comparison_names_both_fits_and_gives_both_figures_and_the_change() -> None:
    row = {"garment": "shirt", "level": "waist", "body_girth": 800.0, "garment_girth": 900.0, "natural_girth": 890.0}
    reports = [
        {"worn": worn, "strain": {"p99": 0.01}, "girths_mm": [{**row, "ease": ease}]}
        for worn, ease in ((True, 90.0), (False, 40.0))
    ]
    fits = tuple(
        WrittenFit("out", (mapped("shirt"),), None, report, Path(folder))
        for report, folder in zip(reports, ("x/out", "y/out"), strict=True)
    )
    lines = comparison_lines(compare_fits(*fits), fits)
    assert lines[:2] == ["A = x/out: worn", "B = y/out: not worn"]
    assert [" ".join(line.split()) for line in lines[2:4]] == [
        "shirt: ease at the waist A 9.00 cm B 4.00 cm change -5.00 cm",
        "strain of edges, 99th percentile A 1.00 % B 1.00 % change +0.00 %",
    ]
    assert any("pressure" in line for line in lines[4:])


def test_fits_without_maps_are_compared_by_their_figures(tmp_path: Path) -> None:
    row = {"garment": "bare", "level": "waist", "body_girth": 8e2, "garment_girth": 9e2, "natural_girth": 9e2}
    for name, ease in (("a", 90.0), ("b", 40.0)):
        (tmp_path / name).mkdir()
        write_stage(tmp_path / name / "s.usdc", garments=[replace(mapped(), fields={})], avatar=None, name="s")
        report = {"worn": True, "girths_mm": [{**row, "ease": ease}]}
        (tmp_path / name / "report.json").write_text(json.dumps(report))
    fits = read_fit(tmp_path / "a"), read_fit(tmp_path / "b")
    found = compare_fits(*fits)
    assert "no maps in a and b" in found.notes[0]
    assert comparison_lines(found, fits)[2].split()[-2:] == ["-5.00", "cm"]
    assert [path.name for path in save_comparison(found, fits, tmp_path)] == ["compare.json"]


def test_comparison_is_a_stage_pictures_and_figures(tmp_path: Path) -> None:
    row = {"garment": "shirt", "level": "waist", "body_girth": 800.0, "garment_girth": 900.0, "natural_girth": 890.0}
    reports = [{"status": "at_rest", "girths_mm": [{**row, "ease": ease}]} for ease in (90.0, 40.0)]
    fits = tuple(WrittenFit(name, (mapped(),), None, report) for name, report in zip("ab", reports, strict=True))
    paths = save_comparison(compare_fits(*fits), fits, tmp_path)
    assert [path.name for path in paths] == [
        "compare.usdc", "strain_warp_difference.png", "pressure_difference.png", "compare.json",
    ]  # fmt: skip
    told = json.loads(paths[-1].read_text())
    assert told["girths_mm"][0]["first"]["ease"] == 90.0
    assert told["girths_mm"][0]["second"]["ease"] == 40.0
    assert told["differences"]["pressure_difference"]["unit"] == "kPa"


def test_a_fit_in_several_formats_with_a_layer_over_the_users_stage_is_one_fit(tmp_path: Path) -> None:
    staged(tmp_path / "fit.usdc", mapped())
    (tmp_path / "fit.usdz").touch()
    (tmp_path / "fit_over.usda").touch()
    assert read_fit(tmp_path).garments
    (tmp_path / "other.usdc").touch()
    with pytest.raises(InputError, match="holds 2 stages"):
        read_fit(tmp_path)


def test_a_users_own_body_of_quads_is_read_where_it_stands(tmp_path: Path) -> None:
    write_stage(tmp_path / "fit.usda", garments=[mapped()], avatar=None, name="fit")
    stage = Usd.Stage.Open(str(tmp_path / "fit.usda"))
    place = UsdGeom.Xform.Define(stage, "/fit/theirs")
    place.AddTranslateOp().Set((5.0, 0.0, 0.0))
    place.AddScaleOp().Set((0.01, 0.01, 0.01))
    body = UsdGeom.Mesh.Define(stage, "/fit/theirs/body")
    body.CreatePointsAttr([(x, y, z) for x in (0, 170) for y in (0, 170) for z in (0, 50)])
    body.CreateFaceVertexCountsAttr([4] * 6)
    body.CreateFaceVertexIndicesAttr([corner for side in BOX_SIDES for corner in side])
    stage.Save()
    avatar = read_fit(tmp_path).avatar
    assert avatar.triangle_count == 12
    np.testing.assert_allclose(avatar.bounds(), [[5.0, 0.0, 0.0], [6.7, 1.7, 0.5]], atol=1e-6)


def test_fits_without_maps_in_common_are_refused(tmp_path: Path) -> None:
    bare = replace(mapped(), fields={"gap": np.zeros(49, dtype=np.float32)})
    with pytest.raises(InputError, match="no map that both fits have"):
        compare_fits(WrittenFit("a", (mapped(),), None, {}), WrittenFit("b", (bare,), None, {}))
    write_stage(tmp_path / "bare.usdc", garments=[replace(mapped(), fields={})], avatar=None, name="bare")
    with pytest.raises(InputError, match="has no fit maps"):
        read_fit(tmp_path / "bare.usdc")
    with pytest.raises(InputError, match="no such file or folder"):
        read_fit(tmp_path / "nothing.usdc")

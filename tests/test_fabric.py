"""Fabrics: laboratory figures to SI, and every way of stating one."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from refusals import refusal

from warp_cloth.base.errors import InputError
from warp_cloth.material.constants import yarn_stretches
from warp_cloth.material.fabric import (
    BOUNDS,
    Fabric,
    fabric_named,
    generic_fabric,
    load_fabric,
    resolve_fabric,
    shipped_fabrics,
    unlikely_values,
)
from warp_cloth.material.laboratory import (
    KES_BENDING,
    MATCHED_FOLD,
    MATCHED_SHEAR_ANGLE,
    bending_length,
    bending_of_rigidity,
    rigidity_of_bending,
)

ROUNDING = 1e-12  # relative; conversions are a few products in float64


def test_laboratory_figures_come_back_from_the_laws_that_they_set() -> None:
    fabric = resolve_fabric(
        {
            "weight_gsm": 120,
            "emt_warp_percent": 5,
            "emt_weft_percent": 8,
            "shear_G": 0.9,
            "bending_B_warp": 0.06,
            "bending_B_weft": 0.04,
            "thickness_mm": 0.4,
        }
    )
    kes_force = pytest.approx(0.5 * 9.80665 / 0.01, rel=ROUNDING)  # 500 gf/cm in N/m
    assert fabric.stretch_warp * 0.05**2 == kes_force
    assert fabric.stretch_weft * 0.08**2 == kes_force
    for bending, b in ((fabric.bending_warp, 0.06), (fabric.bending_weft, 0.04)):
        curvature = MATCHED_FOLD / bending_length(b * KES_BENDING, fabric.weight)
        moment = bending * curvature**2 / 2  # of the cosine law, per width
        assert moment == pytest.approx(b * KES_BENDING * curvature, rel=ROUNDING)
    low, high = (fabric.shear * math.radians(degrees) ** 2 for degrees in (0.5, 2.5))
    slope = (high - low) / 2.0  # N/m per degree, read where KES-F reads it
    assert slope == pytest.approx(0.9 * 9.80665e-3 / 0.01, rel=ROUNDING)
    assert (fabric.weight, fabric.thickness) == pytest.approx((0.12, 0.4e-3), rel=ROUNDING)


def test_unit_of_bending_rigidity_is_one_gram_force_centimetre_squared_per_centimetre() -> None:
    assert pytest.approx(9.80665e-3 * 1e-2**2 / 1e-2, rel=ROUNDING) == KES_BENDING


def test_emt_of_five_percent_is_the_stretch_that_the_model_states() -> None:
    fabric = resolve_fabric({"emt_percent": 5})
    assert fabric.stretch_warp == fabric.stretch_weft == pytest.approx(196e3, rel=1e-3)  # model.md gives three digits


def test_a_measured_curve_gives_the_stretch_that_made_it() -> None:
    curve = [[percent, 150e3 * (percent / 100) ** 2] for percent in (1, 2, 4)]
    assert resolve_fabric({"tension_warp": curve}).stretch_warp == pytest.approx(150e3, rel=ROUNDING)


def test_bending_length_and_bias_extension_state_bending_and_shear() -> None:
    fabric = resolve_fabric(
        {"weight_gsm": 100, "bending_length_warp_mm": 20, "bias_extension_percent": 4, "base": "silk"}
    )
    rigidity = rigidity_of_bending(fabric.bending_warp, fabric.weight)
    assert rigidity == pytest.approx(0.1 * 9.80665 * 0.02**3, rel=ROUNDING)  # ISO 9073-7: weight times length cubed
    assert fabric.shear * MATCHED_SHEAR_ANGLE == pytest.approx(123 / 4, rel=ROUNDING)


def tip_angle(curvature_of: Callable[[np.ndarray], np.ndarray], overhang: float) -> float:
    """Angle below the clamp [degrees] at which a heavy strip's end is seen, its curvature a law of its moment.

    Weight and rigidity are 1; so lengths are in bending lengths. Damped fixed point on the strip's slope.
    """
    step = overhang / 1000
    place = np.linspace(0.0, overhang, 1001)

    def summed(values: np.ndarray) -> np.ndarray:
        return np.concatenate([[0.0], np.cumsum(0.5 * step * (values[1:] + values[:-1]))])

    slope = 0.3 * place
    for _ in range(60):
        out = summed(np.cos(slope))
        weight = summed(out)
        moment = np.maximum(weight[-1] - weight - out * (overhang - place), 0.0)
        slope = 0.5 * slope + 0.5 * summed(curvature_of(moment))
    return math.degrees(math.atan2(summed(np.sin(slope))[-1], summed(np.cos(slope))[-1]))


def test_the_law_reads_in_the_cantilever_test_what_the_rigidity_reads() -> None:
    bending = bending_of_rigidity(1.0, 1.0 / 9.80665)
    assert tip_angle(lambda moment: moment, 2.0) == pytest.approx(41.5, abs=0.02)  # ISO 9073-7 rounds
    assert tip_angle(lambda moment: np.sqrt(2.0 * moment / bending), 2.0) == pytest.approx(41.5, abs=0.02)


def test_cloths_of_one_bending_length_fold_alike() -> None:
    light, heavy = (resolve_fabric({"weight_gsm": weight, "bending_length_warp_mm": 20}) for weight in (60, 600))
    assert heavy.bending_warp / heavy.weight == pytest.approx(light.bending_warp / light.weight, rel=ROUNDING)


def test_a_stretch_without_a_shear_is_woven_alike_in_every_direction() -> None:
    fabric = resolve_fabric({"base": "cotton", "stretch": 5e3, "bending": 2e-7})
    assert (fabric.stretch_warp, fabric.stretch_weft, fabric.shear) == (5e3, 5e3, fabric.even_shear)
    assert (fabric.bending_warp, fabric.bending_weft) == (2e-7, 2e-7)
    warp, weft, shear = yarn_stretches(5e3, 5e3, fabric.shear, fabric.compression)
    assert (warp, weft) == pytest.approx((shear, shear), rel=1e-9)
    assert resolve_fabric({"base": "cotton", "stretch": 5e3, "shear": 100}).shear == 100.0
    assert resolve_fabric({"base": "cotton", "stretch_warp": 5e4}).shear == fabric_named("cotton").shear
    assert resolve_fabric({"emt_warp_percent": 5}).shear == Fabric().even_shear  # by the softer weft


def test_edges_pull_only_where_that_is_asked_for() -> None:
    for value in ({"shear": "edges"}, {"stretch": 5e3, "shear": "edges"}, {"base": "silk", "shear": "edges"}):
        assert resolve_fabric(value).shear is None
    for woven in (resolve_fabric("default"), resolve_fabric({"weight": 0.3}), resolve_fabric({"emt_weft_percent": 30})):
        assert woven.shear == woven.even_shear


def test_a_base_of_edges_stays_one(tmp_path: Path) -> None:
    (tmp_path / "edges.toml").write_text('shear = "edges"\n')
    assert resolve_fabric({"base": "edges.toml", "weight": 0.3}, tmp_path).shear is None


def test_nine_fabrics_and_a_generic_one_ship_each_with_its_source() -> None:
    fabrics = shipped_fabrics()
    names = ("cotton", "denim", "faille", "felt", "jersey", "linen", "polyester", "silk", "wool")
    assert list(fabrics) == ["default", *names]
    assert all(fabric.source for fabric in fabrics.values())
    assert fabrics["default"] == generic_fabric()


def test_shipped_fabrics_are_ordered_as_cloth_is() -> None:
    fabrics = shipped_fabrics()
    # bending length (B / weight)^(1/3) is what orders drape
    droop = {name: (f.bending / f.weight) ** (1.0 / 3.0) for name, f in fabrics.items()}
    assert droop["silk"] < droop["cotton"] < droop["denim"] < droop["felt"]
    assert droop["jersey"] < droop["wool"] < droop["linen"]
    assert fabrics["jersey"].stretch < fabrics["wool"].stretch < fabrics["linen"].stretch


def test_name_table_file_and_fabric_all_state_a_fabric(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text('base = "cotton"\nweight = 0.15\n')
    assert resolve_fabric("silk") == fabric_named("silk")
    assert resolve_fabric(Fabric(weight=1)).weight == 1.0
    table = resolve_fabric({"name": "cotton", "stretch": 1000})
    assert (table.name, table.stretch_warp, table.weight) == ("cotton", 1000.0, 0.1238)
    assert "the scene's own: stretch" in table.source
    file = resolve_fabric("mine.toml", tmp_path)
    assert (file.name, file.weight, file.stretch) == ("mine", 0.15, fabric_named("cotton").stretch)
    over_file = resolve_fabric({"base": "mine.toml", "name": "heavy", "weight": 2}, tmp_path)
    assert (over_file.name, over_file.weight) == ("heavy", 2.0)
    assert resolve_fabric({}) == generic_fabric()


@pytest.mark.parametrize("key", BOUNDS)
@pytest.mark.parametrize("value", [-1, math.nan, math.inf, 1e12, "3", True, [1]])
def test_a_value_out_of_bounds_is_refused_by_key(key: str, value: object) -> None:
    with pytest.raises(InputError, match="must be a number from") as refused:
        Fabric(**{key: value})  # type: ignore[arg-type]
    assert refused.value.place == key


@pytest.mark.parametrize(
    ("value", "place", "problem"),
    [
        ("dennim", "", 'unknown fabric "dennim"; did you mean "denim"?'),
        (3, "", "must be a name, a .toml file or a table, not 3"),
        ({"name": "cottn"}, "name", 'unknown fabric "cottn"; did you mean "cotton"?'),
        ({"base": 3}, "base", "must be a name or a .toml file, not 3"),
        ({"stretsh": 3}, "stretsh", "unknown key; did you mean stretch? allowed here: base, name"),
        ({"stretch": "much"}, "stretch", 'must be a number from 0.001 to 1e+09, not "much"'),
        ({"emt_warp_percent": 0}, "emt_warp_percent", "must be a number from 0.05 to 300 [% at 500 gf/cm], not 0"),
        ({"emt_percent": 3, "stretch": 3.0}, "stretch", "states the same value as emt_percent; give one of them"),
        ({"weight_gsm": 160, "weight": 0.2}, "weight", "states the same value as weight_gsm; give one of them"),
        ({"tension_warp": []}, "tension_warp", "must be a list of [elongation in %, force in N/m] pairs, all positive"),
        ({"shear": 1e4}, "shear", "1e+04 N/m is more than 0.25 times the smaller stretch; use at most 5000 N/m"),
        ({"shear": "edgs"}, "shear", 'must be a number from 0 to 1e+09, or "edges", not "edgs"'),
        ({"weight": "heavy"}, "weight", 'must be a number from 0.001 to 100, not "heavy"'),
        ({"base": "silk", "name": 3}, "name", "must be a string, not 3"),
    ],
)
def test_a_bad_statement_names_what_is_wrong_and_what_there_is(value: object, place: str, problem: str) -> None:
    with pytest.raises(InputError) as refused:
        resolve_fabric(value)
    assert refused.value.place == place
    assert problem in str(refused.value)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("weight = -1", "bad.toml: weight: must be a number from 0.001 to 100, not -1"),
        ("weight = 160", "not 160; it is in kg/m2; weight_gsm takes g/m2"),
        ("wheight = 1", "bad.toml: wheight: unknown key; did you mean weight?"),
        ('base = "dennim"', 'bad.toml: base: unknown fabric "dennim"; did you mean "denim"?'),
        ('base = "absent.toml"', "absent.toml: no such fabric file; check the path"),
        ('base = "bad.toml"', "bad.toml: base: refers back to this file"),
        ("weight = ", "bad.toml:1: is not valid TOML: Invalid value"),
        ("", "bad.toml: is empty"),
    ],
)
def test_a_bad_fabric_file_is_named_with_its_key(tmp_path: Path, text: str, line: str) -> None:
    (tmp_path / "bad.toml").write_text(text)
    assert line in str(refusal(load_fabric, tmp_path / "bad.toml"))


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("emt_warp_percent", 0.16, "stretch_warp 1.9e+08 N/m"),  # the share, not percent
        ("bending_B_warp", 2e-6, "bending_warp 2.4e-13 N m2"),  # in N m
        ("bending_B_weft", 20.0, "bending_weft 0.00051 N m2"),
        ("thickness_mm", 7e-4, "thickness 7e-07 m"),  # in metres
        ("weight_gsm", 16000.0, "weight 16 kg/m2"),
    ],
)
def test_a_value_in_another_unit_is_told_of(key: str, value: float, told: str) -> None:
    stated = {"weight_gsm": 160.0, "emt_warp_percent": 16.0, "bending_B_warp": 0.02, "bending_B_weft": 0.014}
    assert not unlikely_values(resolve_fabric(stated))
    (note,) = unlikely_values(resolve_fabric({**stated, key: value}))
    assert told in note
    assert not any(unlikely_values(fabric) for fabric in shipped_fabrics().values())

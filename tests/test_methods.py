"""The study of the methods: its scenes, what it tells of a run, its files."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import methods
import methods_files
import methods_study
import numpy as np
import pytest
from methods_files import methods_lines, truth_of
from methods_scenes import GROUPS, KINDS, TRUE_FABRICS, Case, all_cases, case_tree, true_cases
from methods_study import Measurement, Run, run_case

from warp_cloth.garment.outfit import load_outfit
from warp_cloth.scene import load_scene

SMALL = Case("strip", 120, 2e4)
FEW = 200  # iterations; the strip does not rest in so few


def look(iteration: int, relative: float, error: float = math.nan, true: float = math.nan) -> Measurement:
    return Measurement(iteration, 0.01 * iteration, 1.0, relative, relative, error, true)


RUN = Run(
    Case("ball", 3000, 2e4), "multilevel", "cpu", 3025, 50.0, 1.0, 400, 0.01,
    (look(100, 0.5), look(200, 0.008, 4.0, 3.0), look(300, 0.02, 2.0, 1.0), look(400, 0.0005, 1.0, 2.0)),
)  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("friction", [0.5, 0.0])
def test_scenes_have_the_size_and_pins_that_they_should(tmp_path: Path, kind: str, friction: float) -> None:
    outfit = load_outfit(load_scene(case_tree(Case(kind, 1000, 2e4, friction), tmp_path)))
    (garment,) = outfit.garments
    assert len(garment.points) == pytest.approx(1000, rel=0.15)
    assert garment.rest.area == pytest.approx(0.03 if kind == "strip" else 1.0, rel=1e-9)
    assert (outfit.avatar is not None) == (kind == "ball")
    columns = round(math.sqrt(len(garment.points) / 3.0))
    wanted = {"hanging": 2, "strip": columns * 3, "ball": 0 if friction else 5}[kind]
    assert len(garment.pins) == pytest.approx(wanted, rel=0.4 if kind == "strip" else 0.0)


def test_a_disc_is_held_by_its_support_and_hangs_over_it(tmp_path: Path) -> None:
    (garment,) = load_outfit(load_scene(case_tree(Case("disc", 2000, fabric=TRUE_FABRICS[0]), tmp_path))).garments
    assert len(garment.points) == pytest.approx(2000, rel=0.15)
    radius = np.hypot(garment.points[:, 0], garment.points[:, 2])
    assert radius[garment.pins].max() == pytest.approx(0.09)
    assert np.delete(radius, garment.pins).min() > 0.09


def test_every_group_has_scenes_and_forty_tell_of_the_truth() -> None:
    cases = all_cases()
    assert {group for group, _, _ in cases} == set(GROUPS)
    assert len({case.name for case in true_cases()}) == len(true_cases()) >= 40
    others = {case.name for group, case, _ in cases if group != "truth"}
    assert not others & {case.name for case in true_cases()}


def test_a_level_counts_from_where_the_residual_stays_below_it() -> None:
    found = [RUN.first(level) for level in (0.1, 0.01, 0.0001)]
    assert [None if one is None else one.iteration for one in found] == [200, 400, None]
    assert RUN.work == 450.0
    assert replace(RUN, rest=0).work == math.inf


def test_only_known_distances_at_balanced_forces_tell_of_the_truth() -> None:
    assert [one.iteration for one in RUN.estimates()] == [200, 400]
    truth = truth_of([RUN])
    assert (truth.scenes, truth.certificates, truth.held, truth.checks, truth.checks_held) == (1, 1, 0, 2, 1)
    assert replace(RUN, end_mm=1.0).estimates() == []


def test_what_the_end_may_still_be_from_rest_counts_as_distance() -> None:
    near = replace(RUN, rest=200)
    assert truth_of([near]).held == 1
    assert truth_of([replace(near, end_mm=0.75)]).held == 1
    far = replace(RUN, looks=(*RUN.looks[:3], look(400, 0.0005, 1.0, 0.95)), end_mm=0.1)
    assert (truth_of([far]).held, truth_of([far]).certificates) == (0, 1)


def test_a_run_without_certificate_or_whose_end_still_moved_is_named_not_judged() -> None:
    for run in (replace(RUN, rest=0), replace(RUN, end_mm=0.5)):
        truth = truth_of([run])
        assert truth.certificates == 0
        assert truth.unknown == ("ball 3000 20000 0.5, multilevel",)


def test_scenes_that_chose_the_constants_do_not_count() -> None:
    assert truth_of([replace(RUN, case=Case("ball", 1000, 2e4))]).certificates == 0


def test_a_run_goes_on_and_knows_how_far_it_was() -> None:
    found = run_case(SMALL, "accelerated", "cpu", FEW)
    assert [one.iteration for one in found.looks] == [100, 200]
    assert found.rest == 0
    assert found.looks[-1].true_mm == pytest.approx(0.0, abs=1e-9)
    assert found.looks[0].true_mm > 1.0


def test_the_script_writes_tables_and_continues_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    case = Case("hanging", 120, 2e4)
    every = ("direct", "momentum", "accelerated", "multilevel")
    for module in (methods_study, methods_files):
        monkeypatch.setattr(module, "all_cases", lambda: [("methods", case, every), ("truth", case, every[2:])])
    monkeypatch.setattr(methods_study.MethodStudy.run, "__defaults__", (dict.fromkeys(every, FEW),))
    methods.main(["--device", "cpu", "--out", str(tmp_path)])
    written = {path.name for path in tmp_path.iterdir()}
    assert written >= {"methods.png", "rest_error.png"}
    kept = (tmp_path / "methods.jsonl").read_text()
    assert kept.count("\n") == len(every)
    methods.main(["--device", "cpu", "--out", str(tmp_path), "--no-plots"])
    assert (tmp_path / "methods.jsonl").read_text() == kept
    with pytest.raises(SystemExit):
        methods.main(["--only", "all", "--out", str(tmp_path)])


def test_tables_tell_of_what_is_not_at_rest() -> None:
    lost = replace(RUN, rest=0, looks=(look(100, np.inf),))
    assert any("not at rest" in line for line in methods_lines([lost]))

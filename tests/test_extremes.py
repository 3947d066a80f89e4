"""At the ends of what is possible a fit is at rest, says that it is not, or refuses; it is never lost."""

from __future__ import annotations

import math
import os
import signal
import time
from pathlib import Path

import extremes
import extremes_study
import numpy as np
import pytest
from extreme_meshes import caps, needles, square, torn, tube
from extremes_files import extremes_lines, save_extremes
from extremes_study import Case, Job, Outcome, hanging, run_case, single_cases, theory_cap

FEW = 150  # iterations
LONG_ENOUGH = 5.0  # [s] for what takes no time, however busy the machine is
ONE_OF = 6  # of the single cases, that many apart


@pytest.mark.parametrize("case", single_cases()[::ONE_OF], ids=lambda case: case.name)
@pytest.mark.parametrize("method", ["accelerated", "direct"])
def test_an_extreme_case_keeps_the_promise(case: Case, method: str) -> None:
    outcome = run_case(case, method, "mixed", "cpu", FEW)
    assert outcome.kept, outcome
    assert math.isfinite(outcome.furthest) or outcome.verdict in ("refused", "diverged")


@pytest.mark.parametrize("stiffness", [1.0, 1e4, 1e8])
@pytest.mark.parametrize("cap", [1e-7, 1.0])
def test_the_corners_of_the_map_keep_the_promise(stiffness: float, cap: float) -> None:
    for method in extremes_study.METHODS:
        case = Case("map", "corner", {**hanging(stiffness, 5), "solver": {"cap": cap}})
        assert run_case(case, method, "mixed", "cpu", FEW).kept


def test_the_direct_rule_rests_well_below_the_theorys_line_and_not_well_above_it() -> None:
    stiffness = 100.0
    verdicts = {}
    for factor in (0.3, 30.0):
        cap = factor * theory_cap(stiffness)
        case = Case("map", "line", {**hanging(stiffness), "solver": {"cap": cap}})
        verdicts[factor] = run_case(case, "direct", "mixed", "cpu", 4000).verdict
    assert verdicts == {0.3: "at rest", 30.0: "not at rest"}


def test_single_precision_ends_before_mixed() -> None:
    tree = {"garment": {"shape": {**hanging()["garment"]["shape"], "height": 1e4}, "pin": {"vertices": [72, 80]}}}
    verdicts = [run_case(Case("", "far", tree), "accelerated", p, "cpu", 2000).verdict for p in ("float32", "mixed")]
    assert verdicts == ["not at rest", "at rest"]


def test_the_odd_meshes_are_what_they_claim() -> None:
    def heights(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
        a, b, c = (points[triangles[:, i]] for i in range(3))
        longest = np.max([np.linalg.norm(u - v, axis=1) for u, v in ((a, b), (b, c), (c, a))], axis=0)
        return np.linalg.norm(np.cross(b - a, c - a), axis=1) / longest**2

    assert heights(*needles(1e4)[:2]) == pytest.approx(1e-4, rel=0.01)
    assert heights(*caps(1e-4)[:2]).min() < 1e-4
    points, _, flat = torn(50.0)
    assert flat is not None
    assert np.ptp(points[:, 2]) == pytest.approx(50.0 * 0.5 / 9)
    assert len(square(9)[1]) == 128
    ring = tube(0.2, 0.5)[0]
    assert np.linalg.norm(ring[:, [0, 2]], axis=1) == pytest.approx(0.2)


def test_a_broken_promise_is_told(tmp_path: Path) -> None:
    lost = Outcome("start", "heap", "direct", "mixed", "not finite", "x")
    lines = extremes_lines([lost, Outcome("start", "fine", "direct", "mixed", "refused", "why")])
    assert any(line.startswith("2 runs: 1 broke") for line in lines)
    assert "BROKEN heap" in lines[-1]
    assert [path.name for path in save_extremes([lost], tmp_path)] == ["extremes.csv"]


@pytest.mark.long
def test_the_script_runs_the_groups_that_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(extremes_study, "single_cases", lambda: single_cases()[:1])
    monkeypatch.setattr(extremes_study, "CASE_LIMIT", FEW)
    assert extremes.main(["--only", "cases", "--out", str(tmp_path)]) == 0
    assert "3 runs: 0 broke" in capsys.readouterr().out
    assert (tmp_path / "extremes.csv").read_text().count("\n") == 4
    with pytest.raises(SystemExit):
        extremes.main(["--only", "everything", "--out", str(tmp_path)])


class _Ends(Job):
    """A run that takes its process along, or never ends, or is soon over."""

    def run(self, device: str) -> Outcome:
        if self.method == "crash":
            os.kill(os.getpid(), signal.SIGSEGV)
        while self.method == "hang":
            time.sleep(0.1)
        return self.lost("refused", device)


def test_a_run_that_crashes_or_hangs_is_told_and_takes_no_other_along(monkeypatch: pytest.MonkeyPatch) -> None:
    ways = ("crash", "end", "hang", "end")
    jobs = [_Ends(single_cases()[0], way, "mixed", 20, {"cap": 1.0}) for way in ways]
    monkeypatch.setattr(extremes_study, "jobs_of", lambda groups: jobs)
    lines: list[str] = []
    found = extremes_study.run_extremes("cpu", lines.append, deadline=LONG_ENOUGH)
    assert [outcome.verdict for outcome in found] == ["crashed", "refused", "hung", "refused"]
    assert "SIGSEGV" in found[0].message
    assert [outcome.kept for outcome in found] == [False, True, False, True]
    assert all(outcome.values == {"cap": 1.0} for outcome in found)
    assert len(lines) == len(jobs)


def test_the_map_is_drawn(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    found = [
        Outcome("map", "", method, "mixed", "at rest", "x", values={"stiffness": k, "cap": c})
        for k in extremes_study.STIFFNESS
        for c in extremes_study.CAPS
        for method in extremes_study.METHODS
    ]
    found += [
        Outcome("precision", "", "accelerated", p, "at rest", "x", values={"stiffness": k, "size": float(n)})
        for k in extremes_study.STIFFNESS
        for n in extremes_study.SIZES
        for p in ("float32", "mixed")
    ]
    paths = save_extremes(found, tmp_path)
    assert paths[-1].stat().st_size > 10_000

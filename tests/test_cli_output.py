"""What the command prints of a fit: its summary, and progress on a terminal and in a log."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from rich.console import Console
from stand_ins import Step

from warp_cloth.cli import fit_progress
from warp_cloth.cli.fit import summary
from warp_cloth.cli.fit_progress import ProgressDisplay


def test_summary_leaves_out_what_is_not_known() -> None:
    report = {
        "status": "at_rest",
        "message": "Fine.",
        "residual": {"relative_rms": 0.00912345, "relative_p99": None},
        "penetration_mm": None,
        "iterations": 12345,
        "iterations_per_second": 812.3,
        "seconds": {"relax": 15.2},
        "problems": [{"code": "crossing", "message": "It crosses.", "remedy": "Leave it out."}],
        "device": "cpu",
        "garments": [{"name": "shirt", "notes": ["units not stated: metres assumed"]}],
        "avatar": {"notes": ["lies along z"]},
    }
    assert summary("x", report, [Path("out/x.usdc")]) == [
        "x: not worn. Fine.",
        "  residual     0.00912 relative rms, ? p99",
        "  iterations   12,345 (812 per second)",
        "  time         15.2 s on cpu",
        "  problem      crossing: It crosses. Leave it out.",
        "  note         shirt: units not stated: metres assumed",
        "  note         avatar: lies along z",
        "  wrote        out/x.usdc",
    ]


@pytest.fixture
def shown() -> Callable[..., str]:
    def show(*steps: Step, terminal: bool) -> str:
        text = io.StringIO()
        with ProgressDisplay(Console(file=text, force_terminal=terminal, width=100, _environ={})) as display:
            for step in steps:
                display(step)
        return text.getvalue()

    return show


def test_progress_in_a_log_is_one_plain_line_a_stage(shown: Callable[..., str]) -> None:
    steps = [Step("load"), Step("build"), *(Step("relax", n, 100, 0.5, None, 10.0) for n in range(1, 50))]
    text = shown(*steps, Step("export"), terminal=False)
    assert text == "loading\nbuilding\nrelaxing 1/100  residual 0.5  10/s\nwriting\n"


def test_progress_on_a_terminal_shows_iteration_residual_and_speed(shown: Callable[..., str]) -> None:
    text = shown(Step("relax", 50, 100, 0.02, float("nan"), 800.0), terminal=True)
    assert "50/100  residual 0.02  800/s" in text
    assert "rest error" not in text


@pytest.mark.parametrize("width", [60, 80, 120])
def test_progress_fits_the_terminal(width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fit_progress, "HINT_SECONDS", 0.0)
    text = io.StringIO()
    console = Console(file=text, force_terminal=True, width=width, color_system=None, _environ={})
    with ProgressDisplay(console) as display:
        display(Step("compile"))
        display._bar.refresh()
        display(Step("dress"))
        display(Step("relax", 99_900, 100_000, 0.0123, 13.4, 12345.0, 1.0))
    shown = text.getvalue()
    assert "…" not in shown
    assert all(len(line) <= width for line in re.split(r"[\r\n]|\x1b\[[0-9;?]*[A-Za-z]", shown))
    assert "rest error 13 mm" in shown
    assert "2/5 compiling" in shown
    assert ("first fit on a machine" if width > 60 else "first run: half a minute") in shown


def test_the_bar_shows_the_rest_error_on_a_logarithmic_scale() -> None:
    shares: list[float | None] = []
    with ProgressDisplay(Console(file=io.StringIO(), force_terminal=True, width=80, _environ={})) as display:
        for number, error in enumerate((None, 100.0, 10.0, 30.0, 1.0, 0.5), start=1):
            display(Step("relax", number, 0, 0.1, error, 10.0, 1.0))
            shares.append(display._share)
    assert shares == pytest.approx([0.0, 0.0, 0.5, 0.5, 1.0, 1.0])


def test_one_bar_goes_through_all_steps_and_never_back() -> None:
    text = io.StringIO()
    console = Console(file=text, force_terminal=True, width=80, color_system=None, _environ={})
    course: list[float] = []
    stages = (
        "load",
        "compile",
        "build",
        "compile",
        "relax",
        "measure",
        "build",
        "compile",
        "relax",
        "measure",
        "export",
    )
    with ProgressDisplay(console) as display:
        for stage in stages:
            for number, error in enumerate((0.0, 100.0, 1.0) if stage == "relax" else (0.0,)):
                display(Step(stage, number, 0, 0.1, error, 10.0, 1.0))
                display._bar.refresh()
                course.append(display.completed)
    assert course == sorted(course)
    assert course[-1] == 0.95
    shown = list(dict.fromkeys(re.findall(r"\d/5 \w+", text.getvalue())))
    assert shown == [
        *("1/5 loading", "2/5 compiling", "2/5 building", "3/5 relaxing", "4/5 measuring"),
        *("4/5 building", "4/5 compiling", "4/5 relaxing", "5/5 writing"),
    ]

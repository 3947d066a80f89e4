"""Results of the methods: tables, and plots of their convergence and of the certificate's truth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from methods_scenes import KINDS, SIZES, STIFFNESS, all_cases
from methods_study import LEVELS, Measurement, Run

from warp_cloth.export.files import whole_file
from warp_cloth.export.plots import figure_class

COLOURS = {"direct": "tab:red", "momentum": "tab:orange", "accelerated": "tab:blue", "multilevel": "tab:green"}
MARKS = {"hanging": "o", "strip": "s", "ball": "^", "disc": "h", "tshirt": "D"}
TRUE = ("accelerated", "multilevel")  # methods whose certificate is put to the test
LEAST_MM = 1e-3  # on the plot of the truth
END_KNOWN = 0.2  # a certificate is judged where the run's end is known to this share of what the certificate says
DPI = 110


def side_by_side(runs: Sequence[Run]) -> list[list[Run]]:
    """Runs of the scenes on which all methods stand side by side, scene by scene."""
    names = [case.name for group, case, _ in all_cases() if group == "methods"]
    rows = [[run for run in runs if run.case.name == name] for name in names]
    return [row for row in rows if row]


@dataclass(frozen=True)
class Truth:
    """How often the rest error was no less than the true distance."""

    scenes: int  # with a certificate and a known end
    certificates: int
    held: int  # of the certificates; what the end may still be from rest counts as distance
    checks: int  # at balanced forces, till the distance is no longer known
    checks_held: int
    unknown: tuple[str, ...]  # runs whose certificate is not judged: there is none, or the end still moved

    @property
    def share(self) -> float:
        """Of the certificates."""
        return self.held / self.certificates if self.certificates else math.nan

    @property
    def checks_share(self) -> float:
        """Of the checks."""
        return self.checks_held / self.checks if self.checks else math.nan

    def sentence(self) -> str:
        """All of it."""
        return (
            f"the rest error held at {self.held} of {self.certificates} certificates ({100.0 * self.share:.1f} %) "
            f"and {100.0 * self.checks_share:.1f} % of {self.checks:,} checks, {self.scenes} scenes"
        )


def truth_of(runs: Sequence[Run]) -> Truth:
    """The truth of the certificates, on the scenes of that group."""
    names = {case.name for group, case, _ in all_cases() if group == "truth"}
    chosen = [run for run in runs if run.method in TRUE and run.case.name in names]
    pairs = [(run, run.certified()) for run in chosen]
    judged = [(run, look) for run, look in pairs if look is not None and run.end_mm <= END_KNOWN * look.rest_error_mm]
    checks = [look.rest_error_mm >= look.true_mm for run in chosen for look in run.estimates()]
    known = {id(run) for run, _ in judged}
    return Truth(
        scenes=len({run.case.name for run, _ in judged}),
        certificates=len(judged),
        held=sum(look.rest_error_mm >= look.true_mm + run.end_mm for run, look in judged),
        checks=len(checks),
        checks_held=sum(checks),
        unknown=tuple(f"{run.case.name}, {run.method}" for run in chosen if id(run) not in known),
    )


def methods_lines(runs: Sequence[Run]) -> list[str]:
    """Tables for people: side by side, work by size, the certificate's truth."""
    lines = []
    heads = "".join(f"{f'{100 * level:g} %':>18}" for level in LEVELS)
    for row in side_by_side(runs):
        lines.append(f"{row[0].case.name}: {row[0].vertices:,} vertices{heads:>60}{'rest':>18}")
        for run in row:
            cells = "".join(f"{_cell(run, run.first(level)):>18}" for level in LEVELS)
            lines.append(f"  {run.method:<28}{cells}{_cell(run, run.certified()):>18}")
    for run in runs:
        if run.case.kind in KINDS and run.method == "multilevel" and run.case.friction:
            words = f"{run.work:,.0f} iterations, {run.rest:,} of them on the finest" if run.rest else "not at rest"
            lines.append(f"  {run.case.name}: {words}")
    for method in (*TRUE, ""):
        truth = truth_of([run for run in runs if run.method == method or not method])
        if truth.certificates:
            lines.append(f"{method or 'all'}: {truth.sentence()}")
    return [*lines, *(f"  not judged: {name}" for name in truth_of(runs).unknown)]


def _cell(run: Run, look: Measurement | None) -> str:
    return "-" if look is None else f"{run.coarse + look.iteration:,.0f} {look.seconds:.3g} s"


def save_plots(runs: Sequence[Run], folder: Path) -> list[Path]:
    """Writes methods.png and rest_error.png."""
    paths = [folder / "methods.png", folder / "rest_error.png"]
    _plot_methods(paths[0], runs)
    _plot_truth(paths[1], runs)
    return paths


def _plot_methods(path: Path, runs: Sequence[Run]) -> None:
    """Residual over seconds, scene by scene; under it the iterations to rest over the vertices."""
    rows = side_by_side(runs)
    figure = figure_class()(figsize=(13, 7), layout="constrained")
    upper, lower = figure.subfigures(2, 1, height_ratios=(1.1, 1.0))
    for axes, row in zip(upper.subplots(1, max(len(rows), 1), sharey=True, squeeze=False)[0], rows, strict=False):
        for run in row:
            looks = [look for look in run.looks if look.relative > 0.0]
            axes.plot(
                [look.seconds for look in looks], [look.relative for look in looks],
                color=COLOURS[run.method], label=run.method, linewidth=1.2,
            )  # fmt: skip
            rest = run.certified()
            if rest is not None:
                axes.plot([rest.seconds], [rest.relative], "*", color=COLOURS[run.method], markersize=13)
        for level in LEVELS:
            axes.axhline(level, color="0.8", linewidth=0.8, zorder=0)
        axes.set(xscale="log", yscale="log", xlabel="seconds", ylim=(1e-5, 1.0))
        stretch = f", {row[0].case.stretch / 1e3:g} kN/m" if row[0].case.stretch else ""
        axes.set_title(f"{row[0].case.kind}, {row[0].vertices:,} vertices{stretch}", fontsize=9)
    first = upper.get_axes()[0]
    first.set_ylabel("relative residual (star: at rest)")
    first.legend(fontsize=8, loc="lower left")
    for axes, kind in zip(lower.subplots(1, len(KINDS), sharey=True), KINDS, strict=True):
        _plot_sizes(axes, [run for run in runs if run.case.kind == kind and run.case.friction])
        axes.set_title(kind, fontsize=9)
    lower.get_axes()[0].set_ylabel("iterations to rest, all levels")
    if lower.get_axes()[0].lines:
        lower.get_axes()[0].legend(fontsize=8)
    with whole_file(path) as place:
        figure.savefig(place, dpi=DPI)


def _plot_sizes(axes: Any, runs: Sequence[Run]) -> None:
    """Iterations to rest over the vertices, a line for each method and stiffness."""
    for method, dash in zip(TRUE, (":", "-"), strict=True):
        for stretch, mark in zip(STIFFNESS, "ovs", strict=True):
            own = [run for run in runs if run.method == method and run.case.stretch == stretch]
            own.sort(key=lambda run: run.vertices)
            if any(run.rest for run in own):
                axes.plot(
                    [run.vertices for run in own], [run.work if run.rest else math.nan for run in own],
                    dash + mark, color=COLOURS[method], markersize=5, label=f"{method}, {stretch / 1e3:g} kN/m",
                )  # fmt: skip
    axes.set(xscale="log", yscale="log", xlabel="vertices")
    axes.set_xticks(SIZES, [f"{size:,}" for size in SIZES])
    axes.tick_params(axis="x", which="minor", labelbottom=False)
    axes.grid(True, which="both", linewidth=0.3, alpha=0.5)


def _plot_truth(path: Path, runs: Sequence[Run]) -> None:
    """The rest error over the true distance: at every check where the forces are balanced, and at the certificates."""
    names = {case.name for group, case, _ in all_cases() if group == "truth"}
    truth = truth_of(runs)
    figure = figure_class()(figsize=(8.0, 6.0), layout="constrained")
    axes = figure.subplots()
    for method in TRUE:
        for kind, mark in MARKS.items():
            own = [run for run in runs if (run.method, run.case.kind) == (method, kind) and run.case.name in names]
            looks = [look for run in own for look in run.estimates()]
            stars = [look for look in (run.certified() for run in own) if look is not None]
            drawn: dict[str, Any] = {"color": COLOURS[method], "linestyle": "none", "marker": mark}
            axes.plot(*_places(looks), markersize=3, alpha=0.3, markeredgewidth=0, **drawn)
            if stars:
                drawn |= {"markersize": 6, "markeredgecolor": "black", "markeredgewidth": 0.6}
                axes.plot(*_places(stars), label=f"{kind}, {method}", **drawn)
    ends = [LEAST_MM, 1e3]
    axes.plot(ends, ends, color="black", linewidth=1)
    axes.axhline(1.0, color="0.7", linewidth=0.8, linestyle="--")
    axes.set(xscale="log", yscale="log", xlabel="true distance from rest [mm, rms]", ylabel="rest_error_mm")
    axes.set(xlim=(LEAST_MM, 1e2), ylim=(1e-2, 1e3))
    if truth.certificates:
        axes.set_title(f"at or above the line: {truth.sentence()}".replace("the rest error held at ", ""), fontsize=9)
        axes.legend(fontsize=8, loc="upper left", title="at the certificate", title_fontsize=8)
    axes.grid(True, linewidth=0.3, alpha=0.5)
    with whole_file(path) as place:
        figure.savefig(place, dpi=DPI)


def _places(looks: Sequence[Measurement]) -> tuple[list[float], list[float]]:
    return [max(look.true_mm, LEAST_MM) for look in looks], [look.rest_error_mm for look in looks]

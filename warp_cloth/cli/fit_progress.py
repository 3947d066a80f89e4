"""The progress of a running fit, on a terminal and in a log file."""

from __future__ import annotations

import math
from typing import Protocol

from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn

from warp_cloth.base.progress_line import ProgressLine

STAGES = {
    "load": "loading",
    "compile": "compiling",
    "build": "building",
    "carry": "posing",
    "dress": "predraping",
    "relax": "relaxing",
    "export": "writing",
}


class Step(Protocol):
    """The progress of a fit (see warp_cloth.fitting.fit.Progress), without an import of Warp."""

    @property
    def stage(self) -> str: ...
    @property
    def iteration(self) -> int: ...
    @property
    def iteration_limit(self) -> int: ...
    @property
    def residual(self) -> float | None: ...  # relative, rms
    @property
    def rest_error_mm(self) -> float | None: ...
    @property
    def iterations_per_second(self) -> float | None: ...


class ProgressDisplay(ProgressLine):
    """Shows the stages and iterations of a fit."""

    def __init__(self, console: Console) -> None:
        columns = (
            TextColumn("{task.description:<10}"),
            BarColumn(bar_width=24),
            TextColumn("{task.fields[figures]}", markup=False),
            TimeElapsedColumn(),
        )
        super().__init__(console, columns, "starting")
        self._stage = ""

    def __call__(self, step: Step) -> None:
        stage = STAGES.get(step.stage, step.stage)
        relaxing = step.stage == "relax" and step.iteration > 0
        text = figures(step) if relaxing else ""
        if self._console.is_terminal:
            total = step.iteration_limit or None if relaxing else None
            self._bar.update(self._task, description=stage, total=total, completed=step.iteration, figures=text)
            return
        if self._line_due(at_once=stage != self._stage):
            self._stage = stage
            self._write(f"{stage} {text}".rstrip())


def figures(step: Step) -> str:
    """Iteration, residual, rest error and speed in one short line, without those not known yet."""
    parts = [f"{step.iteration}/{step.iteration_limit}" if step.iteration_limit else f"{step.iteration} iterations"]
    if _known(step.residual):
        parts.append(f"residual {step.residual:.2g}")
    if _known(step.rest_error_mm):
        parts.append(f"rest error {step.rest_error_mm:.2g} mm")
    if _known(step.iterations_per_second):
        parts.append(f"{step.iterations_per_second:.0f}/s")
    return "  ".join(parts)


def _known(value: float | None) -> bool:
    return value is not None and math.isfinite(value)

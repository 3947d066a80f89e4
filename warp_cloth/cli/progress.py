"""How a running fit looks on a terminal, and in a log file."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Protocol, TypeVar

from rich.console import Console
from rich.progress import BarColumn, ProgressColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar

LOG_SECONDS = 5.0  # between two lines where there is no terminal: a log stays short
STAGES = {
    "load": "loading",
    "compile": "compiling",
    "build": "building",
    "carry": "carrying",
    "dress": "dressing",
    "relax": "relaxing",
    "export": "writing",
}


class Step(Protocol):
    """What a fit tells while it runs (see warp_cloth.fitting.fit.Progress)."""

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


Display = TypeVar("Display", bound="LineDisplay")


class LineDisplay:
    """One moving line on a terminal, a few plain lines elsewhere; what is told is for those who derive from it."""

    def __init__(self, console: Console, columns: Sequence[ProgressColumn], task: str) -> None:
        self._console = console
        self._last_line = -math.inf  # when [s]
        self._bar = Bar(*columns, console=console, transient=True, disable=not console.is_terminal)
        self._task = self._bar.add_task(task, total=None, figures="")

    def __enter__(self: Display) -> Display:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def _line_due(self, at_once: bool) -> bool:
        """Whether it is time for a plain line, and if so, counts it as written."""
        now = time.monotonic()
        due = at_once or now - self._last_line >= LOG_SECONDS
        if due:
            self._last_line = now
        return due

    def _write(self, line: str) -> None:
        self._console.print(line, markup=False, highlight=False, soft_wrap=True)


class ProgressDisplay(LineDisplay):
    """Shows a fit's steps as they come."""

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
        told = figures(step) if relaxing else ""
        if self._console.is_terminal:
            total = step.iteration_limit if relaxing else None
            self._bar.update(self._task, description=stage, total=total, completed=step.iteration, figures=told)
            return
        if self._line_due(at_once=stage != self._stage):
            self._stage = stage
            self._write(f"{stage} {told}".rstrip())


def figures(step: Step) -> str:
    """Iteration, residual, rest error and speed in one short line; what is not known yet is left out."""
    parts = [f"{step.iteration}/{step.iteration_limit}"]
    if _known(step.residual):
        parts.append(f"residual {step.residual:.2g}")
    if _known(step.rest_error_mm):
        parts.append(f"rest error {step.rest_error_mm:.2g} mm")
    if _known(step.iterations_per_second):
        parts.append(f"{step.iterations_per_second:.0f}/s")
    return "  ".join(parts)


def _known(value: float | None) -> bool:
    return value is not None and math.isfinite(value)

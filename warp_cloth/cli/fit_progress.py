"""The progress of a running fit, on a terminal and in a log file."""

from __future__ import annotations

import math
from typing import Protocol

from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn

from warp_cloth.base.progress_line import ProgressLine

STAGES = {
    "load": "loading",
    "compile": "compiling",  # the kernels, which later fits find in Warp's cache
    "build": "building",
    "carry": "posing",
    "dress": "predraping",
    "relax": "relaxing",
    "measure": "measuring",
    "export": "writing",
}


WIDE = 100  # letters of a terminal, from which the bar is wide
WIDE_BAR, NARROW_BAR = 24, 10
NAME, ELAPSED = 11, 9  # letters of the stage, and of the time, with the gaps beside them
FIRST_RUN = "the first fit on a machine takes a minute here"


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
    @property
    def tolerance_mm(self) -> float | None: ...  # of the rest error


class ProgressDisplay(ProgressLine):
    """Shows the stages of a fit; of relaxing how far the rest error has come down, on a logarithmic scale."""

    def __init__(self, console: Console) -> None:
        bar = WIDE_BAR if console.width >= WIDE else NARROW_BAR
        self._room = console.width - NAME - bar - ELAPSED
        columns = (
            TextColumn("{task.description:<10}"),
            BarColumn(bar_width=bar),
            TextColumn("{task.fields[figures]}", markup=False),
            TimeElapsedColumn(),
        )
        super().__init__(console, columns, "starting")
        self._stage = ""
        self._first_error = math.nan  # [mm]
        self._share = 0.0  # of the way to rest

    def __call__(self, step: Step) -> None:
        relaxing = step.stage == "relax" and step.iteration > 0
        if not relaxing:
            self.begin(step.stage)
        elif self._console.is_terminal:
            share, text = self._way(step), figures(step, self._room)
            name, total = STAGES["relax"], None if share is None else 1.0
            self._bar.update(self._task, description=name, total=total, completed=share or 0.0, figures=text)
        else:
            self._line(STAGES["relax"], figures(step))

    def begin(self, stage: str) -> None:
        """Shows a stage of which nothing more is known."""
        name = STAGES.get(stage, stage)
        if self._console.is_terminal:
            hint = FIRST_RUN if stage == "compile" and len(FIRST_RUN) <= self._room else ""
            self._bar.update(self._task, description=name, total=None, completed=0.0, figures=hint)
        else:
            self._line(name, "")

    def _line(self, stage: str, text: str) -> None:
        if self._line_due(at_once=stage != self._stage):
            self._stage = stage
            self._write(f"{stage} {text}".rstrip())

    def _way(self, step: Step) -> float | None:
        """Share of the way from the first rest error to the tolerance; None while that is not known."""
        error, wanted = step.rest_error_mm, step.tolerance_mm
        if error is None or wanted is None or not (math.isfinite(error) and error > 0.0 < wanted):
            return self._share or None
        if not self._first_error > wanted:  # not known yet
            self._first_error = error
        if self._first_error > wanted:
            share = math.log(self._first_error / error) / math.log(self._first_error / wanted)
            self._share = max(self._share, min(share, 1.0))
        return self._share or None


def figures(step: Step, room: float = math.inf) -> str:
    """Iteration, residual, rest error and speed in a line of ``room`` letters, without those not known yet."""
    count = f"{step.iteration}/{step.iteration_limit}" if step.iteration_limit else f"{step.iteration} iterations"
    known = {
        "count": count,
        "residual": f"residual {step.residual:.2g}" if _known(step.residual) else "",
        "error": f"rest error {step.rest_error_mm:.2g} mm" if _known(step.rest_error_mm) else "",
        "speed": f"{step.iterations_per_second:.0f}/s" if _known(step.iterations_per_second) else "",
    }
    for dropped in ("", "speed", "residual", "count"):  # in a narrow terminal, what matters least first
        known.pop(dropped, None)
        text = "  ".join(filter(None, known.values()))
        if len(text) <= room:
            break
    return text


def _known(value: float | None) -> bool:
    return value is not None and math.isfinite(value)

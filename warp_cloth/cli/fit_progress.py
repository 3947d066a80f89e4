"""The progress of a running fit, on a terminal and in a log file."""

from __future__ import annotations

import math
from typing import Protocol

from rich.console import Console
from rich.progress import BarColumn, ProgressColumn, Task, TextColumn, TimeElapsedColumn
from rich.text import Text

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
# The steps of a fit in their order, the stages that each may have, and where the bar stands as it begins. A T-shirt
# takes half of its time to relax, a large garment nearly all.
STEPS: tuple[tuple[frozenset[str], float], ...] = (
    (frozenset({"load"}), 0.0),
    (frozenset({"compile", "build", "carry", "dress"}), 0.1),
    (frozenset({"relax"}), 0.25),
    (frozenset({"measure"}), 0.9),
    (frozenset({"export"}), 0.95),
)
RELAX = 2  # the step that relaxes

WIDE = 100  # letters of a terminal, from which the bar is wide
WIDE_BAR, NARROW_BAR = 24, 10
NAME, ELAPSED = 15, 9  # letters of step and stage, and of the time, with the gaps next to them
FIRST_RUN = ("the first fit on a machine takes half a minute", "first run: half a minute")
HINT_SECONDS = 1.0  # after which kernels are being compiled: those of an earlier run are loaded by then


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


class FiguresColumn(ProgressColumn):
    """What is known of a stage, and a hint where it goes on for longer."""

    def render(self, task: Task) -> Text:
        """The text at this moment."""
        hint, since = task.fields.get("hint", ""), task.fields.get("since", math.inf)
        return Text(hint if hint and task.get_time() - since >= HINT_SECONDS else task.fields["figures"])


class ProgressDisplay(ProgressLine):
    """One bar for all of a fit, which never goes back, with the step and its stage by name.

    While the garment relaxes the bar follows its rest error, on a logarithmic scale. Of what comes again (a further
    attempt) the stage is named; the step stays.
    """

    def __init__(self, console: Console) -> None:
        bar = WIDE_BAR if console.width >= WIDE else NARROW_BAR
        self._room = console.width - NAME - bar - ELAPSED
        columns = (
            TextColumn(f"{{task.description:<{NAME - 1}}}"),
            BarColumn(bar_width=bar),
            FiguresColumn(),
            TimeElapsedColumn(),
        )
        super().__init__(console, columns, "starting")
        self._stage = ""
        self._step = 0
        self._first_error = math.nan  # [mm]
        self._share = 0.0  # of the way to rest
        self.completed = 0.0  # of all

    def __call__(self, step: Step) -> None:
        relaxing = step.stage == "relax" and step.iteration > 0
        if not relaxing:
            self.begin(step.stage)
        elif self._console.is_terminal:
            self._follow(step)
            self._show("relax", figures(step, self._room))
        else:
            self._line(STAGES["relax"], figures(step))

    def begin(self, stage: str) -> None:
        """Shows a stage of which nothing more is known."""
        if self._console.is_terminal:
            fitting = [hint for hint in FIRST_RUN if stage == "compile" and len(hint) <= self._room]
            self._show(stage, "", fitting[0] if fitting else "")
        else:
            self._line(STAGES.get(stage, stage), "")

    def _show(self, stage: str, text: str, hint: str = "") -> None:
        own = next((number for number, (stages, _) in enumerate(STEPS) if stage in stages), self._step)
        self._step = max(self._step, own)
        start = STEPS[self._step][1]
        length = STEPS[RELAX + 1][1] - start if self._step == RELAX else 0.0
        self.completed = max(self.completed, start + self._share * length)
        name = f"{self._step + 1}/{len(STEPS)} {STAGES.get(stage, stage)}"
        since = self._bar.get_time() if hint else math.inf
        self._bar.update(
            self._task, description=name, total=1.0, completed=self.completed, figures=text, hint=hint, since=since
        )

    def _line(self, stage: str, text: str) -> None:
        if self._line_due(at_once=stage != self._stage):
            self._stage = stage
            self._write(f"{stage} {text}".rstrip())

    def _follow(self, step: Step) -> None:
        """Takes in how far the rest error has come from the first one known to the tolerance."""
        error, wanted = step.rest_error_mm, step.tolerance_mm
        if error is None or wanted is None or not (math.isfinite(error) and error > 0.0 < wanted):
            return
        if not self._first_error > wanted:  # not known yet
            self._first_error = error
        if self._first_error > wanted:
            share = math.log(self._first_error / error) / math.log(self._first_error / wanted)
            self._share = max(self._share, min(share, 1.0))


def figures(step: Step, room: float = math.inf) -> str:
    """Iteration, residual, rest error and speed in a line of ``room`` letters, without those not known yet."""
    count = f"{step.iteration}/{step.iteration_limit}" if step.iteration_limit else f"{step.iteration} iterations"
    known = {
        "count": count,
        "residual": f"residual {step.residual:.2g}" if _known(step.residual) else "",
        "error": f"rest error {_millimetres(step.rest_error_mm)} mm" if _known(step.rest_error_mm) else "",
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


def _millimetres(value: float | None) -> str:
    return "" if value is None else f"{value:.0f}" if value >= 100.0 else f"{value:.2g}"

"""How a running batch looks on a terminal, and in a log file."""

from __future__ import annotations

import math
import time
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from warp_cloth.batch.drive import Standing
from warp_cloth.progress import LOG_SECONDS


class BatchDisplay:
    """One moving line on a terminal, a few plain lines elsewhere."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._last_line = -math.inf  # when [s]
        self._bar = Bar(
            TextColumn("fitting"),
            BarColumn(bar_width=24),
            MofNCompleteColumn(),
            TextColumn("{task.fields[figures]}", markup=False),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
            transient=True,
            disable=not console.is_terminal,
        )
        self._task = self._bar.add_task("fitting", total=None, figures="")

    def __enter__(self) -> BatchDisplay:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def __call__(self, standing: Standing) -> None:
        told = figures(standing)
        if self._console.is_terminal:
            self._bar.update(self._task, total=standing.items, completed=standing.done, figures=told)
            return
        now = time.monotonic()
        if now - self._last_line >= LOG_SECONDS or standing.done == standing.items:
            self._last_line = now
            line = f"fitted {standing.done}/{standing.items} {told}".rstrip()
            left = time_left(standing)
            if left:
                line += f"  {left} left"
            self._console.print(line, markup=False, highlight=False, soft_wrap=True)


def figures(standing: Standing) -> str:
    """Items per second and items without a result; what is not known yet is left out."""
    parts = []
    if standing.items_per_second is not None:
        parts.append(f"{standing.items_per_second:.3g}/s")
    if standing.problems:
        parts.append(f"{standing.problems} failed")
    return "  ".join(parts)


def time_left(standing: Standing) -> str:
    """How long the rest takes at the speed so far."""
    if standing.items_per_second is None or standing.done == standing.items:
        return ""
    seconds = round((standing.items - standing.done) / standing.items_per_second)
    return f"{seconds // 3600}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"

"""A progress bar on a terminal, plain lines in a log file."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from types import TracebackType
from typing import TypeVar

from rich.console import Console
from rich.progress import Progress, ProgressColumn

LOG_SECONDS = 5.0  # between two lines where there is no terminal: a log stays short

Display = TypeVar("Display", bound="ProgressLine")


class ProgressLine:
    """One line that updates in place on a terminal, a few plain lines elsewhere; subclasses decide what it says."""

    def __init__(self, console: Console, columns: Sequence[ProgressColumn], task: str) -> None:
        self._console = console
        self._last_line = -math.inf  # when [s]
        self._bar = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
        self._task = self._bar.add_task(task, total=None, figures="")

    def __enter__(self: Display) -> Display:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def _line_due(self, at_once: bool) -> bool:
        """Whether it is time for a plain line; if so, the line counts as written."""
        now = time.monotonic()
        due = at_once or now - self._last_line >= LOG_SECONDS
        if due:
            self._last_line = now
        return due

    def _write(self, line: str) -> None:
        self._console.print(line, markup=False, highlight=False, soft_wrap=True)

"""Seconds of each stage of a fit."""

from __future__ import annotations

import time
from collections.abc import Callable

STAGES = ("load", "compile", "build", "carry", "relax", "measure", "export")  # keys of the report's "seconds"


class StageClock:
    """Adds the time since the last lap to a stage; ``on_begin`` is called with each stage that begins."""

    def __init__(self, on_begin: Callable[[str], None] = lambda _: None) -> None:
        self.seconds = dict.fromkeys(STAGES, 0.0)
        self.begin = on_begin
        self._last = time.perf_counter()

    def lap(self, stage: str) -> None:
        """Ends a stretch of the stage."""
        now = time.perf_counter()
        self.seconds[stage] += now - self._last
        self._last = now

"""Seconds of each stage of a fit, from the start of its process on."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

# Keys of the report's "seconds", in the order of the stages. The first three are the command's: a fit called from
# Python finds its process started.
STAGES = (
    "start",  # of Python itself
    "import",
    "warp",  # its start, and the device's
    "load",
    "compile",
    "build",
    "carry",
    "dress",
    "relax",
    "measure",
    "export",
    "picture",
    "page",
)
IMPORTED = time.perf_counter()  # [s] when this module was imported, the first one of the command
_BEGAN: ContextVar[tuple[float, float] | None] = ContextVar("began", default=None)  # as for ``command_began``


class StageClock:
    """Adds the time since the last lap to a stage; ``on_begin`` is called with each stage that begins.

    It goes on with the ``seconds`` of an earlier clock where they are passed, and counts from ``since`` on
    [s, of ``time.perf_counter``], or from now.
    """

    def __init__(
        self,
        on_begin: Callable[[str], None] = lambda _: None,
        *,
        seconds: dict[str, float] | None = None,
        since: float | None = None,
    ) -> None:
        self.seconds = dict.fromkeys(STAGES, 0.0) if seconds is None else seconds
        self.begin = on_begin
        self._last = time.perf_counter() if since is None else since

    def lap(self, stage: str) -> None:
        """Ends a stretch of the stage."""
        now = time.perf_counter()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now

    def restart(self) -> None:
        """Leaves out the time since the last lap, which another clock has measured."""
        self._last = time.perf_counter()

    def add_to(self, seconds: dict[str, float]) -> None:
        """Adds this clock's seconds to those of what went on after its last lap."""
        for stage, spent in self.seconds.items():
            seconds[stage] = seconds.get(stage, 0.0) + spent


def command_clock() -> StageClock:
    """A clock of a command: it has measured the start of the process, and is at the first import."""
    since, before = _BEGAN.get() or (IMPORTED, seconds_before(IMPORTED))
    clock = StageClock(since=since)
    clock.seconds["start"] = before
    return clock


@contextmanager
def command_began(since: float, before: float) -> Iterator[None]:
    """For a command that another process was started for, ``before`` [s] the moment ``since`` (see StageClock)."""
    token = _BEGAN.set((since, before))
    try:
        yield
    finally:
        _BEGAN.reset(token)


def seconds_before(moment: float) -> float:
    """How long this process had run at a moment [s, of ``time.perf_counter``]; 0 where the system does not tell.

    Linux tells it in steps of 10 ms: field 22 of proc(5)'s stat, in clock ticks since the machine started.
    """
    try:
        fields = Path("/proc/self/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        started = int(fields[19]) / os.sysconf("SC_CLK_TCK")
        age = time.clock_gettime(time.CLOCK_BOOTTIME) - started
    except (OSError, ValueError, IndexError, AttributeError):
        return 0.0
    return max(age - (time.perf_counter() - moment), 0.0)

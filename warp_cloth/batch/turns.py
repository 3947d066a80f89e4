"""Turns on a GPU that several workers use: one has it while its garments relax, the others get theirs ready."""

from __future__ import annotations

import fcntl
from pathlib import Path
from types import TracebackType
from typing import IO

from warp_cloth.solver.relax import Relaxation

FEW = 0.05  # of a relaxation's vertices: so few leave a GPU room for others; of more two processes hold each other up


class Turn:
    """Waits for a lock on a file, and gives it up as soon as few vertices still move; it ends with the process, too."""

    def __init__(self, path: Path | None) -> None:
        """``path`` of the file, which is made; None: nobody else is there."""
        self._path = path
        self._file: IO[str] | None = None

    def __enter__(self) -> Turn:
        if self._path is not None:
            self._file = open(self._path, "w")
            fcntl.flock(self._file, fcntl.LOCK_EX)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.end()

    def offer(self, iteration: int, relaxation: Relaxation) -> None:
        """Ends the turn where most vertices are at rest after this iteration."""
        if self._file is not None and relaxation.active_share < FEW:
            self.end()

    def end(self) -> None:
        """Lets the next one have its turn."""
        if self._file is not None:
            self._file.close()
            self._file = None

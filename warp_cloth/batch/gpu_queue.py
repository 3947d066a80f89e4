"""Turns of workers that share a GPU: one has it while its garments relax, and one, at a time, loads meshes."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from warp_cloth.solver.relax import Relaxation

# Of a relaxation's vertices: so few leave a GPU room for others. Of 4,096 items 204 a second, with 0.05 and 0.5 198.
FEW = 0.2


class Turn:
    """Waits for a lock on a file, and gives it up as soon as few vertices still move; it ends with the process, too."""

    def __init__(self, path: Path | None) -> None:
        """``path`` of the file, which is made; None: nobody else is there."""
        self._path = path
        self._file: int | None = None

    def __enter__(self) -> Turn:
        self.begin()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.end()

    def begin(self) -> None:
        """Has the turn from now on, once nobody else has it."""
        if self._path is not None:
            self._file = os.open(self._path, os.O_WRONLY | os.O_CREAT, 0o644)
            fcntl.flock(self._file, fcntl.LOCK_EX)

    def taken(self) -> bool:
        """Whether another one has it now."""
        if self._path is None or self._file is not None:
            return False
        file = os.open(self._path, os.O_WRONLY | os.O_CREAT, 0o644)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        finally:
            os.close(file)
        return False

    def offer(self, iteration: int, relaxation: Relaxation) -> None:
        """Ends the turn where most vertices are at rest after this iteration."""
        if self._file is not None and relaxation.active_share < FEW:
            self.end()

    def end(self) -> None:
        """Lets the next one have its turn."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

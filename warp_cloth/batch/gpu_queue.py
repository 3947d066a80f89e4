"""Leases of a GPU that several workers share: one relaxes its garments there, the others load or measure meanwhile."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from warp_cloth.solver.relax import Relaxation

# Fraction of a relaxation's vertices still active, below which another one may start on the GPU. 4,096 items: 204 a
# second; with 0.05 and with 0.5 198.
FEW_ACTIVE = 0.2


class GpuLease:
    """A lock on a file, released when few vertices still move, or with the process."""

    def __init__(self, path: Path | None) -> None:
        """``path`` of the file, created if absent; None: no other process uses the GPU."""
        self._path = path
        self._file: int | None = None

    def __enter__(self) -> GpuLease:
        self.acquire()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()

    def acquire(self) -> None:
        """Waits until no other process has the lease, and takes it."""
        if self._path is not None:
            self._file = os.open(self._path, os.O_WRONLY | os.O_CREAT, 0o644)
            fcntl.flock(self._file, fcntl.LOCK_EX)

    def taken(self) -> bool:
        """Whether another process has the lease."""
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

    def release_early(self, iteration: int, relaxation: Relaxation) -> None:
        """Releases the lease where most vertices are at rest after this iteration."""
        if self._file is not None and relaxation.active_fraction < FEW_ACTIVE:
            self.release()

    def release(self) -> None:
        if self._file is not None:
            os.close(self._file)
            self._file = None

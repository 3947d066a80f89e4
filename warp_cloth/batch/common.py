"""What one worker's helpers have worked out, for those of others: files that are whole or not there."""

from __future__ import annotations

import contextlib
import os
import pickle
from pathlib import Path
from typing import Any

MOST = 1 << 30  # [bytes] that a folder holds, or a little more: what has the same panels comes soon, or not at all


def keep_in(file: Path, thing: Any) -> None:
    """Keeps something there; where that cannot be, or the folder is full, others work it out for themselves."""
    part = file.with_name(f"{file.name}.{os.getpid()}")
    with contextlib.suppress(OSError):
        if _held(file.parent) > MOST:
            return
        with part.open("wb") as out:
            pickle.dump(thing, out, protocol=5)
        part.replace(file)


def kept_in(file: Path) -> Any:
    """What was kept there; None: nothing yet, or nothing that can be read."""
    with contextlib.suppress(OSError, EOFError, pickle.UnpicklingError), file.open("rb") as kept:
        return pickle.load(kept)
    return None


def _held(folder: Path) -> int:
    """Bytes of a folder's files, but for those that are renamed at this moment."""
    total = 0
    for each in os.scandir(folder):
        with contextlib.suppress(FileNotFoundError):
            total += each.stat().st_size
    return total

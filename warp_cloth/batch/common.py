"""What one worker's helpers have worked out, for those of others: files that are whole or not there."""

from __future__ import annotations

import contextlib
import os
import pickle
from pathlib import Path
from typing import Any


def keep_in(file: Path, thing: Any) -> None:
    """Keeps something there; where that cannot be, others work it out for themselves."""
    part = file.with_name(f"{file.name}.{os.getpid()}")
    with contextlib.suppress(OSError):
        with part.open("wb") as out:
            pickle.dump(thing, out, protocol=5)
        part.replace(file)


def kept_in(file: Path) -> Any:
    """What was kept there; None: nothing yet, or nothing that can be read."""
    with contextlib.suppress(OSError, EOFError, pickle.UnpicklingError), file.open("rb") as kept:
        return pickle.load(kept)
    return None

"""Atomic writes: files that appear complete or not at all."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from warp_cloth.base.errors import OutputError

REMEDY = "choose an output folder that is writable"
NO_SPACE = "free some space there, or choose another output folder"


def unwritable(path: Path, error: Exception) -> OutputError:
    """The error for a path that cannot be written."""
    reason = getattr(error, "strerror", None) or error
    full = getattr(error, "errno", None) == errno.ENOSPC or os.strerror(errno.ENOSPC) in str(error)  # as USD says it
    return OutputError(path, f"cannot be written ({reason})", NO_SPACE if full else REMEDY)


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yields a temporary path to write to; at the end that file replaces ``path`` in one step.

    After an error ``path`` is as it was. The temporary file is in a hidden folder next to ``path``, so that the last
    step is a rename within one file system, and has its final name from the start, which a usdz package stores.
    """
    try:
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}-") as folder:
            place = Path(folder) / path.name
            yield place
            os.replace(place, path)
    except OSError as error:
        raise unwritable(path, error) from error

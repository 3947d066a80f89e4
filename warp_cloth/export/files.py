"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from warp_cloth.base.errors import OutputError

REMEDY = "choose an output folder that can be written"


def unwritable(path: Path, error: Exception) -> OutputError:
    """The one-line refusal for a place that cannot be written."""
    reason = getattr(error, "strerror", None) or error
    return OutputError(path, f"cannot be written ({reason})", REMEDY)


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yields a place to write; what stands there at the end becomes ``path`` in one step.

    After an error ``path`` is as it was. The place is in a hidden folder beside ``path``: the last step is a
    rename within one file system, and the file has its own name from the start (a usdz package stores it).
    """
    try:
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}-") as folder:
            place = Path(folder) / path.name
            yield place
            os.replace(place, path)
    except OSError as error:
        raise unwritable(path, error) from error

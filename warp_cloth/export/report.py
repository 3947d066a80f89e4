"""report.json and vertex-map files, and a check that the output folder is writable."""

from __future__ import annotations

import json
import math
import os
import tempfile
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.export.files import REMEDY, unwritable, whole_file

SIGNIFICANT_DIGITS = 6  # more than any measured value here justifies


def write_report(path: Path, report: Mapping[str, Any]) -> None:
    """Writes a report as JSON, with its keys in order, and NaN and infinity as null.

    Numbers are rounded to 6 significant digits, except those of ``settings``, so that a fit can be repeated from them.
    """
    rounded = {key: value if key == "settings" else plain(value) for key, value in report.items()}
    text = json.dumps(rounded, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    with whole_file(path) as place:
        place.write_text(text, encoding="utf-8")


def plain(value: Any) -> Any:
    """The value in JSON's own types; TypeError if it has no equivalent there."""
    if isinstance(value, Enum):
        return plain(value.value)
    if value is None or isinstance(value, (bool, str, int)):
        return value
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, float):
        return float(f"{value:.{SIGNIFICANT_DIGITS}g}") if math.isfinite(value) else None
    if isinstance(value, (np.generic, np.ndarray)):
        # a float32 is rounded like a float64: its digits beyond the sixth are noise of the cast
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(plain(key)): plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    raise TypeError(f"a report cannot hold {type(value).__name__}")


def write_map(path: Path, mesh: Mesh) -> bool:
    """Writes which vertex and face of the loaded file became which of the mesh; False, without a file, if none changed.

    In that case the file of an earlier run is removed, as it would be taken for that of this run.
    """
    arrays = mesh.arrays()
    if not arrays:
        path.unlink(missing_ok=True)
        return False
    with whole_file(path) as place, place.open("wb") as file:
        np.savez_compressed(file, **arrays)
    return True


def result_paths(directory: Path, name: str) -> tuple[Path, Path, Path, Path]:
    """Paths of a scene's stage, picture, page and report."""
    return directory / f"{name}.usdc", directory / "preview.png", directory / "report.html", directory / "report.json"


def check_writable(directory: Path, name: str) -> None:
    """Creates the output folder; InputError, with nothing left behind, if a scene's files cannot be written there."""
    # os.path returns False where Path raises: a name too long, a folder without permission
    absent = [folder for folder in (directory, *directory.parents) if not os.path.exists(folder)]
    if os.path.isfile(directory):
        raise InputError(directory, "is a file, not a folder", REMEDY)
    for path in result_paths(directory, name):
        if os.path.isdir(path):
            raise InputError(path, "is a folder, but a file of that name would be written", REMEDY)
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory) as probe:
            probe.write(b"0")
            probe.flush()
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        for folder in absent:  # innermost first
            if os.path.isdir(folder):
                folder.rmdir()
        raise unwritable(directory, error) from error

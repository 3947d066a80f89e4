"""Validation of paths and names in scenes."""

from __future__ import annotations

import contextlib
import os
import re
import sys
from pathlib import Path
from typing import Any

from pydantic import ValidationInfo

from warp_cloth.scene.messages import refusal, show

SPECIFICATION = "_specification"  # as GarmentCode's files end


def directory_of(info: ValidationInfo) -> Path:
    """Folder where relative paths start: the scene file's, or the current one."""
    return (info.context or {}).get("directory", Path())


def path_from(value: Any, info: ValidationInfo, what: str) -> Path | None:
    """The path of ``what`` that a value states, relative to the scene's folder; None for None."""
    if value is None:
        return None
    if not isinstance(value, str | Path) or not str(value).strip() or "\0" in str(value):
        raise refusal(f"{show(value)} is not a path", f"give {what}, relative to the scene file")
    path = directory_of(info) / value
    with contextlib.suppress(RuntimeError):  # an unknown user
        path = directory_of(info) / Path(value).expanduser()  # a shell does not expand "~" within --set
    try:
        str(path).encode("utf-8")
    except UnicodeEncodeError:
        raise refusal(f"{show(str(path))} is not valid text", "rename the file or its folder") from None
    try:
        os.fsencode(path)
    except UnicodeEncodeError:
        problem = f"{show(str(path))} cannot be the name of a file in this locale ({sys.getfilesystemencoding()})"
        raise refusal(problem, "set LC_ALL to a UTF-8 locale, such as C.UTF-8") from None
    return path


def file_stem(path: Path | None) -> str:
    """A garment's name by its file, without the ending of GarmentCode's specifications."""
    stem = Path(path or "").stem
    return stem.removesuffix(SPECIFICATION) or stem


def is_name(value: str) -> bool:
    """Whether a file can have the name."""
    return re.fullmatch(r"[^/\\\x00-\x1f.][^/\\\x00-\x1f]{0,99}", value) is not None


def checked_name(value: str) -> str:
    """The name, if a file can have it."""
    if not is_name(value):
        raise refusal(
            f"{show(value)} cannot be a file name",
            "use 1 to 100 characters, without slashes, not starting with a dot",
        )
    return value

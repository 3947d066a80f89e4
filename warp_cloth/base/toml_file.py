"""TOML files: errors are one line with file, line, problem and remedy."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Mapping
from datetime import date, datetime, time
from pathlib import Path
from typing import Any

from warp_cloth.base.errors import InputError
from warp_cloth.base.text import to_utf8

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found,unused-ignore]

LARGEST_FILE = 1_000_000  # [bytes]; these files are written by hand, so that a longer one is something else

BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")

MENDED = {  # the parser's messages for the most frequent mistakes
    "Invalid value": 'put strings in "quotes"; true and false are lower case',
    "'\\'": "write paths with /, which works on every system",
}


def read_toml(path: Path, role: str, *, largest: int = LARGEST_FILE) -> dict[str, Any]:
    """The values of a TOML file of at most ``largest`` bytes; ``role`` says in messages what it should have been."""
    text = _text(path, role, largest)
    if not text.strip():
        raise InputError(path, "is empty", f"give a {role} in TOML")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        problem, line = _problem(str(error), text)
        remedy = next((way for mark, way in MENDED.items() if mark in problem), f"a {role} is a TOML file")
        raise InputError(f"{path}:{line}", f"is not valid TOML: {problem}", remedy) from None
    except RecursionError:
        raise InputError(path, "is nested too deeply", f"give a {role} in TOML") from None
    except ValueError as error:  # Python's own, of numbers with thousands of digits
        raise InputError(path, f"is not valid TOML: {error}", f"a {role} is a TOML file") from None


def toml_value(text: str) -> Any:
    """The value that a text is in TOML, or else the text itself."""
    try:
        values = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return values["value"] if len(values) == 1 else text


def toml_text(value: Any) -> str:
    """A value in TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, (int, float, date, time, datetime)):
        return str(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(str(key))} = {toml_text(entry)}" for key, entry in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(toml_text(entry) for entry in value) + "]"
    return json.dumps(str(value))


def _key(name: str) -> str:
    return name if BARE_KEY.fullmatch(name) else json.dumps(name, ensure_ascii=False)


def exists(path: Path) -> bool:
    """Whether the path exists; a name that the system refuses does not."""
    try:
        return path.exists()
    except (OSError, ValueError):
        return False


def _text(path: Path, role: str, largest: int) -> str:
    if not exists(path):
        raise InputError(path, f"no such {role}", "check the path")
    if path.is_dir():
        raise InputError(path, f"is a folder, not a {role}", "give the .toml file")
    try:
        if not path.is_file() or path.stat().st_size > largest:
            size = f"{largest // 10**6} MB"
            raise InputError(path, f"is not a {role}", f"give a TOML file below {size}, which refers to meshes by name")
        text = to_utf8(path.read_bytes()).decode("utf-8")
    except OSError as error:
        raise InputError(path, f"cannot be read: {error.strerror or error}", "check its permissions") from None
    except UnicodeDecodeError as error:
        raise InputError(path, f"is not text in UTF-8 (byte {error.start})", f"save the {role} as UTF-8") from None
    if "\0" in text:
        raise InputError(path, "is a binary file", f"a {role} is a TOML file")
    return text


def _problem(message: str, text: str) -> tuple[str, int]:
    """What the TOML parser says, and the line that it says it of."""
    problem, _, at = message.rpartition(" (at ")
    if not problem:
        problem, at = message, ""
    line = at.removeprefix("line ").partition(",")[0]
    return problem, int(line) if line.isdigit() else text.rstrip("\n").count("\n") + 1

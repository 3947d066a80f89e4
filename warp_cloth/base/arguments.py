"""Type checks of arguments of the Python interface: the value in the type wanted, or one InputError."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from numbers import Integral, Real
from pathlib import Path
from typing import Any

from warp_cloth.base.errors import InputError


def strings(value: Any, name: str) -> tuple[str, ...]:
    """One string, or an iterable of them, as a tuple."""
    if isinstance(value, str):
        return (value,)
    items = tuple(value) if isinstance(value, Iterable) and not isinstance(value, Mapping) else (None,)
    if not all(isinstance(item, str) for item in items):
        raise _wrong_type(value, name, "a string or a list of strings")
    return items


def path(value: Any, name: str) -> Path:
    """A path, or a string that is one."""
    if not isinstance(value, str | os.PathLike) or not isinstance(os.fspath(value), str):
        raise _wrong_type(value, name, "a path")
    return Path(value)


def integer(value: Any, name: str) -> int:
    """An integer, Python's or NumPy's."""
    if not isinstance(value, Integral) or isinstance(value, bool):
        raise _wrong_type(value, name, "an integer")
    return int(value)


def number(value: Any, name: str) -> float:
    """A finite number, Python's or NumPy's."""
    if not isinstance(value, Real) or isinstance(value, bool) or not math.isfinite(value):
        raise _wrong_type(value, name, "a number")
    return float(value)


def _wrong_type(value: Any, name: str, wanted: str) -> InputError:
    plain = isinstance(value, bool | int | float | str | None)
    shown = value if plain else f"an object of type {type(value).__name__}"
    return InputError(name, f"must be {wanted}, not {shown}", f"give {wanted}")

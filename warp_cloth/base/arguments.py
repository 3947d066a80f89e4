"""What a caller gave the Python interface: of the kind that is wanted, or refused in one line."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from numbers import Integral, Real
from pathlib import Path
from typing import Any

from warp_cloth.base.errors import InputError


def texts(given: Any, place: str) -> tuple[str, ...]:
    """A text, or several, as several."""
    if isinstance(given, str):
        return (given,)
    several = tuple(given) if isinstance(given, Iterable) and not isinstance(given, Mapping) else (None,)
    if not all(isinstance(each, str) for each in several):
        raise _refused(given, place, "a text or a list of texts")
    return several


def path(given: Any, place: str) -> Path:
    """A path, or the text of one."""
    if not isinstance(given, str | os.PathLike) or not isinstance(os.fspath(given), str):
        raise _refused(given, place, "a path")
    return Path(given)


def whole(given: Any, place: str) -> int:
    """A whole number."""
    if not isinstance(given, Integral) or isinstance(given, bool):
        raise _refused(given, place, "a whole number")
    return int(given)


def number(given: Any, place: str) -> float:
    """A finite number."""
    if not isinstance(given, Real) or isinstance(given, bool) or not math.isfinite(given):
        raise _refused(given, place, "a number")
    return float(given)


def _refused(given: Any, place: str, wanted: str) -> InputError:
    shown = given if isinstance(given, bool | int | float | str | None) else f"something of type {type(given).__name__}"
    return InputError(place, f"must be {wanted}, not {shown}", f"give {wanted}")

"""Numbers as people read them."""

from __future__ import annotations

import math
from collections.abc import Sequence


def short_number(value: float | None, digits: int = 3) -> str:
    """A number in few significant digits; a large one in full, with commas, rather than as a power of ten."""
    if value is None or not math.isfinite(value):
        return "unknown"
    return f"{value:,.0f}" if abs(value) >= 10 ** (digits - 1) else f"{value:.{digits}g}"


def shown_choice(value: str | float | bool | Sequence[float]) -> str:
    """A value that the program chose for a key of the scene."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return value
    if isinstance(value, Sequence):
        return " by ".join(f"{each:g}" for each in value)
    return f"{value:g}"

"""Numbers as people read them."""

from __future__ import annotations

import math


def short_number(value: float | None, digits: int = 3) -> str:
    """A number in few significant digits; a large one in full, with commas, rather than as a power of ten."""
    if value is None or not math.isfinite(value):
        return "unknown"
    return f"{value:,.0f}" if abs(value) >= 10 ** (digits - 1) else f"{value:.{digits}g}"

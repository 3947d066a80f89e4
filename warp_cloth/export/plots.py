"""Matplotlib, which is optional: imported where a plot is drawn."""

from __future__ import annotations

from typing import Any

from warp_cloth.base.errors import InputError


def figure_class() -> Any:
    """Matplotlib's Figure.

    Raises:
        InputError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise InputError("matplotlib", "is needed for plots", "pip install 'warp-cloth[plot]'") from None
    return Figure

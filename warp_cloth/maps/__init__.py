"""Fit maps: strain, pressure and gap of a worn garment at every vertex, and its girths."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from warp_cloth.maps.kinds import MAPS, MapKind, chosen_colour, chosen_maps

if TYPE_CHECKING:
    from warp_cloth.maps.measure import add_girths, map_summary, measure_maps

__all__ = ["MAPS", "MapKind", "add_girths", "chosen_colour", "chosen_maps", "map_summary", "measure_maps"]


def __getattr__(name: str) -> Any:
    """Imports what measures on first use, and Warp with it: a command checks the names of its maps before."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.measure"), name)

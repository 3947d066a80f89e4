"""Fit maps: strain, pressure and gap of a worn garment at every vertex, and its girths."""

from warp_cloth.maps.kinds import MAPS, MapKind, chosen_colour, chosen_maps
from warp_cloth.maps.measure import add_girths, map_summary, measure_maps

__all__ = ["MAPS", "MapKind", "add_girths", "chosen_colour", "chosen_maps", "map_summary", "measure_maps"]

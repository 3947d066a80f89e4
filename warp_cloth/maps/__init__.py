"""Fit maps: strain, pressure and ease of a worn garment at every vertex, and its girths."""

from warp_cloth.maps.kinds import MAPS, MapKind, chosen_colour, chosen_maps
from warp_cloth.maps.measure import map_summary, measure_maps

__all__ = ["MAPS", "MapKind", "chosen_colour", "chosen_maps", "map_summary", "measure_maps"]

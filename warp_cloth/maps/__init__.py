"""Fit maps: what a worn garment does, vertex by vertex, and what a pattern maker reads off it."""

from warp_cloth.maps.kinds import MAPS, MapKind, chosen_colour, chosen_maps
from warp_cloth.maps.measure import map_summary, measure_maps

__all__ = ["MAPS", "MapKind", "chosen_colour", "chosen_maps", "map_summary", "measure_maps"]

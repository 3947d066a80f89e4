"""Sewing patterns: flat panels and their stitches, read, meshed, placed and sewn."""

from warp_cloth.pattern.assembly import load_pattern, read_pattern, sewn_mesh

__all__ = ["load_pattern", "read_pattern", "sewn_mesh"]

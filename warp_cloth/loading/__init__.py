"""Meshes from files: OBJ, PLY, STL, GLB/glTF and USD, checked, repaired and in metres."""

from warp_cloth.loading.load import SUPPORTED, load_mesh
from warp_cloth.loading.placement import Placement
from warp_cloth.loading.poses import load_poses
from warp_cloth.loading.repair import without_area
from warp_cloth.loading.sizes import check_sizes

__all__ = ["SUPPORTED", "Placement", "check_sizes", "load_mesh", "load_poses", "without_area"]

"""Meshes from files: OBJ, PLY, STL, GLB/glTF and USD, checked, repaired and in metres."""

from warp_cloth.loading.load import lies, load_mesh, with_y_up
from warp_cloth.loading.placement import Placement
from warp_cloth.loading.poses import load_poses
from warp_cloth.loading.repair import without_area
from warp_cloth.loading.sizes import (
    check_sizes,
    fitting_reading,
    is_of_fitting_size,
    is_usual_size,
    lies_apart,
    was_guessed,
)
from warp_cloth.loading.stored import load_mesh_once

__all__ = [
    "Placement",
    "check_sizes",
    "fitting_reading",
    "is_of_fitting_size",
    "is_usual_size",
    "lies",
    "lies_apart",
    "load_mesh",
    "load_mesh_once",
    "load_poses",
    "was_guessed",
    "with_y_up",
    "without_area",
]

"""The file formats of meshes, by the ends of their names; ``loading/load.py`` has a reader for each."""

from __future__ import annotations

OBJ = (".obj",)
PLAIN = (*OBJ, ".ply", ".stl")  # they state no up axis, and need no other file
GLTF = (".glb", ".gltf")
USD = (".usdc", ".usda", ".usd", ".usdz")  # a stage, which may be a whole scene; the likeliest first
NAMED = (*OBJ, *GLTF, *USD)  # whose meshes have names, so that one file may hold garment and body
MESHES = (*PLAIN, *GLTF)  # that are never scenes
SUPPORTED = (*MESHES, *USD)

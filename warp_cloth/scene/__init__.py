"""Scenes: what to fit, on what, and how; from TOML files, shipped names or dictionaries."""

from warp_cloth.scene.load import describe_scene, load_scene, shipped_scenes
from warp_cloth.scene.schema import CollisionSpec, Scene, SolverSpec
from warp_cloth.scene.shapes import BodyMeasures, MannequinShape, SphereShape, SquareShape, TshirtShape
from warp_cloth.scene.wearables import AvatarSpec, GarmentSpec, PinSpec

__all__ = [
    "AvatarSpec",
    "BodyMeasures",
    "CollisionSpec",
    "GarmentSpec",
    "MannequinShape",
    "PinSpec",
    "Scene",
    "SolverSpec",
    "SphereShape",
    "SquareShape",
    "TshirtShape",
    "describe_scene",
    "load_scene",
    "shipped_scenes",
]

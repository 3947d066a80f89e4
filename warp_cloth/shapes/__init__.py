"""Generated garments and avatars: parameters in, meshes in metres out."""

from __future__ import annotations

from functools import partial
from typing import Any

from warp_cloth.base.cache import Cache
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.stored_mesh import stored_mesh
from warp_cloth.shapes.mannequin import mannequin
from warp_cloth.shapes.measures import SIZE_BODIES, MannequinMeasures
from warp_cloth.shapes.simple import sphere, square
from warp_cloth.shapes.tshirt import tshirt

__all__ = [
    "SIZE_BODIES",
    "MannequinMeasures",
    "build_avatar",
    "build_garment",
    "build_mannequin",
    "mannequin",
    "mannequin_measures",
    "sphere",
    "square",
    "tshirt",
]

PACKAGES = ("shapes", "base")  # whose code shapes depend on


def build_garment(shape: Any, *, body: MannequinMeasures | None = None, cache: Cache | None = None) -> Mesh:
    """Mesh of a scene's garment shape, square or tshirt.

    Args:
        shape: SquareShape or TshirtShape of the scene.
        body: the mannequin that wears it; None: the standard body of its size.
        cache: shares drafts (patterns, body forms) between shapes.
    """
    if shape.kind == "square":
        return square(
            side=shape.side, vertices_per_side=shape.vertices_per_side, height=shape.height, plane=shape.plane
        )
    if shape.kind == "tshirt":
        edge = shape.edge_mm / 1000
        make = partial(tshirt, size=shape.size, edge=edge, body=body, cache=cache)
        return stored_mesh("tshirt", PACKAGES, make, shape.size, edge, body)
    raise InputError("garment.shape", f"kind {shape.kind!r} is unknown", 'use "square" or "tshirt"')


def build_avatar(shape: Any, *, cache: Cache | None = None) -> Mesh:
    """Mesh of a scene's avatar shape, sphere or mannequin; ``cache`` shares drafts."""
    if shape.kind == "sphere":
        return sphere(radius=shape.radius, centre=shape.centre, edge=shape.edge_mm / 1000)
    if shape.kind == "mannequin":
        return build_mannequin(mannequin_measures(shape), cache or Cache())
    raise InputError("avatar.shape", f"kind {shape.kind!r} is unknown", 'use "sphere" or "mannequin"')


def build_mannequin(measures: MannequinMeasures, cache: Cache) -> Mesh:
    """The mannequin with these measures, from the cache where it is known."""

    def make() -> Mesh:
        return stored_mesh("mannequin", PACKAGES, partial(mannequin, measures, cache=cache), measures)

    return cache.get_or_make("mannequin", (), make, measures)


def mannequin_measures(shape: Any) -> MannequinMeasures:
    """Measures of a scene's mannequin; omitted ones (None) are those of its size's standard body."""
    standard = SIZE_BODIES[shape.size]
    given = {name: getattr(shape, name) for name in ("stature", "chest", "waist", "hip")}
    filled = {name: getattr(standard, name) if value is None else value for name, value in given.items()}
    return MannequinMeasures(**filled, arm_angle=shape.arm_angle_degrees)

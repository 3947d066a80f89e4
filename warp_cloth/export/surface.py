"""Colours of written surfaces, sRGB conversion, and checks of their values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warp_cloth.base.mesh import Indices, Mesh
from warp_cloth.model.result import WornGarment

Colour = tuple[float, float, float]

CLOTH_COLOURS: tuple[Colour, ...] = (  # sRGB; mid tones, bright enough for folds to be visible
    (0.29, 0.49, 0.66),  # denim blue
    (0.77, 0.42, 0.34),  # brick
    (0.43, 0.58, 0.42),  # sage
    (0.85, 0.66, 0.33),  # ochre
    (0.53, 0.42, 0.62),  # plum
    (0.30, 0.57, 0.58),  # teal
)
TRIM_SHADE = 0.55  # times the cloth's colour: buttons stand out, and belong to it
AVATAR_COLOUR: Colour = (0.80, 0.78, 0.76)  # sRGB; a shop mannequin's grey


def cloth_colour(garment: int) -> Colour:
    """Colour (sRGB) of a garment by its index."""
    return CLOTH_COLOURS[garment % len(CLOTH_COLOURS)]


def trim_colour(garment: int) -> Colour:
    """Colour (sRGB) of a garment's buttons and other trims: a darker one than its cloth's."""
    red, green, blue = cloth_colour(garment)
    return TRIM_SHADE * red, TRIM_SHADE * green, TRIM_SHADE * blue


def material_name(garment: WornGarment) -> str:
    """Name of a garment's material: by garment and fabric, in one word."""
    parts = [garment.name, garment.fabric.name if garment.fabric is not None else ""]
    return "_".join(" ".join(parts).split()) or "garment"


def linear(srgb: ArrayLike) -> NDArray[np.float64]:
    """Linear light from sRGB values, both 0..1 (IEC 61966-2-1)."""
    value = np.asarray(srgb, dtype=np.float64)
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def srgb(light: ArrayLike) -> NDArray[np.float64]:
    """sRGB values from linear light, both 0..1; values outside are clipped."""
    value = np.clip(np.asarray(light, dtype=np.float64), 0.0, 1.0)
    return np.where(value <= 0.0031308, value * 12.92, 1.055 * value ** (1 / 2.4) - 0.055)


def in_bytes(light: ArrayLike) -> NDArray[np.uint8]:
    """sRGB values in bytes from linear light."""
    return np.round(srgb(light) * 255.0).astype(np.uint8)


def winds_outward(points: ArrayLike, triangles: Indices) -> bool:
    """Whether the triangles face away from the surface's centre: the sign of the volume that they enclose with it."""
    corners = np.asarray(points, dtype=np.float64)[triangles]
    corners = corners - corners.reshape(-1, 3).mean(axis=0)
    volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    return bool(volume >= 0.0)


def require_sound(garments: Sequence[WornGarment], avatar: Mesh | None) -> None:
    """ValueError, naming the garment, if points, frames or fields are not finite, or not one per vertex."""
    for garment in garments:
        arrays: dict[str, NDArray[Any]] = {"points": garment.points, **garment.fields}
        for what, values in arrays.items():
            if len(values) != garment.mesh.vertex_count:
                raise ValueError(f"garment {garment.name!r}: {what} are not one per vertex")
        if garment.frames is not None:
            arrays["frames"] = garment.frames
        for what, values in arrays.items():
            if not all_finite(values):
                raise ValueError(f"garment {garment.name!r}: {what} contain NaN or infinity")
    if avatar is not None and not all_finite(avatar.points):
        raise ValueError(f"avatar {avatar.name!r}: points contain NaN or infinity")


def all_finite(values: ArrayLike) -> bool:
    """Whether every value is finite as float32, the type that is written."""
    with np.errstate(over="ignore"):
        return bool(np.isfinite(np.asarray(values, dtype=np.float32)).all())

"""Per-vertex values and maps as primvars of a USD mesh; names and arrays in the form that USD requires."""

from __future__ import annotations

import unicodedata
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pxr import Sdf, Tf, UsdGeom, Vt

from warp_cloth.export.surface import linear
from warp_cloth.maps.colour import colours
from warp_cloth.maps.kinds import kind_named

Ranges = Mapping[str, tuple[float, float]]  # of the colours of maps, by name

MESH_PRIMVARS = ("st", "normals", "displayColor", "displayOpacity")  # names that a field must not take


def author_fields(surface: UsdGeom.Mesh, fields: Mapping[str, NDArray[np.float32]], ranges: Ranges) -> None:
    """Values per vertex as float primvars (Blender drops double and half), those of a map with its unit and ranges."""
    taken = set(MESH_PRIMVARS)
    for name, values in fields.items():
        primvar = UsdGeom.PrimvarsAPI(surface).CreatePrimvar(
            unique_identifier(name, "field", taken), Sdf.ValueTypeNames.FloatArray, UsdGeom.Tokens.vertex
        )
        written = contiguous(values, np.float32)
        primvar.Set(Vt.FloatArray.FromNumpy(written))
        about = {"minimum": float(written.min()), "maximum": float(written.max())}
        if name in ranges:
            about |= dict(zip(("range_low", "range_high"), ranges[name], strict=True))
        for key, value in about.items():
            primvar.GetAttr().SetCustomDataByKey(key, value)
        kind = kind_named(name)
        if kind is not None:
            primvar.GetAttr().SetCustomDataByKey("unit", kind.unit)
            primvar.GetAttr().SetDocumentation(kind.about)


def author_colours(surface: UsdGeom.Mesh, values: NDArray[np.float32], name: str, bounds: tuple[float, float]) -> None:
    """A map as displayColor: linear colours per vertex."""
    kind = kind_named(name)
    if kind is None:
        raise ValueError(f"{name!r} is not a map")
    primvar = surface.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex)
    shown = linear(colours(kind, values, bounds))
    primvar.Set(Vt.Vec3fArray.FromNumpy(contiguous(shown, np.float32)))
    primvar.GetAttr().SetCustomDataByKey("map", name)


def unique_identifier(name: str, fallback: str, taken: set[str]) -> str:
    """A valid ASCII identifier (which every tool reads) close to ``name``, not in ``taken``, and added to it."""
    ascii_name = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    if not any(character.isalnum() for character in ascii_name):
        ascii_name = fallback
    base = Tf.MakeValidIdentifier(f"_{ascii_name}" if ascii_name[0].isdigit() else ascii_name)
    identifier, count = base, 1
    while identifier in taken:
        count += 1
        identifier = f"{base}_{count}"
    taken.add(identifier)
    return identifier


def contiguous(values: ArrayLike, dtype: type[np.generic]) -> NDArray[Any]:
    """The array in the memory layout that Vt requires."""
    return np.ascontiguousarray(values, dtype=dtype)

"""Makes the maps of a finished fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.avatar.exact import signed_distances
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.garment.part import GarmentPart
from warp_cloth.maps.girths import garment_girths
from warp_cloth.maps.kinds import MAPS, shown_range
from warp_cloth.maps.levels import body_levels
from warp_cloth.maps.strain import face_strains, vertex_areas, vertex_means
from warp_cloth.model.result import FitMaps

PASCALS = 1e3  # in a kPa
MILLIMETRES = 1e3  # in a metre

Floats = NDArray[np.float64]


def map_summary(maps: FitMaps, names: Sequence[str]) -> dict[str, Any]:
    """Unit, colour range and percentiles of each map, for the report; ``names`` are those of the garments."""
    summary: dict[str, Any] = {}
    for kind in (MAPS[name] for name in maps.ranges):
        garments = {
            garment: percentiles(fields[kind.name])
            for garment, fields in zip(names, maps.fields, strict=True)
            if kind.name in fields
        }
        summary[kind.name] = {"unit": kind.unit, "range": list(maps.ranges[kind.name]), "garments": garments}
    return summary


def percentiles(values: NDArray[np.float32]) -> dict[str, float]:
    """Least, 2nd, 50th and 98th percentile, greatest and mean of a map."""
    shares = dict(zip(("p2", "p50", "p98"), np.percentile(values, (2, 50, 98)).tolist(), strict=True))
    return {"min": float(values.min()), **shares, "max": float(values.max()), "mean": float(values.mean())}


def check_maps(names: Sequence[str], *, has_avatar: bool, asked: str = "--maps") -> tuple[str, ...]:
    """The maps that a scene can have; InputError where every one asked for needs an avatar that is not there."""
    possible = tuple(name for name in names if has_avatar or not MAPS[name].needs_avatar)
    if names and not possible:
        raise InputError(asked, f"{', '.join(names)}: the scene has no avatar", "add an [avatar], or ask for strain")
    return possible


def measure_maps(
    names: Sequence[str],
    *,
    parts: Sequence[GarmentPart],
    worn: Sequence[Points],
    pushes: Sequence[Floats] | None,
    avatar: Mesh | None,
    garment_names: Sequence[str],
    device: str,
    girths: bool = True,
) -> FitMaps:
    """Maps by name (see ``kinds.MAPS``) of garments as worn.

    Args:
        names: the maps.
        parts: rest shapes of the garments.
        worn: their points [m], shape [V, 3] each.
        pushes: contact force of each vertex on the avatar [N], shape [V] each; None: no contact.
        avatar: the body, for ease and girths.
        garment_names: for the girths.
        device: where distances are measured.
        girths: whether the body's levels are looked for, and girths taken there.
    """
    fields: list[dict[str, NDArray[np.float32]]] = []
    notes: list[str] = []
    for index, (part, points) in enumerate(zip(parts, worn, strict=True)):
        push = None if pushes is None else pushes[index]
        values = _values(names, part, points, push, avatar, device)
        missing = [name for name in names if name not in values and MAPS[name].needs_warp]
        if missing:
            notes.append(f'"{garment_names[index]}" does not tell its warp: no {", ".join(missing)}')
        fields.append({name: values[name].astype(np.float32) for name in names if name in values})
    made = [name for name in names if any(name in of_garment for of_garment in fields)]
    ranges = {name: shown_range(MAPS[name], [field[name] for field in fields if name in field]) for name in made}
    levels = body_levels(avatar) if avatar is not None and girths else None
    taken: list[dict[str, Any]] = []
    if "ease" in names and avatar is not None and girths and levels is None:
        notes.append("no girths: the avatar is no standing body with head and feet and arms apart from its trunk")
    if avatar is not None and levels is not None:
        for name, part, points in zip(garment_names, parts, worn, strict=True):
            taken += garment_girths(name, points, part.rest.sheet, avatar, levels)
    return FitMaps(tuple(fields), ranges, tuple(taken), tuple(notes))


def _values(
    names: Sequence[str], part: GarmentPart, points: Points, push: Floats | None, avatar: Mesh | None, device: str
) -> dict[str, Floats]:
    """Every map that can be made of one garment, among those asked for; shape [V] each."""
    values: dict[str, Floats] = {}
    sheet = part.rest.sheet
    if sheet is not None and any(name in ("strain", "shear") or name.startswith("strain_") for name in names):
        for name, of_faces in face_strains(points, sheet).items():
            values[name] = vertex_means(of_faces, sheet.areas, sheet.triangles, len(points))
    if "pressure" in names and avatar is not None:
        area = np.maximum(vertex_areas(points, part.triangles), np.finfo(float).tiny)
        values["pressure"] = np.zeros(len(points)) if push is None else push / area / PASCALS
    if "ease" in names and avatar is not None:
        values["ease"] = MILLIMETRES * signed_distances(points, avatar, device).astype(np.float64)
    return values

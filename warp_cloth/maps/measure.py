"""Measures the maps of a finished fit: strain, pressure, gap; and girths of any fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.anatomy.stored_body import stored_levels
from warp_cloth.avatar.exact import signed_distances
from warp_cloth.avatar.solid import closing_of
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.garment.garment import Garment
from warp_cloth.maps.girths import TrunkLevels, garment_girths
from warp_cloth.maps.kinds import MAPS, shown_range
from warp_cloth.material.strain import face_strains, vertex_areas, vertex_means
from warp_cloth.model.result import FitMaps, FitResult, WornGarment

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
    """Minimum, 2nd, 50th and 98th percentile, maximum and mean of a map."""
    quantiles = dict(zip(("p2", "p50", "p98"), np.percentile(values, (2, 50, 98)).tolist(), strict=True))
    return {"min": float(values.min()), **quantiles, "max": float(values.max()), "mean": float(values.mean())}


def check_maps(names: Sequence[str], *, has_avatar: bool) -> tuple[str, ...]:
    """Those maps that a scene can have; InputError where none can be had without an avatar."""
    possible = tuple(name for name in names if has_avatar or not MAPS[name].needs_avatar)
    if names and not possible:
        raise InputError("maps", f"{', '.join(names)}: the scene has no avatar", "add an [avatar], or choose strain")
    return possible


def measure_maps(
    names: Sequence[str],
    *,
    garments: Sequence[Garment],
    worn: Sequence[Points],
    normal_forces: Sequence[Floats] | None,
    avatar: Mesh | None,
    garment_names: Sequence[str],
    device: str,
) -> FitMaps:
    """Measures maps (see ``kinds.MAPS``) of garments as worn.

    Args:
        names: of the maps.
        garments: with their rest shapes.
        worn: points of each garment [m], shape [V, 3].
        normal_forces: of each garment's vertices on the avatar [N], shape [V]; None: no contact.
        avatar: the body, for gaps.
        garment_names: for notes.
        device: on which distances are measured.
    """
    fields: list[dict[str, NDArray[np.float32]]] = []
    notes: list[str] = []
    for index, (garment, points) in enumerate(zip(garments, worn, strict=True)):
        forces = None if normal_forces is None else normal_forces[index]
        values = _values(names, garment, points, forces, avatar, device)
        missing = [name for name in names if name not in values and MAPS[name].needs_warp]
        if missing:
            notes.append(f'"{garment_names[index]}" has no warp direction, and so no {", ".join(missing)}')
        fields.append({name: values[name].astype(np.float32) for name in names if name in values})
    measured = [name for name in names if any(name in of_garment for of_garment in fields)]
    ranges = {name: shown_range(MAPS[name], [field[name] for field in fields if name in field]) for name in measured}
    return FitMaps(tuple(fields), ranges, tuple(notes))


@dataclass(frozen=True, eq=False)
class MeasuredBody:
    """A body with what girths are measured against; the same for all garments on it."""

    avatar: Mesh
    trunk: TrunkLevels | None  # with chest, waist or hip; None: it does not stand

    @classmethod
    def of(cls, avatar: Mesh) -> MeasuredBody:
        surface = closing_of(avatar).surface(avatar)
        levels = stored_levels(surface)
        return cls(avatar, None if levels is None else TrunkLevels(surface, levels))


def measured_girths(garments: Sequence[WornGarment], body: MeasuredBody | None) -> tuple[list[dict[str, Any]], str]:
    """Girths of body and worn garments at chest, waist and hip [mm], and why there are none, if so."""
    if body is None:
        return [], "there is no body"
    if not all(np.isfinite(worn.points).all() for worn in garments):
        return [], "the garment's shape is not finite"
    if body.trunk is None:
        return [], "the body does not stand with its head, its feet, and arms apart from its trunk"
    rows: list[dict[str, Any]] = []
    closed: list[str] = []
    for worn in garments:
        sheet = worn.rest.sheet if worn.rest is not None else None
        if sheet is not None and not sheet.topology.boundary_loops:
            closed.append(worn.name)
            continue
        rows += garment_girths(worn.name, worn.points, sheet, body.trunk)
    lack = "no garment goes round the trunk at chest, waist or hip"
    if closed:
        lack = f'"{closed[0]}" is modelled with its thickness, so that a section has its inside and its outside'
    return rows, "" if rows else lack


def add_girths(fit: FitResult, body: MeasuredBody | None = None) -> None:
    """Measures the girths of a fit, once, into its report: they take a while that not every caller has.

    ``body`` is that of the fit's avatar, where it is known.
    """
    if "girths_mm" not in fit.report:
        fit.report.update(girth_report(fit, body))


def girth_report(fit: FitResult, body: MeasuredBody | None = None) -> dict[str, Any]:
    """What the report of a fit is to say of girths; ``body`` as for ``add_girths``."""
    known = body or (None if fit.avatar is None else MeasuredBody.of(fit.avatar))
    rows, lack = measured_girths(fit.garments, known)
    return {"girths_mm": rows, **({"no_girths": lack} if lack and fit.avatar is not None else {})}


def _values(
    names: Sequence[str], garment: Garment, points: Points, forces: Floats | None, avatar: Mesh | None, device: str
) -> dict[str, Floats]:
    """The maps of one garment, as far as it can have them; shape [V] each."""
    values: dict[str, Floats] = {}
    sheet = garment.rest.sheet
    if sheet is not None and any(name in ("strain", "shear") or name.startswith("strain_") for name in names):
        for name, of_faces in face_strains(points, sheet).items():
            values[name] = vertex_means(of_faces, sheet.areas, sheet.triangles, len(points))
    if "pressure" in names and avatar is not None:
        area = np.maximum(vertex_areas(points, garment.triangles), np.finfo(float).tiny)
        values["pressure"] = np.zeros(len(points)) if forces is None else forces / area / PASCALS
    if "gap" in names and avatar is not None:
        values["gap"] = MILLIMETRES * signed_distances(points, avatar, device).astype(np.float64)
    return values

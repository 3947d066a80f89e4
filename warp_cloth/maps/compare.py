"""The difference between two fits: two sizes, fabrics or bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.avatar.exact import closest_faces
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.maps.kinds import MAPS, difference_of, shown_range
from warp_cloth.maps.read import WrittenFit
from warp_cloth.model.result import WornGarment, matched

# Garments without mesh or panels in common are one garment if at most MOST_APART of either is farther from the other
# than APART of the larger extent: another size, or the same on another body, lies nearer, a skirt and a shirt do not.
APART, MOST_APART = 0.1, 0.25


@dataclass(frozen=True, eq=False)
class Comparison:
    """The second fit minus the first, on the garments of the first."""

    garments: tuple[WornGarment, ...]  # fields: NAME_difference
    ranges: dict[str, tuple[float, float]]
    girths: tuple[dict[str, Any], ...]  # of both fits at each level [mm]
    pairs: tuple[tuple[WornGarment, WornGarment], ...]  # of the first fit and of the second
    notes: tuple[str, ...] = ()  # a sentence about each pair of garments that do not correspond


def compare_fits(first: WrittenFit, second: WrittenFit, *, device: str = "cpu") -> Comparison:
    """Differences of every map that both fits have; garments are matched by name, or else by order.

    Garments of one mesh are compared vertex by vertex. Otherwise a vertex of the first is compared with the nearest
    point of the second as worn; ``notes`` say so where they are not sizes of one pattern either.

    Raises:
        InputError: there are no maps in common, or garments that have neither mesh nor panels in common lie apart.
    """
    if not (first.garments and second.garments):
        lacking = " and ".join(fit.name for fit in (first, second) if not fit.garments)
        note = f"no maps in {lacking}: only figures are compared; fit with --maps all for pictures of the difference"
        return Comparison((), {}, _girths(first.report, second.report, {}), (), (note,))
    if len(first.garments) != len(second.garments):
        problem = f"have {len(first.garments)} and {len(second.garments)} garments"
        raise InputError(f"{first.name}, {second.name}", problem, "compare fits with the same number of garments")
    chosen = matched([worn.name for worn in second.garments], [worn.name for worn in first.garments])
    others = [second.garments[index] for index in chosen or ()]
    garments, notes = [], []
    for one, other in zip(first.garments, others, strict=True):
        if not _same_pattern(one.mesh, other.mesh):
            _refuse_unrelated(first.name, one, second.name, other, device)
            both = f'"{one.name}" of {first.name} and "{other.name}" of {second.name}'
            notes.append(f"{both} have neither mesh nor panels in common: the nearest points are compared")
        shared = [name for name in one.fields if name in other.fields]
        if not shared:
            raise InputError(one.name, "there is no map that both fits have", "make both fits with --maps all")
        values = _values_at(one, other, shared, device)
        fields = {difference_of(MAPS[name]).name: values[name] - one.fields[name] for name in shared}
        garments.append(WornGarment(one.name, one.mesh, one.points, one.thickness, fields=fields))
    names = dict.fromkeys(name for worn in garments for name in worn.fields)
    kinds = [difference_of(kind) for kind in MAPS.values()]
    ranges = {
        kind.name: shown_range(kind, [worn.fields[kind.name] for worn in garments if kind.name in worn.fields])
        for kind in kinds
        if kind.name in names
    }
    names_in_first = {other.name: one.name for one, other in zip(first.garments, others, strict=True)}
    girths = _girths(first.report, second.report, names_in_first)
    return Comparison(tuple(garments), ranges, girths, tuple(zip(first.garments, others, strict=True)), tuple(notes))


def _same_mesh(one: Mesh, other: Mesh) -> bool:
    return one.vertex_count == other.vertex_count and np.array_equal(one.triangles, other.triangles)


def _same_pattern(one: Mesh, other: Mesh) -> bool:
    """Whether meshes are the same, or have panels of the same names, as sizes of one pattern."""
    panels = set(one.panel_names)
    return _same_mesh(one, other) or (len(panels) > 0 and panels == set(other.panel_names))


def _refuse_unrelated(first: str, one: WornGarment, second: str, other: WornGarment, device: str) -> None:
    """Refuses garments of which a part lies far from the other, so that no point there has a counterpart."""
    extent = max(float(np.ptp(each.points, axis=0).max()) for each in (one, other))
    for near, far in ((one, other), (other, one)):
        distance = _nearest(near.points, far, device)[0]
        apart = float(np.mean(distance > APART * extent))
        if apart > MOST_APART:
            problem = (
                f'"{one.name}" and "{other.name}" are not one garment: they share neither mesh nor panels, and '
                f'{100 * apart:.0f} % of "{near.name}" is more than {100 * APART * extent:.0f} cm from the other'
            )
            raise InputError(f"{first}, {second}", problem, "compare a garment in two sizes, fabrics or bodies")


def _nearest(
    points: Points, other: WornGarment, device: str
) -> tuple[NDArray[np.float32], NDArray[np.int32], NDArray[np.float32]]:
    """Distance [m] to a worn garment, its nearest face and the place there; shapes [V], [V] and [V, 3]."""
    found, face, weight = closest_faces(other.points, other.mesh.triangles, points, device)
    return np.linalg.norm(found - points.astype(np.float32), axis=1), face, weight


def _values_at(
    one: WornGarment, other: WornGarment, names: Sequence[str], device: str
) -> dict[str, NDArray[np.float32]]:
    """The other garment's values at the vertices of this one, shape [V] each."""
    if _same_mesh(one.mesh, other.mesh):
        return {name: other.fields[name] for name in names}
    _, face, weights = _nearest(one.points, other, device)
    corners = other.mesh.triangles[face]
    return {name: (other.fields[name][corners] * weights).sum(axis=1).astype(np.float32) for name in names}


def _girths(
    first: dict[str, Any], second: dict[str, Any], names_in_first: Mapping[str, str]
) -> tuple[dict[str, Any], ...]:
    """Girths of both reports by garment and level.

    ``names_in_first`` maps the name of each garment of the second fit to its name in the first.
    """
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    for place, report in (("first", first), ("second", second)):
        for row in report.get("girths_mm") or ():
            garment = str(row.get("garment"))
            key = (garment if place == "first" else names_in_first.get(garment, garment), str(row.get("level")))
            entry = rows.setdefault(key, {"garment": key[0], "level": key[1], "first": None, "second": None})
            entry[place] = {kind: row.get(kind) for kind in ("body_girth", "garment_girth", "natural_girth", "ease")}
    return tuple(rows.values())

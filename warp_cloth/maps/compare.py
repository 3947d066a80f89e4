"""The difference between two fits: of sizes, fabrics or bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.kernels.avatar.nearest import find_nearest
from warp_cloth.maps.kinds import MAPS, difference_of, shown_range
from warp_cloth.maps.read import WrittenFit
from warp_cloth.model.result import WornGarment, matched


@dataclass(frozen=True, eq=False)
class Comparison:
    """The second fit less the first, on the first one's garments."""

    garments: tuple[WornGarment, ...]  # fields: NAME_difference
    ranges: dict[str, tuple[float, float]]
    girths: tuple[dict[str, Any], ...]  # of both fits at each level [mm]
    notes: tuple[str, ...] = ()  # what does not correspond, a sentence each


def compare_fits(first: WrittenFit, second: WrittenFit, *, device: str = "cpu") -> Comparison:
    """Differences of every map that both fits have, garment by garment: by their names, or else in their order.

    Garments of one mesh are compared vertex by vertex; otherwise a vertex of the first is compared with the nearest
    point of the second as worn, which ``notes`` tell where they are not sizes of one pattern either.
    """
    if len(first.garments) != len(second.garments):
        problem = f"{len(first.garments)} garments against {len(second.garments)}"
        raise InputError(f"{first.name}, {second.name}", problem, "compare fits of as many garments")
    chosen = matched([worn.name for worn in second.garments], [worn.name for worn in first.garments])
    others = [second.garments[at] for at in chosen or ()]
    garments, notes = [], []
    for one, other in zip(first.garments, others, strict=True):
        if not _same_pattern(one.mesh, other.mesh):
            both = f'"{one.name}" of {first.name} and "{other.name}" of {second.name}'
            notes.append(f"{both} have neither mesh nor panels in common: compared is what lies nearest")
        shared = [name for name in one.fields if name in other.fields]
        if not shared:
            problem = "no map that both fits have"
            raise InputError(one.name, problem, "make both fits with --maps all")
        values = _carried(one, other, shared, device)
        fields = {difference_of(MAPS[name]).name: values[name] - one.fields[name] for name in shared}
        garments.append(WornGarment(one.name, one.mesh, one.points, one.thickness, fields=fields))
    names = dict.fromkeys(name for worn in garments for name in worn.fields)
    kinds = [difference_of(kind) for kind in MAPS.values()]
    ranges = {
        kind.name: shown_range(kind, [worn.fields[kind.name] for worn in garments if kind.name in worn.fields])
        for kind in kinds
        if kind.name in names
    }
    called = {other.name: one.name for one, other in zip(first.garments, others, strict=True)}
    return Comparison(tuple(garments), ranges, _girths(first.report, second.report, called), tuple(notes))


def _same_mesh(one: Mesh, other: Mesh) -> bool:
    return one.vertex_count == other.vertex_count and np.array_equal(one.triangles, other.triangles)


def _same_pattern(one: Mesh, other: Mesh) -> bool:
    """Whether meshes are the same, or have panels of the same names, as sizes of one pattern."""
    panels = set(one.panel_names)
    return _same_mesh(one, other) or (len(panels) > 0 and panels == set(other.panel_names))


def _carried(one: WornGarment, other: WornGarment, names: Sequence[str], device: str) -> dict[str, NDArray[np.float32]]:
    """The other's values at the vertices of the first, shape [V] each."""
    if _same_mesh(one.mesh, other.mesh):
        return {name: other.fields[name] for name in names}
    mesh = wp.Mesh(
        points=wp.array(other.points.astype(np.float32), dtype=wp.vec3f, device=device),
        indices=wp.array(other.mesh.triangles.ravel(), dtype=wp.int32, device=device),
    )
    points = wp.array(one.points.astype(np.float32), dtype=wp.vec3f, device=device)
    face = wp.empty(len(points), dtype=wp.int32, device=device)
    weight = wp.zeros(len(points), dtype=wp.vec3f, device=device)
    wp.launch(find_nearest, dim=len(points), inputs=[mesh.id, points, face, weight], device=device)
    corners = other.mesh.triangles[face.numpy()]
    share = weight.numpy()
    return {name: (other.fields[name][corners] * share).sum(axis=1).astype(np.float32) for name in names}


def _girths(first: dict[str, Any], second: dict[str, Any], called: Mapping[str, str]) -> tuple[dict[str, Any], ...]:
    """Rows of both reports by garment and level: the first's, the second's.

    ``called`` is what the first calls each garment of the second.
    """
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    for place, report in (("first", first), ("second", second)):
        for row in report.get("girths_mm") or ():
            garment = str(row.get("garment"))
            key = (garment if place == "first" else called.get(garment, garment), str(row.get("level")))
            entry = rows.setdefault(key, {"garment": key[0], "level": key[1], "first": None, "second": None})
            entry[place] = {kind: row.get(kind) for kind in ("body_girth", "garment_girth", "natural_girth", "ease")}
    return tuple(rows.values())

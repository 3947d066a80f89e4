"""The difference between two fits: of sizes, fabrics or bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.errors import InputError
from warp_cloth.kernels.nearest import find_nearest
from warp_cloth.loading.result import WrittenFit
from warp_cloth.maps.kinds import MAPS, difference_of, shown_range
from warp_cloth.result import WornGarment


@dataclass(frozen=True, eq=False)
class Comparison:
    """The second fit less the first, on the first one's garments."""

    garments: tuple[WornGarment, ...]  # fields: NAME_difference
    ranges: dict[str, tuple[float, float]]
    girths: tuple[dict[str, Any], ...]  # of both fits at each level [mm]


def compare_fits(first: WrittenFit, second: WrittenFit, *, device: str = "cpu") -> Comparison:
    """Differences of every map that both fits have, garment by garment in their order.

    Garments of one mesh are compared vertex by vertex; otherwise a vertex of the first is compared with the nearest
    point of the second as worn.
    """
    if len(first.garments) != len(second.garments):
        problem = f"{len(first.garments)} garments against {len(second.garments)}"
        raise InputError(f"{first.name}, {second.name}", problem, "compare fits of as many garments")
    garments = []
    for one, other in zip(first.garments, second.garments, strict=True):
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
    return Comparison(tuple(garments), ranges, _girths(first.report, second.report))


def _carried(one: WornGarment, other: WornGarment, names: Sequence[str], device: str) -> dict[str, NDArray[np.float32]]:
    """The other's values at the vertices of the first, shape [V] each."""
    if one.mesh.vertex_count == other.mesh.vertex_count and np.array_equal(one.mesh.triangles, other.mesh.triangles):
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


def _girths(first: dict[str, Any], second: dict[str, Any]) -> tuple[dict[str, Any], ...]:
    """Rows of both reports by garment and level: the first's, the second's."""
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    for place, report in (("first", first), ("second", second)):
        for row in report.get("girths_mm") or ():
            key = (str(row.get("garment")), str(row.get("level")))
            entry = rows.setdefault(key, {"garment": key[0], "level": key[1], "first": None, "second": None})
            entry[place] = {name: row.get(name) for name in ("body_girth", "garment_girth", "natural_girth", "ease")}
    return tuple(rows.values())

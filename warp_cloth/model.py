"""Device arrays of a scene's garments: what stays constant (ClothModel) and what an iteration changes (its cloth)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.elements import Elements, garment_elements, joined_elements
from warp_cloth.kernels.cloth import Terms, cloth_types
from warp_cloth.mesh import Indices, Points
from warp_cloth.rest import RestShape
from warp_cloth.topology import ragged_rows


@dataclass(frozen=True, eq=False)
class GarmentPart:
    """One garment as it enters the model: where it starts, its constants, its pins."""

    points: Points  # [m], shape [V, 3]
    triangles: Indices  # shape [F, 3]
    rest: RestShape
    pins: Indices  # pinned vertices


@dataclass(frozen=True, eq=False)
class ClothModel:
    """All garments, concatenated. A term that the scene does not use has no arrays (None).

    Forces act in edges and triangles, from which they are scattered or gathered per vertex (see the kernels). Hinges
    and weave are what the certificate measures.
    """

    device: str
    precision: str
    vertex_start: tuple[int, ...]  # first vertex of each garment, and the vertex count
    edge_start: tuple[int, ...]
    triangle_count: int
    hinge_count: int
    weave_count: int
    terms: Terms
    cloth: Any  # kernels.cloth Cloth
    edges: Any  # kernels.cloth Edges
    triangles: Any  # kernels.cloth Triangles
    hinges: Any | None  # kernels.cloth Hinges
    weave: Any | None  # kernels.cloth Weave
    stored_rows: Any | None  # kernels.cloth StoredRows, where forces are gathered

    @property
    def vertex_count(self) -> int:
        return self.vertex_start[-1]

    @property
    def edge_count(self) -> int:
        return self.edge_start[-1]

    @property
    def gathers(self) -> bool:
        """Whether forces are gathered per vertex rather than scattered per edge and triangle."""
        return self.stored_rows is not None

    def points(self) -> NDArray[np.float64]:
        """Positions now [m], shape [V, 3]. Waits for the device."""
        return np.array(self.cloth.position.numpy(), dtype=np.float64)

    def set_points(self, points: Points) -> None:
        """Moves every vertex to these positions [m], shape [V, 3], and forgets its momentum."""
        types = cloth_types(self.precision)
        self.cloth.position.assign(wp.array(points, dtype=types.point, device=self.device))
        self.cloth.move.zero_()

    def cloth_beside(self) -> Any:
        """The cloth with positions and moves of its own, for iterations that write beside what they read."""
        beside = cloth_types(self.precision).Cloth()
        beside.position, beside.move = wp.empty_like(self.cloth.position), wp.empty_like(self.cloth.move)
        beside.weight, beside.pinned = self.cloth.weight, self.cloth.pinned
        beside.stiffness = self.cloth.stiffness
        return beside


def build_model(
    parts: Sequence[GarmentPart], *, device: str, precision: str, gathers: bool | None = None
) -> ClothModel:
    """Concatenates garments and puts them on a device.

    ``gathers`` says how forces are summed; None: gathered on CUDA, scattered on the CPU, which is fastest on each.
    """
    types = cloth_types(precision)
    vertex_start = _starts([len(part.points) for part in parts])
    rests = [part.rest for part in parts]
    elements = joined_elements([garment_elements(part.triangles, part.rest) for part in parts], vertex_start)
    terms = Terms(
        edges=bool(elements.law[:, 1:].any()),
        folds=bool(elements.fold.any()),
        threads=any(rest.weave is not None for rest in rests),
        angles=bool((elements.rest[elements.fold != 0.0] != (1.0, 0.0)).any()),
    )

    def upload(array: NDArray[Any], dtype: Any) -> wp.array:
        return wp.array(np.ascontiguousarray(array), dtype=dtype, device=device)

    hinges, hinge_count = _hinges(types, upload, rests, vertex_start, terms.angles)
    weave, weave_count = _weave(types, upload, rests, vertex_start)
    gathered = wp.get_device(device).is_cuda if gathers is None else gathers
    return ClothModel(
        device=device,
        precision=precision,
        vertex_start=vertex_start,
        edge_start=_starts([len(rest.topology.edges) for rest in rests]),
        triangle_count=len(elements.corners),
        hinge_count=hinge_count,
        weave_count=weave_count,
        terms=terms,
        cloth=_cloth(types, upload, parts, vertex_start),
        edges=_edges(types, upload, elements, terms),
        triangles=_triangles(types, upload, elements, terms),
        hinges=hinges,
        weave=weave,
        stored_rows=_stored_rows(types, upload, elements, vertex_start[-1]) if gathered else None,
    )


def _edges(types: Any, upload: Any, elements: Elements, terms: Terms) -> Any:
    """Edges of all garments."""
    edges = types.Edges()
    edges.ends = upload(elements.ends, wp.vec2i)
    edges.law = upload(elements.law, types.vec3)
    if terms.folds:
        edges.beside = upload(elements.beside, wp.vec2i)
        edges.fold = upload(elements.fold, types.real)
    if terms.angles:
        edges.rest = upload(elements.rest, types.vec2)
    return edges


def _triangles(types: Any, upload: Any, elements: Elements, terms: Terms) -> Any:
    """Triangles with the arrays of the terms that there are."""
    triangles = types.Triangles()
    triangles.corners = upload(elements.corners, wp.vec3i)
    if terms.folds:
        triangles.edges = upload(elements.edges, wp.vec3i)
    if terms.threads:
        triangles.slope = upload(elements.slope, types.vec4)
        triangles.threads = upload(elements.threads, types.vec4)
    return triangles


def _hinges(
    types: Any, upload: Any, rests: Sequence[RestShape], vertex_start: tuple[int, ...], angles: bool
) -> tuple[Any | None, int]:
    """Hinges of all garments that are stiff, and their number."""
    stiffness = np.concatenate([rest.hinge_stiffness for rest in rests])
    used = stiffness > 0.0
    if not used.any():
        return None, 0
    hinges = types.Hinges()
    hinges.corners = upload(_shifted([rest.topology.hinges for rest in rests], vertex_start)[used], wp.vec4i)
    hinges.stiffness = upload(stiffness[used], types.real)
    if angles:
        angle = np.concatenate([rest.fold_angle for rest in rests])
        hinges.rest = upload(np.stack([np.cos(angle), np.sin(angle)], axis=1)[used], types.vec2)
    return hinges, int(used.sum())


def _weave(
    types: Any, upload: Any, rests: Sequence[RestShape], vertex_start: tuple[int, ...]
) -> tuple[Any | None, int]:
    """Woven triangles of all garments, and their number."""
    woven = [(rest.weave, first) for rest, first in zip(rests, vertex_start, strict=False) if rest.weave is not None]
    if not woven:
        return None, 0
    weave = types.Weave()
    weave.corners = upload(np.concatenate([shape.corners + first for shape, first in woven]), wp.vec3i)
    weave.slope = upload(np.concatenate([shape.slope for shape, _ in woven]), types.vec4)
    weave.law = upload(np.concatenate([shape.law for shape, _ in woven]), types.vec4)
    return weave, sum(len(shape.corners) for shape, _ in woven)


def _cloth(types: Any, upload: Any, parts: Sequence[GarmentPart], vertex_start: tuple[int, ...]) -> Any:
    """Vertices of all garments at rest where they are loaded."""
    count = vertex_start[-1]
    pinned = np.zeros(count, dtype=np.uint8)
    for part, first in zip(parts, vertex_start, strict=False):
        pinned[part.pins + first] = 1
    cloth = types.Cloth()
    cloth.position = upload(np.concatenate([part.points for part in parts]), types.point)
    cloth.move = upload(np.zeros((count, 3)), types.vec3)
    cloth.weight = upload(np.concatenate([part.rest.vertex_weight for part in parts]), types.real)
    cloth.stiffness = upload(np.zeros(count), types.real)
    cloth.pinned = upload(pinned, wp.uint8)
    return cloth


def _shifted(arrays: Sequence[Indices], starts: tuple[int, ...]) -> Indices:
    """Vertices of each garment as those of all."""
    return np.concatenate([array + first for array, first in zip(arrays, starts, strict=False)])


def _starts(counts: list[int]) -> tuple[int, ...]:
    return (0, *(int(end) for end in np.cumsum(counts)))


def _stored_rows(types: Any, upload: Any, elements: Elements, vertex_count: int) -> Any:
    """The edges and triangles at each vertex, in their order."""
    edges, triangles = np.arange(len(elements.ends)), np.arange(len(elements.corners))
    edge = np.stack([edges, -1 - edges], axis=1)
    # planes by corner: neighbouring threads write side by side
    slot = np.arange(3) * len(triangles) + triangles[:, None]
    rows = types.StoredRows()
    start, order = ragged_rows(elements.ends.ravel(), vertex_count)
    rows.edge_start = upload(start, wp.int32)
    rows.edge = upload(edge.ravel()[order].astype(np.int32), wp.int32)
    start, order = ragged_rows(elements.corners.ravel(), vertex_count)
    rows.start = upload(start, wp.int32)
    rows.slot = upload(slot.ravel()[order].astype(np.int32), wp.int32)
    return rows

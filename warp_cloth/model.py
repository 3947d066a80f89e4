"""Device arrays of a scene's garments: what stays constant (ClothModel) and what an iteration changes (its cloth)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.kernels.cloth import cloth_types
from warp_cloth.material import WeaveShape
from warp_cloth.mesh import Indices, Points
from warp_cloth.rest import Floats, RestShape
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

    Forces are scattered per edge and hinge or gathered per vertex (see the kernels); only the arrays of the one way
    are made, except ``edges`` and ``hinges``, which the certificate reads in both.
    """

    device: str
    precision: str
    vertex_start: tuple[int, ...]  # first vertex of each garment, and the vertex count
    edge_start: tuple[int, ...]
    triangle_count: int
    hinge_count: int
    cloth: Any  # kernels.cloth Cloth
    edges: Any  # kernels.cloth Edges
    pulling: Any | None  # those of the edges that pull, kernels.cloth Edges: not those of woven triangles
    pulling_count: int
    hinges: Any | None  # kernels.cloth Hinges
    weave: Any | None  # kernels.cloth Weave
    weave_count: int
    edge_rows: Any | None  # kernels.cloth EdgeRows, where forces are gathered
    stored_rows: Any | None  # kernels.cloth StoredRows, where forces are gathered; empty without hinges and weave

    @property
    def vertex_count(self) -> int:
        return self.vertex_start[-1]

    @property
    def edge_count(self) -> int:
        return self.edge_start[-1]

    @property
    def gathers(self) -> bool:
        """Whether forces are summed per vertex rather than scattered per edge."""
        return self.edge_rows is not None

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
    edge_start = _starts([len(part.rest.topology.edges) for part in parts])

    def joined(arrays: list[Any]) -> NDArray[Any]:
        return np.concatenate(arrays)

    def upload(array: NDArray[Any], dtype: Any) -> wp.array:
        return wp.array(np.ascontiguousarray(array), dtype=dtype, device=device)

    cloth = _cloth(types, upload, parts, vertex_start)

    def shifted(arrays: list[Indices]) -> Indices:
        return joined([array + first for array, first in zip(arrays, vertex_start, strict=False)])

    ends = shifted([part.rest.topology.edges for part in parts])
    rests = [part.rest for part in parts]
    length = joined([rest.edge_length for rest in rests])
    law = np.stack([length, joined([r.edge_pull for r in rests]), joined([r.edge_push for r in rests])], axis=1)
    edges = types.Edges()
    edges.ends = upload(ends, wp.vec2i)
    edges.law = upload(law, types.vec3)
    pulls = law[:, 1] > 0.0  # the edges of woven garments do not
    pulling = None
    if pulls.all():
        pulling = edges
    elif pulls.any():
        pulling = types.Edges()
        pulling.ends = upload(ends[pulls], wp.vec2i)
        pulling.law = upload(law[pulls], types.vec3)

    corners = shifted([rest.topology.hinges for rest in rests])
    stiffness = joined([rest.hinge_stiffness for rest in rests])
    used = stiffness > 0.0
    hinges = None
    if used.any():
        hinges = types.Hinges()
        hinges.corners = upload(corners[used], wp.vec4i)
        hinges.stiffness = upload(stiffness[used], types.real)

    woven = [(rest.weave, first) for rest, first in zip(rests, vertex_start, strict=False) if rest.weave is not None]
    threaded = joined([part.corners + first for part, first in woven]) if woven else np.zeros((0, 3), dtype=np.int32)
    weave = _weave(types, upload, threaded, [part for part, _ in woven]) if woven else None
    edge_rows = stored_rows = None
    if wp.get_device(device).is_cuda if gathers is None else gathers:
        edge_rows = _edge_rows(types, upload, ends[pulls], law[pulls], vertex_start[-1])
        stored_rows = _stored_rows(types, upload, [corners[used], threaded], vertex_start[-1])
    return ClothModel(
        device=device,
        precision=precision,
        vertex_start=vertex_start,
        edge_start=edge_start,
        triangle_count=sum(len(part.triangles) for part in parts),
        hinge_count=int(used.sum()),
        cloth=cloth,
        edges=edges,
        pulling=pulling,
        pulling_count=int(pulls.sum()),
        hinges=hinges,
        weave=weave,
        weave_count=len(threaded),
        edge_rows=edge_rows,
        stored_rows=stored_rows,
    )


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


def _weave(types: Any, upload: Any, corners: Indices, shapes: Sequence[WeaveShape]) -> Any:
    """Woven triangles of all garments."""
    weave = types.Weave()
    weave.corners = upload(corners, wp.vec3i)
    weave.slope = upload(np.concatenate([shape.slope for shape in shapes]), types.vec4)
    weave.law = upload(np.concatenate([shape.law for shape in shapes]), types.vec4)
    return weave


def _starts(counts: list[int]) -> tuple[int, ...]:
    return (0, *(int(end) for end in np.cumsum(counts)))


def _edge_rows(types: Any, upload: Any, ends: Indices, law: Floats, vertex_count: int) -> Any:
    """The edges at each vertex, in the order of the edges."""
    start, order = ragged_rows(ends.ravel(), vertex_count)
    rows = types.EdgeRows()
    rows.start = upload(start, wp.int32)
    rows.other = upload(ends[:, ::-1].ravel()[order], wp.int32)
    rows.law = upload(np.repeat(law, 2, axis=0)[order], types.vec3)
    return rows


def _stored_rows(types: Any, upload: Any, elements: list[Indices], vertex_count: int) -> Any:
    """The elements at each vertex: hinges in their order, then woven triangles in theirs; one array of corners each."""
    rows = types.StoredRows()
    if not any(len(corners) for corners in elements):
        return rows
    slots, first = [], 0
    for corners in elements:
        count, width = corners.shape
        # planes by corner: neighbouring threads write side by side
        slots.append(first + (np.arange(width) * count + np.arange(count)[:, None]).ravel())
        first += count * width
    start, order = ragged_rows(np.concatenate([corners.ravel() for corners in elements]), vertex_count)
    rows.start = upload(start, wp.int32)
    rows.slot = upload(np.concatenate(slots)[order].astype(np.int32), wp.int32)
    return rows

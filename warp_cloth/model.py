"""Device arrays of a scene's garments: what stays constant (ClothModel) and what an iteration changes (its cloth)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.kernels.cloth import cloth_types
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
    hinges: Any | None  # kernels.cloth Hinges
    edge_rows: Any | None  # kernels.cloth EdgeRows, where forces are gathered
    hinge_rows: Any | None  # kernels.cloth HingeRows, where forces are gathered; empty without bending
    rest_length: Floats  # of all edges, for reports [m]

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

    cloth = types.Cloth()
    cloth.position = upload(joined([part.points for part in parts]), types.point)
    cloth.move = wp.zeros(vertex_start[-1], dtype=types.vec3, device=device)
    cloth.weight = upload(joined([part.rest.vertex_weight for part in parts]), types.real)
    cloth.stiffness = wp.zeros(vertex_start[-1], dtype=types.real, device=device)
    pinned = np.zeros(vertex_start[-1], dtype=np.uint8)
    for part, first in zip(parts, vertex_start, strict=False):
        pinned[part.pins + first] = 1
    cloth.pinned = upload(pinned, wp.uint8)

    def shifted(arrays: list[Indices]) -> Indices:
        return joined([array + first for array, first in zip(arrays, vertex_start, strict=False)])

    ends = shifted([part.rest.topology.edges for part in parts])
    rests = [part.rest for part in parts]
    length = joined([rest.edge_length for rest in rests])
    law = np.stack([length, joined([r.edge_pull for r in rests]), joined([r.edge_push for r in rests])], axis=1)
    edges = types.Edges()
    edges.ends = upload(ends, wp.vec2i)
    edges.law = upload(law, types.vec3)

    corners = shifted([rest.topology.hinges for rest in rests])
    stiffness = joined([rest.hinge_stiffness for rest in rests])
    used = stiffness > 0.0
    bends = bool(used.any())
    hinges = None
    if bends:
        hinges = types.Hinges()
        hinges.corners = upload(corners[used], wp.vec4i)
        hinges.stiffness = upload(stiffness[used], types.real)

    gathers = wp.get_device(device).is_cuda if gathers is None else gathers
    hinge_rows = None
    if gathers:
        hinge_rows = _hinge_rows(types, upload, corners[used], vertex_start[-1]) if bends else types.HingeRows()
    return ClothModel(
        device=device,
        precision=precision,
        vertex_start=vertex_start,
        edge_start=edge_start,
        triangle_count=sum(len(part.triangles) for part in parts),
        hinge_count=int(used.sum()),
        cloth=cloth,
        edges=edges,
        hinges=hinges,
        edge_rows=_edge_rows(types, upload, ends, law, vertex_start[-1]) if gathers else None,
        hinge_rows=hinge_rows,
        rest_length=length,
    )


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


def _hinge_rows(types: Any, upload: Any, corners: Indices, vertex_count: int) -> Any:
    """The hinges at each vertex, in the order of the hinges."""
    start, order = ragged_rows(corners.ravel(), vertex_count)
    rows = types.HingeRows()
    rows.start = upload(start, wp.int32)
    slot = order % 4 * len(corners) + order // 4  # planes by corner: neighbouring threads write side by side
    rows.slot = upload(slot.astype(np.int32), wp.int32)
    return rows

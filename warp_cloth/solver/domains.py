"""A model cut into domains, each with all that its vertices' forces take."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices
from warp_cloth.garment.rest import Floats
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.model.model import ClothModel
from warp_cloth.model.vertices import part_of, reordered

Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Domain:
    """Vertices that one thread moves.

    ``model`` has the whole cloth, its vertices in the order of the domains, but only the edges and triangles that
    forces on the own vertices take. Sums at others' vertices are left unfinished, and are not read.
    """

    model: ClothModel
    span: slice  # of its vertices in that order
    vertices: Any  # kernels.base.types Model of these alone
    state: Any  # and State
    order: wp.array  # where they are in the model that was cut, shape [own]


def cut_model(model: ClothModel, count: int) -> list[Domain]:
    """Shares of about as much work, in slabs across one axis: that which doubles the least."""
    around = _Around(model)
    points = model.points()
    cuts = [around.slabs(points[:, axis], count) for axis in range(3)]
    owner = min(cuts, key=around.most_work)
    order = np.argsort(owner, kind="stable").astype(np.int32)
    place = np.empty_like(order)
    place[order] = np.arange(len(order), dtype=np.int32)
    ends = np.cumsum([0, *np.bincount(owner, minlength=count)]).tolist()
    where = wp.array(order, dtype=wp.int32, device=model.device)
    vertices, state = reordered(model.vertices, model.state, where)
    domains = []
    for number in range(count):
        span = slice(ends[number], ends[number + 1])
        own = wp.array(order[span], dtype=wp.int32, device=model.device)
        part = around.part(owner == number, place, vertices, state)
        domains.append(Domain(part, span, *part_of(vertices, state, span), own))
    return domains


class _Around:
    """Which edges and triangles lie around vertices."""

    def __init__(self, model: ClothModel) -> None:
        self._model = model
        self._ends, self._corners = model.edges.ends.numpy(), model.triangles.corners.numpy()
        self._bends = model.terms.folds
        if self._bends:
            self._signed, self._beside = model.triangles.edges.numpy(), model.edges.adjacent_triangles.numpy()
            self._sides = np.where(self._signed < 0, -1 - self._signed, self._signed)
            self._hinged = model.edges.hinge_stiffness.numpy() != 0

    def slabs(self, height: Floats, count: int) -> Indices:
        """Which of as many slabs, of as many vertices each, every vertex is in."""
        rank = np.empty(len(height), dtype=np.int64)
        rank[np.argsort(height, kind="stable")] = np.arange(len(height))
        return (rank * count // len(height)).astype(np.int32)

    def most_work(self, owner: Indices) -> int:
        """Elements of the domain that has most of them."""
        return max(
            sum(int(flags.sum()) for flags in self._needed(owner == number)) for number in range(int(owner.max()) + 1)
        )

    def _needed(self, own: Flags) -> tuple[Flags, Flags]:
        """Edges and triangles that the forces on some vertices take."""
        edges = own[self._ends].any(axis=1)
        triangles = own[self._corners].any(axis=1)
        if self._bends:  # also the hinges of those triangles, and the triangles of these
            edges[self._sides[triangles]] = True
            triangles[self._beside[edges & self._hinged]] = True
        return edges, triangles

    def part(self, own: Flags, place: Indices, vertices: Any, state: Any) -> ClothModel:
        """The model of these vertices' elements, in their order; vertices are at ``place``."""
        model, types, device = self._model, cloth_types(self._model.precision), self._model.device
        needed, near = self._needed(own)
        edge_at, triangle_at = _numbered(needed), _numbered(near)

        def some(array: wp.array, kept: Flags) -> wp.array:
            return wp.array(np.ascontiguousarray(array.numpy()[kept]), dtype=array.dtype, device=device)

        edges, triangles = types.Edges(), types.Triangles()
        edges.ends = wp.array(place[self._ends[needed]], dtype=wp.vec2i, device=device)
        edges.spring = some(model.edges.spring, needed)
        triangles.corners = wp.array(place[self._corners[near]], dtype=wp.vec3i, device=device)
        if self._bends:
            edges.hinge_stiffness = some(model.edges.hinge_stiffness, needed)
            edges.adjacent_triangles = wp.array(triangle_at[self._beside[needed]], dtype=wp.vec2i, device=device)
            at = edge_at[self._sides[near]]
            triangles.edges = wp.array(np.where(self._signed[near] < 0, -1 - at, at), dtype=wp.vec3i, device=device)
        if model.terms.angles:
            edges.rest = some(model.edges.rest, needed)
        if model.terms.hysteresis:
            edges.hysteresis = some(model.edges.hysteresis, needed)
        if model.terms.yarns:
            triangles.slope = some(model.triangles.slope, near)
            triangles.yarns = some(model.triangles.yarns, near)
        if model.terms.shear_hysteresis:
            triangles.shear_hysteresis = some(model.triangles.shear_hysteresis, near)
        return replace(
            model,
            vertices=vertices,
            state=state,
            edges=edges,
            triangles=triangles,
            edge_start=(0, int(needed.sum())),
            triangle_count=int(near.sum()),
        )


def _numbered(kept: Flags) -> Indices:
    """Number of each that is kept among those, and 0 for the others, whose forces are not read."""
    return np.where(kept, np.cumsum(kept) - 1, 0).astype(np.int32)

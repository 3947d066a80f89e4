"""Device arrays of a scene's garments: what stays constant (ClothModel) and what an iteration changes (its state)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.base.cache import Cache
from warp_cloth.base.mesh import Points
from warp_cloth.garment.elements import Elements, elements_of, garment_elements, winding_of
from warp_cloth.garment.garment import Garment, terms_of
from warp_cloth.garment.rest import RestShape
from warp_cloth.kernels.base.options import Terms
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.material.constants import YarnConstants
from warp_cloth.model.patches.on_device import CutOptions, Patches, PatchSource, device_patches
from warp_cloth.model.upload import upload_concatenated
from warp_cloth.model.vertices import AvatarSkin, build_state, build_vertices

USUAL_CUT = CutOptions()


@dataclass(frozen=True, eq=False)
class ClothModel:
    """All garments of all items, concatenated. A term that no scene uses has no arrays (None).

    An item is one fit. Nothing in the arithmetic of its vertices depends on what else is there.

    Forces act in edges and triangles, from which they are scattered or gathered by vertex (see the kernels). Hinges
    and weave are what the certificate measures.
    """

    device: str
    precision: str
    item_start: tuple[int, ...]  # first vertex of each item, and the vertex count
    vertex_start: tuple[int, ...]  # first vertex of each garment, and the vertex count
    edge_start: tuple[int, ...]
    triangle_count: int
    hinge_count: int
    weave_start: tuple[int, ...]  # first woven triangle of each garment, and their number
    terms: Terms
    avatars: tuple[AvatarSkin, ...]  # of each item
    vertices: Any  # kernels.base.types Model
    state: Any  # kernels.base.types State
    edges: Any  # kernels.base.types Edges
    triangles: Any  # kernels.base.types Triangles
    hinges: Any | None  # kernels.base.types Hinges
    weave: Any | None  # kernels.base.types Weave
    patches: Patches | None  # where forces are gathered patch by patch
    garments: tuple[Elements, ...]  # the elements of each, as the host has them

    @property
    def vertex_count(self) -> int:
        return self.vertex_start[-1]

    @property
    def edge_count(self) -> int:
        return self.edge_start[-1]

    @property
    def item_count(self) -> int:
        return len(self.item_start) - 1

    @property
    def weave_count(self) -> int:
        return self.weave_start[-1]

    def of_item(self, item: int, starts: tuple[int, ...] | None = None) -> slice:
        """The vertices of an item, or what else ``starts`` counts by garment."""
        first, last = self.item_start[item], self.item_start[item + 1]
        if starts is None:
            return slice(first, last)
        return slice(starts[self.vertex_start.index(first)], starts[self.vertex_start.index(last)])

    def points(self, item: int | None = None) -> NDArray[np.float64]:
        """Positions now [m] of all vertices or of an item's, shape [V, 3]. Waits for the device."""
        position = self.state.position if item is None else self.state.position[self.of_item(item)]
        return np.array(position.numpy(), dtype=np.float64)

    def to_device(self, points: Points) -> wp.array:
        """Positions [m], shape [V, 3], on the device, as ``set_points`` takes them for several items."""
        return wp.array(points, dtype=cloth_types(self.precision).point, device=self.device)

    def set_points(self, points: Points | wp.array, item: int = 0) -> None:
        """Moves an item's vertices to these positions [m], shape [V, 3], and forgets their momentum."""
        part = self.of_item(item)
        there = points if isinstance(points, wp.array) else self.to_device(points)
        wp.copy(self.state.position[part], there)
        self.state.displacement[part].zero_()
        self.forget_clearance(item)

    def forget_clearance(self, item: int) -> None:
        """Discards the known distances of an item's vertices to the avatar, after it or they were moved."""
        if self.state.clearance:
            self.state.clearance[self.of_item(item)].zero_()


def build_model(
    garments: Sequence[Garment],
    *,
    device: str,
    precision: str,
    gathers: bool | None = None,
    garment_counts: Sequence[int] | None = None,
    avatars: Sequence[AvatarSkin] | None = None,
    cache: Cache | None = None,
    cut: CutOptions = USUAL_CUT,
) -> ClothModel:
    """Concatenates garments and puts them on a device.

    Args:
        garments: of all items, those of one item together.
        device: Warp's name of it.
        precision: of the arithmetic, see kernels.base.types.
        gathers: how forces are summed; None: gathered on CUDA, scattered on the CPU, which is fastest on each.
        garment_counts: number of garments of each item; None: all belong to one item.
        avatars: how each item's avatar meets cloth; None: there is no avatar.
        cache: what earlier models of the same garments have left.
        cut: how patches are cut.
    """
    types = cloth_types(precision)
    vertex_start = _starts([len(garment.points) for garment in garments])
    rests = [garment.rest for garment in garments]
    cache = cache or Cache()
    elements, rounded = _elements(garments, precision, cache)
    terms = terms_of(garments)
    upload = partial(upload_concatenated, device=device)

    edge_start = _starts([len(rest.topology.edges) for rest in rests])
    triangle_start = _starts([len(garment.triangles) for garment in garments])
    item_start = tuple(vertex_start[first] for first in _starts(list(garment_counts or [len(garments)])))
    avatars = avatars or [AvatarSkin()] * (len(item_start) - 1)
    hinges, hinge_count = _hinges(types, upload, rests, vertex_start, terms, cache)
    weave = _weave(types, upload, rests, vertex_start, terms, cache)
    patches = None
    if wp.get_device(device).is_cuda if gathers is None else gathers:
        points = [garment.points for garment in garments]
        source = PatchSource(elements, rounded, points, terms, item_start, cut)
        patches = device_patches(source, types, device, cache)
    return ClothModel(
        device=device,
        precision=precision,
        item_start=item_start,
        vertex_start=vertex_start,
        edge_start=edge_start,
        triangle_count=triangle_start[-1],
        hinge_count=hinge_count,
        weave_start=_starts([0 if rest.yarns is None else len(rest.yarns.corners) for rest in rests]),
        terms=terms,
        avatars=tuple(avatars),
        vertices=build_vertices(precision, garments, item_start, avatars, device),
        state=build_state(precision, garments, device),
        edges=_edges(types, upload, rounded, vertex_start, triangle_start, terms),
        triangles=_triangles(types, upload, rounded, vertex_start, edge_start, terms),
        hinges=hinges,
        weave=weave,
        patches=patches,
        garments=tuple(elements),
    )


def _elements(garments: Sequence[Garment], precision: str, cache: Cache) -> tuple[list[Elements], list[Elements]]:
    """Edges and triangles of each garment, in float64 and as the device has them."""
    topologies = [(garment.triangles, garment.rest.topology) for garment in garments]
    wound = cache.get_or_make_each("winding", topologies, winding_of)
    sources = [(garment.triangles, garment.rest, winding) for garment, winding in zip(garments, wound, strict=True)]
    elements = cache.get_or_make_each("elements", sources, garment_elements)
    round_to = partial(elements_of, real=wp.dtype_to_numpy(cloth_types(precision).real))
    return elements, cache.get_or_make_each("rounded elements", [(each,) for each in elements], round_to, precision)


def _edges(
    types: Any,
    upload: Any,
    garments: Sequence[Elements],
    vertex_start: tuple[int, ...],
    triangle_start: tuple[int, ...],
    terms: Terms,
) -> Any:
    """Edges of all garments; ``upload`` is ``upload_concatenated`` to their device."""
    edges = types.Edges()
    edges.ends = upload([each.ends for each in garments], wp.vec2i, starts=vertex_start)
    edges.spring = upload([each.spring for each in garments], types.vec3)
    if terms.folds:
        edges.adjacent_triangles = upload(
            [each.adjacent_triangles for each in garments], wp.vec2i, starts=triangle_start
        )
        edges.hinge_stiffness = upload([each.hinge_stiffness for each in garments], types.real)
    if terms.angles:
        edges.rest = upload([each.rest for each in garments], types.vec2)
    if terms.hysteresis:
        edges.hysteresis = upload([each.hysteresis for each in garments], types.vec4)
    return edges


def _triangles(
    types: Any,
    upload: Any,
    garments: Sequence[Elements],
    vertex_start: tuple[int, ...],
    edge_start: tuple[int, ...],
    terms: Terms,
) -> Any:
    """Triangles of all garments, with the arrays of the terms in use."""
    triangles = types.Triangles()
    triangles.corners = upload([each.corners for each in garments], wp.vec3i, starts=vertex_start)
    if terms.folds:
        triangles.edges = upload([each.edges for each in garments], wp.vec3i, starts=edge_start, signed=True)
    if terms.yarns:
        triangles.slope = upload([each.slope for each in garments], types.vec4)
        triangles.yarns = upload([each.yarns for each in garments], types.vec4)
    if terms.shear_hysteresis:
        triangles.shear_hysteresis = upload([each.shear_hysteresis for each in garments], types.vec3)
    return triangles


def _hinges(
    types: Any, upload: Any, rests: Sequence[RestShape], vertex_start: tuple[int, ...], terms: Terms, cache: Cache
) -> tuple[Any | None, int]:
    """Hinges of all garments that are stiff, and their number."""
    make = partial(_stiff_hinges, types=types, terms=terms)
    each = cache.get_or_make_each(
        "hinges", [(rest,) for rest in rests], make, types.name, terms.angles, terms.hysteresis
    )
    count = sum(len(stiffness) for _, stiffness, _, _ in each)
    if not count:
        return None, 0
    corners, stiffness, rotations, sliders = zip(*each, strict=True)
    hinges = types.Hinges()
    hinges.corners = upload(corners, wp.vec4i, starts=vertex_start)
    hinges.stiffness = upload(stiffness, types.real)
    if terms.angles:
        hinges.rest = upload(rotations, types.vec2)
    if terms.hysteresis:
        hinges.hysteresis = upload(sliders, types.vec4)
    return hinges, count


def _stiff_hinges(
    rest: RestShape, types: Any, terms: Terms
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any] | None, NDArray[Any] | None]:
    """Corners and stiffness of a garment's hinges that are stiff; of these terms their rest angles and friction."""
    real, used = wp.dtype_to_numpy(types.real), rest.hinge_stiffness > 0.0
    corners, stiffness = rest.topology.hinges, rest.hinge_stiffness
    if not used.all():
        corners, stiffness = corners[used], stiffness[used]
    rotations, sliders = None, None
    if terms.angles:
        angle = rest.fold_angle[used]
        rotations = np.stack([np.cos(angle), np.sin(angle)], axis=1).astype(real)
    if terms.hysteresis:
        sliders = rest.hinge_hysteresis[used].astype(real)
    return corners, stiffness.astype(real), rotations, sliders


def _weave(
    types: Any, upload: Any, rests: Sequence[RestShape], vertex_start: tuple[int, ...], terms: Terms, cache: Cache
) -> Any | None:
    """Woven triangles of all garments."""
    woven = [(rest.yarns, first) for rest, first in zip(rests, vertex_start, strict=False) if rest.yarns is not None]
    if not woven:
        return None
    real = wp.dtype_to_numpy(types.real)

    def rounded(yarns: YarnConstants, name: str) -> NDArray[Any]:
        return np.asarray(getattr(yarns, name).astype(real))

    def uploaded(name: str, dtype: type = types.vec4) -> wp.array:
        each = [cache.get_or_make(name, (shape,), partial(rounded, shape, name), types.name) for shape, _ in woven]
        return upload(each, dtype)

    weave = types.Weave()
    weave.corners = upload([shape.corners for shape, _ in woven], wp.vec3i, starts=[first for _, first in woven])
    weave.slope, weave.yarns = uploaded("slope"), uploaded("packed")
    if terms.shear_hysteresis:
        weave.shear_hysteresis = uploaded("slider", types.vec3)
    return weave


def _starts(counts: list[int]) -> tuple[int, ...]:
    return (0, *(int(end) for end in np.cumsum(counts)))

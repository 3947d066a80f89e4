"""Coarse garments: the same cloth with fewer vertices, each a garment of its own, and the finer one's prolongation."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices, Points, vertex_normals
from warp_cloth.base.stored_value import SMALLEST, stored
from warp_cloth.garment.folds import fold_angles
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.rest import constants_of
from warp_cloth.material.constants import Sheet
from warp_cloth.material.fabric import Fabric
from warp_cloth.solver.implicit.coarsen import Coarsening, Flags, Pattern, coarsen, rest_pattern

Floats = NDArray[np.float64]

RATIO = 4  # of the vertices of a garment to those of the next: edges twice as long
FEWEST = 30  # vertices of a garment's coarsest version
# Phong tessellation's factor: fraction of the distance to the tangent planes of the followed vertices; exact on an arc.
ROUNDING = 0.5
LEAST_WEIGHT = 1e-2  # of the mean; extrapolation may leave a coarse vertex with nothing
# Strain of a limp garment under the weight of cloth as long as itself. Large triangles that hardly stretch hardly fold,
# either: around a ball of 0.3 m, edges of 16 mm stand off by up to 15 mm more than edges of 8 mm.
LIMP_STRAIN = 0.009


@dataclass(frozen=True, eq=False)
class Hierarchy:
    """A garment and its coarser versions, finest first."""

    garment: Garment
    pattern: Pattern | None  # the garment's own rest shape, if it is known
    coarsenings: tuple[Coarsening, ...]

    def coarser(self, *, limp: bool = False) -> Hierarchy | None:
        """The next coarser garment and all below it; None at the end. ``limp``: no stiffer than it needs to be."""
        if not self.coarsenings or self.pattern is None or self.garment.rest.fabric is None:
            return None
        first, *others = self.coarsenings
        return Hierarchy(_coarse_garment(self.garment, self.pattern, first, limp), first.cloth, tuple(others))


def build_hierarchy(garment: Garment) -> Hierarchy:
    """All coarser versions of a garment; none if its rest shape is not known."""
    if garment.rest.corners is None:
        return Hierarchy(garment, None, ())
    pinned = np.zeros(len(garment.points), dtype=bool)
    pinned[garment.pins] = True
    parts = garment.triangles, garment.rest.corners, pinned
    make = partial(_coarsened, *parts)
    found = make() if len(pinned) < SMALLEST else stored("coarsenings", ("solver/implicit", "base"), make, *parts)
    return Hierarchy(garment, *found)


def _coarsened(triangles: Indices, corners: Floats, pinned: Flags) -> tuple[Pattern, tuple[Coarsening, ...]]:
    """A garment's rest shape, and its coarser versions, finest first; takes what ``rest_pattern`` does."""
    pattern = cloth = rest_pattern(triangles, corners, pinned)
    coarsenings: list[Coarsening] = []
    while len(cloth.pinned) >= RATIO * FEWEST:
        found = coarsen(cloth, len(cloth.pinned) // RATIO)
        if found is None:
            break
        coarsenings.append(found)
        cloth = found.cloth
    return pattern, tuple(coarsenings)


def prolong_shape(coarse: Coarsening, points: Points, garment: Garment) -> Points:
    """A garment's points [m], shape [V, 3], from a coarser one's; pinned vertices stay.

    They lie on rounded faces (Boubekeur and Alexa, "Phong Tessellation", 2008): creases along the coarse edges would
    snap flat at once, and overstretch the cloth.
    """
    row = np.repeat(np.arange(len(garment.points)), np.diff(coarse.start))
    normals = vertex_normals(points, coarse.cloth.vertex[coarse.cloth.triangles])[coarse.index]
    followed = points[coarse.index]
    flat = _summed(coarse.weight[:, None] * followed, row, len(garment.points))
    above = ((followed - flat[row]) * normals).sum(axis=1)
    out = flat + ROUNDING * _summed((coarse.weight * above)[:, None] * normals, row, len(garment.points))
    out[garment.pins] = garment.points[garment.pins]
    return out


def _summed(values: Floats, row: NDArray[np.int64], count: int) -> Floats:
    """Sums of vectors by rows, shape [count, 3]."""
    return np.stack([np.bincount(row, values[:, axis], count) for axis in range(3)], axis=1).astype(np.float64)


def _coarse_garment(garment: Garment, pattern: Pattern, coarse: Coarsening, limp: bool) -> Garment:
    """The coarse garment: same fabric, same total weight, warp as in the finer one."""
    rest = garment.rest
    if rest.fabric is None:
        raise ValueError("a garment whose fabric is not known cannot be coarsened")
    row = np.repeat(np.arange(len(garment.points)), np.diff(coarse.start))
    weight = np.bincount(coarse.index, coarse.weight * rest.vertex_weight[row], len(coarse.fine_vertex))
    weight = np.maximum(weight, LEAST_WEIGHT * weight.mean())
    cloth = coarse.cloth
    triangles, place = cloth.vertex[cloth.triangles], cloth.place[cloth.triangles]
    like = None
    if rest.sheet is not None and rest.sheet.directed:
        warps = _warps(rest.sheet, pattern)[coarse.wedges]
        like = _laid_along_warp(place, warps[cloth.triangles].mean(axis=1))
    sides = np.linalg.norm(np.roll(place, -1, axis=1) - place, axis=2)
    fabric = limp_fabric(rest.fabric, float(weight.sum()) / math.sqrt(rest.area)) if limp else rest.fabric
    constants = constants_of(triangles, sides, weight, fabric, like)
    points = garment.points[coarse.fine_vertex]
    angle = fold_angles(points, constants.topology) if rest.hinge_angle is not None else None
    pins = np.flatnonzero(cloth.pinned).astype(np.int32)
    return Garment(points, triangles, replace(constants, hinge_angle=angle, corners=place), pins)


def limp_fabric(fabric: Fabric, load: float) -> Fabric:
    """The fabric, softened in all directions until such a load [N/m] strains it by LIMP_STRAIN; as it is if softer."""
    factor = load / LIMP_STRAIN**2 / min(fabric.stretch_warp, fabric.stretch_weft)
    if factor >= 1.0:
        return fabric
    shear = None if fabric.shear is None else factor * fabric.shear
    return replace(
        fabric, stretch_warp=factor * fabric.stretch_warp, stretch_weft=factor * fabric.stretch_weft, shear=shear
    )


def _warps(sheet: Sheet, pattern: Pattern) -> Floats:
    """Sum of area w w^T over the triangles at every wedge, w their warp in the rest shape, shape [W, 3, 3]."""
    place = _spatial(pattern.place)[pattern.triangles]
    flat = sheet.flat
    sides = np.swapaxes(flat[:, 1:] - flat[:, :1], 1, 2)  # columns are the sides from the first corner
    spans = np.abs(np.linalg.det(sides)) > 0.0
    inverse = np.zeros_like(sides)
    inverse[spans] = np.linalg.inv(sides[spans])
    warp = np.einsum("fcd,fc->fd", place[:, 1:] - place[:, :1], inverse[:, :, 1])
    both = warp[:, :, None] * warp[:, None, :] * sheet.areas[:, None, None]
    out = np.zeros((len(pattern.place), 3, 3))
    for corner in range(3):
        np.add.at(out, pattern.triangles[:, corner], both)
    return out


def _spatial(place: Floats) -> Floats:
    return np.pad(place, [(0, 0)] * (place.ndim - 1) + [(0, 3 - place.shape[-1])])


def _laid_along_warp(place: Floats, warps: Floats) -> Floats:
    """Triangles laid flat with y along their warp, up or down, shape [F, 3, 2]."""
    corners = _spatial(place)
    tiny = np.finfo(float).tiny
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    along = first / np.maximum(np.linalg.norm(first, axis=1, keepdims=True), tiny)
    across = second - along * (second * along).sum(axis=1, keepdims=True)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), tiny)
    axes = np.stack([along, across], axis=1)
    seen = np.einsum("fia,fab,fjb->fij", axes, warps, axes)
    angle = 0.5 * np.arctan2(2.0 * seen[:, 0, 1], seen[:, 0, 0] - seen[:, 1, 1])  # of the warp, from ``along``
    laid = np.einsum("fca,fia->fci", corners - corners[:, :1], axes)
    flat = (laid[..., 0] + 1j * laid[..., 1]) * np.exp(1j * (0.5 * np.pi - angle))[:, None]
    return np.stack([flat.real, flat.imag], axis=2)

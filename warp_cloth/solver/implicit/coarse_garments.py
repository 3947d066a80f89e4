"""Simplified garments: the same cloth with fewer vertices, each a garment of its own, and how the finer one follows."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Points, vertex_normals
from warp_cloth.garment.folds import fold_angles
from warp_cloth.garment.part import GarmentPart
from warp_cloth.garment.rest import constants_of
from warp_cloth.material.constants import Sheet
from warp_cloth.material.fabric import Fabric
from warp_cloth.solver.implicit.coarsen import Coarse, Pattern, coarsen, rest_pattern

Floats = NDArray[np.float64]

RATIO = 4  # of the vertices of a garment to those of the next: edges twice as long
FEWEST = 30  # vertices of a garment's coarsest version
ROUND = 0.5  # of the way to the tangent planes of those that a vertex follows: exact on an arc
LEAST_WEIGHT = 1e-2  # of the mean; extrapolated places may leave a coarse vertex with nothing
# Strain by which the weight of cloth as long as the garment may draw a limp one out. Large triangles that hardly
# stretch hardly fold, either: round a ball of 0.3 m, edges of 16 mm stand off by up to 15 mm more than edges of 8 mm.
LIMP = 0.009


@dataclass(frozen=True, eq=False)
class Ladder:
    """A garment and its coarser versions, finest first; ``pattern`` is its own rest shape, where that is known."""

    part: GarmentPart
    pattern: Pattern | None
    rungs: tuple[Coarse, ...]

    def below(self, *, limp: bool = False) -> Ladder | None:
        """The next coarser garment with what is below it; None at the end. ``limp``: no stiffer than it needs to be."""
        if not self.rungs or self.pattern is None or self.part.rest.fabric is None:
            return None
        first, *others = self.rungs
        return Ladder(_simplified(self.part, self.pattern, first, limp), first.cloth, tuple(others))


def build_ladder(part: GarmentPart) -> Ladder:
    """All coarser versions of a garment; none where its rest shape is not known."""
    if part.rest.corners is None:
        return Ladder(part, None, ())
    pinned = np.zeros(len(part.points), dtype=bool)
    pinned[part.pins] = True
    pattern = cloth = rest_pattern(part.triangles, part.rest.corners, pinned)
    rungs: list[Coarse] = []
    while len(cloth.pinned) >= RATIO * FEWEST:
        found = coarsen(cloth, len(cloth.pinned) // RATIO)
        if found is None:
            break
        rungs.append(found)
        cloth = found.cloth
    return Ladder(part, pattern, tuple(rungs))


def carried(coarse: Coarse, points: Points, part: GarmentPart) -> Points:
    """Where a garment's vertices are [m] if a coarser one's are at ``points``; the pinned ones stay.

    They lie on rounded faces (Boubekeur and Alexa, "Phong tessellation"): creases along the coarser edges would snap
    flat at once, and overstretch the cloth by that.
    """
    row = np.repeat(np.arange(len(part.points)), np.diff(coarse.start))
    normals = vertex_normals(points, coarse.cloth.vertex[coarse.cloth.triangles])[coarse.index]
    followed = points[coarse.index]
    flat = _summed(coarse.weight[:, None] * followed, row, len(part.points))
    above = ((followed - flat[row]) * normals).sum(axis=1)
    out = flat + ROUND * _summed((coarse.weight * above)[:, None] * normals, row, len(part.points))
    out[part.pins] = part.points[part.pins]
    return out


def _summed(values: Floats, row: NDArray[np.int64], count: int) -> Floats:
    """Sums of vectors by rows, shape [count, 3]."""
    return np.stack([np.bincount(row, values[:, axis], count) for axis in range(3)], axis=1).astype(np.float64)


def _simplified(part: GarmentPart, pattern: Pattern, coarse: Coarse, limp: bool) -> GarmentPart:
    """The coarse garment: same fabric, same weight in all, its warp where that of the finer one is."""
    rest = part.rest
    if rest.fabric is None:
        raise ValueError("a garment whose fabric is not known cannot be simplified")
    row = np.repeat(np.arange(len(part.points)), np.diff(coarse.start))
    weight = np.bincount(coarse.index, coarse.weight * rest.vertex_weight[row], len(coarse.kept))
    weight = np.maximum(weight, LEAST_WEIGHT * weight.mean())
    cloth = coarse.cloth
    triangles, place = cloth.vertex[cloth.triangles], cloth.place[cloth.triangles]
    like = None
    if rest.sheet is not None and rest.sheet.directed:
        warps = _warps(rest.sheet, pattern)[coarse.wedges]
        like = _drawn_along(place, warps[cloth.triangles].mean(axis=1))
    sides = np.linalg.norm(np.roll(place, -1, axis=1) - place, axis=2)
    fabric = limp_fabric(rest.fabric, float(weight.sum()) / math.sqrt(rest.area)) if limp else rest.fabric
    made = constants_of(triangles, sides, weight, fabric, like)
    points = part.points[coarse.kept]
    angle = fold_angles(points, made.topology) if rest.hinge_angle is not None else None
    pins = np.flatnonzero(cloth.pinned).astype(np.int32)
    return GarmentPart(points, triangles, replace(made, hinge_angle=angle, corners=place), pins)


def limp_fabric(fabric: Fabric, load: float) -> Fabric:
    """The fabric, as much softer in all directions as such a load [N/m] draws it out by no more than LIMP."""
    share = load / LIMP**2 / min(fabric.stretch_warp, fabric.stretch_weft)
    if share >= 1.0:
        return fabric
    shear = None if fabric.shear is None else share * fabric.shear
    return replace(
        fabric, stretch_warp=share * fabric.stretch_warp, stretch_weft=share * fabric.stretch_weft, shear=shear
    )


def _warps(sheet: Sheet, pattern: Pattern) -> Floats:
    """Sum of w w^T over the triangles at every wedge, w their warp in the rest shape, shape [W, 3, 3]."""
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


def _drawn_along(place: Floats, warps: Floats) -> Floats:
    """Triangles drawn flat, y along their warp, shape [F, 3, 2]; which of its two ends is up means nothing."""
    corners = _spatial(place)
    tiny = np.finfo(float).tiny
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    along = first / np.maximum(np.linalg.norm(first, axis=1, keepdims=True), tiny)
    across = second - along * (second * along).sum(axis=1, keepdims=True)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), tiny)
    axes = np.stack([along, across], axis=1)
    seen = np.einsum("fia,fab,fjb->fij", axes, warps, axes)
    angle = 0.5 * np.arctan2(2.0 * seen[:, 0, 1], seen[:, 0, 0] - seen[:, 1, 1])  # of the warp, from ``along``
    drawn = np.einsum("fca,fia->fci", corners - corners[:, :1], axes)
    flat = (drawn[..., 0] + 1j * drawn[..., 1]) * np.exp(1j * (0.5 * np.pi - angle))[:, None]
    return np.stack([flat.real, flat.imag], axis=2)

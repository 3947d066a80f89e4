"""How well texture coordinates fit a garment's mesh: their scale, and where they keep its lengths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.connected import connected_components
from warp_cloth.base.mesh import Mesh
from warp_cloth.garment.panels import MOST_LEFT_OUT, left_out_triangles
from warp_cloth.loading.unique_rows import edges_of, unique_rows

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

SAME_PLACE = 1e-6  # of the extent of texture space: corners of one vertex that are nearer have one place there
CLOSE, NEAR = 1.05, 1.2  # lengths over those of the panel that agree: placed or worn panels, worn woven ones
EQUAL = 1.001  # lengths that are the same, but for the file's rounding
LEAST = 1e-30  # [m2]
HALF, ROUNDING = 0.5, 1e-3  # axes have scales of their own where lengths are then half as far off, or nearer
FEW = 0.05  # of a garment's area; what lies clear of the seams is judged by itself if it is more


@dataclass(frozen=True)
class PanelFit:
    """Islands of texture space compared with the mesh, at one scale for all. Fractions are of area in texture space.

    Clear of the seams: placed panels keep their lengths inside, while their seams start open.
    """

    scale: tuple[float, float]  # metres in the mesh per unit of u and of v
    off: float  # median of how far a length is from the panel's: 0.01 is 1 %
    close: float  # fraction, clear of the seams, whose lengths are within CLOSE of the island's own scale
    near: float  # the same, within NEAR
    alike_close: float  # fraction in islands whose scale is within CLOSE of the garment's
    alike_near: float  # the same, within NEAR: panels may be a little scaled where they are placed
    equal: bool  # whether all lengths are the mesh's at this scale, across the seams too


def fit_panels(mesh: Mesh) -> PanelFit | None:
    """Compares texture coordinates with the mesh; None where many triangles have no area there, or all."""
    if mesh.texcoords is None:
        return None
    metric, area, usable = _metric(mesh, mesh.texcoords)
    if usable.mean() < 1.0 - MOST_LEFT_OUT:
        return None
    island, seam = _islands(mesh, mesh.texcoords)
    metric, area, island, inside = metric[usable], area[usable], island[usable], ~seam[usable]
    _, island = np.unique(island, return_inverse=True)
    # an island without a triangle clear of the seams is judged by all that it has
    sample = inside | ~np.isin(island, island[inside])
    if area[sample].sum() < FEW * area.sum():
        sample[:] = True
    even = _compared(metric, (1.0, 1.0), area, island, inside, sample)
    along = tuple(_median(0.5 * _log(metric[sample, axis]), area[sample]) for axis in (0, 2))
    by_axis = _compared(metric, (float(np.exp(along[0])), float(np.exp(along[1]))), area, island, inside, sample)
    return by_axis if by_axis.off < HALF * even.off and even.off > ROUNDING else even


def _metric(mesh: Mesh, texcoords: Floats) -> tuple[Floats, Floats, Flags]:
    """First fundamental form (E, F, G) of the mesh over texture space [m2], area there, and whether there is any.

    Shapes [F, 3], [F] and [F].
    """
    a, b = np.moveaxis(texcoords[:, 1:] - texcoords[:, :1], 1, 0)
    corners = mesh.points[mesh.triangles]
    p, q = np.moveaxis(corners[:, 1:] - corners[:, :1], 1, 0)
    whole = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    usable = ~left_out_triangles(0.5 * np.abs(whole))
    safe = np.where(usable, whole, 1.0)[:, None]
    u, v = (b[:, 1:] * p - a[:, 1:] * q) / safe, (a[:, :1] * q - b[:, :1] * p) / safe
    metric = np.stack([(u * u).sum(axis=1), (u * v).sum(axis=1), (v * v).sum(axis=1)], axis=1)
    return metric, 0.5 * np.abs(whole), usable


def _islands(mesh: Mesh, texcoords: Floats) -> tuple[NDArray[np.int64], Flags]:
    """Island of texture space of each triangle, and whether it touches a seam; shape [F] each."""
    step = SAME_PLACE * max(float(np.ptp(texcoords, axis=(0, 1)).max()), np.finfo(float).tiny)
    place = np.rint((texcoords.reshape(-1, 2) - texcoords.min(axis=(0, 1))) / step).astype(np.int64)
    corner = unique_rows(np.column_stack([mesh.triangles.reshape(-1), place]))
    number = corner.number.reshape(-1, 3)
    edges = edges_of(number)
    island = connected_components(len(corner.first), edges[:, 0], edges[:, 1])[number[:, 0]]
    places = np.bincount(mesh.triangles.reshape(-1)[corner.first], minlength=mesh.vertex_count)
    return island, np.asarray((places[mesh.triangles] > 1).any(axis=1))


def _compared(
    metric: Floats, scale: tuple[float, float], area: Floats, island: NDArray[Any], inside: Flags, sample: Flags
) -> PanelFit:
    """The fit after texture space was stretched by this scale along u and v; what is left is one scale for all."""
    u, v = scale
    e, f, g = metric[:, 0] / (u * u), metric[:, 1] / (u * v), metric[:, 2] / (v * v)
    middle, radius = 0.5 * (e + g), np.hypot(0.5 * (e - g), f)
    long = 0.5 * _log(middle + radius)
    short = 0.5 * _log(e * g - f * f) - long  # tiny where a triangle is drawn together in the mesh
    size = np.where(inside, 0.5 * (long + short), short)  # at open seams, lengths across them are far too long
    own = _medians(size[sample], area[sample], island[sample])[island]
    area = area * np.exp(2.0 * own)  # in the mesh: islands of an atlas may be as small there as they like
    whole = _median(own[sample], area[sample])
    off = np.maximum(np.abs(long - own), np.abs(short - own))
    share = area[sample] / area[sample].sum()
    middle_off = _median(off[sample], area[sample])
    close, near = (float(share[off[sample] <= np.log(limit)].sum()) for limit in (CLOSE, NEAR))
    apart = np.abs(own - whole)[sample]
    alike_close, alike_near = (float(share[apart <= np.log(limit)].sum()) for limit in (CLOSE, NEAR))
    equal = bool((np.maximum(np.abs(long - whole), np.abs(short - whole)) <= np.log(EQUAL)).all())
    return PanelFit(
        (u * float(np.exp(whole)), v * float(np.exp(whole))), middle_off, close, near, alike_close, alike_near, equal
    )


def _log(squared: Floats) -> Floats:
    """The logarithm of squared lengths [m2]; finite where they are zero."""
    return np.asarray(np.log(np.maximum(squared, LEAST)))


def _median(values: Floats, weights: Floats) -> float:
    """The weighted median."""
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(total, 0.5 * total[-1])]])


def _medians(values: Floats, weights: Floats, group: NDArray[Any]) -> Floats:
    """The weighted median of each group that has values, by its number."""
    order = np.lexsort((values, group))
    ordered, total = group[order], np.cumsum(weights[order])
    count = int(ordered[-1]) + 1
    first, last = np.searchsorted(ordered, np.arange(count)), np.searchsorted(ordered, np.arange(count), side="right")
    before = np.where(first > 0, total[np.maximum(first, 1) - 1], 0.0)
    half = 0.5 * (before + total[np.maximum(last, 1) - 1])
    middle = np.minimum(np.searchsorted(total, half), len(order) - 1)
    return np.asarray(values[order[middle]])

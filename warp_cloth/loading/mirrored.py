"""The half of a garment, whose other half a modelling tool's mirror shows but does not export."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.connected import connected_components
from warp_cloth.loading.raw import Floats, Ints
from warp_cloth.loading.unique_rows import rim_edges

AT_PLANE = 1e-3  # of the largest extent, from the plane x = 0, within which a mirror merges vertices
# Of the garment's height and depth, whichever is which, what its rims at the plane span: a crotch all of its depth, the
# back of an open jacket all of its height, and either some of the other. The straight edge of a scarf has no depth.
SPANNED, ALSO = 0.6, 0.2
FLAT = 0.05  # of its largest extent, at most as deep as which a garment is a flat piece


def half_at(points: Floats, triangles: Ints) -> NDArray[np.bool_] | None:
    """Which vertices of half a garment lie at the plane x = 0, behind which it goes on, shape [V]; None: it is whole.

    All of it is on one side, and rims lie at the plane in lines that end at other rims. A glove or a sleeve may end at
    a plane, too, but in a ring.

    Args:
        points: in the file's own axes and unit, shape [V, 3].
        triangles: shape [F, 3].
    """
    used = np.unique(triangles)
    low, high = points[used].min(axis=0), points[used].max(axis=0)
    extent = float((high - low).max())
    near = AT_PLANE * extent
    sizes = (high - low)[1:]
    if not (low[0] >= -near or high[0] <= near) or sizes.min() <= FLAT * extent:
        return None
    at_plane = np.zeros(len(points), dtype=bool)
    at_plane[used] = np.abs(points[used, 0]) <= near
    rims = rim_edges(triangles)
    cut = rims[at_plane[rims].all(axis=1)]
    ends, place, degree = np.unique(cut, return_inverse=True, return_counts=True)
    line = connected_components(len(ends), *place.reshape(-1, 2).T)
    is_open = np.isin(line, line[degree == 1])
    if not is_open.any() or degree.max() > 2 or _is_straight(points[ends[is_open], 1:]):
        return None
    spanned = np.sort(np.ptp(points[ends[is_open], 1:], axis=0) / sizes)
    return at_plane if spanned[0] >= ALSO and spanned[1] >= SPANNED else None


def _is_straight(places: Floats) -> bool:
    """Whether points in a plane are about in one line, as the edge of a slanting sheet; shape [N, 2]."""
    sizes = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
    return bool(len(sizes) < 2 or sizes[1] <= FLAT * sizes[0])

"""A surface wrapped round a body whose own is rough, coarse, torn, or in pieces that touch.

The cells of a grid that its surface or its inside lies in, smoothed: as a sheet would lie round it that spans gaps of
less than two cells. Limbs that are nearer to each other than that grow together.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.anatomy.geodesics import row_lengths
from warp_cloth.base.connected import mesh_parts
from warp_cloth.base.mesh import Indices, Points, face_normals, signed_volumes
from warp_cloth.base.surface import split_quads, surface_nets, without_saddles

CELLS = 160  # along the body's largest extent: 1 cm in a grown-up
MARGIN = 3  # empty cells round it
SAMPLES_PER_CELL = 2.0  # along rows of a triangle, and across
MOST_PER_EDGE = 2 * CELLS  # samples; no edge is longer than the body
COUNTS = np.unique(np.geomspace(1, MOST_PER_EDGE, 30).round().astype(np.int64))  # of samples: few, to be made together
SMOOTHING = 1.0  # cells, the standard deviation
FILLED = 0.4  # of the box round it: more, and nothing sticks out; people fill a quarter at most, a ball half of it
THINNEST = 1e-3  # of the extent; parts with less volume over area are sheets, which have no limbs: a floor, hair


def wrapped(points: Points, triangles: Indices) -> tuple[Points, Indices]:
    """The points [m] and triangles of a surface wrapped round a closed one.

    There are no triangles where nothing is in it, or where nothing sticks out of it that could be a limb.

    Args:
        points: vertices [m], shape [V, 3].
        triangles: shape [F, 3].
    """
    corners = points[triangles]
    box = np.ptp(corners.reshape(-1, 3), axis=0)
    if abs(signed_volumes(corners - points[0]).sum()) > FILLED * box.prod():
        return points[:0], triangles[:0]
    from scipy import ndimage

    extent = float(box.max())
    corners = corners[~_is_sheet(points, triangles, THINNEST * extent)]
    spacing = extent / CELLS
    origin = corners.reshape(-1, 3).min(axis=0) - MARGIN * spacing
    cells = np.floor((_samples(corners, spacing / SAMPLES_PER_CELL) - origin) / spacing).astype(np.int64)
    is_skin = np.zeros(cells.max(axis=0) + MARGIN + 1, dtype=bool)
    is_skin[tuple(cells.T)] = True
    is_solid = ndimage.binary_erosion(ndimage.binary_fill_holes(ndimage.binary_dilation(is_skin))) | is_skin
    density = ndimage.gaussian_filter(is_solid.astype(np.float64), SMOOTHING, mode="constant")
    values = without_saddles(0.5 - density)
    wrap, quads = surface_nets(values, origin + 0.5 * spacing, spacing)
    return wrap, split_quads(wrap, quads) if len(quads) else np.zeros((0, 3), dtype=np.int32)


def _is_sheet(points: Points, triangles: Indices, thinnest: float) -> NDArray[np.bool_]:
    """Whether each triangle belongs to a connected part that encloses hardly anything; none does where all would."""
    part = mesh_parts(len(points), triangles)[triangles[:, 0]]
    corners = points[triangles] - points[part][:, None]
    volume = np.bincount(part, signed_volumes(corners), len(points))
    area = np.bincount(part, 0.5 * row_lengths(face_normals(corners)), len(points))
    thin = (np.abs(volume) <= thinnest * area)[part]
    return np.zeros(len(triangles), dtype=bool) if thin.all() else np.asarray(thin)


def _samples(corners: Points, apart: float) -> Points:
    """Points of triangles, shape [F, 3, 3], in rows along their longest edges, no row and no point in it farther from
    the next than ``apart`` [m]; shape [N, 3].
    """
    edges = np.roll(corners, -1, axis=1) - corners
    lengths = np.linalg.norm(edges, axis=2)
    first, each = lengths.argmax(axis=1), np.arange(len(corners))
    turned = corners[each[:, None], (first[:, None] + np.arange(3)) % 3]
    longest = lengths[each, first]
    height = row_lengths(face_normals(corners)) / np.maximum(longest, np.finfo(float).tiny)
    counts = np.stack([_at_least(longest / apart), _at_least(height / apart)], axis=1)
    kinds, kind = np.unique(counts, axis=0, return_inverse=True)
    kind = kind.ravel()
    found = [_weights(*pair) @ turned[kind == number] for number, pair in enumerate(kinds.tolist())]
    return np.concatenate([points.reshape(-1, 3) for points in found])


def _at_least(counts: NDArray[np.float64]) -> NDArray[np.int64]:
    """Whole numbers from 1 to MOST_PER_EDGE, each of few, and no less than these."""
    return COUNTS[np.searchsorted(COUNTS, np.minimum(counts, MOST_PER_EDGE))]


def _weights(along: int, rows: int) -> Points:
    """Weights of a triangle's corners at points in ``rows`` rows off its longest edge, which has ``along`` steps.

    Shape [N, 3].
    """
    found = []
    for row in range(rows + 1):
        v = row / rows
        u = np.linspace(0.0, 1.0 - v, max(int(np.ceil(along * (1.0 - v))), 1) + 1)
        found.append(np.stack([1.0 - u - v, u, np.full_like(u, v)], axis=1))
    return np.concatenate(found)

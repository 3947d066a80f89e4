"""Places for the inner vertices of panels: a hexagonal lattice inside an outline and clear of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_cloth.pattern.curve import Floats

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

Ints = NDArray[np.int64]

GRADED = 0.8  # share of the asked spacing below which the lattice leaves room for closer vertices
GRADE = 0.4  # growth of the spacing per distance: triangles a third longer than their neighbours keep 30 degrees
CLEARANCE = 0.6  # of the spacing, between lattice and outline: less makes slivers, more makes wide triangles
JITTER = 1e-3  # of the spacing: no four vertices of the lattice are on one circle, so that one triangulation is right


@dataclass(frozen=True, eq=False)
class Rim:
    """The outlines of panels and their holes, side by side: polygons of straight sides."""

    points: Floats  # where sides start [m], shape [n, 2]
    ends: Floats
    wanted: Floats  # [m] spacing at the points, shape [n]
    panel: Ints  # of each side, shape [n]

    @cached_property
    def places(self) -> cKDTree:
        """Its vertices and the middles of its sides, to look them up."""
        return tree_of(np.concatenate([self.points, 0.5 * (self.points + self.ends)]))

    def holds(self, points: Floats, panel: Ints) -> NDArray[np.bool_]:
        """Whether points lie in the panels that they are of, shape [N]."""
        over = np.ptp(self.points[:, 1]) + 1.0  # one panel above the other, so that few sides are beside a point
        lifted = [np.column_stack([p[:, 0], p[:, 1] + over * of]) for p, of in ((self.points, self.panel),
                  (points, panel), (self.ends, self.panel))]  # fmt: skip
        return inside(*lifted)


def tree_of(points: Floats) -> cKDTree:
    """Points to look the nearest up; built in a third of the time that a balanced tree takes."""
    from scipy.spatial import cKDTree

    return cKDTree(points, balanced_tree=False, compact_nodes=False)


def inside(outline: Floats, points: Floats, ends: Floats | None = None) -> NDArray[np.bool_]:
    """Whether points lie in a polygon (even-odd rule), shape [N]; points of equal y cost one search.

    ``ends``: where the sides end that start at the outline's points; by default each at the next.
    """
    rows, row = np.unique(points[:, 1], return_inverse=True)
    start, end = outline, np.roll(outline, -1, axis=0) if ends is None else ends
    low, high = np.minimum(start[:, 1], end[:, 1]), np.maximum(start[:, 1], end[:, 1])
    first, last = np.searchsorted(rows, low, side="left"), np.searchsorted(rows, high, side="left")
    count = last - first  # rows that each side crosses: low <= y < high
    side = np.repeat(np.arange(len(outline)), count)
    crossed = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + np.repeat(first, count)
    fraction = (rows[crossed] - start[side, 1]) / (end[side, 1] - start[side, 1])
    x = start[side, 0] + fraction * (end[side, 0] - start[side, 0])
    order = np.lexsort((x, crossed))
    crossed, x = crossed[order], x[order]
    width = 4.0 * (np.abs(outline[:, 0]).max() + np.abs(points[:, 0]).max() + 1.0)
    before = np.searchsorted(x + width * crossed, points[:, 0] + width * row.ravel(), side="left")
    return np.asarray((before - np.searchsorted(crossed, row.ravel(), side="left")) % 2 == 1)


def lattice(loop: Floats, spacing: float) -> Floats:
    """Points of a hexagonal lattice about an outline [m], shape [N, 2]; an equilateral triangle has the spacing."""
    low, high = loop.min(axis=0), loop.max(axis=0)
    height = spacing * np.sqrt(0.75)
    count = max(1, int(np.ceil((high[1] - low[1]) / height)))
    rows = low[1] + (high[1] - low[1]) * (np.arange(count) + 0.5) / count
    columns = np.arange(low[0], high[0] + spacing, spacing)
    x = columns + 0.5 * spacing * (np.arange(count) % 2)[:, None]
    return np.column_stack([x.ravel(), np.repeat(rows, len(columns))])


def jittered(points: Floats, spacing: float) -> Floats:
    """The points moved at random by up to JITTER, the same way every time."""
    return points + np.random.default_rng(0).uniform(-JITTER, JITTER, points.shape) * spacing


def spacing_at(points: Floats, rim: Rim, most: float) -> Floats:
    """Wanted spacing at points of panels [m]: that of the outlines' vertices, growing with the distance, shape [N].

    Panels are so far apart that none bears on another's.
    """
    found = np.full(len(points), most)
    fine = rim.wanted < GRADED * most
    if not fine.any() or not len(points):
        return found
    wanted = rim.wanted[fine]
    reach = (most - wanted.min()) / GRADE
    near = tree_of(points).sparse_distance_matrix(tree_of(rim.points[fine]), reach, output_type="ndarray")
    np.minimum.at(found, near["i"], wanted[near["j"]] + GRADE * near["v"])
    return found

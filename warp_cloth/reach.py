"""How far a pinned garment can reach: a bound that no shape of less energy than the start passes."""

from __future__ import annotations

import numpy as np

from warp_cloth.model import GarmentPart
from warp_cloth.rest import Floats

ROUNDS = 40  # of raising the energy until it holds itself
MOST_STEPS = 400  # edges on the way from a pin; a bound is not worth more work than this


def reach_box(part: GarmentPart) -> tuple[Floats, Floats] | None:
    """Lowest and highest corner [m] of a box that the garment cannot leave; None where nothing can be proved.

    An edge of E = k/3 (r - L)^3 is stretched by no more than (3 E / k)^(1/3) while E is all the elastic energy there
    is: that of the start, and what the weight gives by sinking to where the edges let it. Along the shortest way of
    such edges from the pins, every vertex stays within reach of the pins' box. An energy that these distances cannot
    give is never passed.
    """
    rest = part.rest
    ends, pull = rest.topology.edges, rest.edge_pull
    if not len(part.pins) or not len(ends) or not (pull > 0.0).all():
        return None
    now = np.linalg.norm(part.points[ends[:, 0]] - part.points[ends[:, 1]], axis=1) - rest.edge_length
    start = float(np.sum(np.where(now > 0.0, pull, rest.edge_push) * np.abs(now) ** 3) / 3.0)
    start += 4.0 * float(rest.hinge_stiffness.sum())  # C (t - sin t) is at most pi C
    held = part.points[part.pins]
    low, high = held.min(axis=0), held.max(axis=0)
    energy = start + 1e-9
    for _ in range(ROUNDS):
        way = _ways(part, rest.edge_length + np.cbrt(3.0 * energy / pull))
        if way is None:
            return None
        sunk = np.maximum(part.points[:, 1] - (low[1] - way), 0.0)
        needed = start + float(rest.vertex_weight @ sunk)
        if needed < energy:
            furthest = float(way.max())
            return low - furthest, high + furthest
        energy = 1.1 * needed
    return None


def _ways(part: GarmentPart, lengths: Floats) -> Floats | None:
    """Length of the shortest way from any pin to each vertex [m]; None where one is not held, or the ways are long."""
    ends = part.rest.topology.edges
    way = np.full(len(part.points), np.inf)
    way[part.pins] = 0.0
    for _ in range(MOST_STEPS):
        shorter = way.copy()
        np.minimum.at(shorter, ends[:, 0], way[ends[:, 1]] + lengths)
        np.minimum.at(shorter, ends[:, 1], way[ends[:, 0]] + lengths)
        if np.array_equal(shorter, way):
            return way if np.isfinite(way).all() else None
        way = shorter
    return None

"""Places for the inner vertices of panels: a hexagonal lattice inside an outline and clear of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_cloth.pattern.curve import Floats

GRADED = 0.8  # share of the asked spacing below which the lattice leaves room for closer vertices
GRADE = 0.4  # growth of the spacing per distance: triangles a third longer than their neighbours keep 30 degrees
CLEARANCE = 0.6  # of the spacing, between lattice and outline: less makes slivers, more makes wide triangles
JITTER = 1e-3  # of the spacing: no four vertices of the lattice are on one circle, so that one triangulation is right


@dataclass(frozen=True, eq=False)
class Rim:
    """The outline of a panel and its holes: polygons of straight sides."""

    points: Floats  # where sides start [m], shape [n, 2]
    ends: Floats
    wanted: Floats  # [m] spacing at the points, shape [n]


def rim_of(loops: Sequence[Floats], wanted: Sequence[Floats]) -> Rim:
    """The rim of closed loops, shape [n, 2] each."""
    ends = [np.roll(loop, -1, axis=0) for loop in loops]
    return Rim(np.concatenate(loops), np.concatenate(ends), np.concatenate(wanted))


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


def lattice(rim: Rim, spacing: float) -> Floats:
    """Points of a hexagonal lattice inside a panel [m], shape [N, 2]; an equilateral triangle has the spacing."""
    low, high = rim.points.min(axis=0), rim.points.max(axis=0)
    height = spacing * np.sqrt(0.75)
    count = max(1, int(np.ceil((high[1] - low[1]) / height)))
    rows = low[1] + (high[1] - low[1]) * (np.arange(count) + 0.5) / count
    columns = np.arange(low[0], high[0] + spacing, spacing)
    x, y = np.meshgrid(columns, rows)
    x = x + 0.5 * spacing * (np.arange(count) % 2)[:, None]
    spots = np.column_stack([x.ravel(), y.ravel()])
    return spots[inside(rim.points, spots, rim.ends)]


def jittered(points: Floats, spacing: float) -> Floats:
    """The points moved at random by up to JITTER, the same way every time."""
    return points + np.random.default_rng(0).uniform(-JITTER, JITTER, points.shape) * spacing


def spacing_at(points: Floats, rim: Rim, most: float) -> Floats:
    """Wanted spacing at points of a panel [m]: that of the outline's vertices, growing with the distance, shape [N]."""
    found = np.full(len(points), most)
    outline, wanted = rim.points, rim.wanted
    fine = wanted < GRADED * most
    for chunk in np.array_split(np.arange(len(points)), 1 + len(points) * int(fine.sum()) // 2_000_000):
        if fine.any():
            away = points[chunk, None, :] - outline[None, fine, :]
            distance = np.hypot(away[..., 0], away[..., 1])
            found[chunk] = np.minimum(most, (wanted[fine] + GRADE * distance).min(axis=1, initial=most))
    return found

"""Meshing of panels: vertices inside their outlines, and triangles without small angles where the outline allows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warp_cloth.base.row_sums import RowSums
from warp_cloth.base.topology import ragged_rows
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.delaunay import Ints, OutlineError, corners_of, doubled_areas, flat_ones, next_of, triangulated
from warp_cloth.pattern.flips import flipped, inserted
from warp_cloth.pattern.lattice import CLEARANCE, GRADED, Rim, jittered, lattice, spacing_at, tree_of

SMOOTHING_ROUNDS = 8
REFINING_ROUNDS = 3
LARGE = 0.75  # of the spacing: circumradius above which a triangle is split; equilateral ones have 0.58
SMALL_ANGLE = 27.0  # [degrees] below which a triangle is split
IMPROVED = 26.5  # [degrees] below which a triangle's inner vertices are moved by themselves
SWEEPS = 3
LEAST_ANGLE = 25.0  # [degrees] below which triangles between outlines get a vertex inside
# Places tried for such a vertex, in lengths of its shortest edge
_TRIED = np.array(
    [(0.0, 0.0)] + [(r * np.cos(a), r * np.sin(a)) for r in (0.06, 0.18, 0.4) for a in np.arange(8) * np.pi / 4]
)
OFF_CENTRE = 1.6  # of the shortest edge: as far as its triangle reaches at 35 degrees (Uengoer, Off-centers, 2004)
APART = 3.0  # spacings between the panels, side by side, of one triangulation


@dataclass(frozen=True, eq=False)
class Flat:
    """Meshed panels side by side: vertices of all outlines first, then of all holes, then those inside."""

    points: Floats  # [m], shape [N, 2]
    triangles: Ints  # counter-clockwise, shape [F, 3]
    panel: Ints  # of each vertex, shape [N]
    origins: Floats  # [m] by how much each panel was moved, shape [P, 2]


@dataclass(eq=False)
class _Sheet:
    """All panels, side by side."""

    loops: list[Floats]  # outlines counter-clockwise, then holes clockwise
    panels: list[int]  # of each loop
    rim: Rim  # of all loops
    spacing: float
    origins: Floats  # [m], shape [P, 2]

    @property
    def sides(self) -> Ints:
        starts = np.cumsum([0, *(len(loop) for loop in self.loops[:-1])])
        loops = [start + np.arange(len(loop)) for start, loop in zip(starts, self.loops, strict=True)]
        return np.concatenate([np.column_stack([loop, np.roll(loop, -1)]) for loop in loops])


def meshed(
    outlines: Sequence[Floats],
    wanted: Sequence[Floats],
    spacing: float,
    holes: Sequence[tuple[int, Floats, Floats]] = (),
) -> Flat:
    """Fills outlines, each counter-clockwise [m], shape [n, 2], with triangles of about the spacing [m].

    ``wanted``: the spacing at each outline's vertices. Vertices keep the order of the outlines; the panels are moved
    side by side along x. ``holes``: the panel of each, its vertices counter-clockwise and their spacing.

    Raises:
        OutlineError: an outline crosses or touches itself.
    """
    sheet = _side_by_side(outlines, wanted, spacing, holes)
    seeds, of_seeds = _seeds(sheet, len(outlines))
    rim = sheet.rim.points
    points = np.concatenate([rim, jittered(seeds, spacing)])
    panel = np.concatenate([sheet.rim.panel, of_seeds])
    sides = sheet.sides
    triangles = triangulated(points, sides, panel)
    for _ in range(REFINING_ROUNDS):
        added, of = _refined(sheet, points, triangles, panel)
        if not len(added):
            break
        count = len(points)
        points, panel = np.concatenate([points, added]), np.concatenate([panel, of])
        with_added = inserted(points, triangles, count)
        if with_added is None:
            with_added = _renewed(points, panel, triangles, sides, np.unique(of))
        triangles = with_added
    points = _smoothed(points, triangles, len(rim))
    triangles = flipped(points, triangles)
    points = _improved(points, triangles, len(rim))
    points, triangles, panel = _mended(sheet, points, triangles, panel)
    flat, _ = flat_ones(points, triangles)
    if len(flat):  # a place where two sides all but touch
        raise OutlineError(*(int(vertex) for vertex in triangles[flat[0]] if vertex < len(rim)))
    return Flat(points, triangles, panel, sheet.origins)


def _renewed(points: Floats, panel: Ints, triangles: Ints, sides: Ints, changed: Ints) -> Ints:
    """The triangles with those of the changed panels made anew."""
    mine = np.flatnonzero(np.bincount(changed, minlength=int(panel.max()) + 1)[panel])
    place = np.full(len(points), -1, dtype=np.int64)
    place[mine] = np.arange(len(mine))
    own = sides[place[sides[:, 0]] >= 0]
    kept = triangles[place[triangles[:, 0]] < 0]
    try:
        return np.concatenate([kept, mine[triangulated(points[mine], place[own], panel[mine])]])
    except OutlineError as error:
        raise OutlineError(*(int(mine[at]) for at in error.places)) from None


def _side_by_side(
    outlines: Sequence[Floats],
    wanted: Sequence[Floats],
    spacing: float,
    holes: Sequence[tuple[int, Floats, Floats]],
) -> _Sheet:
    moved, origins, right = [], [], 0.0
    for outline in outlines:
        low, high = outline.min(axis=0), outline.max(axis=0)
        origins.append(np.array([right - low[0], -low[1]]))
        moved.append(outline + origins[-1])
        right += high[0] - low[0] + APART * spacing
    loops = [*moved, *((points + origins[panel])[::-1] for panel, points, _ in holes)]
    panels = [*range(len(outlines)), *(panel for panel, _, _ in holes)]
    local = [*wanted, *(spacings[::-1] for _, _, spacings in holes)]
    of = np.repeat(panels, [len(loop) for loop in loops])
    ends = np.concatenate([np.roll(loop, -1, axis=0) for loop in loops])
    rim = Rim(np.concatenate(loops), ends, np.concatenate(local), of)
    return _Sheet(loops, panels, rim, spacing, np.array(origins))


def _seeds(sheet: _Sheet, panels: int) -> tuple[Floats, Ints]:
    """Inner vertices at first, and their panels: the lattice, but where the spacing is closer or the rim near."""
    lattices = [lattice(loop, sheet.spacing) for loop in sheet.loops[:panels]]
    spots, of = np.concatenate(lattices), np.repeat(np.arange(panels), [len(each) for each in lattices])
    held = sheet.rim.holds(spots, of)
    spots, of = spots[held], of[held]
    local = spacing_at(spots, sheet.rim, sheet.spacing)
    clear, _ = sheet.rim.places.query(spots, distance_upper_bound=sheet.spacing)
    kept = (local >= GRADED * sheet.spacing) & (clear > CLEARANCE * local)
    return spots[kept], of[kept]


def angles_of(points: Floats, triangles: Ints) -> Floats:
    """The angles of triangles [degrees], shape [F, 3]."""
    corner = points[triangles]
    out, back = corner[:, [1, 2, 0]] - corner, corner[:, [2, 0, 1]] - corner
    sine = out[..., 0] * back[..., 1] - out[..., 1] * back[..., 0]
    return np.asarray(np.degrees(np.arctan2(np.abs(sine), (out * back).sum(axis=2))))


def _sharp(points: Floats, triangles: Ints, degrees: float) -> Ints:
    """Triangles with an angle below so many degrees; most are told by their sides, without an arc tangent."""
    x, y = corners_of(points, triangles)
    aside, up = x[[1, 2, 0]] - x, y[[1, 2, 0]] - y
    square = aside * aside + up * up
    across = np.abs(aside[0] * up[1] - aside[1] * up[0])
    _, middle, high = np.sort(square, axis=0)
    maybe = np.flatnonzero(across * across <= (np.sin(np.radians(degrees)) ** 2 + 1e-6) * middle * high)
    return maybe[angles_of(points, triangles[maybe]).min(axis=1) < degrees]


def _refined(sheet: _Sheet, points: Floats, triangles: Ints, panel: Ints) -> tuple[Floats, Ints]:
    """Vertices that split triangles which are too large or have too small an angle, and their panels."""
    x, y = corners_of(points, triangles)
    aside, up = x[[1, 2, 0]] - x, y[[1, 2, 0]] - y
    length = np.hypot(aside, up)
    area = aside[0] * (y[2] - y[0]) - up[0] * (x[2] - x[0])
    shortest = np.minimum(np.minimum(length[0], length[1]), length[2])
    product = length[0] * length[1] * length[2]
    radius = product / np.maximum(2.0 * area, 1e-9 * product + 1e-30)  # at most 1e9 m
    sharp = shortest < 2.0 * np.sin(np.radians(SMALL_ANGLE)) * radius  # law of sines
    maybe = np.flatnonzero(sharp | (radius > LARGE * sheet.spacing))
    if not len(maybe):
        return np.zeros((0, 2)), np.zeros(0, dtype=np.int64)
    place = shortest[maybe]
    which = length[:, maybe].argmin(axis=0)
    a = np.column_stack([x[which, maybe], y[which, maybe]])
    along = np.column_stack([aside[which, maybe], up[which, maybe]])
    left = np.column_stack([-along[:, 1], along[:, 0]]) / place[:, None]
    tall = np.sqrt(np.maximum(radius[maybe] ** 2 - 0.25 * place**2, 0.0))
    third = (which + 2) % 3
    opposite = np.column_stack([x[third, maybe], y[third, maybe]]) - a
    obtuse = ((opposite - along) * opposite).sum(axis=1) < 0.0
    tall = np.where(obtuse, -tall, tall)
    off = a + 0.5 * along + left * np.minimum(tall, OFF_CENTRE * place)[:, None]
    of, radius = panel[triangles[maybe, 0]], radius[maybe]
    local = spacing_at(off, sheet.rim, sheet.spacing)
    good = np.flatnonzero((radius > 0.5 * local) & sheet.rim.holds(off, of))
    for tree, clear in ((sheet.rim.places, 0.5), (tree_of(points), 0.55)):
        away, _ = tree.query(off[good], distance_upper_bound=sheet.spacing)
        good = good[away > clear * local[good]]
    good = good[np.argsort(-radius[good], kind="stable")]
    kept = good[_apart(off[good], 0.8 * local[good])]
    kept = kept[np.argsort(of[kept], kind="stable")]
    return off[kept], of[kept]


def _apart(spots: Floats, clear: Floats) -> Ints:
    """The places of spots of which none is as near as ``clear`` [m] to one before it that is kept."""
    if not len(spots):
        return np.zeros(0, dtype=np.int64)
    pairs = tree_of(spots).query_pairs(float(clear.max()), output_type="ndarray")
    first, second = pairs.min(axis=1), pairs.max(axis=1)
    close = np.hypot(*(spots[first] - spots[second]).T) <= clear[second]
    order = np.lexsort((first[close], second[close]))
    free = [True] * len(spots)
    for one, other in zip(first[close][order].tolist(), second[close][order].tolist(), strict=True):
        free[other] &= not free[one]
    return np.flatnonzero(free)


def _smoothed(points: Floats, triangles: Ints, rim: int) -> Floats:
    """Inner vertices moved to the mean of their neighbours, round by round, where no triangle turns over."""
    count = len(points)
    neighbours = RowSums(triangles.ravel(), next_of(triangles).ravel(), count)
    degree = np.maximum(np.bincount(triangles.ravel(), minlength=count), 1).astype(float)[rim:, None]
    smooth = points.copy()
    for _ in range(SMOOTHING_ROUNDS):
        before = smooth.copy()
        smooth[rim:] = neighbours(before)[rim:] / degree
        for _ in range(3):
            turned = triangles[doubled_areas(smooth, triangles) <= 0.0].ravel()
            if not len(turned):
                break
            smooth[turned] = before[turned]
        else:
            return before
    return smooth


def _improved(points: Floats, triangles: Ints, rim: int) -> Floats:
    """Inner vertices of triangles with small angles moved to where the smallest angle about them is largest."""
    vertices = np.unique(triangles[_sharp(points, triangles, IMPROVED)])
    vertices = vertices[vertices >= rim]
    if not len(vertices):
        return points
    points = points.copy()
    starts, order = ragged_rows(triangles.ravel(), len(points))
    first, last = starts[vertices].tolist(), starts[vertices + 1].tolist()
    for _ in range(SWEEPS):
        for vertex, begin, end in zip(vertices.tolist(), first, last, strict=True):
            star = order[begin:end]
            around = triangles[star // 3]
            turn = (star % 3)[:, None] + np.arange(3)
            around = np.take_along_axis(around, turn % 3, axis=1)  # the vertex first
            b, c = points[around[:, 1]], points[around[:, 2]]
            reach = np.hypot(*(b - points[vertex]).T).min()
            tried = points[vertex] + reach * _TRIED
            points[vertex] = tried[_least_angles(tried, b, c).argmax()]
    return points


def _mended(sheet: _Sheet, points: Floats, triangles: Ints, panel: Ints) -> tuple[Floats, Ints, Ints]:
    """Points, triangles and panels, with a vertex more in each sharp triangle between outlines that it does good.

    In a corner of some 30 degrees vertices of both edges are opposite each other, at distances that grow too fast; as
    seams have them there, only a vertex nearer to the edges than others may be helps.
    """
    rim, count = len(sheet.rim.points), len(points)
    sharp = _sharp(points, triangles, LEAST_ANGLE)
    sharp = sharp[(triangles[sharp] < rim).all(axis=1)]
    spots, of = _circumcentres(points, triangles[sharp]), panel[triangles[sharp, 0]]
    good = np.flatnonzero(sheet.rim.holds(spots, of)) if len(spots) else sharp
    while len(good):
        spots, of = spots[good], of[good]
        added = np.concatenate([points, spots])
        made = inserted(added, triangles, count)
        if made is None:
            break
        least = np.full(len(added), 180.0)
        np.minimum.at(least, made, angles_of(added, made).min(axis=1)[:, None])
        good = np.flatnonzero(least[count:] >= LEAST_ANGLE)
        if len(good) == len(spots):
            return added, made, np.concatenate([panel, of])
    return points, triangles, panel


def _circumcentres(points: Floats, triangles: Ints) -> Floats:
    """Centres of the circles through triangles' corners [m], shape [F, 2]."""
    a = points[triangles[:, 0]]
    b, c = points[triangles[:, 1]] - a, points[triangles[:, 2]] - a
    across = 2.0 * (b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0])
    bb, cc = (b**2).sum(axis=1), (c**2).sum(axis=1)
    x, y = c[:, 1] * bb - b[:, 1] * cc, b[:, 0] * cc - c[:, 0] * bb
    return np.asarray(a + np.column_stack([x, y]) / np.maximum(across, 1e-300)[:, None])


def _least_angles(tips: Floats, b: Floats, c: Floats) -> Floats:
    """For each tip, shape [T, 2], the least cosine-ordered angle of its triangles over edges b-c, shape [S, 2] each.

    Returns minus the largest cosine, so that more is better; worse than any angle where a triangle is turned over.
    """
    to_b, to_c, along = b - tips[:, None], c - tips[:, None], np.broadcast_to(c - b, (len(tips), *b.shape))
    sides = [np.hypot(v[..., 0], v[..., 1]) for v in (to_b, to_c, along)]
    tiny = 1e-300
    at_tip = (to_b * to_c).sum(axis=2) / (sides[0] * sides[1] + tiny)
    at_b = -(to_b * along).sum(axis=2) / (sides[0] * sides[2] + tiny)
    at_c = (to_c * along).sum(axis=2) / (sides[1] * sides[2] + tiny)
    turned = to_b[..., 0] * to_c[..., 1] - to_b[..., 1] * to_c[..., 0] <= 0.0
    most = np.maximum(np.maximum(at_tip, at_b), at_c)
    return -np.where(turned, 2.0, most).max(axis=1)

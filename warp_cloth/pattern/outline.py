"""Vertices along the outlines of all panels: as many on either side of a seam, closer where the cloth is narrow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warp_cloth.pattern.curve import Curve, Floats
from warp_cloth.pattern.lattice import GRADE
from warp_cloth.pattern.loops import area_of
from warp_cloth.pattern.seam import Piece, Seam
from warp_cloth.pattern.specification import Dart, Panel, Pattern, Side, short

Ints = NDArray[np.int64]

NARROW = 1.3  # spacing over the width of a strip: a rectangle so cut in two has no angle below 37 degrees
BEND = 0.15  # [rad] that an edge of the mesh may turn: with it areas and lengths keep to 0.1 %
LONGER = 5e-4  # of a curve's length, by which its polygon may be longer in order to keep the area
AREA_KEPT = 5e-4  # of a panel's area, by which its polygon's may differ; thin panels need more than their curves give
CLOSEST = 0.125  # of the asked spacing: no seam is finer, however narrow or bent the cloth is
FACING = 0.5  # cosine between the inward normal and the way to a point beyond which it lies across the cloth
OPEN = np.radians(4.0)  # least angle of a corner; less is opened, as cloth there is narrower than a thread
HOLE_SIDES = 16  # of a hole's polygon at least
GROWN = (0.98, 1.02)  # of a hole's polygon about its middle; one of 16 sides in a circle lacks 1.3 %
CROSSING = np.radians(15.0)  # by which edges may cross at a corner that is opened
REACH = 24  # vertices from a corner up to which edges that cross are parted
MOST_OPENED = 8e-3  # [m] that a vertex is moved in doing so; outlines that cross by more are refused
ROUNDS = 2  # of passing spacings across seams and panels


@dataclass(frozen=True, eq=False)
class Outline:
    """A panel's outline as vertices in the order of its loop."""

    points: Floats  # [m], shape [n, 2]
    spacing: Floats  # [m] wanted at each vertex, shape [n]
    edges: tuple[int, ...]  # place in the panel of the edge that each vertex starts


@dataclass(frozen=True, eq=False)
class SewnOutlines:
    """All outlines, and which of their vertices are one; vertices are (panel, place in the outline)."""

    outlines: tuple[Outline, ...]
    seams: tuple[tuple[int, Ints, int, Ints], ...]  # panel and vertices of either side, as they meet
    holes: tuple[tuple[int, Floats, Floats], ...] = ()  # panel, vertices of a hole counter-clockwise, their spacing
    darts: tuple[tuple[int, Ints, Ints], ...] = ()  # hole, and its vertices on either side, as they meet
    notes: tuple[str, ...] = ()


@dataclass(eq=False)
class _Run:
    """A piece of an edge with samples at even fractions, at which the spacing is found."""

    piece: Piece
    curve: Curve
    fractions: Floats  # of the whole edge, shape [m + 1]
    points: Floats
    spacing: Floats  # [m]

    @property
    def length(self) -> float:
        return self.curve.length * (self.piece.high - self.piece.low)


def sewn_outlines(pattern: Pattern, seams: Sequence[Seam], edge: float) -> SewnOutlines:
    """Vertices about ``edge`` [m] apart on all outlines; either side of a seam is divided in the same ratios."""
    runs, pairs = _runs(pattern, seams, edge)
    by_panel = [[run for run in runs if run.piece.side.panel == index] for index in range(len(pattern.panels))]
    near = [_near(panel, own, edge) for panel, own in zip(pattern.panels, by_panel, strict=True)]
    for _ in range(ROUNDS):
        for own, limits in zip(by_panel, near, strict=True):
            _grade(own, limits)
        for (one, other), seam in zip(pairs, seams, strict=True):
            _share(one, other, seam.reverse)
    divided: dict[int, Floats] = {}
    for (one, other), seam in zip(pairs, seams, strict=True):
        shares = divided.get(id(one))  # there already where other layers are sewn to it
        if shares is None:
            shares = _divided(one, 2 if not (one.curve.is_line and other.curve.is_line) else 1)
        divided[id(one)], divided[id(other)] = shares, 1.0 - shares[::-1] if seam.reverse else shares
    for run in runs:
        if id(run) not in divided:
            divided[id(run)] = _divided(run, 1 if run.curve.is_line else 2)
    holes = [(n, *_hole(hole, edge)) for n, panel in enumerate(pattern.panels) for hole in panel.holes]
    darts = []
    for n, panel in enumerate(pattern.panels):
        for dart in panel.darts:
            points, spacing, half = _dart(dart, edge)
            there = (len(points) - np.arange(half + 1)) % len(points)
            darts.append((len(holes), np.arange(half + 1), there))
            holes.append((n, points, spacing))
    return replace(_collected(pattern, by_panel, divided, pairs, seams), holes=tuple(holes), darts=tuple(darts))


def _hole(edges: Sequence[Curve], edge: float) -> tuple[Floats, Floats]:
    """Vertices round a hole [m], shape [n, 2], and their spacing."""
    spacing = float(np.clip(sum(curve.length for curve in edges) / HOLE_SIDES, CLOSEST * edge, edge))
    points = []
    for curve in edges:
        count = max(2, int(np.ceil(curve.length / spacing)))
        points.append(curve.at(np.arange(count) / count))
    polygon = np.concatenate(points)
    middle = polygon.mean(axis=0)
    share = sum(curve.area for curve in edges) / max(area_of(polygon), 1e-12)
    grown = float(np.clip(np.sqrt(max(share, 0.0)), *GROWN))  # so that it encloses the hole's area
    return middle + grown * (polygon - middle), np.full(len(polygon), spacing)


def _dart(dart: Dart, edge: float) -> tuple[Floats, Floats, int]:
    """Vertices round a dart within a panel [m], shape [n, 2], their spacing, and how many steps a side has."""
    sides: list[list[Floats]] = [[], []]
    for pair in zip(dart.one, dart.other[::-1], strict=True):
        runs = [_drawn(Piece(Side(-1, -1)), curve, max(4, math.ceil(curve.length / edge)), edge) for curve in pair]
        bent = any(not curve.is_line for curve in pair)
        count = max(len(_divided(run, 2 if bent else 1)) for run in runs) - 1
        for own, run in zip(sides, runs, strict=True):
            own.append(_beside(run, _even(count))[:-1])
    one, other = np.concatenate(sides[0]), np.concatenate(sides[1][::-1])
    points = np.concatenate([one, other])
    return points, np.minimum(np.hypot(*(np.roll(points, -1, axis=0) - points).T), edge), len(one)


def _runs(pattern: Pattern, seams: Sequence[Seam], edge: float) -> tuple[list[_Run], list[tuple[_Run, _Run]]]:
    """Runs of all edges in the order of the loops, and those of each seam."""
    sewn: dict[Side, dict[Piece, list[tuple[int, int]]]] = {}
    steps = []
    for index, seam in enumerate(seams):
        lengths = [pattern.panels[p.side.panel].edges[p.side.edge].curve.length * (p.high - p.low) for p in seam.pieces]
        steps.append(max(4, math.ceil(max(lengths) / edge)))
        for which, piece in enumerate(seam.pieces):
            sewn.setdefault(piece.side, {}).setdefault(piece, []).append((index, which))
    layers = [[index for index, _ in places] for pieces in sewn.values() for places in pieces.values()]
    layers = [own for own in layers if len(own) > 1]
    uneven = True
    while uneven:  # all layers of a seam have as many steps
        uneven = False
        for own in layers:
            most = max(steps[index] for index in own)
            uneven |= any(steps[index] < most for index in own)
            for index in own:
                steps[index] = most
    runs: list[_Run] = []
    found: dict[tuple[int, int], _Run] = {}
    for panel_index, panel in enumerate(pattern.panels):
        for edge_index, drawn in enumerate(panel.edges):
            side, curve = Side(panel_index, edge_index), drawn.curve
            for piece, places in sorted(sewn.get(side, {Piece(side): []}).items(), key=lambda each: each[0].low):
                count = steps[places[0][0]] if places else max(4, math.ceil(curve.length / edge))
                run = _drawn(piece, curve, count, edge)
                for place in places:
                    found[place] = run
                runs.append(run)
    return runs, [(found[index, 0], found[index, 1]) for index in range(len(seams))]


def _drawn(piece: Piece, curve: Curve, count: int, edge: float) -> _Run:
    """A piece of an edge with the spacing that its length and bends allow."""
    fractions = piece.low + (piece.high - piece.low) * _even(count)
    points, bends = curve.with_bends(fractions)
    length = curve.length * (piece.high - piece.low)
    spacing = np.full(count + 1, min(edge, length / math.ceil(length / edge)))
    if not curve.is_line:
        bend = np.hypot(bends[:, 0], bends[:, 1])
        spacing = np.minimum(spacing, np.maximum(BEND / np.maximum(bend, 1e-9), 0.25 * edge))
    return _Run(piece, curve, fractions, points, spacing)


def _even(count: int) -> Floats:
    """Fractions from 0 to 1, shape [count + 1]."""
    return np.arange(count + 1) / count


@dataclass(frozen=True, eq=False)
class _Near:
    """Samples of one panel: the spacing that its width allows, and pairs near enough to bear on each other's."""

    allowed: Floats  # [m], shape [N]
    pairs: Ints  # shape [M, 2]
    apart: Floats  # [m], shape [M]


def _near(panel: Panel, runs: Sequence[_Run], edge: float) -> _Near:
    """What limits the spacing along a panel's outline, apart from its edges' lengths and bends."""
    from scipy.spatial import cKDTree

    points = np.concatenate([run.points for run in runs])
    of = np.concatenate([np.full(len(run.points), run.piece.side.edge) for run in runs])
    along = np.concatenate([_along(run.points) for run in runs])
    inward = np.column_stack([-along[:, 1], along[:, 0]]) * np.sign(panel.area)
    inward /= np.maximum(np.hypot(*inward.T), 1e-300)[:, None]
    pairs = cKDTree(points).query_pairs((1.0 - CLOSEST) / GRADE * edge, output_type="ndarray").astype(np.int64)
    pairs = np.concatenate([pairs, pairs[:, ::-1]])
    one, other = pairs.T
    way = points[other] - points[one]
    apart = np.hypot(*way.T)
    step = np.abs(of[one] - of[other])
    count = len(panel.edges)
    across = (np.minimum(step, count - step) > 1) & ((way * inward[one]).sum(axis=1) > FACING * apart)
    width = np.full(len(points), np.inf)
    np.minimum.at(width, one[across], apart[across])
    return _Near(np.clip(NARROW * width, CLOSEST * edge, edge), pairs, apart)


def _along(points: Floats) -> Floats:
    """The way of a polyline at its points, shape [n, 2]."""
    step = points[1:] - points[:-1]
    return np.concatenate([step[:1], 0.5 * (step[1:] + step[:-1]), step[-1:]])


def _grade(runs: Sequence[_Run], near: _Near) -> None:
    """Lets the spacing grow by no more than GRADE with the distance within a panel."""
    spacing = np.minimum(np.concatenate([run.spacing for run in runs]), near.allowed)
    graded = spacing.copy()
    np.minimum.at(graded, near.pairs[:, 0], spacing[near.pairs[:, 1]] + GRADE * near.apart)
    start = 0
    for run in runs:
        run.spacing = graded[start : start + len(run.points)]
        start += len(run.points)


def _share(one: _Run, other: _Run, reverse: bool) -> None:
    """Gives both sides of a seam the finer spacing, relative to their lengths."""
    there = other.spacing[::-1] if reverse else other.spacing
    relative = np.minimum(one.spacing / one.length, there / other.length)
    one.spacing, back = relative * one.length, relative * other.length
    other.spacing = back[::-1] if reverse else back


def _divided(run: _Run, fewest: int) -> Floats:
    """Fractions of a piece, from 0 to 1, at which it has vertices."""
    density = run.length / run.spacing
    total = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))]) / (len(density) - 1)
    count = max(fewest, int(np.ceil(total[-1] - 0.1)))
    shares = np.interp(total[-1] * _even(count), total, _even(len(density) - 1))
    shares[-1] = 1.0
    return shares


def _collected(
    pattern: Pattern,
    by_panel: Sequence[Sequence[_Run]],
    divided: dict[int, Floats],
    pairs: Sequence[tuple[_Run, _Run]],
    seams: Sequence[Seam],
) -> SewnOutlines:
    outlines, vertices, notes = [], {}, []
    for panel, runs in zip(pattern.panels, by_panel, strict=True):
        points, spacing, edges, start = [], [], [], 0
        total = sum(len(divided[id(run)]) - 1 for run in runs)
        for run in runs:
            shares = divided[id(run)]
            points.append(_beside(run, shares)[:-1])
            spacing.append(np.interp(shares, _even(len(run.spacing) - 1), run.spacing)[:-1])
            edges += [run.piece.side.edge] * (len(shares) - 1)
            vertices[id(run)] = (start + np.arange(len(shares))) % total
            start += len(shares) - 1
        drawn = np.concatenate(points)
        opened, told = _opened(panel, drawn, edges)
        notes += told
        outlines.append(Outline(_with_area(panel, drawn, opened, edges), np.concatenate(spacing), tuple(edges)))
    sewn = []
    for (one, other), seam in zip(pairs, seams, strict=True):
        there = vertices[id(other)][::-1] if seam.reverse else vertices[id(other)]
        sewn.append((one.piece.side.panel, vertices[id(one)], other.piece.side.panel, there))
    return SewnOutlines(tuple(outlines), tuple(sewn), notes=tuple(notes))


def _beside(run: _Run, shares: Floats) -> Floats:
    """Vertices beside a curve, so that the polygon through them has its length and encloses its area; shape [n + 1, 2].

    A polygon that turns by a at each vertex of a circle of radius R is shorter than it by a^2 / 24 of its length, and
    lies within it by R a^2 / 12 in the mean. Vertices moved outwards by half of that keep the length, by all of it
    the area; they are moved by three quarters, but not so that the length grows by more than LONGER.
    """
    fractions = run.piece.low + shares * (run.piece.high - run.piece.low)
    if run.curve.is_line or len(shares) < 3:
        return run.curve.at(fractions)
    step = 0.5 * run.length * (shares[2:] - shares[:-2])
    points, bends = run.curve.with_bends(fractions)
    bends = bends[1:-1]
    shift = np.zeros_like(points)
    shift[1:-1] = -bends * (step**2 / 24)[:, None]
    chords, moved = (float(np.hypot(*(p[1:] - p[:-1]).T).sum()) for p in (points, points + shift))
    if moved - chords <= 1e-9 * run.length:
        return points
    turns = (bends[:, 0] ** 2 + bends[:, 1] ** 2) * step**2
    wanted = run.length * (1.0 + min(LONGER, float(turns.mean()) / 48))
    return np.asarray(points + shift * min(max((wanted - chords) / (moved - chords), 0.0), 3.0))


def _with_area(panel: Panel, drawn: Floats, opened: Floats, edges: Sequence[int]) -> Floats:
    """The outline with what its area lacks or exceeds beyond AREA_KEPT spread over curved and opened edges.

    Their vertices between the corners are moved along the outline's normals, all by the same distance; those that the
    opening of a corner moved stay.
    """
    around = sum(edge.curve.area for edge in panel.edges)
    if abs(area_of(opened) - around) <= AREA_KEPT * abs(around):
        return opened
    of = np.array(edges)
    moved = (drawn != opened).any(axis=1)
    free = np.isin(of, [k for k, edge in enumerate(panel.edges) if not edge.curve.is_line])
    free = (free | np.isin(of, of[moved])) & ~moved & (of == np.roll(of, 1))
    points = opened.copy()
    for _ in range(2):  # the area is quadratic in the distance
        excess = area_of(points) - around
        excess = math.copysign(max(abs(excess) - AREA_KEPT * abs(around), 0.0), excess)
        along = 0.5 * (np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0))[free]
        length = np.hypot(*along.T)
        if excess == 0.0 or not length.sum() > 0.0:
            break
        outwards = np.column_stack([along[:, 1], -along[:, 0]]) / np.maximum(length, 1e-300)[:, None]
        points[free] -= outwards * (excess / length.sum())
    return points


def _opened(panel: Panel, points: Floats, edges: Sequence[int]) -> tuple[Floats, list[str]]:
    """The outline with its closed corners opened, and a note on each: edges that leave a corner side by side or cross.

    Drafted curves often meet a line almost along it, and cross it by a fraction of a millimetre.
    """
    count, moved, notes = len(points), points.copy(), []
    side = np.sign(panel.area)
    corners = [i for i in range(count) if edges[i] != edges[i - 1]]
    first = _corner_angles(moved, side)
    for corner in corners:
        if OPEN <= first[corner] < 2.0 * np.pi - CROSSING:
            continue
        steps = range(1, min(REACH, count // 3) + 1)
        ways = [[moved[(corner + sign * k) % count] - moved[corner] for k in steps] for sign in (1, -1)]
        ahead, behind = (np.arctan2(*np.array(way).T[::-1]) for way in ways)
        angle = np.unwrap(np.mod(side * (behind - ahead), 2.0 * np.pi))
        if angle[0] > 2.0 * np.pi - CROSSING:  # they cross, or run round the tip of a slit, which stays as narrow
            angle -= 2.0 * np.pi
        until = np.flatnonzero(angle >= OPEN)
        if angle[0] >= OPEN or not len(until) or angle[until[0]] >= np.pi:
            continue
        before, most = moved.copy(), 0.0
        for k in range(until[0]):
            turn = 0.5 * side * (OPEN - angle[k])
            for sign, way in ((1, ways[0][k]), (-1, ways[1][k])):
                c, s = np.cos(-sign * turn), np.sin(-sign * turn)
                to = moved[corner] + (c * way[0] - s * way[1], s * way[0] + c * way[1])
                most = max(most, float(np.hypot(*(to - moved[(corner + sign * k + sign) % count]))))
                moved[(corner + sign * (k + 1)) % count] = to
        if most > MOST_OPENED:
            moved = before
            continue
        first = _corner_angles(moved, side)
        numbers = [panel.edges[edges[place]].number for place in (corner - 1, corner)]
        told = f'panel "{short(panel.name)}", edges {numbers[0]} and {numbers[1]} touch or cross at their corner'
        notes.append(f"{told}: opened by up to {1e3 * most:.2g} mm")
    return moved, notes


def _corner_angles(points: Floats, side: float) -> Floats:
    """The cloth's angle at each vertex of an outline [rad], shape [n]."""
    step = np.roll(points, -1, axis=0) - points
    ahead, behind = np.arctan2(step[:, 1], step[:, 0]), np.arctan2(-step[:, 1], -step[:, 0])
    return _of_cloth(side * (np.roll(behind, 1) - ahead))


def _of_cloth(angle: Floats) -> Floats:
    """Angles [rad] as cloth has them: from -OPEN, a little below 0 where edges cross, to a turn less that."""
    return np.asarray(np.mod(angle + OPEN, 2.0 * np.pi) - OPEN)

"""Sizes of drawn pieces by a grade rule table: points with a rule move by it, those between them in proportion.

A point has a rule where a text "# 12" lies on it. Where no text states any, rules are counted: the first turn point of
the first piece has rule 1, and so on, if there are as many points as rules. Rules move along and across the grade
reference line (layer 5), as ASTM D6673 has it, or along the drawing's axes where there is none, or where sizes would
shrink instead of grow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.dxf_drawn import CUT, GRADE_LINE, GRAIN, SEW, TURN, Drawn
from warp_cloth.pattern.grade_table import GradeTable
from warp_cloth.pattern.labels import SIZE_KEYS, size_of
from warp_cloth.pattern.loops import area_of, chained
from warp_cloth.pattern.piece_sizes import rank

ON_POINT = 1e-3  # [m] from the text of a rule to its point
TRUNCATED = 2e-5  # relative, by which areas may shrink

Movement = dict[int, Floats]  # of the points of a loop that have a rule, shape [S, 2] each, in the file's unit


@dataclass(frozen=True, eq=False)
class _Graded:
    """A piece, its cut line as loops, and how far each of their points moves in each size."""

    drawn: Drawn
    loops: list[Floats]
    moved: list[Floats]  # shape [n, S, 2] each

    @property
    def points(self) -> Floats:
        return np.concatenate(self.loops)


def graded(pieces: Sequence[Drawn], table: GradeTable, metres: float) -> tuple[list[Drawn], list[str]]:
    """The pieces in all sizes of the table, and notes.

    Args:
        pieces: as drawn, in the sample size.
        table: as read.
        metres: metres in a unit of the drawing.
    """
    sizes = {size_of(piece).lower() for piece in pieces} - {""}
    if len(sizes) > 1:
        return list(pieces), ["the file has its sizes: the grade rule table is not used"]
    if len(table.sizes) < 2:
        return list(pieces), []
    scale = table.unit(metres) / metres
    rules = {number: scale * moved for number, moved in table.rules.items()}
    numbered = _counted(pieces, rules, metres)
    near = ON_POINT / metres
    ways = [[_axes(piece) for piece in pieces], [np.eye(2) for _ in pieces]]
    made = [
        [_moved(piece, own, rules, way, near) for piece, own, way in zip(pieces, numbered, axes, strict=True)]
        for axes in ways
    ]
    if not any(moved.any() for piece in made[0] for moved in piece.moved):
        return list(pieces), ["no point of a piece has a rule of the grade rule table: it is not used"]
    chosen = next((each for each in made if _grows(each, table.sizes)), made[0])
    notes = [f"sizes {', '.join(table.sizes)} by the grade rule table, from size {table.sample}"]
    if chosen is made[1] and any(not np.allclose(way, np.eye(2)) for way in ways[0]):
        notes.append("along grade reference lines sizes would shrink: rules are taken along the drawing's axes")
    still = sum(not any(moved.any() for moved in piece.moved) for piece in chosen)
    if still:
        notes.append(f"{still} of {len(pieces)} pieces have no grade rules: alike in all sizes")
    sample = table.sizes.index(table.sample)
    out = []
    for number, size in enumerate(table.sizes):
        named = {SIZE_KEYS[0]: size}
        for piece in chosen:
            own = {key: text for key, text in piece.drawn.texts.items() if key not in SIZE_KEYS} | named
            shifted = piece.drawn if number == sample else _in_size(piece, number)
            out.append(replace(shifted, texts=own))
    return out, notes


def _counted(pieces: Sequence[Drawn], rules: dict[int, Floats], metres: float) -> list[list[tuple[Floats, int]]]:
    """The points of each piece that have rules, and which."""
    if any(piece.rules for piece in pieces):
        return [piece.rules for piece in pieces]
    found = []
    count = 0
    for piece in pieces:
        points: list[Floats] = []
        for point in piece.points.get(TURN, []):
            if all(float(np.hypot(*(point - other))) > ON_POINT / metres for other in points):
                points.append(point)
        found.append([(point, count + k + 1) for k, point in enumerate(points)])
        count += len(points)
    return found if count == len(rules) else [[] for _ in pieces]


def _axes(piece: Drawn) -> Floats:
    """The axes of its rules as rows, shape [2, 2]: along the grade reference line, and to its left."""
    spans = [line[-1] - line[0] for line in piece.lines.get(GRADE_LINE, [])]
    span = max(spans, key=lambda each: float(np.hypot(*each)), default=np.zeros(2))
    length = float(np.hypot(*span))
    if length <= 0.0:
        return np.eye(2)
    x, y = span / length
    return np.array([[x, y], [-y, x]])


def _moved(
    piece: Drawn, numbered: Sequence[tuple[Floats, int]], rules: dict[int, Floats], axes: Floats, near: float
) -> _Graded:
    loops = chained(piece.lines.get(CUT) or piece.lines.get(SEW, []))
    count = len(next(iter(rules.values()))) if rules else 0
    return _Graded(piece, loops, [_movement(loop, numbered, rules, axes, near, count) for loop in loops])


def _movement(
    loop: Floats,
    numbered: Sequence[tuple[Floats, int]],
    rules: dict[int, Floats],
    axes: Floats,
    near: float,
    count: int,
) -> Floats:
    """How far each point of a loop moves in each size, shape [n, S, 2]: in proportion between those with rules."""
    known: Movement = {}
    for point, number in numbered:
        apart = np.hypot(*(loop - point).T)
        place = int(apart.argmin())
        if number in rules and apart[place] <= near:
            known[place] = rules[number] @ axes
    if not known:
        return np.zeros((len(loop), count, 2))
    step = np.hypot(*(np.roll(loop, -1, axis=0) - loop).T)
    reach = np.concatenate([[0.0], np.cumsum(step)])
    places = sorted(known)
    stops = np.array([*(reach[place] for place in places), reach[places[0]] + reach[-1]])
    values = np.array([*(known[place] for place in places), known[places[0]]]).reshape(len(stops), -1)
    at = reach[:-1] + np.where(reach[:-1] < stops[0], reach[-1], 0.0)
    columns = [np.interp(at, stops, values[:, column]) for column in range(values.shape[1])]
    return np.stack(columns, axis=1).reshape(len(loop), count, 2)


def _grows(pieces: Sequence[_Graded], sizes: Sequence[str]) -> bool:
    """Whether larger sizes have larger pieces, in all."""
    order = sorted(range(len(sizes)), key=lambda number: rank(sizes[number]))
    areas = [
        sum(abs(area_of(loop + moved[:, number])) for p in pieces for loop, moved in zip(p.loops, p.moved, strict=True))
        for number in order
    ]
    return all(b >= (1.0 - TRUNCATED) * a for a, b in pairwise(areas))


def _in_size(piece: _Graded, number: int) -> Drawn:
    """A piece in another size: its loops as they move, what else is drawn as the points of these nearest to it."""
    drawn = piece.drawn
    main = CUT if drawn.lines.get(CUT) else SEW
    if not piece.loops:
        return drawn
    moved = np.concatenate([each[:, number] for each in piece.moved])
    points = piece.points

    def shifted(line: Floats) -> Floats:
        return line + moved[_nearest(line, points)]

    loops = [loop + each[:, number] for loop, each in zip(piece.loops, piece.moved, strict=True)]
    lines = {
        layer: found if layer in (GRAIN, GRADE_LINE) else [shifted(line) for line in found]
        for layer, found in drawn.lines.items()
    }
    lines[main] = [np.concatenate([loop, loop[:1]]) for loop in loops]
    marks = {layer: [shifted(point[None])[0] for point in found] for layer, found in drawn.points.items()}
    return replace(drawn, lines=lines, points=marks, rules=[])


def _nearest(line: Floats, points: Floats) -> NDArray[np.int64]:
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(points).query(line)[1], dtype=np.int64)

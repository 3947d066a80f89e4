"""Drawn pieces as pieces to cut, in metres: outlines with numbered edges, grain upright, folds opened."""

from __future__ import annotations

import re
from collections.abc import Container, Sequence
from dataclasses import replace

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.drawn_darts import turned, with_darts
from warp_cloth.pattern.dxf import Drawing
from warp_cloth.pattern.dxf_drawn import CUT_OUT, FOLD, GRAIN, INTERNAL, TURN, Drawn
from warp_cloth.pattern.dxf_unit import unit_of
from warp_cloth.pattern.grade_table import GradeTable
from warp_cloth.pattern.grading import graded
from warp_cloth.pattern.inner_sew_lines import with_inner_sew_lines
from warp_cloth.pattern.kinds import Named, named_all
from warp_cloth.pattern.labels import ON_FOLD, PLEATED, copies_of, name_of, plain_text, size_of
from warp_cloth.pattern.lattice import inside
from warp_cloth.pattern.loops import area_of, smoothed
from warp_cloth.pattern.marks import NO_POINTS, carried, corners_of, marks_of, notches_of, with_cut_notches
from warp_cloth.pattern.nests import unnested, without_shadows
from warp_cloth.pattern.piece import Piece
from warp_cloth.pattern.piece_sizes import numbered, sized, sized_by_blocks
from warp_cloth.pattern.sewn_line import SewnLine, closed_loops, sewn_line
from warp_cloth.pattern.specification import MOST_EDGES, SMALLEST, short

SMOOTH = 4e-3  # [m] between points of a curve
FOLD_NEAR = 2e-3  # [m]
SMALL_HOLE = 0.02  # [m] across: buttonholes, eyelets and drills are left closed
QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])  # turns +x to +y
UPRIGHT = 0.05  # across over along the grain, of an edge that a text says is on the fold
NOTCH_OFF = 2e-3  # [m] from a notch to a line that it is on
ALIKE = 3e-3  # [m] to which corners of a symmetric piece agree
ABOUT = (("category", "description"), ("material", "fabric"))  # texts that tell what a piece is


def pieces_of(
    file: str,
    drawing: Drawing,
    allowance: float,
    table: GradeTable | None = None,
    undarted: Container[str] = (),
    sideways: bool = False,
) -> tuple[tuple[Piece, ...], list[str]]:
    """All pieces of a drawing, in all sizes, and notes on the whole file.

    Args:
        file: for messages.
        drawing: as read.
        allowance: seam allowance [m] of pieces without a sew line.
        table: grade rules of the pieces.
        undarted: names of pieces whose inner lines show no darts.
        sideways: the warp of pieces without a grain line is along x of the drawing, not y.

    Raises:
        InputError: a piece has no closed outline, or an impossible size.
    """
    metres, told = unit_of(file, drawing)
    every, lined = with_inner_sew_lines(drawing.pieces, metres)
    every, nested = unnested(without_shadows(every))
    if table is not None:
        every, by_rules = graded(every, table, metres)
        nested += by_rules
    loops = [sewn_line(file, drawn, metres, allowance) for drawn in every]
    groups: dict[str, list[int]] = {}
    for index, drawn in enumerate(every):
        groups.setdefault(name_of(drawn), []).append(index)
    pieces, abouts = [], []
    for index, (drawn, loop) in enumerate(zip(every, loops, strict=True)):
        # what only one size states, as AccuMark's sample size does, goes for all
        others = [index, *groups[name_of(drawn)]]
        texts: dict[str, str] = {}
        for each in others:
            texts = {key: text for key, text in every[each].texts.items() if text} | texts
        alike = [each for each in others if len(loops[each].points) == len(loop.points)]
        marked = next((each for each in alike if TURN in every[each].points), index)
        darted = name_of(drawn) not in undarted
        pieces.append(
            _piece(file, drawn, loop, copies_of(drawn, texts), every[marked], loops[marked], metres, darted, sideways)
        )
        abouts.append([texts.get(key) or texts.get(other, "") for key, other in ABOUT])
    by_names = sized_by_blocks(sized(pieces), [plain_text(drawn.block) for drawn in every])
    pieces, counted = numbered(by_names)
    kinds = named_all([(piece.name, *about) for piece, about in zip(pieces, abouts, strict=True)])
    found = tuple(replace(piece, what=what) for piece, what in zip(pieces, kinds, strict=True))
    return found, [*told, *lined, *nested, *counted]


def _piece(
    file: str,
    drawn: Drawn,
    loop: SewnLine,
    copies: tuple[int, int] | None,
    sample: Drawn,
    there: SewnLine,
    metres: float,
    darted: bool,
    sideways: bool,
) -> Piece:
    """A piece; ``sample``, with its loop, has the marks, where it has none itself; ``darted``: see ``pieces_of``."""
    name, size = name_of(drawn), size_of(drawn)
    place = f'{file}: piece "{short(name)}"'
    notes = list(loop.notes)
    marks = marks_of(drawn, metres)
    if sample is not drawn:
        marks = carried(marks_of(sample, metres), there.points, loop.points) | marks
    marks = with_cut_notches(marks, loop.notches)
    lines = {layer: [metres * line for line in found] for layer, found in drawn.lines.items()}
    cut = with_darts(loop.points, lines.get(INTERNAL, []) if darted else [])
    notches = _clear_of(notches_of(loop.points, marks), cut.removed)
    marks |= {TURN: np.concatenate([marks[TURN], cut.corners])} if TURN in marks else {}
    edges = _edges(cut.outline, corners_of(cut.outline, marks, np.concatenate([loop.ends, cut.corners])))
    if len(edges) > MOST_EDGES:
        raise InputError(place, f"has {len(edges):,} corners; an outline has up to {MOST_EDGES:,}", "smooth it")
    grain = _grain(lines, notes, sideways)
    edges = [edge.turned(grain, np.zeros(2)) for edge in edges]
    notches = notches @ grain.T
    darts = [turned(dart, grain, np.zeros(2)) for dart in cut.inner]
    cut_out = _holes(loop.points, lines.get(CUT_OUT, []), loop.inner, notes)
    holes = [[edge.turned(grain, np.zeros(2)) for edge in _edges(h, corners_of(h, {}, NO_POINTS))] for h in cut_out]
    inner = tuple(line @ grain.T for layer in (INTERNAL, FOLD) for line in lines.get(layer, []))
    mirror: tuple[int, ...] | None
    fold = _fold_of(edges, [line @ grain.T for line in lines.get(FOLD, [])] or _told_folds(drawn, edges))
    if fold is not None and cut.removed and not _follow(fold[2]):
        plain = _piece(file, drawn, loop, copies, sample, there, metres, False, sideways)
        left = f'piece "{short(name)}": a dart opens at its fold line, so its darts are left as they are drawn'
        return replace(plain, notes=(*plain.notes, left))
    if fold is not None:
        start, along, flat = fold
        matrix = 2.0 * np.outer(along, along) - np.eye(2)
        shift = start - matrix @ start
        edges, mirror = _unfolded(edges, flat, start, along)
        notches = np.concatenate([notches, notches @ matrix.T + shift])
        holes += [[edge.turned(matrix, shift).reversed for edge in hole[::-1]] for hole in holes]
        darts += [turned(dart, matrix, shift) for dart in darts]
        notes.append("is a half: mirrored at its fold line")
    else:
        edges, mirror = halved(edges)
    if re.search(PLEATED, " ".join((*drawn.texts.values(), *drawn.remarks)).lower()):
        notes.append("its pleats are not folded: what is longer at a seam is gathered")
    if cut.removed or darts:
        count = len(cut.removed) * (1 if fold is None else 2) + len(darts)
        notes.append(f"{count} dart{'s' * (count > 1)} drawn as inner lines: cut out, to be sewn")
    told = tuple(f'piece "{short(name)}": {note}' for note in notes)
    return Piece(
        name, size, copies, tuple(edges), mirror, notches, inner, tuple(map(tuple, holes)), tuple(darts), told, Named()
    )


def _clear_of(notches: Floats, removed: Sequence[Floats]) -> Floats:
    """The notches that do not lie on what is no longer outline, between a dart's legs."""
    kept = np.ones(len(notches), dtype=bool)
    for line in removed:
        fine = Chain(line).at(np.linspace(0.0, 1.0, 129))
        away = np.hypot(*np.moveaxis(notches[:, None] - fine[None], 2, 0)).min(axis=1, initial=np.inf)
        ends = np.hypot(*np.moveaxis(notches[:, None] - line[None, [0, -1]], 2, 0)).min(axis=1)
        kept &= (away > NOTCH_OFF) | (ends <= NOTCH_OFF)
    return notches[kept]


def _holes(outline: Floats, lines: Sequence[Floats], loops: Sequence[Floats], notes: list[str]) -> list[Floats]:
    """What is cut out of a piece, of lines and loops: loops counter-clockwise."""
    found: list[Floats] = []
    drawn = closed_loops(lines, 1.0)
    for loop in (*drawn, *loops):
        across = float(np.ptp(loop, axis=0).max())
        if across < SMALL_HOLE or area_of(loop) < 0.1 * SMALL_HOLE**2:
            notes.append(f"a cut-out of {1e3 * across:.0f} mm is left closed")
        elif not inside(outline, loop).all() or any(inside(hole, loop).any() for hole in found):
            notes.append(f"a cut-out of {1e3 * across:.0f} mm does not lie within it: left closed")
        else:
            found.append(loop)
    if lines and not drawn:
        notes.append("its cut-outs are open lines: left closed")
    return found


def _edges(loop: Floats, corners: Sequence[int]) -> list[Chain]:
    """The edges between corners, curves smooth, from the first corner on."""
    edges = []
    for start, end in zip(corners, [*corners[1:], corners[0] + len(loop)], strict=True):
        points = loop[np.arange(start, end + 1) % len(loop)]
        edges.append(Chain(smoothed(points, SMOOTH)))
    return edges


def _grain(lines: dict[int, list[Floats]], notes: list[str], sideways: bool) -> Floats:
    """The rotation that turns the grain line to +y, shape [2, 2]; the longest line counts, others are its arrow.

    ``sideways``: without a grain line the warp is along x of the drawing.
    """
    spans = [line[-1] - line[0] for line in lines.get(GRAIN, [])]
    way = max(spans, key=lambda span: float(np.hypot(*span)), default=np.zeros(2))
    length = float(np.hypot(*way))
    if length < SMALLEST:
        notes.append(f"has no grain line: the warp is taken along {'x' if sideways else 'y'} of the drawing")
        return QUARTER if sideways else np.eye(2)
    x, y = way / length
    return np.array([[y, -x], [x, y]])


def _fold_of(edges: Sequence[Chain], folds: Sequence[Floats]) -> tuple[Floats, Floats, list[bool]] | None:
    """The fold line that is an edge of a piece: a point, its direction, and which edges lie on it."""
    outline = np.concatenate([edge.points for edge in edges])
    for fold in folds:
        start, along = fold[0], fold[-1] - fold[0]
        length = float(np.hypot(*along))
        if length < SMALLEST:
            continue
        along = along / length
        aside = (outline - start) @ np.array([-along[1], along[0]])
        if aside.min() < -FOLD_NEAR and aside.max() > FOLD_NEAR:
            continue  # inside: where the whole piece is folded
        flat = [_off(edge, start, along) <= FOLD_NEAR for edge in edges]
        if any(flat) and not all(flat):
            return start, along, flat
    return None


def _follow(flat: Sequence[bool]) -> bool:
    """Whether the edges that lie on a fold follow each other."""
    return sum(flat[k - 1] and not flat[k] for k in range(len(flat))) == 1


def _told_folds(drawn: Drawn, edges: Sequence[Chain]) -> list[Floats]:
    """The longest straight edge along the grain, where a text says that the piece is cut on the fold."""
    said = " ".join((*drawn.texts.values(), *drawn.remarks)).lower()
    if not re.search(ON_FOLD, said):
        return []
    ends = [np.stack([edge.start, edge.end]) for edge in edges]
    along = [np.abs(line[1] - line[0]) for line in ends]
    straight = [
        k
        for k, (x, y) in enumerate(along)
        if x <= UPRIGHT * y and _off(edges[k], edges[k].start, (ends[k][1] - ends[k][0]) / y) < FOLD_NEAR
    ]
    return [ends[max(straight, key=lambda k: edges[k].chord)]] if straight else []


def opened(piece: Piece, centre: Sequence[int]) -> Piece | None:
    """A half piece mirrored at the edges of its centre; None where these are no straight fold."""
    made = mirrored_at(piece.edges, centre)
    if made is None:
        return None
    edges, mirror, matrix, shift = made
    notches = np.concatenate([piece.notches, piece.notches @ matrix.T + shift])
    other = tuple(tuple(edge.turned(matrix, shift).reversed for edge in hole[::-1]) for hole in piece.holes)
    darts = (*piece.darts, *(turned(dart, matrix, shift) for dart in piece.darts))
    return replace(piece, edges=edges, mirror=mirror, notches=notches, holes=(*piece.holes, *other), darts=darts)


def mirrored_at(
    edges: Sequence[Chain], run: Sequence[int]
) -> tuple[tuple[Chain, ...], tuple[int, ...], Floats, Floats] | None:
    """An outline and its mirror image at a run of its edges as one; None where these are no straight fold.

    Also which edge is each one's mirror image, and the reflection: ``matrix @ point + shift``.
    """
    fold = _fold_of(edges, [np.stack([edges[run[0]].start, edges[run[-1]].end])])
    if fold is None or {k for k, flat in enumerate(fold[2]) if flat} != set(run):
        return None
    start, along, flat = fold
    both, mirror = _unfolded(edges, flat, start, along)
    matrix = 2.0 * np.outer(along, along) - np.eye(2)
    return tuple(both), mirror, matrix, np.asarray(start - matrix @ start)


def _unfolded(
    edges: Sequence[Chain], flat: Sequence[bool], start: Floats, along: Floats
) -> tuple[list[Chain], tuple[int, ...]]:
    """The whole piece of one that is cut on the fold."""
    first = next(k for k in range(len(edges)) if flat[k - 1] and not flat[k])
    order = [(first + k) % len(edges) for k in range(len(edges))]
    kept = _onto([edges[k] for k in order if not flat[k]], start, along)
    matrix = 2.0 * np.outer(along, along) - np.eye(2)
    shift = start - matrix @ start
    both = [*kept, *(edge.turned(matrix, shift).reversed for edge in kept[::-1])]
    return both, tuple(range(len(both)))[::-1]


def _off(edge: Chain, start: Floats, along: Floats) -> float:
    """How far an edge goes from a line."""
    return float(np.abs((edge.points - start) @ np.array([-along[1], along[0]])).max())


def _onto(edges: list[Chain], start: Floats, along: Floats) -> list[Chain]:
    """Edges whose first and last point lie on the fold exactly."""
    first, last = edges[0].points.copy(), edges[-1].points.copy()
    if len(edges) == 1:
        last = first
    first[0] = start + along * ((first[0] - start) @ along)
    last[-1] = start + along * ((last[-1] - start) @ along)
    return [Chain(first), *edges[1:-1], Chain(last)] if len(edges) > 1 else [Chain(first)]


def halved(edges: list[Chain]) -> tuple[list[Chain], tuple[int, ...] | None]:
    """The edges of a piece that is symmetric about its grain, parted where they cross the middle; else as they are."""
    outline = np.concatenate([edge.points[:-1] for edge in edges])
    middle = 0.5 * float(outline[:, 0].min() + outline[:, 0].max())
    flip = np.array([2.0 * middle, 0.0])
    starts = np.array([edge.start for edge in edges])
    mirrored = np.array([edge.end for edge in edges]) * (-1.0, 1.0) + flip
    apart = np.hypot(*np.moveaxis(mirrored[:, None] - starts[None], 2, 0))
    twin = apart.argmin(axis=1)
    if apart.min(axis=1).max() > ALIKE or len(set(twin.tolist())) < len(edges):
        return edges, None
    half = np.linspace(0.0, 1.0, 9)
    for edge, other in zip(edges, twin.tolist(), strict=True):
        there = edges[other].at(1.0 - half) * (-1.0, 1.0) + flip
        if float(np.hypot(*(edge.at(half) - there).T).max()) > ALIKE:
            return edges, None
    parted: list[Chain] = []
    where: dict[int, list[int]] = {}
    for k, edge in enumerate(edges):
        where[k] = [len(parted)] if twin[k] != k else [len(parted), len(parted) + 1]
        parted += [edge] if twin[k] != k else [edge.part(0.0, 0.5), edge.part(0.5, 1.0)]
    mirror = [0] * len(parted)
    for k, other in enumerate(twin.tolist()):
        if other == k:
            mirror[where[k][0]], mirror[where[k][1]] = where[k][1], where[k][0]
        else:
            mirror[where[k][0]] = where[other][0]
    return parted, tuple(mirror)

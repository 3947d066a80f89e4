"""Drawn pieces as pieces to cut, in metres: outlines with numbered edges, grain upright, folds opened."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.dxf import CUT, CUT_OUT, FOLD, GRAIN, INTERNAL, SEW, TURN, Drawing, Drawn
from warp_cloth.pattern.dxf_unit import unit_of
from warp_cloth.pattern.kinds import Named, named_all
from warp_cloth.pattern.lattice import inside
from warp_cloth.pattern.loops import area_of, chained, cleaned, gap_of, inset, smoothed
from warp_cloth.pattern.marks import NO_POINTS, carried, corners_of, marks_of, notches_of
from warp_cloth.pattern.specification import LARGEST, MOST_EDGES, NO_LENGTH, SMALLEST, short

OPEN_GAP = 2e-3  # [m] that an outline may be open without a note
SMOOTH = 4e-3  # [m] between points of a curve
FOLD_NEAR = 2e-3  # [m]
SMALL_HOLE = 0.02  # [m] across: buttonholes, eyelets and drills are left closed
UPRIGHT = 0.05  # across over along the grain, of an edge that a text says is on the fold
ALIKE = 3e-3  # [m] to which corners of a symmetric piece agree
ABOUT = (("category", "description"), ("material", "fabric"))  # texts that tell what a piece is
# Keys of texts, in the languages of programs
NAME_KEYS = (
    *("piecename", "partname", "piece", "part", "name", "patternname", "teilename", "teilbezeichnung", "bezeichnung"),
    *("nompiece", "nomdelapiece", "nom", "nombrepieza", "nombredelapieza", "nombre", "pieza", "nomepezzo", "nome"),
)
SIZE_KEYS = ("size", "sizename", "groesse", "grosse", "konfektionsgrosse", "taille", "talla", "taglia", "tamanho")
COUNT_KEYS = ("quantity", "qty", "pieces", "anzahl", "stuckzahl", "quantite", "cantidad", "quantita", "quantidade")
PAIR = r"\bpairs?\b|\bpaare?\b|\bpaires?\b|\bpar(es)?\b|\bpai[ao]\b|[对對双雙]"
ON_FOLD = r"\bon (the )?fold|\bau pli|\bbruch\b|stoffbruch|\bdoblez|\bpiega\b|对折|對折"
SIZES = ("XXXS", "XXS", "XS", "S", "M", "L", "XL", "XXL", "XXXL", "2XL", "3XL", "4XL", "5XL", "6XL")


@dataclass(frozen=True, eq=False)
class Piece:
    """A piece as cut, its grain along +y, its loop counter-clockwise as drawn."""

    name: str
    size: str
    copies: tuple[int, int] | None  # as drawn, and mirrored; None: not stated
    edges: tuple[Chain, ...]
    mirror: tuple[int, ...] | None  # the edge that each is the mirror image of in a symmetric piece
    notches: Floats  # [m], shape [N, 2]
    lines: tuple[Floats, ...]  # inner lines, drawn only [m], shape [n, 2] each
    holes: tuple[tuple[Chain, ...], ...]  # cut out of it, counter-clockwise
    notes: tuple[str, ...]
    what: Named  # what its texts say it is

    @property
    def outline(self) -> Floats:
        return np.concatenate([edge.points[:-1] for edge in self.edges])


def pieces_of(file: str, drawing: Drawing, allowance: float) -> tuple[tuple[Piece, ...], list[str]]:
    """All pieces of a drawing, in all sizes, and notes on the whole file.

    Args:
        file: for messages.
        drawing: as read.
        allowance: seam allowance [m] of pieces without a sew line.

    Raises:
        InputError: a piece has no closed outline, or an impossible size.
    """
    metres, told = unit_of(file, drawing)
    loops = [_outline(file, drawn, metres, allowance) for drawn in drawing.pieces]
    groups: dict[str, list[int]] = {}
    for index, drawn in enumerate(drawing.pieces):
        groups.setdefault(_named(drawn)[0], []).append(index)
    pieces, abouts = [], []
    for index, (drawn, loop) in enumerate(zip(drawing.pieces, loops, strict=True)):
        # what only one size states, as AccuMark's sample size does, goes for all
        others = [index, *groups[_named(drawn)[0]]]
        texts: dict[str, str] = {}
        for each in others:
            texts = {key: text for key, text in drawing.pieces[each].texts.items() if text} | texts
        alike = [each for each in others if len(loops[each].points) == len(loop.points)]
        marked = next((each for each in alike if TURN in drawing.pieces[each].points), index)
        pieces.append(_piece(file, drawn, loop, _copies(texts), drawing.pieces[marked], loops[marked], metres))
        abouts.append([texts.get(key) or texts.get(other, "") for key, other in ABOUT])
    pieces = _sized(pieces)
    kinds = named_all([(piece.name, *about) for piece, about in zip(pieces, abouts, strict=True)])
    return tuple(replace(piece, what=what) for piece, what in zip(pieces, kinds, strict=True)), told


def _piece(
    file: str, drawn: Drawn, loop: _Loop, copies: tuple[int, int] | None, sample: Drawn, there: _Loop, metres: float
) -> Piece:
    """A piece; ``sample``, with its loop, has the marks, where it has none itself."""
    name, size = _named(drawn)
    place = f'{file}: piece "{short(name)}"'
    notes = list(loop.notes)
    marks = marks_of(drawn, metres)
    if sample is not drawn:
        marks = carried(marks_of(sample, metres), there.points, loop.points) | marks
    lines = {layer: [metres * line for line in found] for layer, found in drawn.lines.items()}
    edges = _edges(loop.points, corners_of(loop.points, marks, loop.ends))
    if len(edges) > MOST_EDGES:
        raise InputError(place, f"has {len(edges):,} corners; an outline has up to {MOST_EDGES:,}", "smooth it")
    grain = _grain(lines, notes)
    edges = [edge.turned(grain, np.zeros(2)) for edge in edges]
    notches = notches_of(loop.points, marks) @ grain.T
    cut_out = _holes(loop.points, lines.get(CUT_OUT, []), loop.inner, notes)
    holes = [[edge.turned(grain, np.zeros(2)) for edge in _edges(h, corners_of(h, {}, NO_POINTS))] for h in cut_out]
    inner = tuple(line @ grain.T for layer in (INTERNAL, FOLD) for line in lines.get(layer, []))
    mirror: tuple[int, ...] | None
    fold = _fold_of(edges, [line @ grain.T for line in lines.get(FOLD, [])] or _told_folds(drawn, edges))
    if fold is not None:
        start, along, flat = fold
        matrix = 2.0 * np.outer(along, along) - np.eye(2)
        shift = start - matrix @ start
        edges, mirror = _unfolded(edges, flat, start, along)
        notches = np.concatenate([notches, notches @ matrix.T + shift])
        holes += [[edge.turned(matrix, shift).reversed for edge in hole[::-1]] for hole in holes]
        notes.append("is a half: mirrored at its fold line")
    else:
        edges, mirror = _halved(edges)
    told = tuple(f'piece "{short(name)}": {note}' for note in notes)
    return Piece(name, size, copies, tuple(edges), mirror, notches, inner, tuple(map(tuple, holes)), told, Named())


def _named(drawn: Drawn) -> tuple[str, str]:
    return _plain(drawn.said(*NAME_KEYS) or drawn.block) or "piece", _plain(drawn.said(*SIZE_KEYS))


def _plain(text: str) -> str:
    return re.sub(r"\s+", " ", "".join(c if c.isprintable() else " " for c in text)).strip()[:100]


def _copies(texts: dict[str, str]) -> tuple[int, int] | None:
    """How many are cut as drawn, and mirrored: "2" means a pair, "1,1" says so."""
    text = next((texts[key] for key in COUNT_KEYS if texts.get(key)), "")
    numbers = [min(int(each), 99) for each in re.findall(r"\d{1,4}", text)[:2]]
    if re.search(PAIR, text.lower()):
        count = max(numbers[:1] or [1])
        return count, count
    if not numbers or not any(numbers):
        return None
    if len(numbers) == 2:
        return numbers[0], numbers[1]
    return (numbers[0] + 1) // 2, numbers[0] // 2


@dataclass(frozen=True, eq=False)
class _Loop:
    """The line to sew along [m], the ends of the lines that draw it, and loops of the cut line within it."""

    points: Floats  # counter-clockwise, shape [n, 2]
    ends: Floats
    inner: list[Floats]
    notes: tuple[str, ...]


def _outline(file: str, drawn: Drawn, metres: float, allowance: float) -> _Loop:
    """The sew line, or the cut line without the stated allowance."""
    place, notes = f'{file}: piece "{short(_named(drawn)[0])}"', []
    loops, within = {}, []
    for layer in (CUT, SEW):
        found = drawn.lines.get(layer, [])
        closed = _closed(found, metres)
        if layer == SEW and not closed and found:  # not drawn along the fold
            closed = _closed([*found, *drawn.lines.get(FOLD, [])], metres)
        if closed:
            loops[layer] = max(closed, key=lambda loop: abs(area_of(loop)))
            gap = gap_of([metres * line for line in found], loops[layer])
            if gap > OPEN_GAP and layer == CUT:
                notes.append(f"its outline was open by {1e3 * gap:.0f} mm: closed")
            if layer == CUT:
                half = 0.5 * area_of(loops[CUT])
                within = [loop for loop in closed if loop is not loops[CUT] and area_of(loop) < half]
    sewn = SEW in loops and (CUT not in loops or area_of(loops[SEW]) > 0.5 * area_of(loops[CUT]))
    if not loops:
        raise InputError(place, "its outline is not closed", "close the line on layer 1 (the cut line)")
    if SEW in drawn.lines and not sewn:
        notes.append("its sew line does not go round it: the cut line is used")
    loop = loops[SEW] if sewn else loops[CUT]
    ends = [metres * line[[0, -1]] for line in drawn.lines[SEW if sewn else CUT]]
    if not sewn and allowance > 0.0:
        inner = cleaned(inset(loop, allowance), NO_LENGTH)
        if len(inner) < 3 or not 0.0 < area_of(inset(loop, allowance)) < area_of(loop):
            raise InputError(place, f"is too narrow for a seam allowance of {1e3 * allowance:g} mm", "make it smaller")
        loop, ends = inner, []
    extent = float(np.ptp(loop, axis=0).max())
    if not SMALLEST <= extent <= LARGEST:
        raise InputError(place, f"is {1e3 * extent:.4g} mm across, which no piece is", "check the unit of the file")
    if area_of(loop) < 1e-4 * extent**2:
        raise InputError(place, "its outline has no area", "correct it")
    if not 1 < len(ends) < 0.25 * len(loop):  # each side is a line of its own, or all are one
        ends = []
    return _Loop(loop, np.concatenate(ends) if ends else NO_POINTS, within, tuple(notes))


def _closed(lines: Sequence[Floats], metres: float) -> list[Floats]:
    """Loops that lines draw [m]."""
    loops = [cleaned(metres * loop, NO_LENGTH) for loop in chained(lines)]
    return [loop for loop in loops if len(loop) > 2]


def _holes(outline: Floats, lines: Sequence[Floats], loops: Sequence[Floats], notes: list[str]) -> list[Floats]:
    """What is cut out of a piece, of lines and loops: loops counter-clockwise."""
    found: list[Floats] = []
    drawn = _closed(lines, 1.0)
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


def _grain(lines: dict[int, list[Floats]], notes: list[str]) -> Floats:
    """The rotation that turns the grain line to +y, shape [2, 2]; the longest line counts, others are its arrow."""
    spans = [line[-1] - line[0] for line in lines.get(GRAIN, [])]
    way = max(spans, key=lambda span: float(np.hypot(*span)), default=np.zeros(2))
    length = float(np.hypot(*way))
    if length < SMALLEST:
        notes.append("has no grain line: the warp is taken along y of the drawing")
        return np.eye(2)
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
    fold = _fold_of(piece.edges, [np.stack([piece.edges[centre[0]].start, piece.edges[centre[-1]].end])])
    if fold is None or {k for k, flat in enumerate(fold[2]) if flat} != set(centre):
        return None
    start, along, flat = fold
    edges, mirror = _unfolded(piece.edges, flat, start, along)
    matrix = 2.0 * np.outer(along, along) - np.eye(2)
    shift = start - matrix @ start
    notches = np.concatenate([piece.notches, piece.notches @ matrix.T + shift])
    other = tuple(tuple(edge.turned(matrix, shift).reversed for edge in hole[::-1]) for hole in piece.holes)
    return replace(piece, edges=tuple(edges), mirror=mirror, notches=notches, holes=(*piece.holes, *other))


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


def _halved(edges: list[Chain]) -> tuple[list[Chain], tuple[int, ...] | None]:
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


def _sized(pieces: list[Piece]) -> list[Piece]:
    """The pieces with sizes that only their names state ("FRONT-M"), where names so end in sizes."""
    ends = [re.match(r"^(.*\S)\s*[-_ .(]\s*([A-Za-z0-9]{1,4})\)?$", piece.name) for piece in pieces]
    firsts = {found[1].upper() for piece in pieces if (found := _FIRST.match(piece.name))}
    out = []
    for piece, found in zip(pieces, ends, strict=True):
        if found is None:
            out.append(piece if piece.size else _size_first(piece, firsts))
            continue
        stem, size = found[1], found[2]
        if piece.size:
            named = size.lower() == piece.size.lower()
        else:
            of_stem = [each[2].upper() for each in ends if each is not None and each[1] == stem]
            others = len(of_stem)
            named = (size.upper() in SIZES and "R" not in of_stem) or (size.isdigit() and int(size) > 3 and others > 1)
        if not named and not piece.size:
            piece = _size_first(piece, firsts)
        out.append(replace(piece, name=stem, size=size) if named else piece)
    return out


_FIRST = re.compile(r"^([A-Za-z0-9]{1,4})\s*[-_ .]\s*(.*\S)$")


def _size_first(piece: Piece, firsts: set[str]) -> Piece:
    """A piece whose name begins with its size ("M_FRONT"), where others begin with others."""
    found = _FIRST.match(piece.name)
    sizes = firsts.intersection(SIZES)
    if found is None or found[1].upper() not in sizes or len(sizes) < 2 or sizes <= {"L", "R"}:
        return piece
    return replace(piece, name=found[2], size=found[1].upper())

"""Drawn pieces as pieces to cut, in metres: outlines with numbered edges, grain upright, folds opened."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.dxf import (
    CURVE,
    CUT,
    CUT_OUT,
    FOLD,
    GRAIN,
    INTERNAL,
    NOTCH,
    SEW,
    TURN,
    Drawing,
    Drawn,
)
from warp_cloth.pattern.loops import area_of, chained, cleaned, gap_of, inset, smoothed, turns_of
from warp_cloth.pattern.specification import LARGEST, MOST_EDGES, NO_LENGTH, SMALLEST, short

INCH = 0.0254
# Metres in a unit of $INSUNITS
CODES = {1: INCH, 2: 12 * INCH, 4: 1e-3, 5: 1e-2, 6: 1.0, 14: 0.1}
LIKELY = (0.12, 4.0)  # [m] extent of a garment's largest piece
CORNER = np.radians(35.0)  # turn that makes a corner where turn points do not state them
MARKED_CORNER = np.radians(60.0)  # and where the file calls the point one of a curve
NEAR = 1.5e-3  # [m] from a mark to the outline that it belongs to
NOTCH_REACH = 0.03  # [m]: notches are on the cut line, and outlines may be sew lines
OPEN_GAP = 2e-3  # [m] that an outline may be open without a note
SMOOTH = 4e-3  # [m] between points of a curve
FOLD_NEAR = 2e-3  # [m]
ALIKE = 3e-3  # [m] to which corners of a symmetric piece agree
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
    notes: tuple[str, ...]

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
    metres, told = _unit(file, drawing)
    pieces = [_piece(file, drawn, metres, allowance) for drawn in drawing.pieces]
    return tuple(_sized(pieces)), told


def _unit(file: str, drawing: Drawing) -> tuple[float, list[str]]:
    """Metres in a unit of the file: as stated where the pieces are then of a garment's size, else as that shows."""
    extents = [
        float(np.ptp(np.concatenate(drawn.lines.get(CUT) or drawn.lines[SEW]), axis=0).max())
        for drawn in drawing.pieces
    ]
    extent = max(extents)
    said = " ".join((drawing.stated.get("units", ""), *(drawn.texts.get("units", "") for drawn in drawing.pieces)))
    said = said.strip().lower()
    code = CODES.get(drawing.unit_code)
    stated: list[float] = []
    if re.search(r"english|imperial|inch|\bin\b", said):
        stated = [INCH]
    elif re.search(r"\bmm\b|millimet", said):
        stated = [1e-3]
    elif re.search(r"\bcm\b|centimet", said):
        stated = [1e-2]
    elif "metric" in said:
        stated = [1e-3, *([code] if code in (1e-2, 1.0) else []), 1e-2]
    stated += [code] if code is not None else []
    for metres in stated:
        if LIKELY[0] <= extent * metres <= LIKELY[1]:
            return metres, []
    guess = next((m for m in (1e-3, 1e-2, INCH, 1.0) if LIKELY[0] <= extent * m <= LIKELY[1]), None)
    if guess is None:
        across = f"{extent:.4g} units"
        raise InputError(file, f"its largest piece is {across} across, which is no garment's size in any unit",
                         "export it in millimetres")  # fmt: skip
    names = {1e-3: "mm", 1e-2: "cm", INCH: "inch", 1.0: "m"}
    why = "the stated unit would make no garment" if stated else "no unit is stated"
    return guess, [f"{why}: {names[guess]} assumed, as its largest piece is then {extent * guess:.2f} m"]


def _piece(file: str, drawn: Drawn, metres: float, allowance: float) -> Piece:
    name, size = _named(drawn)
    place = f'{file}: piece "{short(name)}"'
    notes: list[str] = []
    loop = _outline(place, drawn, metres, allowance, notes)
    marks = {layer: metres * np.array(points) for layer, points in drawn.points.items() if points}
    lines = {layer: [metres * line for line in found] for layer, found in drawn.lines.items()}
    if CUT_OUT in lines:
        raise InputError(place, "has a cut-out (layer 11), and panels with holes are not meshed",
                         "cut the piece through the hole, or remove it")  # fmt: skip
    corners = _corners(loop, marks)
    edges = _edges(loop, corners)
    if len(edges) > MOST_EDGES:
        raise InputError(place, f"has {len(edges):,} corners; an outline has up to {MOST_EDGES:,}", "smooth it")
    notches = np.concatenate(
        [marks.get(NOTCH, np.zeros((0, 2))), *(line.mean(axis=0)[None] for line in lines.get(NOTCH, []))]
    )
    notches = _on_outline(notches, loop)
    grain = _grain(lines, notes)
    edges = [edge.turned(grain, np.zeros(2)) for edge in edges]
    notches = notches @ grain.T
    inner = tuple(line @ grain.T for layer in (INTERNAL, FOLD) for line in lines.get(layer, []))
    edges, notches, mirror = _unfolded(edges, notches, [line @ grain.T for line in lines.get(FOLD, [])], notes)
    if mirror is None:
        edges, mirror = _halved(edges)
    told = tuple(f'piece "{short(name)}": {note}' for note in notes)
    return Piece(name, size, _copies(drawn), tuple(edges), mirror, notches, inner, told)


def _named(drawn: Drawn) -> tuple[str, str]:
    name = drawn.texts.get("piece name") or drawn.texts.get("piece") or drawn.texts.get("name") or drawn.block
    return _plain(name) or "piece", _plain(drawn.texts.get("size", ""))


def _plain(text: str) -> str:
    return re.sub(r"\s+", " ", "".join(c if c.isprintable() else " " for c in text)).strip()[:100]


def _copies(drawn: Drawn) -> tuple[int, int] | None:
    """How many are cut as drawn, and mirrored: "2" means a pair, "1,1" says so."""
    text = drawn.texts.get("quantity") or drawn.texts.get("qty") or ""
    numbers = [min(int(each), 99) for each in re.findall(r"\d{1,4}", text)[:2]]
    if not numbers or not any(numbers):
        return None
    if len(numbers) == 2:
        return numbers[0], numbers[1]
    return (numbers[0] + 1) // 2, numbers[0] // 2


def _outline(place: str, drawn: Drawn, metres: float, allowance: float, notes: list[str]) -> Floats:
    """The line to sew along, as a loop [m]: the sew line, or the cut line without the stated allowance."""
    loops = {}
    for layer in (CUT, SEW):
        found = drawn.lines.get(layer, [])
        closed = [metres * loop for loop in chained(found)]
        closed = [cleaned(loop, NO_LENGTH) for loop in closed]
        closed = [loop for loop in closed if len(loop) > 2]
        if closed:
            loops[layer] = max(closed, key=lambda loop: abs(area_of(loop)))
            gap = gap_of([metres * line for line in found], loops[layer])
            if gap > OPEN_GAP:
                notes.append(f"its outline was open by {1e3 * gap:.0f} mm: closed")
            if len(closed) > 1 and layer == CUT:
                notes.append(f"has {len(closed)} closed cut lines: the largest is its outline")
    sewn = SEW in loops and (CUT not in loops or area_of(loops[SEW]) > 0.5 * area_of(loops[CUT]))
    if not loops:
        raise InputError(place, "its outline is not closed", "close the line on layer 1 (the cut line)")
    if SEW in drawn.lines and not sewn:
        notes.append("its sew line does not go round it: the cut line is used")
    loop = loops[SEW] if sewn else loops[CUT]
    if not sewn and allowance > 0.0:
        inner = cleaned(inset(loop, allowance), NO_LENGTH)
        if len(inner) < 3 or not 0.0 < area_of(inset(loop, allowance)) < area_of(loop):
            raise InputError(place, f"is too narrow for a seam allowance of {1e3 * allowance:g} mm", "make it smaller")
        loop = inner
    extent = float(np.ptp(loop, axis=0).max())
    if not SMALLEST <= extent <= LARGEST:
        raise InputError(place, f"is {1e3 * extent:.4g} mm across, which no piece is", "check the unit of the file")
    if area_of(loop) < 1e-4 * extent**2:
        raise InputError(place, "its outline has no area", "correct it")
    return loop


def _corners(loop: Floats, marks: dict[int, Floats]) -> list[int]:
    """Points of a loop at which its edges end."""
    turn = np.abs(turns_of(loop))
    curved = _marked(loop, marks.get(CURVE))
    stated = _marked(loop, marks.get(TURN))
    if stated.sum() > max(12, 0.5 * len(loop)) and not curved.any():
        stated[:] = False  # all points are marked alike
    corner = stated | (turn > np.where(curved, MARKED_CORNER, CORNER))
    found = np.flatnonzero(corner).tolist()
    if len(found) < 2:  # a disc, or a drop: parted where it turns most, and opposite
        first = found[0] if found else int(turn.argmax())
        reach = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(np.roll(loop, -first, axis=0), axis=0).T))])
        half = int(np.abs(reach - 0.5 * reach[-1]).argmin())
        found = sorted({first, (first + max(1, half)) % len(loop)})
    return found


def _marked(loop: Floats, marks: Floats | None) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Which points of a loop have a mark on them."""
    marked = np.zeros(len(loop), dtype=bool)
    if marks is not None and len(marks):
        from scipy.spatial import cKDTree

        apart, nearest = cKDTree(loop).query(marks)
        marked[nearest[apart <= NEAR]] = True
    return marked


def _edges(loop: Floats, corners: Sequence[int]) -> list[Chain]:
    """The edges between corners, curves smooth, from the first corner on."""
    edges = []
    for start, end in zip(corners, [*corners[1:], corners[0] + len(loop)], strict=True):
        points = loop[np.arange(start, end + 1) % len(loop)]
        edges.append(Chain(smoothed(points, SMOOTH)))
    return edges


def _on_outline(points: Floats, loop: Floats) -> Floats:
    """The nearest points of a loop, for those that are near it, shape [M, 2]."""
    if not len(points):
        return np.zeros((0, 2))
    start, along = loop, np.roll(loop, -1, axis=0) - loop
    square = np.maximum((along**2).sum(axis=1), 1e-300)
    found = []
    for point in points:
        share = np.clip(((point - start) * along).sum(axis=1) / square, 0.0, 1.0)
        spots = start + share[:, None] * along
        apart = np.hypot(*(spots - point).T)
        if apart.min() <= NOTCH_REACH:
            found.append(spots[int(apart.argmin())])
    return np.array(found).reshape(-1, 2)


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


def _unfolded(
    edges: list[Chain], notches: Floats, folds: Sequence[Floats], notes: list[str]
) -> tuple[list[Chain], Floats, tuple[int, ...] | None]:
    """The whole piece of one that is cut on the fold; as it is where no fold line is an edge of it."""
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
        if not any(flat) or all(flat):
            continue
        first = next(k for k in range(len(edges)) if flat[k - 1] and not flat[k])
        order = [(first + k) % len(edges) for k in range(len(edges))]
        kept = [edges[k] for k in order if not flat[k]]
        matrix = 2.0 * np.outer(along, along) - np.eye(2)
        shift = start - matrix @ start
        kept = _onto(kept, start, along)
        other = [edge.turned(matrix, shift).reversed for edge in kept[::-1]]
        notes.append("is a half: mirrored at its fold line")
        both = [*kept, *other]
        return both, np.concatenate([notches, notches @ matrix.T + shift]), tuple(range(len(both)))[::-1]
    return edges, notches, None


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
    out = []
    for piece, found in zip(pieces, ends, strict=True):
        if found is None:
            out.append(piece)
            continue
        stem, size = found[1], found[2]
        if piece.size:
            named = size.lower() == piece.size.lower()
        else:
            of_stem = [each[2].upper() for each in ends if each is not None and each[1] == stem]
            others = len(of_stem)
            named = (size.upper() in SIZES and "R" not in of_stem) or (size.isdigit() and int(size) > 3 and others > 1)
        out.append(replace(piece, name=stem, size=size) if named else piece)
    return out

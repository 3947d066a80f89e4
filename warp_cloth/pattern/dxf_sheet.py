"""Pieces of a drawing without blocks: each closed outline is one, with all that lies in its box."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.dxf_drawn import CUT, INTERNAL, NAMELESS, SEW, Drawn, drawn_piece, texts_of
from warp_cloth.pattern.lattice import inside
from warp_cloth.pattern.loops import area_of, chained, gap_of

WITHIN = 0.95  # of a loop's points, within another: a part of the same piece
LINED = 0.6  # of the area, from which a loop within an outline is its sew line
# Of an outline's area, which several loops within it fill where it is a sheet's frame
FRAMED_RECTANGLE, FRAMED_OTHER = 0.1, 0.4
SQUARE = 1e-3  # of its extent, to which a frame is a rectangle


def sheet_pieces(entities: list[Any]) -> tuple[list[Drawn], list[str]]:
    """Pieces of a sheet, by their closed outlines, and the texts that lie in none."""
    whole = drawn_piece("", entities)
    layers = whole.lines
    main = CUT if CUT in layers else SEW if SEW in layers else NAMELESS
    drawn = layers.get(main, [])
    loops = [line if gap_of(drawn, line) else np.concatenate([line, line[:1]]) for line in chained(drawn)]
    pieces, outlines = _outlined(_unframed(loops), main)
    boxes = [(outline.min(axis=0), outline.max(axis=0)) for outline in outlines]
    sizes = [float(np.prod(high - low)) for low, high in boxes]

    def owner(point: Floats) -> Drawn | None:
        holding = [
            index
            for index, (low, high) in enumerate(boxes)
            if (point >= low - 0.01 * (high - low)).all() and (point <= high + 0.01 * (high - low)).all()
        ]
        return pieces[min(holding, key=lambda index: sizes[index])] if holding else None

    for number, lines in layers.items():
        for line in lines if number not in (main, NAMELESS) else ():
            mine = owner(line.mean(axis=0))
            if mine is not None:
                mine.lines.setdefault(number, []).append(line)
    for number, points in whole.points.items():
        for point in points:
            mine = owner(point)
            if mine is not None:
                mine.points.setdefault(number, []).append(point)
    for point, rule in whole.rules:
        mine = owner(point)
        if mine is not None:
            mine.rules.append((point, rule))
    loose = []
    for entity in entities:
        for text in texts_of(entity):
            place = entity.dxf.get("insert", None)
            mine = None if place is None else owner(np.array([place.x, place.y]))
            if mine is None:
                loose.append(text)
            else:
                mine.state(text)
    return pieces, loose


def _outlined(loops: Sequence[Floats], main: int) -> tuple[list[Drawn], list[Floats]]:
    """A piece for each loop that lies in no other, in the order of the file, and these loops."""
    pieces: list[Drawn] = []
    outlines: list[Floats] = []
    places: list[int] = []
    for place in _by_area(loops):
        line = loops[place]
        around = next((k for k in range(len(outlines)) if _holds(outlines[k], line)), None)
        if around is None:
            outlines.append(line)
            places.append(place)
            pieces.append(Drawn(""))
            pieces[-1].lines[SEW if main == SEW else CUT] = [line]
        elif abs(area_of(line)) < LINED * abs(area_of(outlines[around])):
            pieces[around].lines.setdefault(CUT if main == CUT else INTERNAL, []).append(line)
        elif main == NAMELESS:
            pieces[around].lines.setdefault(SEW, [line])
    order = np.argsort(places).tolist()
    return [pieces[k] for k in order], [outlines[k] for k in order]


def _unframed(loops: list[Floats]) -> list[Floats]:
    """The loops without frames of sheets: outlines that several others lie in, and fill."""
    while len(loops) > 2:
        largest = _by_area(loops)[0]
        rest = loops[:largest] + loops[largest + 1 :]
        inner = [rest[k] for k in _by_area(rest) if _holds(loops[largest], rest[k])]
        apart: list[Floats] = []
        boxes = np.array([(loop.min(axis=0), loop.max(axis=0)) for loop in inner]).reshape(-1, 2, 2)
        held = np.zeros(len(inner), dtype=bool)
        for k, loop in enumerate(inner):
            middle = boxes[k].mean(axis=0)
            about = ((boxes[:k, 0] <= middle) & (middle <= boxes[:k, 1])).all(axis=1) & ~held[:k]
            held[k] = any(_holds(inner[other], loop) for other in np.flatnonzero(about).tolist())
            if not held[k]:
                apart.append(loop)
        filled = sum(abs(area_of(loop)) for loop in apart) / max(abs(area_of(loops[largest])), 1e-300)
        if len(apart) < 2 or filled < (FRAMED_RECTANGLE if _is_rectangle(loops[largest]) else FRAMED_OTHER):
            break
        loops = rest
    return loops


def _by_area(loops: Sequence[Floats]) -> list[int]:
    return sorted(range(len(loops)), key=lambda k: -abs(area_of(loops[k])))


def _holds(outline: Floats, loop: Floats) -> bool:
    low, high = outline.min(axis=0), outline.max(axis=0)
    if ((low <= loop) & (loop <= high)).all(axis=1).mean() <= WITHIN:
        return False
    return bool(inside(outline, loop).mean() > WITHIN)


def _is_rectangle(loop: Floats) -> bool:
    low, high = loop.min(axis=0), loop.max(axis=0)
    off = np.minimum(loop - low, high - loop).min(axis=1)
    return bool(off.max() <= SQUARE * float((high - low).max()))

"""Pieces of a drawing without blocks: each closed outline is one, with all that lies in its box; layers as sizes."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.dxf_drawn import (
    CUT,
    INTERNAL,
    LINEAR,
    NAMELESS,
    SEW,
    Drawn,
    drawn_piece,
    layer_number,
    texts_of,
)
from warp_cloth.pattern.labels import SIZE_KEYS
from warp_cloth.pattern.lattice import inside
from warp_cloth.pattern.loops import area_of, chained, gaps_of, is_closed

WITHIN = 0.95  # of a loop's points, within another: a part of the same piece
LINED = 0.6  # of the area, from which a loop within an outline is its sew line
# Of an outline's area, which several loops within it fill where it is a sheet's frame
FRAMED_RECTANGLE, FRAMED_OTHER = 0.1, 0.4
NEXT_TO = 1e-3  # of an outline's extent, from a line along it to its inside
SQUARE = 1e-3  # of its extent, to which a frame is a rectangle
DOT = 1e-3  # of the largest outline's area, under which one outside all others is a button or a mark


def sheet_pieces(entities: list[Any]) -> tuple[list[Drawn], list[str]]:
    """Pieces of a sheet, by their closed outlines, and the texts that lie in none.

    Where no layer is one that patterns have, each may be a size ("SIZE_36"), or all of them are one.
    """
    layers = dict.fromkeys(_layer(entity) for entity in entities if entity.dxftype() in LINEAR)
    if {layer_number(layer) or NAMELESS for layer in layers} & {CUT, SEW, NAMELESS}:
        return _pieces_of(entities, as_one=False)
    texts = [entity for entity in entities if entity.dxftype() not in LINEAR]
    found, loose = [], []
    for layer, size in zip(layers, _told_apart(list(layers)), strict=True):
        own = [entity for entity in entities if entity.dxftype() in LINEAR and _layer(entity) == layer]
        pieces, rest = _pieces_of([*own, *texts], as_one=True)
        for piece in pieces:
            if not piece.said(*SIZE_KEYS):
                piece.texts[SIZE_KEYS[0]] = size
        found.append(pieces)
        loose += [text for text in rest if text not in loose]
    if len(found) > 1 and len({len(pieces) for pieces in found}) == 1 and found[0]:
        return [piece for pieces in found for piece in pieces], loose
    return _pieces_of(entities, as_one=True)


def _layer(entity: Any) -> str:
    return str(entity.dxf.get("layer", "0"))


def _told_apart(names: list[str]) -> list[str]:
    """Names without what they all begin and end with, up to whole words and numbers: "36" of "SIZE_36"."""
    words = [re.findall(r"\d+|[^\W\d_]+", name) for name in names]
    if len(names) < 2 or len({tuple(each) for each in words}) < len(names):
        return names
    shortest = min(map(len, words))
    first = next((k for k in range(shortest) if len({each[k] for each in words}) > 1), shortest)
    last = next((k for k in range(shortest - first) if len({each[-1 - k] for each in words}) > 1), 0)
    told = [" ".join(each[first : len(each) - last]) for each in words]
    return told if all(told) else names


def _pieces_of(entities: list[Any], as_one: bool) -> tuple[list[Drawn], list[str]]:
    """Pieces, and the texts that lie in none; ``as_one``: whatever layers lines are on, they are outlines."""
    whole = drawn_piece("", entities)
    if as_one:
        whole.lines = {NAMELESS: [line for lines in whole.lines.values() for line in lines]}
    layers = whole.lines
    main = CUT if CUT in layers else SEW if SEW in layers else NAMELESS
    drawn = _without_inner_lines(layers.get(main, []))
    found = chained(drawn)
    gaps = gaps_of(drawn, found)
    loops = [line if gap else np.concatenate([line, line[:1]]) for line, gap in zip(found, gaps, strict=True)]
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


def _without_inner_lines(lines: Sequence[Floats]) -> list[Floats]:
    """The lines without open ones that lie within a closed one, or along it: folds and grains, on the outline's layer.

    Joined end to end, as outlines are that are drawn line by line, those of several pieces would be one more outline.
    What a rectangle holds stays: that may be a sheet's frame.
    """
    if not all(np.isfinite(line).all() for line in lines):  # refused by its piece's name
        return list(lines)
    closed = [line for line in lines if is_closed(line) and not _is_rectangle(line)]
    boxes = np.array([(line.min(axis=0), line.max(axis=0)) for line in closed]).reshape(-1, 2, 2)

    def is_inner(line: Floats) -> bool:
        near = NEXT_TO * np.ptp(boxes, axis=1).max(axis=1, initial=0.0)[:, None]
        about = ((boxes[:, 0] - near <= line.min(axis=0)) & (line.max(axis=0) <= boxes[:, 1] + near)).all(axis=1)
        return any(_runs_within(closed[k], line, float(near[k, 0])) for k in np.flatnonzero(about).tolist())

    return [line for line in lines if is_closed(line) or not is_inner(line)]


def _runs_within(outline: Floats, line: Floats, near: float) -> bool:
    """Whether the middle of each side of a line is inside an outline, or has its inside next to it."""
    step = np.diff(line, axis=0)
    length = np.hypot(*step.T)
    middle, step = (0.5 * (line[:-1] + line[1:]))[length > 0.0], step[length > 0.0] / length[length > 0.0, None]
    aside = near * np.column_stack([-step[:, 1], step[:, 0]])
    return bool((inside(outline, middle + aside) | inside(outline, middle - aside)).all())


def _outlined(loops: Sequence[Floats], main: int) -> tuple[list[Drawn], list[Floats]]:
    """A piece for each loop that lies in no other, in the order of the file, and these loops."""
    pieces: list[Drawn] = []
    outlines: list[Floats] = []
    places: list[int] = []
    order = _by_area(loops)
    boxes = np.array([(loop.min(axis=0), loop.max(axis=0)) for loop in loops]).reshape(-1, 2, 2)
    for place in order:
        line, (low, high) = loops[place], boxes[place]
        own = boxes[places]
        meets = ((own[:, 0] <= high) & (low <= own[:, 1])).all(axis=1)
        around = next((k for k in np.flatnonzero(meets).tolist() if _holds(outlines[k], line)), None)
        if around is None and abs(area_of(line)) < DOT * abs(area_of(loops[order[0]])):
            continue
        if around is None:
            outlines.append(line)
            places.append(place)
            pieces.append(Drawn(""))
            pieces[-1].lines[SEW if main == SEW else CUT] = [line]
        elif abs(area_of(line)) < LINED * abs(area_of(outlines[around])):
            pieces[around].lines.setdefault(CUT if main == CUT else INTERNAL, []).append(line)
        elif main == NAMELESS:
            pieces[around].lines.setdefault(SEW, [line])
    in_file = np.argsort(places).tolist()
    return [pieces[k] for k in in_file], [outlines[k] for k in in_file]


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
        frame = loops[largest]
        loops = [loop for loop in rest if not (_is_rectangle(loop) and _touches(frame, loop))]  # its title block
    return loops


def _touches(frame: Floats, loop: Floats) -> bool:
    """Whether two corners of a loop lie on a frame's box."""
    low, high = frame.min(axis=0), frame.max(axis=0)
    off = np.minimum(np.abs(loop - low), np.abs(high - loop)).min(axis=1)
    return bool((off <= SQUARE * float((high - low).max())).sum() > 1)


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

"""Reading a DXF file of pattern pieces, by the layers of AAMA-292 and ASTM D6673, into pieces as they are drawn.

A piece is a block, inserted or not; where there are no blocks, a closed outline of the model space. Layers: 1 cut line,
2 turn points, 3 curve points, 4 (and 80 to 83) notches, 6 fold line, 7 grain line, 8 internal lines, 11 cut-outs, 13
drill holes, 14 sew line, any: text such as ``Piece Name: FRONT``. Lengths stay in the file's unit here.
"""

from __future__ import annotations

import io
import logging
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, NoReturn

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.kinds import plain
from warp_cloth.pattern.lattice import inside
from warp_cloth.pattern.loops import area_of, chained, gap_of
from warp_cloth.pattern.specification import MOST_PANELS, short

EXPORT_AGAIN = "export the DXF again, as AAMA or ASTM"
BINARY = b"AutoCAD Binary DXF"
LARGEST_FILE = 200_000_000  # bytes
MOST_POINTS = 200_000  # of a piece
CUT, TURN, CURVE, NOTCH, FOLD, GRAIN, INTERNAL, CUT_OUT, DRILL, SEW = 1, 2, 3, 4, 6, 7, 8, 11, 13, 14
LAYERS = {80: NOTCH, 81: NOTCH, 82: NOTCH, 83: NOTCH}
# Layers of files that do not number them
NAMED = (
    (CUT, ("allowance", "zugabe", "marge", "margine", "cutline", "cut line", "cut_line", "cut-line")),
    (SEW, ("sew", "stitch", "seam", "naht", "couture", "costura", "cucitura")),
    (NOTCH, ("notch", "knips", "cran", "piquete", "tacc")),
    (GRAIN, ("grain", "fadenlauf", "droit", "hilo", "filo")),
    (FOLD, ("fold", "mirror", "bruch", "pliure", "doblez", "piega")),
    (CUT_OUT, ("cutout", "cut-out", "hole")),
    (DRILL, ("drill",)),
    (INTERNAL, ("internal", "inner")),
    (TURN, ("turn",)),
    (CURVE, ("curve",)),
    (CUT, ("boundary", "outline", "cut", "contour", "schnitt")),
)
LINEAR = ("LINE", "ARC", "CIRCLE", "ELLIPSE", "LWPOLYLINE", "POLYLINE", "SPLINE")
FINE = 2e-5  # of a block's extent: how far the points of an arc or spline may be from it
WITHIN = 0.95  # of a loop's points, within another: a part of the same piece
LINED = 0.6  # of the area, from which a loop within an outline is its sew line
NAMELESS = 0  # lines of layers that have neither number nor known name
# lines of text as AAMA has them; some programs leave blanks out
_STATED = re.compile(r"^\s*([^\W\d_][\w /_-]*?)\s*[:=]\s*(.*?)\s*$")


@dataclass(eq=False)
class Drawn:
    """One piece as drawn: polylines and points by layer, in the file's unit, and what its texts state."""

    block: str  # name of the block; empty in the model space
    lines: dict[int, list[Floats]] = field(default_factory=dict)
    points: dict[int, list[Floats]] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)  # stated, by key in lower case without blanks
    remarks: list[str] = field(default_factory=list)  # other texts

    def state(self, text: str) -> None:
        """Takes a line of text."""
        text = repaired(text)
        found = _STATED.match(text)
        if found is None:
            self.remarks.append(text.strip())
            return
        key = re.sub(r"[^a-z]", "", plain(found[1]))
        if not self.texts.get(key):
            self.texts[key] = found[2]

    def said(self, *keys: str) -> str:
        """What it states under the first of these keys that it states anything under."""
        return next((self.texts[key] for key in keys if self.texts.get(key)), "")

    @property
    def has_outline(self) -> bool:
        return CUT in self.lines or SEW in self.lines


@dataclass(frozen=True, eq=False)
class Drawing:
    """The pieces of a file, what it states of all, and its unit's code ($INSUNITS; 0: none)."""

    pieces: tuple[Drawn, ...]
    stated: dict[str, str]
    unit_code: int


def read_drawing(file: str, data: bytes) -> Drawing:
    """The pieces of a DXF file.

    Raises:
        InputError: ezdxf is not installed, or the file cannot be read or has no pieces.
    """
    document = _document(file, data)
    try:
        pieces, loose = _pieces(document)
        unit = int(document.header.get("$INSUNITS", 0) or 0)
    except InputError:
        raise
    except Exception as error:  # entities that are damaged raise whatever ezdxf happens to meet in them
        _refuse(file, f"an entity cannot be read ({short(type(error).__name__)})")
    sheet = Drawn("")
    for text in loose:
        sheet.state(text)
    pieces = [piece for piece in pieces if piece.has_outline]
    if not pieces:
        _refuse(file, "has no pieces: nothing is drawn on layer 1 (the cut line) or 14 (the sew line)")
    if len(pieces) > MOST_PANELS:
        _refuse(file, f"{len(pieces):,} pieces are more than the {MOST_PANELS:,} that are read", "split the file")
    for piece in pieces:
        _check(file, piece)
    return Drawing(tuple(pieces), sheet.texts, unit)


def _refuse(file: str, problem: str, remedy: str = EXPORT_AGAIN) -> NoReturn:
    raise InputError(file, problem, remedy)


def _document(file: str, data: bytes) -> Any:
    try:
        from ezdxf import recover
        from ezdxf.document import Drawing
        from ezdxf.lldxf.tagger import binary_tags_loader
    except ImportError:
        raise InputError(file, "needs the package ezdxf", "pip install 'warp-cloth[dxf]'") from None
    if len(data) > LARGEST_FILE:
        _refuse(file, f"is larger than {LARGEST_FILE // 1_000_000} MB, too large for a pattern")
    if not data.strip():
        _refuse(file, "is empty")
    if data.startswith(b"AC10"):
        _refuse(file, "is a DWG file, not DXF", "save it as DXF")
    logging.getLogger("ezdxf").addHandler(logging.NullHandler())  # what it mends is not printed
    try:
        if data.startswith(BINARY):
            return Drawing.load(binary_tags_loader(data))
        document, _ = recover.read(io.BytesIO(data))
    except Exception as error:  # a damaged file raises whatever the recovery happens to meet
        said = short(" ".join(str(error).split())) or type(error).__name__
        _refuse(file, f"cannot be read as DXF: {said}")
    return document


def _pieces(document: Any) -> tuple[list[Drawn], list[str]]:
    """The pieces of all blocks, or else of the model space, and the texts that belong to none."""
    space = list(document.modelspace())
    every = [block for block in document.blocks if not block.is_any_layout]
    blocks = [block for block in every if not block.name.startswith("*")]
    if not any(entity.dxftype() in LINEAR for block in blocks for entity in block):
        blocks = [block for block in every if block.name.upper().startswith("*U")]  # groups that were never named
    drawn = {block.name for block in blocks if _has_lines(block, SEW) or _has_lines(block, CUT)}
    # parts of a piece are blocks within its block; a block of nothing but pieces is a sheet of them
    sheets = {block.name for block in blocks if block.name not in drawn and drawn.intersection(_inserted(block))}
    inner = {name for block in blocks if block.name not in sheets for name in _inserted(block)}
    pieces = []
    for block in blocks:
        if block.name in inner or block.name in sheets:
            continue
        insert = next((each for each in space if each.dxftype() == "INSERT" and each.dxf.name == block.name), None)
        piece = _drawn(block.name, list(block), _scale(insert))
        if insert is not None:
            for attribute in insert.attribs:
                piece.state(attribute.dxf.text)
        pieces.append(piece)
    loose = [entity for entity in space if entity.dxftype() != "INSERT"]
    texts = [text for entity in loose for text in _texts(entity)]
    if not any(piece.has_outline for piece in pieces):
        for piece in pieces:
            _take_outline(piece)
    if not any(piece.has_outline for piece in pieces):
        return _loose_pieces(loose)
    outlined = [piece.block for piece in pieces if piece.has_outline]
    if len(outlined) == 1:  # all in one block
        inner_pieces, rest = _loose_pieces(
            [e for block in blocks if block.name == outlined[0] for e in _flat(block, 0)]
        )
        if len(inner_pieces) > 1:
            return inner_pieces, [*texts, *rest]
    return pieces, texts


def _inserted(block: Any) -> set[str]:
    return {entity.dxf.name for entity in block.query("INSERT")}


def _has_lines(block: Any, layer: int) -> bool:
    linear = [entity for entity in block if entity.dxftype() in LINEAR]
    return any(layer_number(str(entity.dxf.get("layer", "0"))) == layer for entity in linear)


def _take_outline(piece: Drawn) -> None:
    """Takes the largest loop of layers without meaning as the cut line, where a file does not use layers."""
    loops = chained(piece.lines.get(NAMELESS, []))
    if loops:
        largest = max(loops, key=lambda loop: abs(area_of(loop)))
        piece.lines[CUT] = [np.concatenate([largest, largest[:1]])]


def _scale(insert: Any) -> float:
    """The size at which a block is inserted; its place and turn say nothing of the cloth."""
    scale = 1.0 if insert is None else abs(float(insert.dxf.get("xscale", 1.0)))
    return scale if 1e-6 < scale < 1e6 else 1.0


def repaired(text: str) -> str:
    """A text that was UTF-8, and was read as of Windows' code page, as files without a stated one are."""
    if text.isascii():
        return text
    try:
        return text.encode("cp1252", "surrogateescape").decode("utf-8")
    except UnicodeError:
        return text


def _drawn(name: str, entities: Iterable[Any], scale: float = 1.0) -> Drawn:
    piece = Drawn(repaired(name))
    flat = list(_flat(entities, 0))
    fine = _extent(flat) * FINE
    for entity in flat:
        for text in _texts(entity):
            piece.state(text)
        layer = layer_number(str(entity.dxf.get("layer", "0")))
        kind = entity.dxftype()
        if kind == "POINT" and layer is not None:
            place = entity.dxf.location
            piece.points.setdefault(layer, []).append(scale * np.array([place.x, place.y]))
        elif kind in LINEAR:
            line = _polyline(entity, fine)
            if len(line) > 1:
                piece.lines.setdefault(layer or NAMELESS, []).append(scale * line)
    return piece


def _flat(entities: Iterable[Any], depth: int) -> Iterator[Any]:
    """Entities, with what blocks within a block hold in their places."""
    for entity in entities:
        if entity.dxftype() == "INSERT":
            yield from entity.attribs
            if depth < 4:
                yield from _flat(entity.virtual_entities(), depth + 1)
        else:
            yield entity


def layer_number(name: str) -> int | None:
    """The number of a layer by AAMA; None where its name has none."""
    found = re.match(r"^\D{0,8}?0*(\d{1,3})(?!\d)", name.strip())
    if found is not None and int(found[1]) > 0:
        number = int(found[1])
        return LAYERS.get(number, number)
    lower = name.lower()
    return next((number for number, words in NAMED if any(word in lower for word in words)), None)


def _extent(entities: Iterable[Any]) -> float:
    ends = [point for entity in entities if entity.dxftype() in LINEAR for point in _polyline(entity, None)]
    return float(np.ptp(np.array(ends), axis=0).max()) if ends else 0.0


def _polyline(entity: Any, fine: float | None) -> Floats:
    """The points of a linear entity, shape [n, 2], closed ones with their first point again; ``fine``: see FINE."""
    from ezdxf import path

    if entity.dxftype() == "POLYLINE" and not (entity.is_2d_polyline or entity.is_3d_polyline):
        return np.zeros((0, 2))
    made = path.make_path(entity)
    if not len(made):
        return np.zeros((0, 2))
    points = made.control_vertices() if fine is None else list(made.flattening(max(fine, 1e-9), segments=4))
    return np.array([(point.x, point.y) for point in points])


def _texts(entity: Any) -> list[str]:
    kind = entity.dxftype()
    if kind in ("TEXT", "ATTRIB", "ATTDEF"):
        return [str(entity.dxf.get("text", ""))]
    if kind == "MTEXT":
        return [str(line) for line in entity.plain_text(split=True)]
    return []


def _loose_pieces(entities: list[Any]) -> tuple[list[Drawn], list[str]]:
    """Pieces of a model space without blocks: each closed outline, with all that lies in its box."""
    whole = _drawn("", entities)
    layers = whole.lines
    main = CUT if CUT in layers else SEW if SEW in layers else NAMELESS
    drawn = layers.get(main, [])
    loops = [line if gap_of(drawn, line) else np.concatenate([line, line[:1]]) for line in chained(drawn)]
    pieces: list[Drawn] = []
    outlines: list[Floats] = []
    places: list[int] = []
    for place in sorted(range(len(loops)), key=lambda k: -abs(area_of(loops[k]))):
        line = loops[place]
        around = next((k for k in range(len(outlines)) if inside(outlines[k], line).mean() > WITHIN), None)
        if around is None:
            outlines.append(line)
            places.append(place)
            pieces.append(Drawn(""))
            pieces[-1].lines[SEW if main == SEW else CUT] = [line]
        elif abs(area_of(line)) < LINED * abs(area_of(outlines[around])):
            pieces[around].lines.setdefault(CUT if main == CUT else INTERNAL, []).append(line)
        elif main == NAMELESS:
            pieces[around].lines.setdefault(SEW, [line])
    order = np.argsort(places).tolist()  # as the file has them
    pieces = [pieces[k] for k in order]
    boxes = [(outlines[k].min(axis=0), outlines[k].max(axis=0)) for k in order]

    def owner(point: Floats) -> Drawn | None:
        sizes = [float(np.prod(high - low)) for low, high in boxes]
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
    loose = []
    for entity in entities:
        for text in _texts(entity):
            place = entity.dxf.get("insert", None)
            mine = None if place is None else owner(np.array([place.x, place.y]))
            if mine is None:
                loose.append(text)
            else:
                mine.state(text)
    return pieces, loose


def _check(file: str, piece: Drawn) -> None:
    """Refuses numbers that are none."""
    for lines in (*piece.lines.values(), *piece.points.values()):
        for line in lines:
            if len(line) > MOST_POINTS:
                _refuse(f'{file}: block "{short(piece.block)}"', f"a line has over {MOST_POINTS:,} points")
            if not np.isfinite(line).all() or float(np.abs(line).max(initial=0.0)) > 1e9:
                _refuse(f'{file}: block "{short(piece.block)}"', "a coordinate is not a usable number")

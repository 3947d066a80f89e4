"""What is drawn of one pattern piece: polylines and points by layer, and what its texts state.

Layers of AAMA-292 and ASTM D6673: 1 cut line, 2 turn points, 3 curve points, 4 (and 80 to 83) notches, 6 fold line,
7 grain line, 8 internal lines, 11 cut-outs, 13 drill holes, 14 sew line; 84 to 87: the curves of 1, 8, 11 and 14, point
by point. Lengths stay in the file's unit here.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.kinds import plain
from warp_cloth.pattern.loops import area_of, chained

CUT, TURN, CURVE, NOTCH, FOLD, GRAIN, INTERNAL, CUT_OUT, DRILL, SEW = 1, 2, 3, 4, 6, 7, 8, 11, 13, 14
GRADE_LINE = 5
LAYERS = {80: NOTCH, 81: NOTCH, 82: NOTCH, 83: NOTCH}
CURVES = {84: CUT, 87: SEW}  # what layers 1 and 14 draw by their key points, drawn point by point
SAME_AREA = 0.03  # relative, to which both agree
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
DARTS = ("dart", "abnäher", "abnaeher", "pince", "pinza")  # where names begin so: others name a piece with darts
LINEAR = ("LINE", "ARC", "CIRCLE", "ELLIPSE", "LWPOLYLINE", "POLYLINE", "SPLINE")
FINE = 2e-5  # of a block's extent: how far the points of an arc or spline may be from it
NAMELESS = 0  # lines of layers that have neither number nor known name
# lines of text as AAMA has them; some programs leave blanks out
_STATED = re.compile(r"^\s*([^\W\d_][\w /_-]*?)\s*[:=：]\s*(.*?)\s*$")
_RULE = re.compile(r"^\s*#\s*(\d{1,6})\b")  # the grade rule of a point
EXTENDED_STRING = 1000  # group code
FRAME_VERTEX = 16  # flag of a vertex of a polyline's control frame, which is not on its curve


@dataclass(eq=False)
class Drawn:
    """One piece as drawn: polylines and points by layer, in the file's unit, and what its texts state."""

    block: str  # name of the block; empty in the model space
    lines: dict[int, list[Floats]] = field(default_factory=dict)
    points: dict[int, list[Floats]] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)  # stated, by key in lower case without blanks
    remarks: list[str] = field(default_factory=list)  # other texts
    rules: list[tuple[Floats, int]] = field(default_factory=list)  # points, and their grade rules

    def state(self, text: str) -> None:
        """Takes a line of text."""
        text = repaired(text)
        found = _STATED.match(text)
        if found is None:
            self.remarks.append(text.strip())
            return
        key = re.sub(r"[\W\d_]", "", plain(found[1]))
        if not self.texts.get(key):
            self.texts[key] = found[2]

    def said(self, *keys: str) -> str:
        """What it states under the first of these keys that it states anything under."""
        return next((self.texts[key] for key in keys if self.texts.get(key)), "")

    @property
    def has_outline(self) -> bool:
        return CUT in self.lines or SEW in self.lines


def repaired(text: str) -> str:
    """A text that was UTF-8, and was read in Windows' code page, as files without a stated one are."""
    if text.isascii():
        return text
    try:
        return text.encode("cp1252", "surrogateescape").decode("utf-8")
    except UnicodeError:
        return text


def drawn_piece(name: str, entities: Iterable[Any], scale: float = 1.0) -> Drawn:
    piece = Drawn(repaired(name))
    flat = list(flat_entities(entities, 0))
    fine = _extent(flat) * FINE
    for entity in flat:
        for text in texts_of(entity):
            rule = _RULE.match(text)
            if rule is not None and entity.dxf.hasattr("insert"):
                place = entity.dxf.insert
                piece.rules.append((scale * np.array([place.x, place.y]), int(rule[1])))
            else:
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
    _take_curves(piece)
    return piece


def _take_curves(piece: Drawn) -> None:
    """Takes the curves that are drawn point by point for those that have fewer points."""
    for layer, coarse in CURVES.items():
        found, key = piece.lines.get(layer, []), piece.lines.get(coarse, [])
        if not found or not all(np.isfinite(line).all() for line in (*found, *key)):
            continue
        areas = [max((abs(area_of(loop)) for loop in chained(lines)), default=0.0) for lines in (found, key)]
        finer = sum(map(len, found)) > sum(map(len, key))
        if finer and (not key or abs(areas[0] - areas[1]) <= SAME_AREA * areas[1]):
            piece.lines[coarse] = found


def flat_entities(entities: Iterable[Any], depth: int) -> Iterator[Any]:
    """Entities, with what blocks within a block hold in their places."""
    for entity in entities:
        if entity.dxftype() == "INSERT":
            yield from entity.attribs
            if depth < 4:
                yield from flat_entities(entity.virtual_entities(), depth + 1)
        else:
            yield entity


def layer_number(name: str) -> int | None:
    """The number of a layer by AAMA; None where its name has none."""
    found = re.match(r"^\D{0,8}?0*(\d{1,3})(?!\d)", name.strip())
    if found is not None and int(found[1]) > 0:
        number = int(found[1])
        return LAYERS.get(number, number)
    lower = name.lower()
    if lower.strip().startswith(DARTS):
        return INTERNAL
    return next((number for number, words in NAMED if any(word in lower for word in words)), None)


def _extent(entities: Iterable[Any]) -> float:
    ends = [point for entity in entities if entity.dxftype() in LINEAR for point in _polyline(entity, None)]
    return float(np.ptp(np.array(ends), axis=0).max()) if ends else 0.0


def _polyline(entity: Any, fine: float | None) -> Floats:
    """The points of a linear entity, shape [n, 2], closed ones with their first point again; ``fine``: see FINE."""
    from ezdxf import path

    if entity.dxftype() == "POLYLINE" and not (entity.is_2d_polyline or entity.is_3d_polyline):
        return np.zeros((0, 2))
    if entity.dxftype() == "POLYLINE" and any(vertex.dxf.flags & FRAME_VERTEX for vertex in entity.vertices):
        fitted = [vertex.dxf.location for vertex in entity.vertices if not vertex.dxf.flags & FRAME_VERTEX]
        return np.array([(place.x, place.y) for place in (*fitted, *fitted[: int(entity.is_closed)])]).reshape(-1, 2)
    made = path.make_path(entity)
    if not len(made):
        return np.zeros((0, 2))
    places = np.array([(point.x, point.y) for point in made.control_vertices()])
    if fine is None or not np.isfinite(places).all():  # flattening what is not finite never ends
        return places
    return np.array([(point.x, point.y) for point in made.flattening(max(fine, 1e-9), segments=4)])


def texts_of(entity: Any) -> list[str]:
    """The lines of text of an entity, those that others carry as extended data ("SIZE;M") among them."""
    kind = entity.dxftype()
    if kind in ("TEXT", "ATTRIB", "ATTDEF"):
        return [str(entity.dxf.get("text", ""))]
    if kind == "MTEXT":
        return [str(line) for line in entity.plain_text(split=True)]
    data = {} if entity.xdata is None else entity.xdata.data
    strings = [str(tag.value) for tags in data.values() for tag in tags if tag.code == EXTENDED_STRING]
    return [text.replace(";", ":", 1) for text in strings if ";" in text]

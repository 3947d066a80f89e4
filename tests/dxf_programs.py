"""DXF files as pattern programs write them: group by group, as AccuMark, CLO, Optitex, Lectra and Valentina do.

No library's writer stands between, which would put right what these programs leave out: headers without a version,
blocks without ends, texts without a height, points that only the sample size has.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from dxf_patterns import Drafted, Point, middle

Pieces = dict[str, list[Drafted]]  # by size
INCH, CM, MM = 1 / 2.54, 1.0, 10.0  # units in a centimetre


class Writer:
    """Pairs of group codes and values."""

    def __init__(self, unit: float, decimals: int = 4, end: str = "\n") -> None:
        self.unit, self.decimals, self.end = unit, decimals, end
        self.parts: list[str] = []

    def add(self, *pairs: object) -> None:
        for code, value in zip(pairs[::2], pairs[1::2], strict=True):
            self.parts.append(f"{code:>3}{self.end}{value}{self.end}")

    def at(self, point: Point, code: int = 10) -> tuple[object, ...]:
        x, y = (f"{self.unit * each:.{self.decimals}f}" for each in point)
        return code, x, code + 10, y

    def text(self, text: str, point: Point = (0.0, 0.0), layer: object = 1, **more: object) -> None:
        self.add(0, "TEXT", 8, layer, *self.at(point))
        self.add(*(each for code, value in more.items() for each in (int(code[1:]), value)))
        self.add(1, text, 7, "STANDARD")

    def polyline(self, points: Sequence[Point], layer: object, closed: bool = False, ends: bool = True) -> None:
        self.add(0, "POLYLINE", 8, layer, 66, 1, 70, int(closed))
        for point in points:
            self.add(0, "VERTEX", 8, layer, *self.at(point))
        self.add(0, "SEQEND")
        if ends:
            self.add(8, layer)

    def line(self, a: Point, b: Point, layer: object) -> None:
        self.add(0, "LINE", 8, layer, *self.at(a), *self.at(b, 11))

    def point(self, point: Point, layer: object, *more: object) -> None:
        self.add(0, "POINT", 8, layer, *self.at(point), *more)

    def save(self, path: Path, encoding: str = "utf-8") -> Path:
        path.write_bytes("".join(self.parts).encode(encoding))
        return path


def outline(piece: Drafted) -> list[Point]:
    return [point for edge in piece.edges for point in edge[:-1]]


def across(points: Sequence[Point]) -> list[Point]:
    """Turned so that the grain runs along x, as AccuMark lays pieces."""
    return [(y, -x) for x, y in points]


def accumark(path: Path, sizes: Pieces, sample: str = "M", codes: Callable[[str], str] = str) -> Path:
    """A line for each edge, its points again and again; marks and texts in the sample size only; inches."""
    out = Writer(INCH)
    out.add(0, "SECTION", 2, "HEADER", 0, "ENDSEC", 0, "SECTION", 2, "BLOCKS")
    blocks = []
    for number in range(len(sizes[sample])):
        for size, pieces in sizes.items():
            piece = pieces[number]
            name = codes(piece.name)
            blocks.append(f"{name}_{size}")
            out.add(0, "BLOCK", 8, 0, 2, blocks[-1], 70, 64, 10, "0.0000", 20, "0.0000")
            out.text(f"Piece Name: {name}", g40="0.250", g50="0.0000")
            if size == sample:
                for text in (
                    f"Quantity: {piece.quantity}",
                    "ANNOTATION: 1XFABRIC",
                    f"CATEGORY: {piece.name}",
                    "Fabric: 1",
                ):
                    out.text(text, g40="0.250", g50="0.0000")
            out.text(f"SIZE: {size}", g40="0.250", g50="0.0000")
            _accumark_piece(out, piece, size == sample)
            out.add(0, "ENDBLK")
    out.add(0, "ENDSEC", 0, "SECTION", 2, "ENTITIES")
    for text in ("Style Name: TEE", "Author: GERBER TECHNOLOGY", "PRODUCT: ACCUMARK", "VERSION: 10.0.1",
                 f"Sample Size: {sample}", "Units: ENGLISH", "TOLERANCE: .006"):  # fmt: skip
        out.text(text, g40="0.250", g50="0.0000")
    for block in blocks:
        out.add(0, "INSERT", 8, 1, 2, block, 10, "0.0000", 20, "0.0000")
    out.add(0, "ENDSEC", 0, "EOF")
    return out.save(path)


def _accumark_piece(out: Writer, piece: Drafted, marked: bool) -> None:
    for edge in piece.edges:
        points = across(edge)
        half = len(points) // 2
        out.polyline([*points[:half], *[points[half]] * 4, *points[half + 1 :]], 1)
        if marked:
            for place, point in enumerate(points):
                out.point(point, 2 if place in (0, len(points) - 1) else 3)
            out.text("# 1", points[0], 2, g40="0.250", g50="0.0000")
    if marked:
        for notch in across(piece.notches):
            out.point(notch, 4, 30, "0.1574", 39, "0.0000")
    xs, ys = zip(*outline(piece), strict=True)
    x, low, high = 0.5 * (min(xs) + max(xs)), min(ys), max(ys)
    grain = across([(x, low + 0.3 * (high - low)), (x, high - 0.3 * (high - low))])
    out.line(*grain, 7)
    out.line(*grain, 5)
    out.line(*across([(min(xs) - 3.0, low - 2.0), (max(xs) + 4.0, low - 2.0)]), 8)
    if piece.fold is not None:
        out.line(*across(piece.fold), 6)


def clo(path: Path, sizes: Pieces, unit: float = CM) -> Path:
    """Closed polylines, their control points on layer 84; texts in capitals, without a height; always "METRIC"."""
    out = Writer(unit, 6)
    out.add(0, "SECTION", 2, "HEADER", 9, "$ACADVER", 1, "AC1006", 9, "$INSBASE", 10, "0.0", 20, "0.0", 30, "0.0")
    out.add(9, "$EXTMIN", 10, "0.0", 20, "0.0", 9, "$EXTMAX", 10, "1000.0", 20, "1000.0")
    out.add(0, "ENDSEC", 0, "SECTION", 2, "BLOCKS")
    blocks = []
    for size, pieces in sizes.items():
        for number, piece in enumerate(pieces):
            shift = np.array([60.0 * number, 100.0])
            points = [(float(x), float(y)) for x, y in np.array(outline(piece)) + shift]
            blocks.append(f"{piece.name}_{size}")
            out.add(0, "BLOCK", 8, 0, 2, blocks[-1], 70, 64, 10, 0, 20, 0)
            for text in (f"PIECE NAME: {piece.name}", f"SIZE: {size}", "ANNOTATION: ", f"QUANTITY: {piece.quantity}"):
                out.text(text, points[0], g50="0.0", g51="0.0", g71="0.0")
            out.polyline(points, 1, closed=True, ends=False)
            corners = {tuple(np.array(edge[0]) + shift) for edge in piece.edges}
            for point in points:
                out.point(point, 2 if point in corners else 3)
            for notch in piece.notches:
                out.point(tuple(np.array(notch) + shift), 4, 50, "350.80249")
            out.line(points[0], (points[0][0], points[0][1] + 18.0), 7)
            out.polyline(points[::4], 84, closed=True, ends=False)
            if piece.fold is not None:
                out.line(*(tuple(np.array(end) + shift) for end in piece.fold), 6)
            out.add(0, "ENDBLK")
    out.add(0, "ENDSEC", 0, "SECTION", 2, "ENTITIES")
    for block in blocks:
        out.add(0, "INSERT", 8, 1, 2, block, 10, "0.0", 20, "0.0")
    for text in ("STYLE NAME: clo", "AUTHOR: CLO Virtual Fashion Inc.", "SAMPLE SIZE: M", "UNITS: METRIC"):
        out.text(text, g40="0.25", g50="0.0")
    out.add(0, "ENDSEC", 0, "EOF")
    return out.save(path)


def optitex(path: Path, sizes: Pieces) -> Path:
    """Millimetres, Windows lines; a sew line inside the cut line; notches as short lines across the cut line."""
    from warp_cloth.pattern.loops import inset

    out = Writer(MM, 3, "\r\n")
    out.add(0, "SECTION", 2, "HEADER", 9, "$ACADVER", 1, "AC1009", 0, "ENDSEC", 0, "SECTION", 2, "BLOCKS")
    blocks = []
    for size, pieces in sizes.items():
        for piece in pieces:
            blocks.append(f"{piece.name}-{size}")
            out.add(0, "BLOCK", 8, 0, 2, blocks[-1], 70, 0, 10, 0, 20, 0, 30, 0)
            sew = outline(piece)
            cut = [(float(x), float(y)) for x, y in inset(np.array(sew), -1.0)]
            out.polyline([*cut, cut[0]], 1, ends=False)
            out.polyline([*sew, sew[0]], 14, ends=False)
            for notch in piece.notches:
                out.line(notch, (notch[0], notch[1] + 0.4), 4)
            xs, ys = zip(*sew, strict=True)
            x = 0.5 * (min(xs) + max(xs))
            out.line((x, min(ys) + 1.0), (x, max(ys) - 1.0), 7)
            if piece.fold is not None:
                out.line(*piece.fold, 6)
            texts = (f"Piece Name:{piece.name}", f"Size:{size}", "Material:SELF", f"Quantity:{piece.quantity}")
            for text in texts:
                out.text(text, (x, min(ys) + 3.0), g40="10")
            out.add(0, "ENDBLK", 8, 0)
    out.add(0, "ENDSEC", 0, "SECTION", 2, "ENTITIES")
    for block in blocks:
        out.add(0, "INSERT", 8, 0, 2, block, 10, 0, 20, 0, 30, 0)
    for text in ("Style Name:OPT", "Sample Size:M", "Units:METRIC", "Product:OPTITEX PDS"):
        out.text(text, g40="10")
    out.add(0, "ENDSEC", 0, "EOF")
    return out.save(path)


def lectra(path: Path, sizes: Pieces) -> Path:
    """French names in a code page of Windows, a decimal comma in texts, both halves cut ("1,1"), no inserts at all."""
    out = Writer(MM, 2)
    out.add(999, "MODARIS", 0, "SECTION", 2, "HEADER", 9, "$ACADVER", 1, "AC1009", 9, "$DWGCODEPAGE", 3, "ANSI_1252")
    out.add(0, "ENDSEC", 0, "SECTION", 2, "BLOCKS")
    for size, pieces in sizes.items():
        for piece in pieces:
            out.add(0, "BLOCK", 8, 0, 2, f"{FRENCH[piece.name]}_{size}", 70, 0, 10, 0, 20, 0)
            for text in (f"Piece Name: {FRENCH[piece.name]}", f"Size: {size}", f"Quantity: {piece.quantity}",
                         "Annotation: marge couture 1,0 côté"):  # fmt: skip
                out.text(text, middle(outline(piece)), 15 if text.startswith("A") else 1, g40="5")
            out.polyline([*outline(piece), outline(piece)[0]], 1, ends=False)
            xs, ys = zip(*outline(piece), strict=True)
            out.line((min(xs) + 2.0, min(ys) + 1.0), (min(xs) + 2.0, max(ys) - 1.0), 7)
            if piece.fold is not None:
                out.line(*piece.fold, 6)
            out.add(0, "ENDBLK")
    out.add(0, "ENDSEC", 0, "SECTION", 2, "ENTITIES")
    out.text("Units: METRIC", g40="5")
    out.add(0, "ENDSEC", 0, "EOF")
    return out.save(path, "cp1252")


FRENCH = {"FRONT": "DEVANT", "BACK": "DOS", "SLEEVE": "MANCHE", "NECKBAND": "BORD CÔTE COL"}


def valentina(path: Path, sizes: Pieces) -> Path:
    """All in the model space, layers by number, one size, the size in the style's texts only."""
    out = Writer(MM, 6)
    out.add(0, "SECTION", 2, "HEADER", 9, "$ACADVER", 1, "AC1015", 9, "$INSUNITS", 70, 4, 9, "$MEASUREMENT", 70, 1)
    out.add(0, "ENDSEC", 0, "SECTION", 2, "TABLES", 0, "ENDSEC", 0, "SECTION", 2, "BLOCKS", 0, "ENDSEC")
    out.add(0, "SECTION", 2, "ENTITIES")
    for size, pieces in sizes.items():
        right = 0.0
        for piece in pieces:
            points = np.array(outline(piece))
            shift = np.array([right - points[:, 0].min(), 0.0])
            right += float(np.ptp(points[:, 0])) + 6.0
            placed = [(float(x), float(y)) for x, y in points + shift]
            out.add(0, "LWPOLYLINE", 100, "AcDbEntity", 8, 1, 100, "AcDbPolyline", 90, len(placed), 70, 1)
            for point in placed:
                out.add(*out.at(point))
            inner = tuple(np.mean(placed, axis=0))
            out.text(f"Piece Name: {piece.name}", inner, g40="5")
            out.text(f"Quantity: {piece.quantity}", inner, g40="5")
            out.line(inner, (inner[0], inner[1] + 1.5), 7)
            if piece.fold is not None:
                out.line(*(tuple(np.array(end) + shift) for end in piece.fold), 6)
            out.text(f"Size: {size}", inner, g40="5")
    out.add(0, "ENDSEC", 0, "EOF")
    return out.save(path)


PROGRAMS = {"accumark": accumark, "clo": clo, "optitex": optitex, "lectra": lectra, "valentina": valentina}

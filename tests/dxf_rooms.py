"""DXF files as pattern rooms have them: habits of exporters that ``dxf_programs.py`` does not have, a T-shirt each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import ezdxf
import numpy as np
from dxf_patterns import GARMENTS, GRADES, Drafted, Point, tshirt
from dxf_programs import CM, INCH, MM, Writer, outline

from warp_cloth.pattern.loops import inset

SIZES = "SML"
Text = Callable[[Drafted], Sequence[str]]


def nest(sizes: str = SIZES) -> dict[str, list[Drafted]]:
    return {size: tshirt(GRADES[size]) for size in sizes}


def named(piece: Drafted) -> list[str]:
    return [f"Piece Name: {piece.name}", f"Quantity: {piece.quantity}"]


class Blocks(Writer):
    """A file of blocks."""

    def __init__(self, unit: float, decimals: int = 3, end: str = "\n", version: str = "AC1009") -> None:
        super().__init__(unit, decimals, end)
        self.names: list[str] = []
        self.add(0, "SECTION", 2, "HEADER", 9, "$ACADVER", 1, version, 0, "ENDSEC", 0, "SECTION", 2, "BLOCKS")

    def begin(self, name: str, texts: Sequence[str]) -> None:
        self.names.append(name)
        self.add(0, "BLOCK", 8, 0, 2, name, 70, 64, 10, 0, 20, 0)
        for text in texts:
            self.text(text, g40="3.0")

    def end_block(self, piece: Drafted) -> None:
        if piece.fold is not None:
            self.line(*piece.fold, 6)
        self.add(0, "ENDBLK", 8, 0)

    def finish(self, path: Path, *texts: str, encoding: str = "utf-8") -> Path:
        self.add(0, "ENDSEC", 0, "SECTION", 2, "ENTITIES")
        for name in self.names:
            self.add(0, "INSERT", 8, 1, 2, name, 10, "0.0", 20, "0.0")
        for text in texts:
            self.text(text, g40="0.25")
        self.add(0, "ENDSEC", 0, "EOF")
        return self.save(path, encoding)

    def marked(self, points: Sequence[Point], piece: Drafted) -> None:
        corners = {edge[0] for edge in piece.edges}
        for point in points:
            self.point(point, 2 if point in corners else 3)


def key_points(path: Path) -> Path:
    """ASTM D6673: key points on layer 1, the curve point by point on layer 84."""
    out = Blocks(MM, 2, version="AC1012")
    for piece in tshirt():
        out.begin(f"{piece.name}_M", (f"Piece Name:{piece.name}", "Size Name:102", f"Quantity:{piece.quantity}"))
        points = [point for edge in piece.edges for point in (edge[0], *(edge[6:-1:6] if len(edge) > 6 else ()))]
        out.polyline(points, 1, closed=True)
        out.marked(points, piece)
        out.polyline(outline(piece), 84, closed=True)
        out.end_block(piece)
    return out.finish(path, "Style Name:shirt", "Sample Size:", "Grade Rule Table:", "Units:METRIC")


def shadows(path: Path) -> Path:
    """A graded nest of Optitex: each block again under a size of its own; pieces and blocks are numbers."""
    out = Blocks(CM, 4, "\r\n")
    for size, pieces in nest().items():
        for number, piece in enumerate(pieces):
            texts = [f"Piece Name: {number + 1}_{size}", f"Size: {size}"]
            full = [*texts, f"Quantity: {piece.quantity}", "Material: 101", f"Annotation: {piece.name}"]
            for each in (full, [texts[0], f"{texts[1]}-1"]):
                out.begin(str(len(out.names) + 1), each)
                out.polyline(outline(piece), 1, closed=True)
                out.end_block(piece)
    return out.finish(path, "Units: METRIC", "Sample Size: M")


def counted_blocks(path: Path) -> Path:
    """No texts; blocks named by number to cut and place in the file, sizes one after another, from large to small."""
    out = Blocks(INCH, 4)
    for pieces in reversed(nest().values()):
        for piece in pieces:
            out.begin(f"{piece.name}X{piece.quantity}-{len(out.names)}", ())
            out.polyline(outline(piece), 1, closed=True)
            out.end_block(piece)
    return out.finish(path)


def _nested(path: Path, layer: int, begin: Callable[[Blocks, int, Drafted], None]) -> Path:
    """One block a piece, as ``begin`` begins it, with the outlines of all sizes on one layer."""
    out = Blocks(MM)
    sizes = nest()
    for number, piece in enumerate(sizes["M"]):
        begin(out, number, piece)
        for pieces in sizes.values():
            out.polyline(outline(pieces[number]), layer, closed=True)
        out.end_block(piece)
    return out.finish(path, "Units: METRIC")


def nested_outlines(path: Path) -> Path:
    """One block a piece, with the outlines of all sizes."""
    return _nested(path, 1, lambda out, _, piece: out.begin(piece.name, named(piece)))


def graded_sew_layer(path: Path) -> Path:
    """TUKAcad: the sample's outline on layer 1, those of all sizes on layer 14."""

    def begin(out: Blocks, number: int, piece: Drafted) -> None:
        out.begin(str(number), (*named(piece), "Size: M"))
        out.polyline(outline(piece), 1, closed=True)

    return _nested(path, 14, begin)


def annotated(path: Path) -> Path:
    """Quantities in annotations; names and sizes as extended data of the outlines."""
    out = Blocks(MM)
    for number, piece in enumerate(tshirt()):
        out.begin(f"P{number}", (f"Annotation: SHELL{'(L*1-R*1)' if piece.quantity == '2' else '*1'}",))
        out.add(0, "POLYLINE", 8, 1, 66, 1, 70, 1, 1001, "ASTM_DXF", 1000, f"PIECE NAME;{piece.name}", 1000, "SIZE;M")
        for point in outline(piece):
            out.add(0, "VERTEX", 8, 1, *out.at(point))
        out.add(0, "SEQEND", 8, 1)
        out.end_block(piece)
    return out.finish(path, "Units: METRIC")


def spline_frames(path: Path) -> Path:
    """Polylines fitted with splines, whose control points are among the vertices."""
    out = Blocks(MM)
    for piece in tshirt():
        out.begin(piece.name, named(piece))
        out.add(0, "POLYLINE", 8, 1, 66, 1, 70, 5, 75, 5)
        for x, y in outline(piece)[::3]:
            out.add(0, "VERTEX", 8, 1, *out.at((x + 1.0, y + 1.0)), 70, 16)
        for point in outline(piece):
            out.add(0, "VERTEX", 8, 1, *out.at(point), 70, 8)
        out.add(0, "SEQEND")
        out.end_block(piece)
    return out.finish(path, "Units: METRIC")


def cut_notches(path: Path) -> Path:
    """Notches cut into the outline, as files for cutters have them."""
    out = Blocks(MM)
    for piece in tshirt():
        out.begin(piece.name, named(piece))
        points = list[Point]()
        for edge in piece.edges:
            for a, b in pairwise(np.array(edge)):
                step = b - a
                long = float(np.hypot(*step))
                points.append((float(a[0]), float(a[1])))
                for notch in piece.notches:
                    along = float((np.array(notch) - a) @ step) / long
                    aside = abs(float((notch[0] - a[0]) * step[1] - (notch[1] - a[1]) * step[0])) / long
                    if aside < 0.02 and -1e-9 <= along < long - 1e-6:
                        ends = [max(along - 0.15, 1e-3), along, min(along + 0.15, long - 1e-3)]
                        inward = np.array([-step[1], step[0]]) / long
                        found = [a + s * step / long + d * inward for s, d in zip(ends, (0, 0.5, 0), strict=True)]
                        points += [(float(x), float(y)) for x, y in found]
        out.polyline(points, 1, closed=True)
        out.end_block(piece)
    return out.finish(path, "Units: METRIC")


def _sew_lines(path: Path, beyond: float) -> Path:
    out = Blocks(MM)
    for piece in tshirt():
        out.begin(piece.name, named(piece))
        out.polyline([(float(x), float(y)) for x, y in inset(np.array(outline(piece)), -1.0)], 1, closed=True)
        for edge in piece.edges:
            line = np.array(edge)
            for end, inner in ((0, 1), (-1, -2)):
                way = line[end] - line[inner]
                line[end] += beyond * way / np.hypot(*way)
            out.polyline([(float(x), float(y)) for x, y in line], 14)
        out.end_block(piece)
    return out.finish(path, "Units: METRIC")


def long_sew_lines(path: Path) -> Path:
    """Sew lines edge by edge that run on beyond their corners."""
    return _sew_lines(path, 0.3)


def short_sew_lines(path: Path) -> Path:
    """Sew lines edge by edge that stop before their corners."""
    return _sew_lines(path, -0.4)


def inner_sew_lines(path: Path, name: Callable[[str], str] = "{}/1".format) -> Path:
    """Valentina's AAMA: sew lines on layer 8, blocks named as no block may be, no texts."""
    out = Blocks(MM)
    for piece in tshirt():
        out.begin(name(piece.name), ())
        out.polyline([(float(x), float(y)) for x, y in inset(np.array(outline(piece)), -1.0)], 1, closed=True)
        out.polyline(outline(piece), 8, closed=True)
        out.end_block(piece)
    return out.finish(path)


def lost_names(path: Path) -> Path:
    """As ``inner_sew_lines``, of names whose letters the file's code page lacks."""
    return inner_sew_lines(path, lambda name: "?" * 6)


def labelled_sheet(path: Path) -> Path:
    """A framed sheet of outlines on one layer, with labels for people ("FRONT", "Cut 1", "Place on fold")."""
    document = ezdxf.new("R2000")
    space = document.modelspace()
    right = 0.0
    for piece in tshirt():
        points = np.array(outline(piece)) * MM
        points[:, 0] += right - points[:, 0].min()
        space.add_lwpolyline(points.tolist(), close=True)
        fold = ["Place on fold"] if piece.fold is not None else []
        for line, text in enumerate((piece.name, f"Cut {piece.quantity}", *fold)):
            middle = points.mean(axis=0)
            space.add_text(text, height=4.0).set_placement((float(middle[0]), float(middle[1]) - 6.0 * line))
        right = float(points[:, 0].max()) + 60.0
    space.add_lwpolyline([(-50, -50), (right, -50), (right, 900), (-50, 900)], close=True)
    document.saveas(path)
    return path


def turned_inserts(path: Path) -> Path:
    """Pieces in inches on a sheet that is turned and inserted in millimetres; a pair is one mirrored insert."""
    document = ezdxf.new("R2000")
    document.header["$INSUNITS"] = 4
    sheet = document.blocks.new("SHEET")
    for number, piece in enumerate(tshirt()):
        block = document.blocks.new(piece.name)
        block.add_lwpolyline((np.array(outline(piece)) * INCH).tolist(), close=True, dxfattribs={"layer": "1"})
        if piece.fold is not None:
            block.add_line(*(np.array(piece.fold) * INCH).tolist(), dxfattribs={"layer": "6"})
        sheet.add_blockref(piece.name, (40 * number, 0), dxfattribs={"rotation": 90})
        if piece.quantity == "2":
            sheet.add_blockref(piece.name, (40 * number, 90), dxfattribs={"rotation": 90, "xscale": -1})
    document.modelspace().add_blockref("SHEET", (0, 0), dxfattribs={"xscale": 25.4, "yscale": 25.4, "rotation": 30})
    document.saveas(path)
    return path


ROOMS = {
    room.__name__: room
    for room in (key_points, shadows, counted_blocks, nested_outlines, graded_sew_layer, annotated, spline_frames,
                 cut_notches, long_sew_lines, short_sew_lines, inner_sew_lines, lost_names,
                 labelled_sheet, turned_inserts)
}  # fmt: skip


def graded(path: Path, unit: float = MM, *, texts: bool = True, packed: bool = False, across: bool = False) -> Path:
    """The middle size, with a rule for each point of its outlines, and a .rul file beside it.

    Args:
        path: of the DXF file.
        unit: units in a centimetre.
        texts: rules are stated; else all points are turn points, and rules are counted.
        packed: rules on one line each, as AAMA has them; else a size a line, as ASTM has them.
        across: drawn with the grain along x, and the grade reference line along y of the piece.
    """
    sizes = {size: GARMENTS["tshirt"](GRADES[size]) for size in SIZES}
    out = Blocks(unit, 5, "\r\n")
    rules: list[list[Point]] = []

    def drawn(point: Point) -> Point:
        return (point[1], -point[0]) if across else point

    for number, piece in enumerate(sizes["M"]):
        out.begin(f"{piece.name}_M", (*named(piece), "Size: M"))
        out.polyline([drawn(point) for point in outline(piece)], 1, closed=True)
        if across:
            out.line((0, 0), drawn((0.0, 20.0)), 7)
            out.line((0, 0), drawn((20.0, 0.0)), 5)
        for place, point in enumerate(outline(piece)):
            out.point(drawn(point), 2)
            other = [outline(sizes[size][number])[place] for size in SIZES]
            rules.append([(x - point[0], y - point[1]) for x, y in other])
            if texts:
                out.text(f"# {len(rules)}", drawn(point), 2, g40="0.25")
        if piece.fold is not None:
            out.line(*map(drawn, piece.fold), 6)
        out.add(0, "ENDBLK", 8, 0)
    units = "ENGLISH" if unit == INCH else "METRIC"
    out.finish(path, f"Units: {units}", "Sample Size: M", f"Grade Rule Table: {path.stem}")
    lines = [
        "",
        "ANSI/AAMA VERSION: 1.0.0",
        f"UNITS: {units}",
        "NUMBER OF SIZES: 3",
        "SIZE LIST: S M L",
        "SAMPLE SIZE: M",
    ]
    for number, moved in enumerate(rules):
        pairs = [f"{unit * x:>12.5f},{unit * y:>12.5f}" for x, y in moved]
        lines += [f"RULE: DELTA {number + 1}", *(["".join(pairs)] if packed else [f"{pair}  # Size" for pair in pairs])]
    path.with_suffix(".RUL").write_bytes("\r\n".join([*lines, "END", ""]).encode())
    return path

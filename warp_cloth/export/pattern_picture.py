"""A pattern drawn: all panels with numbered edges and grain, as SVG and PNG, in millimetres."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from warp_cloth.export.files import whole_file
from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.curve import Curve
from warp_cloth.pattern.specification import Panel, Pattern, Side, short

Floats = NDArray[np.float64]

GAP = 40.0  # [mm] between panels, with room for a name
ROW = 2.0  # width of the sheet over the height that all panels need if it is as wide
TEXT, SMALL, LABEL = 12.0, 8.0, 13.0  # [mm]: letters of names and of edges, and from an edge to its label
NOTCH = 7.0  # [mm]
GRAIN = 0.4  # of a panel's height
MOST_PIXELS = 8000  # along a side of the PNG; 1 mm is a pixel where that suffices
PLAIN = "#000000"
SEAMS = ("#d62728", "#1f77b4", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#e377c2", "#8c564b", "#bcbd22")


@dataclass(frozen=True, eq=False)
class Sheet:
    """Where each panel lies on the sheet: a point (x, y) of it [m] at ``1000 (x, -y) + shift`` [mm]."""

    shifts: tuple[Floats, ...]
    size: tuple[float, float]

    def placed(self, panel: int, points: Floats) -> Floats:
        return np.asarray(1e3 * points * (1.0, -1.0) + self.shifts[panel])


def save_pattern_pictures(pattern: Pattern, name: str, folder: Path) -> list[Path]:
    """Writes NAME_pattern.svg and NAME_pattern.png into a folder.

    Raises:
        InputError: a file cannot be written.
    """
    paths = [folder / f"{name}_pattern.{kind}" for kind in ("svg", "png")]
    with whole_file(paths[0]) as place:
        place.write_text(pattern_svg(pattern), encoding="utf-8")
    with whole_file(paths[1]) as place:
        _save_png(pattern, place)
    return paths


def pattern_svg(pattern: Pattern) -> str:
    """The panels as SVG, 1 unit a millimetre, so that it prints in its true size.

    Edges carry their numbers. Those that are sewn have the colour of their stitch, and its number after a colon.
    """
    sheet = laid_out([_box(panel) for panel in pattern.panels])
    width, height = sheet.size
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.2f}mm" height="{height:.2f}mm" '
        f'viewBox="0 0 {width:.2f} {height:.2f}" font-family="sans-serif" text-anchor="middle">',
    ]
    sewn = _stitch_of(pattern)
    for index, panel in enumerate(pattern.panels):
        lines.append(f'<g id="{escape(panel.name, {chr(34): "&quot;"})}" fill="none" stroke-width="0.6">')
        for place, edge in enumerate(panel.edges):
            colour = _colour(sewn.get(Side(index, place)))
            lines.append(f'<path stroke="{colour}" d="{_path(sheet, index, edge.curve)}"/>')
        (x0, y0), (x1, y1), *heads = _grain(sheet, index, panel)
        arrow = " ".join(f"{x:.2f},{y:.2f}" for x, y in heads)
        lines.append(f'<path stroke="#888888" d="M {x0:.2f} {y0:.2f} L {x1:.2f} {y1:.2f}"/>')
        lines.append(f'<polyline stroke="#888888" points="{arrow}"/>')
        lines += [f'<path stroke="#888888" d="{_path(sheet, index, Chain(line))}"/>' for line in panel.lines]
        cut_out = [curve for loop in panel.cut_out for curve in loop]
        lines += [f'<path stroke="{PLAIN}" d="{_path(sheet, index, curve)}"/>' for curve in cut_out]
        lines += [
            f'<path stroke="{PLAIN}" stroke-width="1.2" d="M {x0:.2f} {y0:.2f} L {x1:.2f} {y1:.2f}"/>'
            for (x0, y0), (x1, y1) in _notches(sheet, index, panel)
        ]
        for text, (x, y), size, colour in _labels(sheet, index, panel, sewn):
            lines.append(f'<text x="{x:.2f}" y="{y:.2f}" font-size="{size:g}" fill="{colour}">{escape(text)}</text>')
        lines.append("</g>")
    return "\n".join([*lines, "</svg>", ""])


def _save_png(pattern: Pattern, path: Path) -> None:
    from PIL import Image, ImageDraw

    from warp_cloth.export.lettering import font_for, spelt

    sheet = laid_out([_box(panel) for panel in pattern.panels])
    scale = min(1.0, MOST_PIXELS / max(sheet.size))
    picture = Image.new("RGB", (max(1, round(scale * sheet.size[0])), max(1, round(scale * sheet.size[1]))), "white")
    pen = ImageDraw.Draw(picture)
    sewn = _stitch_of(pattern)
    for index, panel in enumerate(pattern.panels):
        for place, edge in enumerate(panel.edges):
            points = scale * sheet.placed(index, edge.curve.at(np.linspace(0.0, 1.0, 65)))
            pen.line([(x, y) for x, y in points.tolist()], fill=_colour(sewn.get(Side(index, place))), width=2)
        for curve in (curve for loop in panel.cut_out for curve in loop):
            points = scale * sheet.placed(index, curve.at(np.linspace(0.0, 1.0, 65)))
            pen.line([(x, y) for x, y in points.tolist()], fill=PLAIN, width=2)
        start, end, *heads = _grain(sheet, index, panel)
        for line in ((start, end), heads):
            pen.line([(scale * x, scale * y) for x, y in line], fill="#888888", width=1)
        for points in (sheet.placed(index, line) for line in panel.lines):
            pen.line([(scale * x, scale * y) for x, y in points.tolist()], fill="#888888", width=1)
        for ends in _notches(sheet, index, panel):
            pen.line([(scale * x, scale * y) for x, y in ends], fill=PLAIN, width=3)
        for text, (x, y), size, colour in _labels(sheet, index, panel, sewn):
            font = font_for(max(6.0, 1.3 * scale * size), text)
            pen.text((scale * x, scale * y), spelt(text, font), fill=colour, font=font, anchor="ms")
    picture.save(path, format="PNG")


def laid_out(boxes: Sequence[tuple[Floats, Floats]]) -> Sheet:
    """Boxes, lowest and highest corner [mm] with y down, side by side in rows from the top."""
    sizes = [high - low for low, high in boxes]
    wide = max(max(w for w, _ in sizes), float(np.sqrt(ROW * sum((w + GAP) * (h + GAP) for w, h in sizes)))) + GAP
    shifts, x, y, row, most = [], GAP, GAP, 0.0, 0.0
    for (low, _), (w, h) in zip(boxes, sizes, strict=True):
        if x > GAP and x + w > wide:
            x, y, row = GAP, y + row + GAP, 0.0
        shifts.append(np.array([x, y]) - low)
        x, row = x + w + GAP, max(row, h)
        most = max(most, x)
    return Sheet(tuple(shifts), (most, y + row + GAP))


def _box(panel: Panel) -> tuple[Floats, Floats]:
    """Lowest and highest corner [mm], y down."""
    points = np.concatenate([edge.curve.at(np.linspace(0.0, 1.0, 33)) for edge in panel.edges]) * (1e3, -1e3)
    return points.min(axis=0), points.max(axis=0)


def _path(sheet: Sheet, panel: int, curve: Curve) -> str:
    """An edge as SVG's path: exactly, as SVG has the same curves."""
    points = [f"{x:.3f} {y:.3f}" for x, y in sheet.placed(panel, curve.points).tolist()]
    if curve.turn:
        radius, large = 1e3 * curve.radius, int(abs(curve.turn) > np.pi)
        return f"M {points[0]} A {radius:.3f} {radius:.3f} 0 {large} {int(curve.turn < 0.0)} {points[1]}"
    if isinstance(curve, Chain):
        return f"M {points[0]} L {' '.join(points[1:])}"
    return f"M {points[0]} {' LQC'[len(points) - 1]} {' '.join(points[1:])}"


def _stitch_of(pattern: Pattern) -> dict[Side, int]:
    """The stitch of each edge that is sewn."""
    return {side: stitch.number for stitch in reversed(pattern.stitches) for side in stitch.sides}


def _colour(stitch: int | None) -> str:
    return PLAIN if stitch is None else SEAMS[stitch % len(SEAMS)]


def _labels(
    sheet: Sheet, index: int, panel: Panel, sewn: dict[Side, int]
) -> Iterator[tuple[str, tuple[float, float], float, str]]:
    """Text, place [mm], height of letters [mm] and colour: the panel's name, and its edges' numbers, inside it."""
    low, high = _box(panel)
    shift = sheet.shifts[index]
    yield (
        short(panel.name),
        (float(low[0] + high[0]) / 2 + shift[0], float(high[1] + shift[1]) + 1.5 * TEXT),
        TEXT,
        PLAIN,
    )
    for place, edge in enumerate(panel.edges):
        before, middle, after = edge.curve.at(np.array([0.49, 0.5, 0.51]))
        along = (after - before) / max(float(np.hypot(*(after - before))), 1e-12)
        inward = np.array([-along[1], along[0]]) * np.sign(panel.area)
        ((x, y),) = sheet.placed(index, (middle + 1e-3 * LABEL * inward)[None]).tolist()
        stitch = sewn.get(Side(index, place))
        text = str(edge.number) if stitch is None else f"{edge.number}:{stitch}"
        yield text, (x, y + 0.35 * SMALL), SMALL, _colour(stitch)


def _notches(sheet: Sheet, index: int, panel: Panel) -> Iterator[tuple[tuple[float, float], tuple[float, float]]]:
    """Ends of each notch's stroke [mm], from the outline inwards."""
    if panel.notches is None or not len(panel.notches):
        return
    shares = np.linspace(0.0, 1.0, 129)
    points = np.concatenate([edge.curve.at(shares) for edge in panel.edges])
    along = np.concatenate([np.gradient(edge.curve.at(shares), axis=0) for edge in panel.edges])
    for notch in panel.notches:
        way = along[int(np.hypot(*(points - notch).T).argmin())]
        inward = np.array([-way[1], way[0]]) / max(float(np.hypot(*way)), 1e-12) * np.sign(panel.area)
        (x0, y0), (x1, y1) = sheet.placed(index, np.stack([notch, notch + 1e-3 * NOTCH * inward])).tolist()
        yield (x0, y0), (x1, y1)


def _grain(sheet: Sheet, index: int, panel: Panel) -> list[tuple[float, float]]:
    """The grain line [mm]: its foot, its tip, and the three points of its head; the warp is +y of the panel."""
    low, high = _box(panel)
    (x, y), half = 0.5 * (low + high) + sheet.shifts[index], 0.5 * GRAIN * float(high[1] - low[1])
    head = min(6.0, half)
    tip = (x, y - half)
    return [(x, y + half), tip, (x - 0.5 * head, tip[1] + head), tip, (x + 0.5 * head, tip[1] + head)]

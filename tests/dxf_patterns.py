"""Patterns drafted for tests as DXF files by the layers of AAMA and ASTM: tops, trousers, leggings.

Each knows its true seams. ``python tests/dxf_patterns.py FOLDER`` writes them all.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np

Point = tuple[float, float]
GRADES = {"S": -1.0, "M": 0.0, "L": 1.0}


@dataclass
class Drafted:
    """A piece in centimetres: edges counter-clockwise, each the points of a line or curve with both of its ends."""

    name: str
    edges: list[list[Point]]
    quantity: str = "1"
    fold: tuple[Point, Point] | None = None
    notches: list[Point] = field(default_factory=list)
    inner: list[list[Point]] = field(default_factory=list)  # lines on layer 8


def line(*points: Point) -> list[Point]:
    return list(points)


def bezier(a: Point, b: Point, c: Point, d: Point, count: int = 24) -> list[Point]:
    t = np.linspace(0.0, 1.0, count + 1)[:, None]
    p = (1 - t) ** 3 * np.array(a) + 3 * t * (1 - t) ** 2 * np.array(b) + 3 * t**2 * (1 - t) * np.array(c)
    return [(float(x), float(y)) for x, y in p + t**3 * np.array(d)]


def length(points: Sequence[Point]) -> float:
    return float(np.hypot(*np.diff(np.array(points), axis=0).T).sum())


def middle(points: Sequence[Point], share: float = 0.5) -> Point:
    p = np.array(points)
    reached = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(p, axis=0).T))])
    x, y = (float(np.interp(share * reached[-1], reached, p[:, axis])) for axis in range(2))
    return x, y


def half_body(name: str, width: float, long: float, neck: float, depth: float, shoulder: float) -> Drafted:
    """Half a front or back on the fold at x = 0: hem, side, armhole, shoulder, neck, and the fold itself."""
    tip, under = (shoulder, long - 4.5), (width, long - 24.0)
    hollow = 1.2 if depth > 4 else 0.4
    armhole = bezier(under, (shoulder - 0.5, long - 24.5), (shoulder - hollow, long - 15.0), tip)
    high, low = (neck, long), (0.0, long - depth)
    edges = [
        line((0.0, 0.0), (width, 0.0)),
        line((width, 0.0), under),
        armhole,
        line(tip, high),
        bezier(high, (neck, long - 0.7 * depth), (0.5 * neck, long - depth), low),
        line(low, (0.0, 0.0)),
    ]
    notches = [middle(armhole, 0.4)] if depth > 4 else [middle(armhole, 0.38), middle(armhole, 0.43)]
    return Drafted(name, edges, "1", (low, (0.0, 0.0)), notches)


def sleeve(name: str, half: float, long: float, hem: float, front: float, back: float, ease: float = 1.015) -> Drafted:
    """A left sleeve seen from outside: its front at -x, its cap as long as the armholes, and eased."""

    def caps(high: float) -> tuple[list[Point], list[Point]]:
        top = (0.0, long)
        y = long - high
        behind = bezier((half, y), (half - 5.0, y + 1.0), (0.45 * half, long), top)
        ahead = bezier(top, (-0.40 * half, long), (-half + 6.5, y - 0.2), (-half, y))
        return behind, ahead

    low, high = 4.0, 22.0
    for _ in range(50):
        tried = 0.5 * (low + high)
        behind, ahead = caps(tried)
        low, high = (tried, high) if length(behind) + length(ahead) < ease * (front + back) else (low, tried)
    behind, ahead = caps(low)
    y = long - low
    edges = [
        line((-hem, 0.0), (hem, 0.0)),
        line((hem, 0.0), (half, y)),
        [*behind, *ahead[1:]],
        line((-half, y), (-hem, 0.0)),
    ]
    notches = [middle(behind, 0.38), middle(behind, 0.43), middle(ahead, 0.6), (0.0, long)]
    return Drafted(name, edges, "2", None, notches)


def band(name: str, long: float, wide: float, quantity: str = "1") -> Drafted:
    a, b, c, d = (0.0, 0.0), (long, 0.0), (long, wide), (0.0, wide)
    return Drafted(name, [line(a, b), line(b, c), line(c, d), line(d, a)], quantity)


def tshirt(grade: float = 0.0) -> list[Drafted]:
    front = half_body("FRONT", 26.0 + grade, 70.0 + 1.5 * grade, 8.5, 9.5, 22.0 + 0.7 * grade)
    back = half_body("BACK", 26.0 + grade, 70.0 + 1.5 * grade, 8.5, 2.5, 22.0 + 0.7 * grade)
    arm = sleeve("SLEEVE", 18.0 + 0.6 * grade, 34.0, 16.0 + 0.5 * grade, length(front.edges[2]), length(back.edges[2]))
    neck = 2.0 * (length(front.edges[4]) + length(back.edges[4]))
    return [front, back, arm, band("NECKBAND", 0.9 * neck, 2.0)]


def trousers(grade: float = 0.0) -> list[Drafted]:
    hip, out = 27.5 + grade, 22.0 + 0.5 * grade

    def outseam(shift: float) -> list[Point]:
        low = bezier((out + shift, 0.0), (out + shift, 30.0), (hip + shift, 55.0), (hip + shift, 78.0))
        high = bezier((hip + shift, 78.0), (hip + shift, 88.0), (hip - 1 + shift, 96.0), (hip - 3.5 + shift, 102.0))
        return [*low, *high[1:]]

    pieces = []
    for name, shift, fork, drop, top, lean in (
        ("FRONT LEG", 0.0, -4.5, 0.0, 102.0, 0.8),
        ("BACK LEG", 1.5, -9.5, 0.6, 105.0, 4.0),
    ):
        side = outseam(shift)
        crotch_point, centre = (fork, 76.0 - drop), (lean, top)
        hip_point = (0.3 * lean, 85.0)
        curve = bezier(hip_point, (0.0, 79.0), (0.45 * fork, 76.2 - drop), crotch_point)
        inseam = bezier(crotch_point, (fork + 3.0, 55.0), (-0.2 - 0.5 * shift, 30.0), (-0.5 - shift, 0.0))
        edges = [
            line((-0.5 - shift, 0.0), (out + shift, 0.0)),
            side,
            line(side[-1], centre),
            [centre, *curve],
            inseam,
        ]
        pieces.append(Drafted(name, edges, "1,1", None, [middle(side, 0.45), middle(inseam, 0.5)]))
    waist = 2.0 * sum(length(piece.edges[2]) for piece in pieces)
    return [*pieces, band("WAISTBAND", 0.98 * waist, 4.0)]


def hooded(grade: float = 0.0) -> list[Drafted]:
    front = half_body("Front Panel", 29.0 + grade, 66.0 + 1.5 * grade, 9.5, 9.0, 24.0 + 0.7 * grade)
    back = half_body("Back Panel", 29.0 + grade, 66.0 + 1.5 * grade, 9.5, 3.0, 24.0 + 0.7 * grade)
    arm = sleeve("Sleeve", 20.0 + 0.6 * grade, 62.0 + grade, 12.0, length(front.edges[2]), length(back.edges[2]), 1.0)
    wanted = length(front.edges[4]) + length(back.edges[4])
    low, high = 10.0, 40.0
    for _ in range(50):
        wide = 0.5 * (low + high)
        neck = bezier((0.0, 0.0), (0.3 * wide, -2.5), (0.7 * wide, 1.5), (wide, 2.0))
        low, high = (wide, high) if length(neck) < wanted else (low, wide)
    crown = bezier((low, 2.0), (low + 5.0, 22.0), (low - 2.0, 36.0), (0.0, 35.0), 40)
    hood = Drafted("Hood", [neck, crown, line((0.0, 35.0), (0.0, 0.0))], "2", None, [middle(crown)])
    hem = 2.0 * (length(front.edges[0]) + length(back.edges[0]))
    pocket = [line((-10.0, 0.0), (10.0, 0.0), (10.0, 8.0), (6.0, 16.0), (-6.0, 16.0), (-10.0, 8.0), (-10.0, 0.0))]
    pocket = [[a, b] for a, b in zip(pocket[0][:-1], pocket[0][1:], strict=True)]
    return [
        front, back, arm, hood, band("Cuff", 20.0, 7.0, "2"), band("Hem Band", 0.92 * hem, 7.0),
        Drafted("Kangaroo Pocket", pocket),
    ]  # fmt: skip


def leggings(grade: float = 0.0) -> list[Drafted]:
    """One piece a leg, a left one seen from outside: its back, cut out farther, at +x."""
    ankle, thigh, hip = 12.0 + 0.4 * grade, 29.0 + grade, 24.0 + grade
    fork, rise = 74.0, 100.0
    back, front = (thigh + 5.0, fork), (-thigh - 1.0, fork)
    behind = [
        back,
        *bezier((hip + 2.0, fork + 8.0), (hip + 1.5, fork + 12.0), (hip, rise - 6.0), (hip - 1.0, rise + 3.0)),
    ]
    behind = [*bezier(back, (thigh, fork + 0.5), (hip + 2.5, fork + 3.0), (hip + 2.0, fork + 8.0), 12), *behind[2:]]
    ahead = bezier(front, (-thigh + 2.0, fork + 0.5), (-hip + 0.5, fork + 4.0), (-hip, rise - 1.0))[::-1]
    inner = bezier((ankle, 0.0), (ankle + 4.0, 30.0), (thigh, 60.0), back)
    outer = bezier((-ankle, 0.0), (-ankle - 4.0, 30.0), (-thigh + 2.0, 60.0), front)[::-1]
    waist = line(behind[-1], ahead[0])
    leg = Drafted("LEG", [line((-ankle, 0.0), (ankle, 0.0)), inner, behind, waist, ahead, outer], "1,1")
    return [leg, band("WAISTBAND", 1.9 * length(waist), 4.0)]


def raglan(grade: float = 0.0) -> list[Drafted]:
    """A sweatshirt whose sleeves run up to the neck."""
    width, long = 28.0 + grade, 68.0 + grade
    under = (width, long - 25.0)
    pieces = []
    for name, neck, depth in (("FRONT", 7.5, 8.0), ("BACK", 7.0, 2.5)):
        tip = (neck, long - (2.0 if depth > 4 else 0.5))
        low = (0.0, long - depth)
        seam = bezier(under, (width - 3.0, long - 24.0), (neck + 6.0, long - 10.0), tip)
        opening = bezier(tip, (neck - 1.5, tip[1] - 0.7 * (tip[1] - low[1])), (0.5 * neck, low[1]), low)
        edges = [line((0.0, 0.0), (width, 0.0)), line((width, 0.0), under), seam, opening, line(low, (0.0, 0.0))]
        pieces.append(Drafted(name, edges, "1", (low, (0.0, 0.0))))
    front, back = (length(piece.edges[2]) for piece in pieces)
    half, wrist, arm = 20.0 + grade, 11.0, 44.0

    def side(sign: float, top: Point, wanted: float) -> list[Point]:
        """From under the arm up to the neck, as long as the body's seam."""
        start = (sign * half, arm)
        low, high = 0.0, 40.0
        for _ in range(50):
            tall = 0.5 * (low + high)
            curve = bezier(
                start, (sign * (half - 4.0), arm + 1.0), (top[0] + sign * 5.0, arm + 0.6 * tall), (top[0], arm + tall)
            )
            low, high = (tall, high) if length(curve) < wanted else (low, tall)
        return curve

    behind, ahead = side(1.0, (3.5, 0.0), back), side(-1.0, (-3.5, 0.0), front)
    opening = bezier(behind[-1], (1.5, behind[-1][1] - 1.0), (-1.5, ahead[-1][1] - 1.0), ahead[-1], 12)
    edges = [
        line((-wrist, 0.0), (wrist, 0.0)), line((wrist, 0.0), (half, arm)), behind, opening, ahead[::-1],
        line((-half, arm), (-wrist, 0.0)),
    ]  # fmt: skip
    sleeves = Drafted("SLEEVE", edges, "2", None)
    neck = 2.0 * sum(length(piece.edges[3]) for piece in pieces) + 2.0 * length(opening)
    return [*pieces, sleeves, band("NECKBAND", 0.9 * neck, 2.5)]


GARMENTS: dict[str, Callable[[float], list[Drafted]]] = {
    "tshirt": tshirt,
    "trousers": trousers,
    "hooded": hooded,
    "leggings": leggings,
    "raglan": raglan,
}
# Each true seam by kind and number: what a proposal must find, and nothing else
TRUE_SEAMS = {
    "tshirt": {"shoulder": 2, "side": 2, "sleeve cap": 2, "underarm": 2, "collar": 1, "collar ends": 1},
    "trousers": {"outseam": 2, "inseam": 2, "front crotch": 1, "back crotch": 1, "waistband": 1, "waistband ends": 1},
    "hooded": {
        **{"shoulder": 2, "side": 2, "sleeve cap": 2, "underarm": 2, "hood to neck": 2, "hood centre": 1, "cuff": 2},
        **{"cuff ends": 2, "hem band": 1, "hem_band ends": 1},
    },
    "leggings": {"inseam": 2, "front crotch": 1, "back crotch": 1, "waistband": 1, "waistband ends": 1},
    "raglan": {"side": 2, "raglan": 4, "underarm": 2, "collar": 1, "collar ends": 1},
}  # fmt: skip


@dataclass(frozen=True)
class Style:
    """How a program writes its files."""

    units: str = "METRIC"  # as text; ENGLISH in inches; "" without, in millimetres
    turned: float = 0.0  # [degrees] that pieces are turned in the file
    inserted: bool = True
    entity: str = "POLYLINE"  # LWPOLYLINE, LINE
    marks: bool = True  # turn and curve points
    allowance: float = 0.0  # [cm]; a sew line is written where it is not 0, and the cut line outside it
    insunits: int = 0


def write(path: Path, sizes: dict[str, list[Drafted]], style: Style = Style()) -> Path:
    """Writes pieces, by size, into one file; a nest names its blocks PIECE-SIZE."""
    document = ezdxf.new("R12" if style.entity == "POLYLINE" else "R2000")
    if style.insunits:
        document.header["$INSUNITS"] = style.insunits
    space = document.modelspace()
    factor = 1.0 / 2.54 if style.units == "ENGLISH" else 10.0
    angle = math.radians(style.turned)
    turn = factor * np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    at = 0.0
    for size, pieces in sizes.items():
        for piece in pieces:
            name = piece.name.replace(" ", "_") + (f"-{size}" if len(sizes) > 1 else "")
            block = document.blocks.new(name)
            _draw(block, piece, size, turn, style)
            if style.inserted:
                space.add_blockref(name, (at, 0.0))
                at += 100.0 * factor
    for number, text in enumerate(("Style Name: TEST", f"Units: {style.units}", "Sample Size: M")):
        if style.units or not text.startswith("Units"):
            space.add_text(text, dxfattribs={"layer": "1"}).set_placement((0.0, -10.0 * number - 20.0))
    document.saveas(path)
    return path


def _draw(block: Any, piece: Drafted, size: str, turn: Any, style: Style) -> None:
    def placed(points: Sequence[Point]) -> list[Point]:
        return [(float(x), float(y)) for x, y in np.array(points) @ turn.T]

    outline = [point for edge in piece.edges for point in edge[:-1]]
    layers = {"1": outline}
    if style.allowance:
        from warp_cloth.pattern.loops import inset

        layers = {"14": outline, "1": [tuple(p) for p in inset(np.array(outline), -style.allowance).tolist()]}
    for layer, points in layers.items():
        _outline(block, placed(points), layer, style.entity)
    if style.marks:
        corners = {edge[0] for edge in piece.edges}
        for point in outline:
            block.add_point(placed([point])[0], dxfattribs={"layer": "2" if point in corners else "3"})
    for notch in piece.notches:
        block.add_point(placed([notch])[0], dxfattribs={"layer": "4"})
    xs, ys = zip(*outline, strict=True)
    x, low, high = 0.5 * (min(xs) + max(xs)), min(ys), max(ys)
    grain = placed([(x, low + 0.2 * (high - low)), (x, high - 0.2 * (high - low))])
    block.add_line(*grain, dxfattribs={"layer": "7"})
    for points in piece.inner:
        block.add_polyline2d(placed(points), dxfattribs={"layer": "8"})
    if piece.fold is not None:
        block.add_line(*placed(piece.fold), dxfattribs={"layer": "6"})
    for number, text in enumerate((f"Piece Name: {piece.name}", f"Size: {size}", f"Quantity: {piece.quantity}")):
        where = placed([(x, 0.5 * (low + high) - 2.0 * number)])[0]
        block.add_text(text, dxfattribs={"layer": "1"}).set_placement(where)


def _outline(block: Any, points: list[Point], layer: str, entity: str) -> None:
    attributes = {"layer": layer}
    if entity == "LINE":
        for a, b in zip(points, [*points[1:], points[0]], strict=True):
            block.add_line(a, b, dxfattribs=attributes)
    elif entity == "LWPOLYLINE":
        block.add_lwpolyline(points, close=True, dxfattribs=attributes)
    else:
        block.add_polyline2d([*points, points[0]], dxfattribs=attributes)


STYLES = {
    "tshirt": Style(),
    "trousers": Style("ENGLISH", turned=90.0, entity="LWPOLYLINE", allowance=1.0),
    "leggings": Style(),
    "raglan": Style(turned=90.0, allowance=1.0),
    "hooded": Style("", turned=-90.0, inserted=False, entity="LINE", marks=False, insunits=6),
}


def write_all(folder: Path, sizes: Sequence[str] = ("S", "M", "L")) -> dict[str, Path]:
    """All garments in these sizes, each in its style."""
    return {
        name: write(folder / f"{name}.dxf", {size: draft(GRADES[size]) for size in sizes}, STYLES[name])
        for name, draft in GARMENTS.items()
    }


if __name__ == "__main__":
    for written in write_all(Path(sys.argv[1])).values():
        print(written)

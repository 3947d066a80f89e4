"""Shirts drafted for tests: fronts that open, with facings; a yoke, sleeves with cuffs, a stand and a collar's fall.

``python tests/dxf_shirts.py FOLDER`` writes them all.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from dxf_patterns import Drafted, Point, band, bezier, half_body, length, line, sleeve
from dxf_programs import outline
from dxf_rooms import MM, Blocks

OVERLAP, FACING = 1.8, 4.5  # [cm] in front of the centre: for the buttons, and folded back


def fronts(whole: Drafted, facing: float, notched: bool = True) -> Drafted:
    """The left front of half a front on the fold: its neckline runs on level for the overlap and a facing."""
    hem, side, armhole, shoulder, neck, _ = whole.edges
    low = neck[-1]
    edge = (-OVERLAP - facing, low[1])
    edges = [
        line((edge[0], 0.0), hem[1]),
        side,
        armhole,
        shoulder,
        [*neck, edge],
        line(edge, (edge[0], 0.0)),
    ]
    marks = [low, (-OVERLAP, low[1])] if notched and facing else [low]
    return Drafted("FRONT", edges, "1,1", None, [*whole.notches, *(marks if notched else [])])


def yoke_and_back(back: Drafted, below: float = 8.0) -> tuple[Drafted, Drafted]:
    """Half a back on the fold, cut across below the shoulders."""
    hem, side, armhole, shoulder, neck, fold = (list(edge) for edge in back.edges)
    cut = next(k for k, point in enumerate(armhole) if point[1] > armhole[-1][1] - below)
    corner, centre = armhole[cut], (0.0, armhole[cut][1])
    yoke = [line(centre, corner), armhole[cut:], shoulder, neck, line(fold[0], centre)]
    under = [hem, side, armhole[: cut + 1], line(corner, centre), line(centre, hem[0])]
    return Drafted("YOKE", yoke, "1", (fold[0], centre)), Drafted("BACK", under, "1", (centre, hem[0]))


def stand(name: str, neck: float, wide: float = 3.5, notched: bool = True, quantity: str = "2") -> Drafted:
    """A stand as long as the neckline between the overlaps' edges, its upper corners rounded."""
    half = 0.5 * neck
    bottom = bezier((-half, 1.2), (-0.5 * half, 0.0), (0.5 * half, 0.0), (half, 1.2))
    right = bezier((half, 1.2), (half, wide + 0.6), (half - 0.2, wide + 1.0), (half - OVERLAP, wide + 1.0))
    top = bezier((half - OVERLAP, wide + 1.0), (0.5 * half, wide), (-0.5 * half, wide), (-half + OVERLAP, wide + 1.0))
    left = [(-x, y) for x, y in right[::-1]]
    marks = [(half - OVERLAP, wide + 1.0), (-half + OVERLAP, wide + 1.0)] if notched else []
    return Drafted(name, [bottom, [*right, *top[1:], *left[1:]]], quantity, None, marks)


def fall(name: str, long: float, wide: float = 4.5, quantity: str = "2") -> Drafted:
    """A fall whose inner edge is this long, and hollow; its points stand out."""

    def drawn(half: float) -> list[list[Point]]:
        inner = bezier((-half, 0.0), (-0.5 * half, 1.4), (0.5 * half, 1.4), (half, 0.0))
        outer = line((half + 1.5, wide + 0.5), (0.0, wide + 1.2), (-half - 1.5, wide + 0.5))
        return [inner, line(inner[-1], outer[0]), outer, line(outer[-1], inner[0])]

    half = 0.5 * long
    half *= long / length(drawn(half)[0])
    return Drafted(name, drawn(half), quantity)


def shirt(grade: float = 0.0, facing: float = FACING, notched: bool = True, split: bool = True) -> list[Drafted]:
    body = half_body("FRONT", 28.0 + grade, 74.0 + 1.5 * grade, 7.5, 8.5, 22.5 + 0.7 * grade)
    back = half_body("BACK", 28.0 + grade, 74.0 + 1.5 * grade, 7.5, 2.5, 22.5 + 0.7 * grade)
    front = fronts(body, facing, notched)
    arm = sleeve("SLEEVE", 20.0 + 0.6 * grade, 58.0, 13.0, length(body.edges[2]), length(back.edges[2]))
    neck = 2.0 * (length(body.edges[4]) + length(back.edges[4]))
    backs = list(yoke_and_back(back)) if split else [back]
    cuff = band("CUFF", 24.0, 6.0, "2")
    collars = [stand("STAND", neck + 2.0 * OVERLAP, notched=notched), fall("COLLAR", neck)]
    return [front, *backs, arm, cuff, *collars]


def camp_shirt() -> list[Drafted]:
    """A collar of one piece on the neckline of a front that opens, between its centres."""
    pieces = shirt(split=False)
    neck = 2.0 * sum(length(piece.edges[4]) for piece in (half_body("", 28.0, 74.0, 7.5, 8.5, 22.5),
                                                          half_body("", 28.0, 74.0, 7.5, 2.5, 22.5)))  # fmt: skip
    return [*pieces[:-2], fall("COLLAR", neck, 7.0)]


def renamed(pieces: Sequence[Drafted], names: dict[str, str]) -> list[Drafted]:
    return [replace(piece, name=names.get(piece.name, piece.name)) for piece in pieces]


GERMAN = {
    "FRONT": "Vorderteil",
    "BACK": "Rückenteil",
    "YOKE": "Sattel",
    "SLEEVE": "Ärmel",
    "CUFF": "Manschette",
    "STAND": "Steg",
    "COLLAR": "Kragen",
}
SHIRT_SEAMS = {"shoulder": 2, "side": 2, "yoke": 1, "sleeve cap": 2, "underarm": 2, "cuff": 2, "cuff ends": 2}
SHIRTS: dict[str, Callable[[], list[Drafted]]] = {
    "shirt": shirt,
    "without facings": lambda: shirt(facing=0.0),
    "without notches": lambda: shirt(facing=0.0, notched=False),
    "German": lambda: renamed(shirt(), GERMAN),
    "collar twice": lambda: renamed(shirt(), {"STAND": "COLLAR 2", "COLLAR": "COLLAR 1"}),
    "layers apart": lambda: [*shirt(), fall("UNDER COLLAR", shirt_neck(), quantity="1")],
}  # fmt: skip


def shirt_neck() -> float:
    inner = shirt()[-1].edges[0]
    return length(inner)


def write_shirt(pieces: Sequence[Drafted], path: Path) -> Path:
    out = Blocks(MM)
    for piece in pieces:
        texts = [f"Piece Name: {piece.name}", f"Quantity: {piece.quantity}"]
        out.begin(piece.name, texts)
        out.polyline(outline(piece), 1, closed=True)
        for notch in piece.notches:
            out.point(notch, 4)
        out.end_block(piece)
    return out.finish(path)


if __name__ == "__main__":
    for name, made in {**SHIRTS, "camp": camp_shirt}.items():
        write_shirt(made(), Path(sys.argv[1]) / f"{name.replace(' ', '_')}.dxf")

"""Patterns drafted for tests with pieces set in between others: gussets, a hood's strip, waistbands in two."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

from dxf_patterns import Drafted, band, bezier, hooded, length, line, sleeve


def kimono(with_gusset: bool) -> list[Drafted]:
    """A top whose sleeves are cut in one with it, slit at the underarm where a gusset is set in."""
    pieces = []
    for name, depth in (("Davanti", 9.0), ("Dietro", 3.0)):
        side, under, tip = [(27.0, 32.0)], (55.0, 26.0), (60.0, 40.0)
        slit = [(26.5, 41.0), (33.9, 35.2)]
        up = [*side, *slit] if with_gusset else [(28.0, 36.0)]
        low, high = (0.0, 66.0 - depth), (8.5, 66.0)
        path = [(0.0, 0.0), (27.0, 0.0), *up, under, tip]
        edges = [line(a, b) for a, b in pairwise(path)]
        over, neck = bezier(tip, (35.0, 54.0), (22.0, 62.0), high), bezier(high, (8.0, 63.0), (5.0, low[1]), low)
        pieces.append(Drafted(name, [*edges, over, neck, line(low, (0.0, 0.0))], "1", (low, (0.0, 0.0))))
    if with_gusset:
        legs = length(pieces[0].edges[2]), length(pieces[0].edges[3])
        tall = (legs[0] ** 2 - 25.0) ** 0.5, (legs[1] ** 2 - 25.0) ** 0.5
        corners = [(5.0, 0.0), (0.0, tall[0]), (-5.0, 0.0), (0.0, -tall[1])]  # a kite: body and sleeve differ
        kite = [line(a, b) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)]
        pieces.append(Drafted("Tassello", kite, "2"))
    return pieces


def hood_of_three(tapered: bool = False) -> list[Drafted]:
    """The hooded top, its hood's halves narrower by half a strip, which lies between them."""
    pieces = [piece for piece in hooded() if "Pocket" not in piece.name]
    hood = next(piece for piece in pieces if piece.name == "Hood")
    neck, crown, face = hood.edges
    wide = neck[-1][0]
    shift = [(x * (wide - 3.5) / wide, y) for x, y in neck]
    low = shift[-1]
    crown = [low, *crown[1:]]
    long = length(crown)
    strip = band("Hood Centre", 7.0, long)
    if tapered:  # narrower at the face, drawn with that end down
        ends = [(1.0, 0.0), (6.0, 0.0), (7.0, long), (0.0, long)]
        strip = replace(strip, edges=[line(a, b) for a, b in zip(ends, [*ends[1:], ends[0]], strict=True)])
    half = replace(hood, name="Hood Side", edges=[shift, crown, face], notches=[])
    return [*(half if piece is hood else piece for piece in pieces), strip]


def banded_skirt(behind: float = 1.0) -> list[Drafted]:
    """A skirt with waistbands in front and behind, each shorter than its waist; ``behind``: length of the back's."""
    pieces = []
    for name in ("SKIRT FRONT", "SKIRT BACK"):
        side = bezier((28.0, 0.0), (28.0, 30.0), (27.0, 45.0), (21.0, 60.5))
        edges = [line((0.0, 0.0), (28.0, 0.0)), side, line(side[-1], (0.0, 60.0)), line((0.0, 60.0), (0.0, 0.0))]
        pieces.append(Drafted(name, edges, "1", ((0.0, 60.0), (0.0, 0.0))))
    return [*pieces, band("WAISTBAND FRONT", 34.0, 4.0), band("WAISTBAND BACK", 34.0 * behind, 4.0)]


def romper() -> list[Drafted]:
    """A child's romper: each front and back in one with a leg."""
    pieces, armholes = [], []
    for name, depth, fork in (("ROMPER FRONT", 6.0, 4.0), ("ROMPER BACK", 2.0, 6.0)):
        under, tip, high, low = (21.0, 70.0), (15.5, 83.0), (6.5, 86.0), (0.0, 86.0 - depth)
        armhole = bezier(under, (15.5, 69.6), (14.5, 76.0), tip)
        armholes.append(length(armhole))
        crotch = bezier((0.0, 46.0), (0.0, 41.0), (-0.4 * fork, 38.5), (-fork, 38.0))
        edges = [
            line((2.0, 20.0), (18.0, 20.0)),
            bezier((18.0, 20.0), (21.0, 40.0), (21.0, 55.0), under),
            armhole,
            line(tip, high),
            bezier(high, (6.0, 86.0 - 0.6 * depth), (3.5, low[1]), low),
            [low, *crotch],
            line((-fork, 38.0), (2.0, 20.0)),
        ]
        pieces.append(Drafted(name, edges, "2"))
    return [*pieces, sleeve("SLEEVE", 13.0, 30.0, 9.0, *armholes)]


SEWN_IN: dict[str, Callable[[], list[Drafted]]] = {
    "kimono": lambda: kimono(False),
    "gusset": lambda: kimono(True),
    "hood of three": hood_of_three,
    "tapered strip": lambda: hood_of_three(True),
    "waistband in two": banded_skirt,
    "romper": romper,
}
TOP = {"shoulder": 2, "side": 2}
HOODED = {
    **TOP,
    **{"sleeve cap": 2, "underarm": 2, "cuff": 2, "cuff ends": 2, "hem band": 1, "hem_band ends": 1},
    **{"hood strip": 2, "hood to neck": 1},
}
TRUE_SEWN_IN = {
    "kimono": TOP,
    "gusset": {"shoulder": 2, "side": 4, "gusset": 8},
    "hood of three": HOODED,
    "tapered strip": HOODED,
    "waistband in two": {"side": 2, "waistband": 2, "waistband ends": 2},
    "romper": {**TOP, **{"sleeve cap": 2, "underarm": 2, "inseam": 2, "centre front": 1, "centre back": 1}},
}

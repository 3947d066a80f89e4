"""Patterns drafted for tests with princess seams and sleeves of two pieces."""

from __future__ import annotations

import numpy as np
from dxf_patterns import Drafted, Point, band, bezier, half_body, length, line, middle, sleeve, trousers


def cut_at(curve: list[Point], share: float) -> tuple[list[Point], list[Point]]:
    """A polyline in two, cut at a share of its length."""
    p = np.array(curve)
    reached = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(p, axis=0).T))])
    place, at = middle(curve, share), int(np.searchsorted(reached, share * reached[-1]))
    return [*curve[:at], place], [place, *curve[at:]]


def panelled(half: Drafted, waist: float, from_shoulder: bool, names: tuple[str, str]) -> list[Drafted]:
    """Half a front or back as a middle panel on the fold and a side panel, taken in at the waist between them."""
    hem, side, armhole, shoulder, neck, fold = half.edges
    foot = middle(hem, 0.5)
    if from_shoulder:
        outer, inner = cut_at(shoulder, 0.5)
    else:
        outer, inner = cut_at(armhole, 0.5)
    top = outer[-1]
    mid, high = 0.55 * top[1], 0.75 * top[1]

    def seam(shift: float) -> list[Point]:
        low = bezier(foot, (foot[0], 0.3 * mid), (foot[0] + shift, 0.6 * mid), (foot[0] + shift, mid))
        return [*low, *bezier(low[-1], (foot[0] + shift, high), (foot[0] + 2.0, high), top)[1:]]

    middle_rest = [inner, neck, fold] if from_shoulder else [inner, shoulder, neck, fold]
    side_rest = [side, armhole, outer] if from_shoulder else [side, outer]
    own, beside = seam(-waist), seam(waist)
    return [
        Drafted(names[0], [line(hem[0], foot), own, *middle_rest], "1", half.fold, [middle(own, 0.55)]),
        Drafted(names[1], [line(foot, hem[1]), *side_rest, beside[::-1]], "2", None, [middle(beside, 0.55)]),
    ]


def princess(grade: float = 0.0) -> list[Drafted]:
    """A top with princess seams from the armhole in front, and from the shoulder behind."""
    front = half_body("FRONT", 26.0 + grade, 60.0 + grade, 8.5, 9.5, 20.0 + 0.7 * grade)
    back = half_body("BACK", 26.0 + grade, 60.0 + grade, 8.5, 2.5, 20.0 + 0.7 * grade)
    arm = sleeve("SLEEVE", 18.0 + 0.6 * grade, 30.0, 15.0, length(front.edges[2]), length(back.edges[2]))
    return [
        *panelled(front, 0.8, False, ("CENTER FRONT", "SIDE FRONT")),
        *panelled(back, 1.0, True, ("CENTER BACK", "SIDE BACK")),
        arm,
    ]


def two_piece_sleeve(armholes: float, names: tuple[str, str]) -> list[Drafted]:
    """A left sleeve, its front at -x: an upper piece, and an under one as it is drafted, laid on the upper."""
    front, back, hand = (-15.0, 42.0), (14.0, 47.0), (-13.0, 0.0)
    inner_front, inner_back = (-11.0, 41.5), (4.0, 46.5)
    under_top = [*bezier(inner_back, (1.0, 41.0), (-2.0, 39.0), (-5.0, 39.0), 12)]
    under_top += bezier((-5.0, 39.0), (-8.0, 39.0), (-10.0, 40.0), inner_front, 12)[1:]

    def cap(high: float) -> list[Point]:
        behind = bezier(back, (12.0, 47.0 + 0.6 * high), (7.0, 47.0 + high), (0.0, 47.0 + high), 16)
        ahead = bezier(behind[-1], (-6.0, 47.0 + high), (-11.5, 45.0), front, 16)
        return [*behind, *ahead[1:]]

    low, high = 2.0, 30.0
    for _ in range(50):
        tried = 0.5 * (low + high)
        short = length(cap(tried)) + length(under_top) < 1.03 * armholes
        low, high = (tried, high) if short else (low, tried)

    def piece(name: str, f: Point, b: Point, hem: tuple[Point, Point], top: list[Point], notch: Point) -> Drafted:
        behind = bezier(hem[1], (hem[1][0] + 5.0, 15.0), (b[0] + 3.0, 30.0), b, 16)
        ahead = bezier(f, (f[0] + 3.5, 28.0), (hem[0][0] + 3.0, 15.0), hem[0], 16)
        return Drafted(name, [line(*hem), behind, top, ahead], "2", None, [notch])

    return [
        piece(names[0], front, back, (hand, (4.0, 1.0)), cap(low), (0.0, 47.0 + low)),
        piece(names[1], inner_front, inner_back, ((-9.0, 0.0), (-6.0, 1.0)), under_top, (-5.0, 39.0)),
    ]


def jacket(grade: float = 0.0) -> list[Drafted]:
    """A top with princess seams from the shoulder, and sleeves of two pieces."""
    front = half_body("FRONT", 27.0 + grade, 64.0 + grade, 8.5, 9.5, 21.0 + 0.7 * grade)
    back = half_body("BACK", 27.0 + grade, 64.0 + grade, 8.5, 2.5, 21.0 + 0.7 * grade)
    arms = two_piece_sleeve(length(front.edges[2]) + length(back.edges[2]), ("TOP SLEEVE", "UNDER SLEEVE"))
    return [
        *panelled(front, 0.8, True, ("FRONT", "SIDE FRONT")),
        *panelled(back, 1.0, True, ("BACK", "SIDE BACK")),
        *arms,
    ]


def banded(grade: float = 0.0) -> list[Drafted]:
    """The top with princess seams, and a band at its hem."""
    pieces = princess(grade)
    hem = 2.0 * sum(length(piece.edges[0]) for piece in pieces[:4])
    return [*pieces, band("HEM BAND", 0.95 * hem, 6.0)]


def panelled_skirt(grade: float = 0.0) -> list[Drafted]:
    """A skirt of six panels with a waistband: middle ones on the fold, side ones curved at the hip."""
    pieces, waist = [], 0.0
    for face, narrow in (("FRONT", 0.0), ("BACK", 0.6)):
        top, hem, high = 11.0 - narrow + 0.4 * grade, 17.0 - narrow + 0.5 * grade, 58.0
        inner = line((hem, 0.0), (top, high))
        fold = ((0.0, high), (0.0, 0.0))
        edges = [line((0.0, 0.0), (hem, 0.0)), inner, line((top, high), fold[0]), line(*fold)]
        pieces.append(Drafted(f"SKIRT {face}", edges, "1", fold, [middle(inner, 0.5)]))
        low, out = [(0.0, 0.0), (6.0, high)], (24.0 + 0.6 * grade, 0.8)
        hip, tip = (out[0] - 4.5, high - 20.0), (17.0 - narrow + 0.6 * grade, high + 1.2)
        outer = bezier(out, (out[0] - 2.0, 14.0), (hip[0] + 1.5, hip[1] - 8.0), hip)
        outer = [*outer, *bezier(hip, (hip[0] - 1.0, hip[1] + 7.0), (tip[0] + 1.5, tip[1] - 6.0), tip)[1:]]
        edges = [line(low[0], out), outer, line(tip, low[1]), line(low[1], low[0])]
        pieces.append(Drafted(f"SKIRT SIDE {face}", edges, "2", None, [middle(edges[3], 0.5)]))
        waist += 2.0 * (top + length(edges[2]))
    return [*pieces, band("WAISTBAND", 0.98 * waist, 4.0)]


def gored_skirt(grade: float = 0.0) -> list[Drafted]:
    """A skirt of six equal gores with a waistband."""
    half, hem, high = 7.7 + 0.3 * grade, 15.0 + 0.3 * grade, 60.0
    side = bezier((hem, 0.0), (hem - 4.0, 20.0), (half + 1.5, 40.0), (half, high))
    bottom = bezier((-hem, 0.0), (-5.0, -1.5), (5.0, -1.5), (hem, 0.0))
    top = line((half, high), (-half, high))
    gore = Drafted("GORE", [bottom, side, top, [(-x, y) for x, y in side[::-1]]], "6")
    return [gore, band("WAISTBAND", 12.0 * half * 0.98, 4.0)]


def gored_dress(grade: float = 0.0) -> list[Drafted]:
    """A bodice, and a skirt of seven equal gores at its waist."""
    half = length(half_body("FRONT", 26.0 + grade, 45.0, 8.5, 9.5, 20.0).edges[0]) * 4.0 / 14.0
    gore = gored_skirt(grade)[0]
    grown = [[(x * half / (7.7 + 0.3 * grade), y) for x, y in edge] for edge in gore.edges]
    return [*top(grade), Drafted("SKIRT PANEL", grown, "7")]


def top(grade: float = 0.0) -> list[Drafted]:
    """A sleeveless top to the waist."""
    shoulder = 20.0 + 0.7 * grade
    return [
        half_body(name, 26.0 + grade, 45.0, 8.5, depth, shoulder) for name, depth in (("FRONT", 9.5), ("BACK", 2.5))
    ]


def jumpsuit(grade: float = 0.0) -> list[Drafted]:
    """Trousers without a waistband, and a bodice as wide as their waist with sleeves."""
    legs = trousers(grade)[:2]
    pieces = []
    for name, depth, leg in (("FRONT BODICE", 9.5, legs[0]), ("BACK BODICE", 2.5, legs[1])):
        half = half_body(name, 24.0 + grade, 44.0, 8.5, depth, 20.0)
        corner = (length(leg.edges[2]), 0.0)
        edges = [line((0.0, 0.0), corner), line(corner, half.edges[1][1]), *half.edges[2:]]
        pieces.append(Drafted(name, edges, half.quantity, half.fold, half.notches))
    arm = sleeve("SLEEVE", 17.0 + 0.6 * grade, 25.0, 15.0, *(length(piece.edges[2]) for piece in pieces))
    return [*pieces, *legs, arm]


def side_panelled(grade: float = 0.0) -> list[Drafted]:
    """A T-shirt with a panel under each arm, sewn to front and back; drafted as worn on the left, its front at -x."""
    pieces, strips, holes = [], [], []
    for name, depth, share in (("FRONT", 9.5, 0.25), ("BACK", 2.5, 0.35)):
        half = half_body(name, 26.0 + grade, 62.0 + grade, 8.5, depth, 20.0 + 0.7 * grade)
        hem, side, armhole, shoulder, neck, fold = half.edges
        outer, inner = cut_at(armhole, share)
        holes.append(length(armhole))
        foot = (outer[-1][0] - (0.5 if depth > 4 else 0.0), 0.0)
        cut = line(foot, outer[-1])
        edges = [line(hem[0], foot), cut, inner, shoulder, neck, fold]
        pieces.append(Drafted(name, edges, "1", half.fold, [middle(cut, 0.5)]))
        strips.append((foot, outer, side, hem))
    (foot, outer, side, hem), (behind, back_outer, *_) = strips
    across = 2.0 * hem[1][0]
    mirrored = [(across - x, y) for x, y in back_outer[::-1]]
    edges = [
        line(foot, (across - behind[0], 0.0)),
        line((across - behind[0], 0.0), mirrored[0]),
        [*mirrored, *outer[1:]],
        line(outer[-1], foot),
    ]
    notches = [middle(edges[1], 0.5), middle(edges[3], 0.5)]
    arm = sleeve("SLEEVE", 18.0 + 0.6 * grade, 30.0, 15.0, *holes)
    return [*pieces, Drafted("SIDE PANEL", edges, "2", None, notches), arm]


PANELLED = {
    "princess": princess,
    "jacket": jacket,
    "banded": banded,
    "panelled_skirt": panelled_skirt,
    "gored_skirt": gored_skirt,
    "gored_dress": gored_dress,
    "jumpsuit": jumpsuit,
    "side_panelled": side_panelled,
}
TRUE_PANELLED_SEAMS = {
    "princess": {"princess": 4, "shoulder": 2, "side": 2, "sleeve cap": 2, "underarm": 2},
    "jacket": {
        **{"princess": 4, "shoulder": 2, "side": 2, "sleeve cap": 2},
        **{"front sleeve seam": 2, "back sleeve seam": 2},
    },
    "banded": {
        **{"princess": 4, "shoulder": 2, "side": 2, "sleeve cap": 2, "underarm": 2},
        **{"hem band": 1, "hem_band ends": 1},
    },
    "gored_skirt": {"gore": 6, "waistband": 1, "waistband ends": 1},
    "gored_dress": {"gore": 7, "waist": 1, "shoulder": 2, "side": 2},
    "jumpsuit": {
        **{"waist": 2, "outseam": 2, "inseam": 2, "front crotch": 1, "back crotch": 1},
        **{"shoulder": 2, "side": 2, "sleeve cap": 2, "underarm": 2},
    },
    "side_panelled": {"princess": 2, "shoulder": 2, "side": 2, "sleeve cap": 2, "underarm": 2},
    "panelled_skirt": {"princess": 4, "side": 2, "waistband": 1, "waistband ends": 1},
}

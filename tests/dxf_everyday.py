"""Patterns of everyday clothes drafted for tests, each with what others of its kind have not: its true seams."""

from __future__ import annotations

from collections.abc import Callable

from dxf_patterns import TRUE_SEAMS, Drafted, band, bezier, half_body, length, sleeve, trousers, tshirt

TOP = {"shoulder": 2, "side": 2}


def waistcoat() -> list[Drafted]:
    """Fronts and backs of two halves each, no sleeves; a deep neck, so that the front's centre is short."""
    pieces = []
    for name, depth in (("GILET DAVANTI", 26.0), ("GILET DIETRO", 2.5)):
        half = half_body(name, 25.0, 58.0, 8.0, depth, 19.0)
        pieces.append(Drafted(name, half.edges, "2", None, half.notches))
    return pieces


def square_necked() -> list[Drafted]:
    """A waistcoat of four pieces, named left and right; only its backs are hollow twice, as its neck is square."""
    right = [(0.0, 0.0), (25.0, 0.0), (25.0, 30.0), (18.0, 51.0), (11.0, 54.0), (11.0, 36.0), (0.0, 36.0)]
    armhole = bezier(right[2], (18.0, 29.0), (16.5, 40.0), right[3])
    edges = [[right[0], right[1]], [right[1], right[2]], armhole, [right[3], right[4]], [right[4], right[5]]]
    front = Drafted("LEFT FRONT", [*edges, [right[5], right[6]], [right[6], right[0]]])
    neck = bezier(right[4], (10.0, 51.5), (5.0, 51.0), (0.0, 51.0))
    back = Drafted("RIGHT BACK", [*edges[:4], neck, [neck[-1], right[0]]])
    return [front, back, _mirrored(front, "RIGHT FRONT"), _mirrored(back, "LEFT BACK")]


def _mirrored(piece: Drafted, name: str) -> Drafted:
    edges = [[(-x, y) for x, y in edge[::-1]] for edge in piece.edges[::-1]]
    return Drafted(name, edges, piece.quantity)


def wrapped_top() -> list[Drafted]:
    """Fronts that cross each other: a neck from the shoulder to beyond the middle, above a short upright end."""
    whole = half_body("ESPALDA", 23.0, 42.0, 8.5, 2.5, 19.0)
    hem, side, armhole, shoulder, _, _ = half_body("DELANTERO", 23.0, 42.0, 8.5, 9.5, 19.0).edges
    high, low, corner = shoulder[-1], (-12.0, 4.0), (-12.0, 0.0)
    neck = bezier(high, (6.0, 30.0), (-5.0, 14.0), low)
    front = Drafted("DELANTERO", [[corner, hem[-1]], side, armhole, shoulder, neck, [low, corner]], "2")
    return [whole, front]


def wrap_skirt() -> list[Drafted]:
    """Two fronts that lap over each other by 28 cm, below a waistband as long as all."""
    side = bezier((26.0, 0.0), (26.0, 20.0), (25.0, 45.0), (17.0, 56.0))
    back = [[(0.0, 0.0), (26.0, 0.0)], side, [side[-1], (0.0, 55.0)], [(0.0, 55.0), (0.0, 0.0)]]
    lap, low = (-14.0, 55.0), (-14.0, 0.0)
    front = [[low, (26.0, 0.0)], side, [side[-1], (0.0, 55.0)], [(0.0, 55.0), lap], [lap, low]]
    waist = 4.0 * length(back[2]) + 28.0
    return [
        Drafted("Wickelrock hinten", back, "1", ((0.0, 55.0), (0.0, 0.0))),
        Drafted("Wickelrock vorne", front, "2"),
        band("Bund", waist, 4.0),
    ]


def wrap_dress() -> list[Drafted]:
    """The top with crossed fronts and the wrap skirt, sewn at the waist half by half."""
    whole, crossed = wrapped_top()
    back, front, _ = wrap_skirt()
    shift = whole.edges[0][-1][0] - back.edges[1][-1][0]  # both as wide at the waist

    def wider(piece: Drafted, name: str) -> Drafted:
        edges = [[(x + shift if x > 1.0 else x, y) for x, y in edge] for edge in piece.edges]
        return Drafted(name, edges, piece.quantity, piece.fold)

    front = wider(front, "FALDA DELANTERO")
    front.edges = [[(max(x, -12.0), y) for x, y in edge] for edge in front.edges]
    return [whole, crossed, wider(back, "FALDA ESPALDA"), front]


def puff_sleeves() -> list[Drafted]:
    """A short top whose sleeves are gathered at the cap, by a third, and at the cuff."""
    front = half_body("BODICE FRONT", 25.0, 56.0, 8.5, 9.5, 20.0)
    back = half_body("BODICE BACK", 25.0, 56.0, 8.5, 2.5, 20.0)
    arm = sleeve("SLEEVE", 26.0, 30.0, 24.0, length(front.edges[2]), length(back.edges[2]), 1.33)
    return [front, back, arm, band("CUFF", 32.0, 3.0, "2")]


def rolled_collar() -> list[Drafted]:
    """The T-shirt with a collar and cuffs that are folded over: hardly longer than wide."""
    front, back, arm, neckband = tshirt()
    return [front, back, arm, band("COLLAR", length(neckband.edges[0]), 18.0), band("CUFF", 28.0, 16.0, "2")]


def half_waistband() -> list[Drafted]:
    """Trousers whose waistband is drawn by half, as it is cut on a fold, which nothing says."""
    front, back, waistband = trousers()
    return [front, back, band("WAISTBAND", 0.5 * length(waistband.edges[0]), 4.0)]


def dropped_shoulders() -> list[Drafted]:
    """An oversize shirt cut straight: armholes go on where the sides end, and sleeves are trapezia."""
    pieces = []
    for name, depth in (("FRONT", 9.0), ("BACK", 2.5)):
        under, tip, high, low = (30.0, 44.0), (31.0, 68.0), (9.0, 72.0), (0.0, 72.0 - depth)
        neck = bezier(high, (9.0, 72.0 - 0.7 * depth), (4.5, low[1]), low)
        path = [[(0.0, 0.0), (29.0, 0.0)], [(29.0, 0.0), under], [under, tip], [tip, high], neck, [low, (0.0, 0.0)]]
        pieces.append(Drafted(name, path, "1", (low, (0.0, 0.0))))
    cap = length(pieces[0].edges[2])
    path = [(-16.0, 0.0), (16.0, 0.0), (cap, 30.0), (-cap, 30.0)]
    return [*pieces, Drafted("SLEEVE", [[a, b] for a, b in zip(path, [*path[1:], path[0]], strict=True)], "2")]


def ruffled_skirt() -> list[Drafted]:
    """A short skirt with a ruffle at its hem, twice as long, of two strips."""
    side = bezier((26.0, 0.0), (26.0, 15.0), (24.0, 30.0), (17.0, 41.0))
    edges = [[(0.0, 0.0), (26.0, 0.0)], side, [side[-1], (0.0, 40.0)], [(0.0, 40.0), (0.0, 0.0)]]
    pieces = [Drafted(name, edges, "1", ((0.0, 40.0), (0.0, 0.0))) for name in ("FALDA DELANTERA", "FALDA TRASERA")]
    return [*pieces, band("PRETINA", 4.0 * length(edges[2]), 4.0), band("VOLANTE", 104.0, 12.0, "2")]


def ruffled_tshirt() -> list[Drafted]:
    """Ruffles at the hem and at the sleeves, each half as long again as what it is sewn to."""
    front, back, arm, neckband = tshirt()
    hem, wrist = 4.0 * length(front.edges[0]), length(arm.edges[0])
    ruffles = [band("RUFFLE", 1.5 * hem, 10.0), band("SLEEVE RUFFLE", 1.5 * wrist, 6.0, "2")]
    return [front, back, arm, neckband, *ruffles]


def skirt_cut_twice() -> list[Drafted]:
    """A rectangle for front and back alike, gathered to half, with a ruffle at its hem."""
    return [band("SKIRT", 76.0, 40.0, "2"), band("WAISTBAND", 76.0, 4.0), band("RUFFLE", 230.0, 12.0)]


def tiers() -> list[Drafted]:
    """Three strips, each wider than the one above, of which the lowest is cut three times; a ruffle at its hem."""
    strips = [band("TIER 1", 50.0, 22.0, "2"), band("TIER 2", 75.0, 22.0, "2"), band("TIER 3", 75.0, 22.0, "3")]
    return [*strips, band("WAISTBAND", 72.0, 4.0), band("RUFFLE", 340.0, 8.0)]


def named_tiers() -> list[Drafted]:
    """Tiers of a front and a back each, the lowest drawn first."""
    wide = {"UNTERE": 112.0, "MITTLERE": 75.0, "OBERE": 50.0}
    pieces = [band(f"{name} STUFE {face}", w, 22.0) for name, w in wide.items() for face in ("VORNE", "HINTEN")]
    return [*pieces, band("BUND", 72.0, 4.0)]


def overalls() -> list[Drafted]:
    """Trousers with bibs, before and behind, that are hollow from the waist to their tops; no straps."""
    legs = trousers()[:2]
    bibs = []
    for name, leg, top in (("PETO DELANTERO", legs[0], (10.0, 24.0)), ("PETO TRASERO", legs[1], (4.0, 30.0))):
        wide, (x, y) = length(leg.edges[2]), top
        side = bezier((wide, 0.0), (12.0, 8.0), (x + 1.0, 18.0), top)
        edges = [[(0.0, 0.0), (wide, 0.0)], side, [top, (0.0, y)], [(0.0, y), (0.0, 0.0)]]
        bibs.append(Drafted(name, edges, "1", ((0.0, y), (0.0, 0.0))))
    return [*legs, *bibs]


def robe(is_crossed: bool = True) -> list[Drafted]:
    """A kimono's fronts, or a cardigan's, and a band as long as both of their edges and the neck behind."""
    pieces = []
    for name, depth in (("FRONT BODY", 0.0), ("BACK BODY", 2.0)):
        side, under, tip, high = (32.0, 0.0), (30.0, 82.0), (30.0, 108.0), (8.0, 110.0)
        low = (0.0, 110.0 - depth) if depth else (0.0, 60.0)
        neck = bezier(high, (7.0, 108.5), (4.0, low[1]), low)
        if not depth and is_crossed:
            neck = [high, low]
        edges = [[(0.0, 0.0), side], [side, under], [under, tip], [tip, high], neck, [low, (0.0, 0.0)]]
        pieces.append(Drafted(name, edges, "1" if depth else "2", (low, (0.0, 0.0)) if depth else None))
    path = [(-26.0, 0.0), (26.0, 0.0), (26.0, 28.0), (-26.0, 28.0)]
    sleeve_edges = [[a, b] for a, b in zip(path, [*path[1:], path[0]], strict=True)]
    front, back = pieces
    around = 2.0 * (length(front.edges[4]) + length(front.edges[5]) + length(back.edges[4]))
    return [front, back, Drafted("SLEEVE", sleeve_edges, "2"), band("COLLAR BAND", around, 10.0)]


EVERYDAY: dict[str, Callable[[], list[Drafted]]] = {
    "waistcoat": waistcoat,
    "square-necked waistcoat": square_necked,
    "wrapped top": wrapped_top,
    "wrap skirt": wrap_skirt,
    "wrap dress": wrap_dress,
    "puff sleeves": puff_sleeves,
    "rolled collar": rolled_collar,
    "half a waistband": half_waistband,
    "dropped shoulders": dropped_shoulders,
    "ruffled skirt": ruffled_skirt,
    "ruffled T-shirt": ruffled_tshirt,
    "skirt cut twice": skirt_cut_twice,
    "tiers": tiers,
    "named tiers": named_tiers,
    "overalls": overalls,
    "robe": robe,
    "cardigan": lambda: robe(False),
}
TRUE_EVERYDAY = {
    "waistcoat": {**TOP, "centre back": 1},
    "square-necked waistcoat": {**TOP, "centre back": 1},
    "wrapped top": TOP,
    "wrap skirt": {"side": 2, "waistband": 1},
    "wrap dress": {"shoulder": 2, "side": 4, "waist": 3},
    "puff sleeves": {**TOP, "sleeve cap": 2, "underarm": 2, "cuff": 2, "cuff ends": 2},
    "rolled collar": {
        **{**TOP, "sleeve cap": 2, "underarm": 2, "cuff": 2, "cuff ends": 2},
        **{"collar": 1, "collar ends": 1},
    },
    "half a waistband": TRUE_SEAMS["trousers"],
    "dropped shoulders": {**TOP, "sleeve cap": 2, "underarm": 2},
    "ruffled skirt": {"side": 2, "waistband": 1, "waistband ends": 1, "hem band": 1, "hem_band ends": 1},
    "ruffled T-shirt": {
        **TRUE_SEAMS["tshirt"],
        **{"hem band": 1, "hem_band ends": 1, "cuff": 2, "cuff ends": 2},
    },
    "tiers": {"side": 6, "tier": 4, "waistband": 1, "waistband ends": 1, "hem band": 1, "hem_band ends": 1},
    "named tiers": {"side": 6, "tier": 4, "waistband": 1, "waistband ends": 1},
    "overalls": {"outseam": 2, "inseam": 2, "front crotch": 1, "back crotch": 1, "waist": 2},
    "robe": {**TOP, "sleeve cap": 2, "underarm": 2, "collar": 1},
    "cardigan": {**TOP, "sleeve cap": 2, "underarm": 2, "collar": 1},
    "skirt cut twice": {"gore": 2, "waistband": 1, "waistband ends": 1, "hem band": 1, "hem_band ends": 1},
}

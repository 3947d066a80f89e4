"""What pieces are that no name tells: by what is cut out of them, and by which other pieces they fit.

A piece is taken for something only where its shape is of that kind and of no other, and where what it would be sewn to
is there and as long: two fronts and backs by their sides and shoulders, a sleeve by the armholes, a hood by the neck,
a band by the edges it goes round. What stays open stays unknown, and where that is more than a pocket, all does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from warp_cloth.pattern.bodices import arm_side, bodice_roles
from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.facings import is_facing
from warp_cloth.pattern.kinds import Named
from warp_cloth.pattern.piece import Piece
from warp_cloth.pattern.roles import (
    SHOULDER_FALL,
    UPWARDS,
    Roles,
    Shape,
    hood_roles,
    is_strip,
    leg_roles,
    pants_roles,
    sleeve_roles,
    upright,
)

SURE, UNSURE = 0.85, 0.65  # how sure a kind is by shape; the latter where front and back are hardly told apart
ALIKE = 0.04  # relative difference of edges that are sewn together
TOLD_APART = 0.01  # [m] by which a front's neck is deeper, or a back's crotch longer
CAP = (0.98, 1.15)  # of the armholes that a sleeve is set into
ODD_CAP = (0.88, 1.3)  # of a sleeve that is taken for one where there is no other, but not sewn unasked
HOOD_NECK = (0.93, 1.08)  # of half the neckline
LEAST_HOOD = 0.2  # [m] of its face, and of its centre
FACED = 0.6  # of the area of the piece behind which a facing lies
POCKET = 0.15  # of the largest piece's area, that a piece has at most which is left unknown
MIRRORED = 2e-3  # [m] by which edges of mirror images differ
LEAST_SIDE = 0.12  # [m] of a bodice's side, and of an inseam
# Length of a band, over that of the edges that it goes round
BANDS = {"collar": (0.75, 1.03), "waistband": (0.8, 1.03), "hem_band": (0.7, 1.03), "cuff": (0.5, 1.03)}


@dataclass(frozen=True, eq=False)
class _Drawn:
    """A piece as it would hang if it was of a kind."""

    shape: Shape
    roles: Roles
    is_whole: bool

    def length(self, role: str) -> float:
        """Length of a role's edges, on one side of the piece [m]."""
        return max(self.shape.length(self.roles.get(role + mark, ())) for mark in ("", "+", "-"))

    def whole(self, role: str) -> float:
        """Length of a role's edges in the whole garment, of a piece that is cut twice unless it is symmetric [m]."""
        return self.shape.length(self.roles.get(role, ())) * (1.0 if self.is_whole else 2.0)

    @property
    def shoulder_falls(self) -> bool:
        """Whether it has shoulders that fall from the neck as a body's, more than a waist does towards a crotch."""
        runs = [run for role, run in self.roles.items() if role.startswith("shoulder") and run]
        falls = []
        for run in runs:
            ends = [self.shape.turned[run[0]].start, self.shape.turned[run[-1]].end]
            x, y = np.abs(ends[1] - ends[0])
            falls.append(y > SHOULDER_FALL * x)
        return bool(falls) and all(falls)

    def depth(self, role: str) -> float:
        """How far a role's edges reach down from their highest point [m]."""
        points = np.concatenate([self.shape.turned[k].points[:, 1] for k in self.roles[role]])
        return float(np.ptp(points))


def told_by_shape(pieces: Sequence[Piece]) -> tuple[list[Piece], list[str]]:
    """The pieces of a garment, of which no name tells any, with what they are by shape; and notes on that.

    Where some names tell, the other pieces are identified by shape only if shapes agree with all of these names.
    """
    if any(piece.what.kind for piece in pieces) or len(pieces) < 2:
        return _among_named(_with_facings(pieces))
    kinds = _Kinds(pieces)
    found = kinds.found()
    if not found:
        return list(pieces), []
    out = []
    for index, piece in enumerate(pieces):
        copies = (1, 0) if index in kinds.drawn_twice else piece.copies
        out.append(replace(piece, what=found.get(index, piece.what), copies=copies))
    told = {index: "facing" if what.kind == "none" else what.kind for index, what in sorted(found.items())}
    said = ", ".join(f"{pieces[index].name}: {kind.replace('_', ' ')}" for index, kind in told.items())
    return out, [f"no names tell what pieces are; by their shapes {said}"]


def _among_named(pieces: Sequence[Piece]) -> tuple[list[Piece], list[str]]:
    """The pieces, those whose names say nothing identified by shape among others whose names do; and notes on that.

    None is, where shapes contradict the names. A strip as long as the hem may be a belt: it stays unknown.
    """
    out = list(pieces)
    outer = [index for index, piece in enumerate(pieces) if piece.what.kind != "none"]
    if all(pieces[index].what.kind or pieces[index].what.panel for index in outer):
        return out, []
    found = _Kinds([pieces[index] for index in outer]).told()
    told = {}
    for place, index in enumerate(outer):
        kind, panel = pieces[index].what.kind, pieces[index].what.panel
        what = found.get(place, Named())
        differs = what.kind != kind and kind not in what.kind.split("_")
        if kind and differs and (what.kind or kind in _ROLES or kind == "back"):
            return out, []
        if not kind and not panel and what.kind not in ("", "hem_band"):
            told[index] = what
    for index, what in told.items():
        out[index] = replace(pieces[index], what=replace(what, side=pieces[index].what.side))
    said = ", ".join(f"{pieces[index].name}: {what.kind.replace('_', ' ')}" for index, what in sorted(told.items()))
    return out, [f"by shape, as the names do not tell, {said}"] if told else []


def _with_facings(pieces: Sequence[Piece]) -> list[Piece]:
    """The pieces, those left out that face another one of the outer cloth, whose names say nothing, or the same."""
    areas = [abs(sum(edge.area for edge in piece.edges)) for piece in pieces]
    outer = [index for index, piece in enumerate(pieces) if piece.what.kind not in ("", "none")]
    out = []
    for piece, area in zip(pieces, areas, strict=True):
        faced = [pieces[index] for index in outer if area < FACED * areas[index]]
        if piece.what.kind:
            own = piece.what.kind, piece.what.face
            faced = [other for other in faced if (other.what.kind, other.what.face) == own]
        is_one = not piece.what.panel and any(is_facing(piece.edges, other.edges) for other in faced)
        out.append(replace(piece, what=Named("none", sure=SURE, is_facing=True)) if is_one else piece)
    return out


class _Kinds:
    """The kinds of a garment's pieces, found one after another."""

    def __init__(self, pieces: Sequence[Piece]) -> None:
        self.pieces = pieces
        bare = [index for index, piece in enumerate(pieces) if piece.mirror is None and piece.copies in (None, (1, 0))]
        twins = [pair for pair in combinations(bare, 2) if are_mirrored(*(pieces[index].edges for index in pair))]
        partners = [index for pair in twins for index in pair]
        pairs = [pair for pair in twins if all(partners.count(index) == 1 for index in pair)]
        self.drawn_twice = {index for pair in pairs for index in pair}
        self._second = dict(pairs)  # of a pair drawn as left and right, the second by the first
        self._firsts = [index for index in range(len(pieces)) if index not in self._second.values()]
        self._found: dict[int, Named] = {}

    def found(self) -> dict[int, Named]:
        """What each piece is, of those that are told; of none where one is unknown that is too large for a pocket.

        It would be another garment than it seems.
        """
        self.told()
        areas = [abs(sum(edge.area for edge in piece.edges)) for piece in self.pieces]
        for index, piece in enumerate(self.pieces):
            faced = [self.pieces[k] for k in self._found if areas[index] < FACED * areas[k]]
            if index not in self._found and any(is_facing(piece.edges, other.edges) for other in faced):
                self._tell(index, "none", SURE)
        largest = max((areas[index] for index in self._found), default=0.0)
        known = all(index in self._found or area < POCKET * largest for index, area in enumerate(areas))
        return self._found if known else {}

    def told(self) -> dict[int, Named]:
        """The kinds of the pieces that shapes identify, whatever stays unknown."""
        self._find()
        return self._found

    def _find(self) -> None:
        shapes = {kind: self._shaped(kind) for kind in ("front", "leg_front", "leg", "sleeve", "hood")}
        tops = [i for i, each in shapes["front"].items() if i not in shapes["leg_front"] or each.shoulder_falls]
        legs = [index for index in shapes["leg_front"] if index not in shapes["front"]]
        bodice = self._pair(shapes["front"], tops, "neck", ("side", "shoulder"), ("front", "back"))
        if not bodice:
            whole = [index for index in shapes["leg"] if self._matches(shapes["leg"][index], "inseam+", "inseam-")]
            if len(legs) == 2:
                bottoms = self._pair(
                    shapes["leg_front"], legs, "crotch", ("outseam", "inseam"), ("leg_front", "leg_back")
                )
                self._bands([("waistband", sum(each.whole("waist") for each in bottoms))])
            elif len(whole) == 1:
                self._tell(whole[0], "leg", SURE)
                leg = shapes["leg"][whole[0]]
                self._bands([("waistband", leg.whole("waist")), ("cuff", leg.length("hem"))])
            return
        self._sleeves_and_hood(bodice, shapes)

    def _sleeves_and_hood(self, bodice: Sequence[_Drawn], shapes: Mapping[str, Mapping[int, _Drawn]]) -> None:
        armholes = sum(each.length("armhole") for each in bodice)
        caps = {
            index: each.length("cap") / armholes
            for index, each in shapes["sleeve"].items()
            if index not in self._found and self._matches(each, "under+", "under-")
        }
        fits = [index for index, cap in caps.items() if CAP[0] <= cap <= CAP[1]]
        sleeves = fits or [index for index, cap in caps.items() if ODD_CAP[0] <= cap <= ODD_CAP[1]]
        neck = sum(each.whole("neck") for each in bodice)
        hoods = [
            index
            for index, each in shapes["hood"].items()
            if HOOD_NECK[0] <= 2.0 * each.length("neck") / neck <= HOOD_NECK[1]
            and min(each.length("face"), each.length("centre")) > LEAST_HOOD
        ]
        hoods = [index for index in hoods if index not in self._found and index not in sleeves]
        if len(sleeves) == 1:
            self._tell(sleeves[0], "sleeve", SURE if fits else UNSURE)
        if len(hoods) == 1:
            self._tell(hoods[0], "hood", SURE)
        rings = [("hem_band", sum(each.whole("hem") for each in bodice))]
        if not hoods:
            rings.append(("collar", neck))
        if len(sleeves) == 1:
            rings.append(("cuff", shapes["sleeve"][sleeves[0]].length("hem")))
        self._bands(rings)

    def _shaped(self, kind: str) -> dict[int, _Drawn]:
        """The pieces that have the shape of a kind."""
        found = {}
        for index in self._firsts:
            piece = self.pieces[index]
            whole = piece.mirror is not None
            shape = Shape(piece.edges, upright(piece.edges, kind))
            if len(shape.order) < 3 or is_strip(shape):
                continue
            drawn = _Drawn(shape, _ROLES[kind](shape, whole), whole)
            if _IS[kind](drawn):
                found[index] = drawn
        return found

    def _pair(
        self,
        shapes: Mapping[int, _Drawn],
        own: Sequence[int],
        telling: str,
        alike: Sequence[str],
        kinds: tuple[str, str],
    ) -> list[_Drawn]:
        """The two pieces that are front and back, which are alike where they are sewn; empty: these are not two.

        ``telling``: the role that tells them apart; a front's neck is deeper, and a back's crotch longer.
        """
        if len(own) != 2:
            return []
        one, other = (shapes[index] for index in own)
        if not all(_alike(one.length(role), other.length(role)) for role in alike):
            return []
        sizes = [each.depth(telling) if telling == "neck" else each.length(telling) for each in (one, other)]
        apart = sizes[0] - sizes[1] if telling == "neck" else sizes[1] - sizes[0]
        sure = SURE if abs(apart) >= TOLD_APART else UNSURE
        for index, kind in zip(own, kinds if apart > 0.0 else kinds[::-1], strict=True):
            self._tell(index, kind, sure)
        return [one, other]

    def _bands(self, rings: Sequence[tuple[str, float]]) -> None:
        """Strips that go round one of these rings of edges, and round no other; each ring has one band."""
        fits: dict[int, list[str]] = {}
        for index in self._firsts:
            piece = self.pieces[index]
            shape = Shape(piece.edges, UPWARDS)
            if index in self._found or not is_strip(shape):
                continue
            long = float(np.ptp(np.array(shape.box), axis=0).max())
            kinds = [kind for kind, ring in rings if BANDS[kind][0] <= long / max(ring, 1e-9) <= BANDS[kind][1]]
            count = 2 if index in self._second else None if piece.copies is None else sum(piece.copies)
            fits[index] = [kind for kind in kinds if kind != "cuff" or count in (None, 2)]
        for index, own in fits.items():
            if len(own) == 1 and sum(own[0] in others for others in fits.values()) == 1:
                self._tell(index, own[0], SURE)

    def _matches(self, drawn: _Drawn, one: str, other: str) -> bool:
        return _alike(*(drawn.shape.length(drawn.roles.get(role, ())) for role in (one, other)))

    def _tell(self, index: int, kind: str, sure: float) -> None:
        for each in (index, self._second.get(index)):
            if each is not None:
                self._found[each] = Named(kind, sure=sure, is_facing=kind == "none")


def is_leg_and_no_bodice(piece: Piece) -> bool:
    """Whether a half piece has the shape of a leg's front or back, and not that of a bodice's."""
    leg = Shape(piece.edges, upright(piece.edges, "leg_front"))
    if len(leg.order) < 3:
        return False
    return _is_leg(_Drawn(leg, leg_roles(leg), False)) and not is_bodice(piece)


def is_bodice(piece: Piece) -> bool:
    """Whether a piece has neck, shoulder, armhole and side of a bodice's front or back, or of half of one."""
    shape, whole = Shape(piece.edges, upright(piece.edges, "front")), piece.mirror is not None
    return len(shape.order) >= 3 and _is_bodice(_Drawn(shape, bodice_roles(shape, whole, arm_side), whole))


def _alike(one: float, other: float) -> bool:
    return min(one, other) > 0.0 and abs(one - other) <= ALIKE * max(one, other)


def are_mirrored(one: Sequence[Chain], other: Sequence[Chain]) -> bool:
    """Whether two outlines are each other's mirror image, and not the same: edge by edge by lengths and bows."""
    if len(one) != len(other):
        return False
    a, b = np.array([_measures(edge) for edge in one]), np.array([_measures(edge) for edge in other])
    back = np.array([_measures(edge.reversed) for edge in other[::-1]])
    apart, same = (min(float(np.abs(a - np.roll(each, k, axis=0)).max()) for k in range(len(a))) for each in (back, b))
    return apart < MIRRORED and apart < same


def _measures(edge: Chain) -> list[float]:
    """An edge's length, and how far from its start it is at four places [m]."""
    points = edge.at(np.array([0.25, 0.5, 0.75, 1.0]))
    return [edge.length, *np.hypot(*(points - edge.start).T).tolist()]


def _is_bodice(drawn: _Drawn) -> bool:
    """Whether it has a hollow neck and armholes, and a side and a shoulder at each."""
    roles, shape = drawn.roles, drawn.shape
    marks = [mark for mark in "+-" if roles.get(f"armhole{mark}")]
    if not roles.get("neck") or not roles.get("hem") or len(marks) != (2 if drawn.is_whole else 1):
        return False
    if not all(roles.get(f"{role}{mark}") for role in ("side", "shoulder") for mark in marks):
        return False
    hollow = all(any(shape.is_concave(k) for k in roles[f"armhole{mark}"]) for mark in marks)
    is_half = drawn.is_whole or bool(roles.get("centre"))
    straight = all(shape.is_straight(k) for mark in marks for k in roles[f"shoulder{mark}"])
    long = drawn.length("side") > max(LEAST_SIDE, 0.5 * drawn.length("shoulder"))
    return hollow and is_half and straight and long and drawn.depth("neck") > 0.0


def _is_leg(drawn: _Drawn) -> bool:
    """Whether it is cut out at one side for the crotch, above an inseam that is shorter than the outseam."""
    roles, shape = drawn.roles, drawn.shape
    if drawn.is_whole or not all(roles.get(role) for role in ("hem", "waist", "outseam", "inseam", "crotch")):
        return False
    hollow = any(shape.is_concave(k) for k in roles["crotch"])
    return hollow and drawn.length("outseam") > drawn.length("inseam") + 0.5 * drawn.length("crotch") > LEAST_SIDE


def _is_whole_leg(drawn: _Drawn) -> bool:
    roles, shape = drawn.roles, drawn.shape
    marked = [f"{role}{mark}" for role in ("inseam", "crotch") for mark in "+-"]
    if drawn.is_whole or not all(roles.get(role) for role in ("hem", "waist", *marked)):
        return False
    return all(any(shape.is_concave(k) for k in roles[f"crotch{mark}"]) for mark in "+-")


def _is_sleeve(drawn: _Drawn) -> bool:
    """Whether it rises to a cap between two seams."""
    roles, shape = drawn.roles, drawn.shape
    if not all(roles.get(role) for role in ("hem", "cap", "under+", "under-")):
        return False
    cap = np.concatenate([shape.turned[k].points for k in roles["cap"]])
    return bool(cap[:, 1].max() > max(cap[0, 1], cap[-1, 1]) + 0.1 * float(np.ptp(cap[:, 0])))


_ROLES = {
    "front": lambda shape, whole: bodice_roles(shape, whole, arm_side),
    "leg_front": lambda shape, _: leg_roles(shape),
    "leg": lambda shape, _: pants_roles(shape),
    "sleeve": lambda shape, _: sleeve_roles(shape),
    "hood": lambda shape, _: hood_roles(shape),
}
_IS = {
    "front": _is_bodice,
    "leg_front": _is_leg,
    "leg": _is_whole_leg,
    "sleeve": _is_sleeve,
    "hood": lambda drawn: not drawn.is_whole and bool(drawn.roles.get("neck")),
}

"""The edges that collars, waistbands, cuffs and bands at the hem go round."""

from __future__ import annotations

from collections.abc import Sequence

from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.kinds import BOTH, HALF_SLEEVES, LEFT, RIGHT
from warp_cloth.pattern.leg_yokes import leg_run
from warp_cloth.pattern.neckline import neck_from_back, opens_in_front
from warp_cloth.pattern.runs import face_run, faces_of, parts_of_kind, run_of
from warp_cloth.pattern.sleeves import end_of_sleeve, half_sleeves, sleeve_side, under_sleeve_of
from warp_cloth.pattern.specification import Side

UNSHAPED = 0.85  # waist over hem, of a skirt that is shaped by its gathers alone
WITH_CUFFS = ("sleeve", *HALF_SLEEVES, "leg", "leg_front", "leg_back")
LAPPED = 0.12  # relative, by which a skirt's fronts are wider than its back if they lap over each other


def ring_of(parts: Sequence[Part], band: int) -> tuple[Side, ...]:
    """The closed run of edges that a band goes round, from the middle of the back, or an underarm or inner seam."""
    kind = parts[band].kind
    if kind == "collar":
        return neck_from_back(parts)
    if kind == "cuff":
        side = parts[band].side or (RIGHT if parts[band].twin is not None and (parts[band].twin or 0) < band else LEFT)
        for sleeve in parts_of_kind(parts, "sleeve"):
            if sleeve_side(parts, sleeve) == side:
                under = under_sleeve_of(parts, sleeve)
                sleeve = end_of_sleeve(parts, sleeve, side)
                both = (sleeve,) if under is None else (sleeve, under[0])
                return tuple(each for one in both for each in run_of(one, parts[one].roles.get("hem", ()), True))
        faces = HALF_SLEEVES[::-1] if side == LEFT else HALF_SLEEVES
        if halves := [half for face in faces for half in half_sleeves(parts, face, side)]:
            return tuple(each for one in halves for each in run_of(one, parts[one].roles.get("hem", ()), True))
        if has_wrists(parts):
            return _round_arm(parts, "wrist", side)
        for leg in parts_of_kind(parts, "leg"):
            if parts[leg].side == side:
                return run_of(leg, parts[leg].roles.get("hem", ()), True)
        legs = {
            parts[leg].kind: leg for leg in parts_of_kind(parts, "leg_front", "leg_back") if parts[leg].side == side
        }
        runs = [run_of(leg, parts[leg].roles.get("hem", ()), True) for leg in legs.values()]
        if len(runs) == 2:
            return tuple(each for run in runs for each in run)
        return _round_arm(parts, "armhole", side) if is_round_armhole(parts, band) else ()
    gores = parts_of_kind(parts, "gore")
    if kind == "hem_band":
        if gores:
            return tuple(side for gore in gores[::-1] for side in run_of(gore, parts[gore].roles.get("hem", ()), True))
        skirts = around(parts, ("skirt_front", "tier_front"), ("skirt_back", "tier_back"), "hem", True)
        return skirts or around(parts, ("front",), ("back",), "hem", True)
    whole = {
        parts[leg].side: run_of(leg, parts[leg].roles.get("waist", ()), True) for leg in parts_of_kind(parts, "leg")
    }
    if all(whole.get(side) for side in (LEFT, RIGHT)):
        return (*whole[RIGHT], *whole[LEFT])  # from the middle of the back
    if gores:
        return tuple(side for gore in gores for side in run_of(gore, parts[gore].roles.get("waist", ()), True))
    legs_or_skirt = around(parts, ("leg_front", "skirt_front"), ("leg_back", "skirt_back"), "waist", False)
    return legs_or_skirt or around(parts, ("front",), ("back",), "hem", True)


def is_round_armhole(parts: Sequence[Part], band: int) -> bool:
    """Whether a cuff can only go round an armhole: nothing that has an end for it is there."""
    return parts[band].kind == "cuff" and not parts_of_kind(parts, *WITH_CUFFS) and not has_wrists(parts)


def has_wrists(parts: Sequence[Part]) -> bool:
    """Whether sleeves are cut in one with fronts or backs: these have ends for cuffs."""
    return any(f"wrist{mark}" in part.roles for part in parts for mark in "+-")


def _round_arm(parts: Sequence[Part], role: str, side: int) -> tuple[Side, ...]:
    """The edges of the armhole or of a sleeve's end on a side, against their direction, from the underarm on."""
    found = [
        [run for face in faces_of(parts, kind) if (run := face_run(parts, face, role, side, True))]
        for kind in (("back", "front") if side == LEFT else ("front", "back"))
    ]
    return (*found[0][0], *found[1][0]) if all(len(runs) == 1 for runs in found) else ()


def is_left_open(parts: Sequence[Part]) -> bool:
    """Whether the front opens from neck to hem: of two halves, and not of a romper, which is closed to its fork."""
    return opens_in_front(parts) and not any("inseam" in parts[panel].roles for panel in parts_of_kind(parts, "front"))


def are_unshaped_skirts(parts: Sequence[Part], ring: Sequence[Side]) -> bool:
    """Whether the waists of a ring are of skirts that are as wide there as at their hems: cut to be gathered."""
    skirts = [parts[panel] for panel in {side.panel for side in ring}]
    widths = [[skirt.shape.length(skirt.roles.get(role, ())) for role in ("waist", "hem")] for skirt in skirts]
    return all("skirt" in skirt.kind or skirt.kind == "gore" for skirt in skirts) and all(
        a > UNSHAPED * b > 0.0 for a, b in widths
    )


def skirt_fronts_cross(parts: Sequence[Part]) -> bool:
    """Whether a skirt's fronts are of two halves that lap over each other: together much wider than what is behind."""
    fronts = parts_of_kind(parts, "skirt_front")
    ahead, behind = (
        sum(parts[panel].shape.length(parts[panel].roles.get("hem", ())) for panel in panels)
        for panels in (fronts, parts_of_kind(parts, "skirt_back"))
    )
    return {parts[panel].side for panel in fronts} == {LEFT, RIGHT} and 0.0 < behind * (1.0 + LAPPED) < ahead


def opens_between_fronts(parts: Sequence[Part], ring: Sequence[Side]) -> bool:
    """Whether a ring of edges begins at one front and ends at another, and is open between them."""
    ends = [ring[0].panel, ring[-1].panel] if ring else []
    return len({*ends}) == 2 and all(parts[panel].kind in ("front", "skirt_front") for panel in ends)


def has_rival(parts: Sequence[Part], ring: Sequence[Side]) -> bool:
    """Whether a piece that a ring of edges does not go through is of the same kind and side as one that it does."""
    own = {side.panel for side in ring}
    keys = {(parts[panel].kind, parts[panel].side, parts[panel].level) for panel in own}
    return any((part.kind, part.side, part.level) in keys for panel, part in enumerate(parts) if panel not in own)


def around(
    parts: Sequence[Part], fronts: tuple[str, ...], backs: tuple[str, ...], role: str, low: bool
) -> tuple[Side, ...]:
    """The edges of this role all round the trunk, each against its direction, from a side or the centre back.

    Of fronts that are left open from the middle of one on to that of the other.
    """
    runs: dict[tuple[bool, bool, int], tuple[Side, ...]] = {}
    for panel, part in sorted(enumerate(parts), key=lambda each: -each[1].level):  # of tiers the lowest
        kind = part.kind.removeprefix("side_")
        if kind in fronts or kind in backs:
            run = leg_run(parts, panel, role)[::-1]
            if run:
                runs.setdefault((kind in fronts, kind != part.kind, part.side), run)
    # upper edges run from the wearer's left to the right in front, so against them it is right to left
    half = [(True, RIGHT), (False, RIGHT), (False, BOTH), (False, LEFT), (True, LEFT)]
    if low:
        half = half[::-1]
    turn = [(True, *each) for each in half] + [(False, *each) for each in half[::-1]]
    if ("front" in fronts and is_left_open(parts)) or ("skirt_front" in fronts and skirt_fronts_cross(parts)):
        turn = [*turn[3:], *turn[:3]]
    found = [runs[key] for key in turn if key in runs]
    faces = {key[0] for key in runs}
    return tuple(side for run in found for side in run) if len(faces) == 2 else ()

"""Yokes of trousers: a pair, or one whole, between the backs of the legs and the waistband, as jeans have it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.joints import Joint
from warp_cloth.pattern.kinds import LEFT, RIGHT
from warp_cloth.pattern.roles import Roles, skirt_roles
from warp_cloth.pattern.runs import DOUBTED, joint_of, parts_of_kind, run_of
from warp_cloth.pattern.specification import Side

EASE = (-0.03, 0.03)
APART = 4e-3  # [m] by which one way of laying a yoke is to fit better than the other
TURNED = {"hem": "waist", "waist": "hem", "side+": "side-", "side-": "side+"}


@dataclass(frozen=True)
class LegYoke:
    """The yoke above a leg's back."""

    panel: int
    roles: Roles  # hem, waist, and the sides that it has at +x and -x as it is worn, seen from behind
    sure: float


def has_loose_yokes(parts: Sequence[Part]) -> bool:
    """Whether yokes may belong between trousers or a skirt and the waist, but no leg's back fits them."""
    return bool(_lower_yokes(parts)) and not leg_yokes(parts)


def _lower_yokes(parts: Sequence[Part]) -> list[int]:
    """Yokes without a neck and shoulders."""
    return [yoke for yoke in parts_of_kind(parts, "yoke") if not parts[yoke].roles]


def leg_yokes(parts: Sequence[Part]) -> dict[int, LegYoke]:
    """The yoke of each leg's back. Which of a yoke's ends is at the side, the front's longer outseam tells."""
    yokes = _lower_yokes(parts)
    fronts, backs = ({parts[leg].side: leg for leg in parts_of_kind(parts, kind)} for kind in ("leg_front", "leg_back"))
    is_pair = len(yokes) == 2 and parts[yokes[0]].twin == yokes[1]
    is_whole = len(yokes) == 1 and parts[yokes[0]].mirror is not None
    if not (is_pair or is_whole) or not {*fronts} == {*backs} == {LEFT, RIGHT}:
        return {}
    ahead, behind = parts[fronts[RIGHT]], parts[backs[RIGHT]]
    waist, outseam = (behind.shape.length(behind.roles.get(role, ())) for role in ("waist", "outseam"))
    lacking = ahead.shape.length(ahead.roles.get("outseam", ())) - outseam
    found = []
    for right, left in (yokes, yokes[::-1]) if is_pair else (yokes * 2,):
        for is_turned in (False, True):
            own, other = (_roles(parts[each], is_turned) for each in (right, left))
            if is_whole:
                own, other = _half(own, RIGHT), _half(other, LEFT)
            length = {role: parts[right].shape.length(run) for role, run in own.items()}
            if not all(length.values()):
                return {}
            apart = abs(length["hem"] - waist) + abs(length["side+"] - lacking)
            found.append((apart, right, own, left, other))
    found.sort(key=lambda each: each[0])
    best, right, own, left, other = found[0]
    sure = 1.0 if found[1][0] - best > APART else DOUBTED
    return {backs[RIGHT]: LegYoke(right, own, sure), backs[LEFT]: LegYoke(left, other, sure)}


def _roles(part: Part, is_turned: bool) -> Roles:
    roles = skirt_roles(part.shape)
    return {TURNED[role]: run for role, run in roles.items()} if is_turned else roles


def _half(roles: Roles, side: int) -> Roles:
    """The roles of a whole yoke on one side of the wearer, parted at its middle, where it is sewn to nothing.

    Seen from behind, the wearer's right is at +x; along a hem the loop runs there, along a waist from there.
    """
    hem, waist = (roles[role] for role in ("hem", "waist"))
    low, high = hem[: len(hem) // 2], hem[len(hem) // 2 :]
    right, left = waist[: len(waist) // 2], waist[len(waist) // 2 :]
    if side == RIGHT:
        return {"hem": high, "waist": right, "side+": roles["side+"]}
    return {"hem": low, "waist": left, "side-": roles["side-"]}


def proposed_leg_yokes(parts: Sequence[Part]) -> Iterable[Joint]:
    """The seams between the backs of legs and the yokes above them."""
    for back, yoke in leg_yokes(parts).items():
        one, other = run_of(back, parts[back].roles.get("waist", ())), run_of(yoke.panel, yoke.roles["hem"], True)
        yield from joint_of(parts, one, other, "yoke", EASE, yoke.sure)


def leg_run(parts: Sequence[Part], panel: int, role: str) -> tuple[Side, ...]:
    """The edges of a role of a leg, or of any other part, as its loop runs: with those of the yoke above it."""
    own = run_of(panel, parts[panel].roles.get(role, ()))
    yoke = leg_yokes(parts).get(panel) if role in ("outseam", "crotch", "waist") else None
    if yoke is None or not own:
        return own
    if role == "waist":
        return run_of(yoke.panel, yoke.roles["waist"])
    # as seen from behind: the wearer's right leg has its outer side at +x, where the loop runs up
    is_high = (parts[panel].side == RIGHT) == (role == "outseam")
    above = run_of(yoke.panel, yoke.roles.get("side+" if is_high else "side-", ()))
    return (*own, *above) if is_high else (*above, *own)

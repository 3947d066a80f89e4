"""Seams proposed for pieces of a file that states none: by what pieces and edges are, their lengths and notches.

Each proposal has a confidence: how sure the kinds of both pieces are, times how well lengths agree, times how well
notches do. Edges of unknown pieces are compared by length and bow alone, which is never enough to sew them unasked,
unless their notches agree, too.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.joints import Joint, notch_fractions
from warp_cloth.pattern.kinds import BOTH, LEFT, RIGHT
from warp_cloth.pattern.specification import Side

SEWN_FROM = 0.75  # confidence from which a proposed seam is sewn without a word
SHOWN_FROM = 0.3  # and from which it is written into the table at all
PLAIN_EASE = (-0.02, 0.02)  # longer side over shorter, less 1: as drafted
NOTCH_NEAR = 6e-3  # [m] between notches that belong together
LEFTOVER = 0.6  # most that lengths alone make sure
FRONT_CENTRE = 0.5  # a front's two halves are as often closed by a zip, or left open

Run = tuple[int, ...]


def proposed_joints(parts: Sequence[Part]) -> tuple[Joint, ...]:
    """Joints in the order of their confidence, none naming an edge that a surer one names."""
    found = [
        *_darts(parts),
        *_bodices(parts),
        *_sleeves(parts),
        *_legs(parts),
        *_hoods(parts),
        *_skirts(parts),
        *_bands(parts),
    ]
    kept = _without_conflicts(found)
    used = {side for joint in kept for side in (*joint.one, *joint.other)}
    return tuple(_without_conflicts([*kept, *_leftovers(parts, used)]))


def _without_conflicts(joints: Iterable[Joint]) -> list[Joint]:
    used: set[Side] = set()
    kept = []
    for joint in sorted(joints, key=lambda each: -each.confidence):
        sides = (*joint.one, *joint.other)
        if joint.confidence >= SHOWN_FROM and len(set(sides)) == len(sides) and not used.intersection(sides):
            used.update(sides)
            kept.append(joint)
    return kept


def _run(panel: int, run: Run, against: bool = False) -> tuple[Side, ...]:
    return tuple(Side(panel, edge) for edge in (run[::-1] if against else run))


def _length(parts: Sequence[Part], run: Sequence[Side]) -> float:
    return sum(parts[side.panel].edges[side.edge].length for side in run)


def _joint(
    parts: Sequence[Part],
    one: tuple[Side, ...],
    other: tuple[Side, ...],
    reason: str,
    ease: tuple[float, float] = PLAIN_EASE,
    sure: float = 1.0,
) -> list[Joint]:
    """A joint with its confidence; ``ease``: by how much the first side may be longer than the other, relatively."""
    if not one or not other:
        return []
    more = _length(parts, one) / max(_length(parts, other), 1e-9) - 1.0
    beyond = max(ease[0] - more, more - ease[1], 0.0)
    kinds = min(parts[side.panel].sure for side in (*one, *other))
    confidence = sure * kinds * float(np.clip(1.0 - 3.0 * beyond, 0.0, 1.0)) * _notches_agree(parts, one, other)
    note = f"{reason}, {_length(parts, one) * 1e3:.0f} to {_length(parts, other) * 1e3:.0f} mm"
    return [Joint(one, other, round(confidence, 3), note)]


def _notches_agree(parts: Sequence[Part], one: Sequence[Side], other: Sequence[Side]) -> float:
    """1.02 where notches of both sides meet, 0.97 where both have notches that do not; 1 where a side has none."""
    spots = []
    for run, against in ((one, False), (other, True)):
        reached, found = 0.0, []
        for side in run:
            length = parts[side.panel].edges[side.edge].length
            shares = notch_fractions(parts[side.panel], side.edge)
            found += (reached + length * (1.0 - shares[::-1] if against else shares)).tolist()
            reached += length
        spots.append(np.array(found) / reached * max(_length(parts, one), _length(parts, other)))
    if not len(spots[0]) or not len(spots[1]):
        return 1.0
    few, many = sorted(spots, key=len)
    met = sum(bool(np.abs(many - spot).min() <= NOTCH_NEAR + 0.02 * many.max()) for spot in few)
    return 1.02 if met == len(few) else 0.97


def _of(parts: Sequence[Part], *kinds: str) -> list[int]:
    return [index for index, part in enumerate(parts) if part.kind in kinds]


def _mark(part: Part, side: int) -> str:
    """The side of a whole piece's own frame that is on this side of the wearer: a back is seen from behind."""
    high = side == LEFT if part.kind in ("front", "skirt_front") else side == RIGHT
    return "+" if high else "-"


def _role(parts: Sequence[Part], panel: int, role: str, side: int) -> Run:
    part = parts[panel]
    return part.roles.get(role + _mark(part, side), ()) if part.side in (BOTH, side) else ()


def _darts(parts: Sequence[Part]) -> Iterable[Joint]:
    for panel, part in enumerate(parts):
        for one, other in part.shape.darts:
            yield from _joint(parts, (Side(panel, one),), (Side(panel, other),), "dart")


def _bodices(parts: Sequence[Part]) -> Iterable[Joint]:
    fronts, backs = _of(parts, "front"), _of(parts, "back")
    for front in fronts:
        for back in backs:
            for side in (LEFT, RIGHT):
                for role in ("shoulder", "side"):
                    one, other = _role(parts, front, role, side), _role(parts, back, role, side)
                    ease = (-0.06, 0.02) if role == "shoulder" else PLAIN_EASE
                    yield from _joint(parts, _run(front, one), _run(back, other, True), role, ease)
    yield from _centres(parts, fronts, FRONT_CENTRE, "centre front")
    yield from _centres(parts, backs, 1.0, "centre back")


def _centres(
    parts: Sequence[Part], panels: Sequence[int], sure: float, reason: str, role: str = "centre"
) -> list[Joint]:
    """The middles of left and right halves."""
    out = []
    for one in panels:
        other = parts[one].twin
        if other is not None and one < other and parts[one].side != BOTH:
            runs = parts[one].roles.get(role, ()), parts[other].roles.get(role, ())
            out += _joint(parts, _run(one, runs[0]), _run(other, runs[1], True), reason, sure=sure)
    return out


def _sleeves(parts: Sequence[Part]) -> Iterable[Joint]:
    fronts, backs, sleeves = _of(parts, "front"), _of(parts, "back"), _of(parts, "sleeve")
    holes: dict[int, list[tuple[tuple[Side, ...], tuple[Side, ...]]]] = {LEFT: [], RIGHT: []}
    for side, found in holes.items():
        for front in fronts:
            for back in backs:
                one, other = _role(parts, front, "armhole", side), _role(parts, back, "armhole", side)
                if one and other:
                    found.append((_run(front, one, True), _run(back, other, True)))
    for sleeve in sleeves:
        part = parts[sleeve]
        under = part.roles.get("under+", ()), part.roles.get("under-", ())
        yield from _joint(parts, _run(sleeve, under[0]), _run(sleeve, under[1], True), "underarm")
        side = sleeve_side(parts, sleeve)
        for front_run, back_run in holes[side]:
            # the cap runs from +x to -x; its front is at -x on the wearer's left, as seen from outside
            others = (*back_run, *front_run) if side == LEFT else (*front_run, *back_run)
            if is_raglan(parts):
                runs = back_run, front_run
                for mark, run in zip("+-" if side == LEFT else "-+", runs, strict=True):
                    own = _run(sleeve, part.roles.get(f"raglan{mark}", ()))
                    yield from _joint(parts, own, run, "raglan", (-0.03, 0.05))
                continue
            cap = _run(sleeve, part.roles.get("cap", ()))
            yield from _joint(parts, cap, others, "sleeve cap", (-0.01, 0.12))


def is_raglan(parts: Sequence[Part]) -> bool:
    """Whether fronts and backs have armholes that run up to the neck, and sleeves that fill the rest of it."""
    bodices = [parts[index] for index in _of(parts, "front", "back")]
    shoulders = any(role.startswith("shoulder") for part in bodices for role in part.roles)
    return bool(bodices) and not shoulders and any("raglan+" in part.roles for part in parts)


def sleeve_side(parts: Sequence[Part], sleeve: int) -> int:
    """The side on which a sleeve is worn: as named, else so that the front of its cap meets the front's armhole."""
    part = parts[sleeve]
    if part.side != BOTH:
        return part.side
    if part.twin is not None and part.twin < sleeve:
        return -sleeve_side(parts, part.twin)
    cap = part.roles.get("cap", ())
    if not cap:
        return LEFT
    shape = part.shape
    if is_raglan(parts) and "raglan+" in part.roles:  # its back is longer; at +x on the wearer's left
        return LEFT if shape.length(part.roles["raglan+"]) > shape.length(part.roles["raglan-"]) else RIGHT
    points = np.concatenate([shape.turned[k].at(np.linspace(0.0, 1.0, 65)) for k in cap])
    top = int(points[:, 1].argmax())
    # the front half is cut out more deeply: it encloses less beside the line from underarm to top
    halves = [points[: top + 1], points[top:]]
    hollow = []
    for half in halves:
        chord = half[-1] - half[0]
        aside = (half - half[0]) @ np.array([chord[1], -chord[0]]) / max(float(np.hypot(*chord)), 1e-9)
        hollow.append(float(aside.min()))
    return RIGHT if hollow[0] < hollow[1] - 5e-4 else LEFT  # at +x on the wearer's right


def _legs(parts: Sequence[Part]) -> Iterable[Joint]:
    fronts, backs = _of(parts, "leg_front"), _of(parts, "leg_back")
    for front in fronts:
        for back in backs:
            if BOTH not in (parts[front].side, parts[back].side) and parts[front].side == parts[back].side:
                for role in ("outseam", "inseam"):
                    one, other = parts[front].roles.get(role, ()), parts[back].roles.get(role, ())
                    yield from _joint(parts, _run(front, one), _run(back, other, True), role, (-0.03, 0.03))
    yield from _centres(parts, fronts, 1.0, "front crotch", "crotch")
    yield from _centres(parts, backs, 1.0, "back crotch", "crotch")
    for leg in _of(parts, "leg"):
        part, twin = parts[leg], parts[leg].twin
        yield from _joint(
            parts, _run(leg, part.roles.get("inseam+", ())), _run(leg, part.roles.get("inseam-", ()), True), "inseam",
            (-0.05, 0.05),
        )  # fmt: skip
        if twin is None or twin < leg:
            continue
        for mark, against in ("+-", "-+"):
            face = "back" if (mark == "+") == (part.side == LEFT) else "front"
            one, other = part.roles.get(f"crotch{mark}", ()), parts[twin].roles.get(f"crotch{against}", ())
            yield from _joint(parts, _run(leg, one), _run(twin, other, True), f"{face} crotch")


def _hoods(parts: Sequence[Part]) -> Iterable[Joint]:
    hoods = [index for index in _of(parts, "hood") if parts[index].side != BOTH]
    yield from _centres(parts, hoods, 1.0, "hood centre")
    for hood in hoods:
        side = parts[hood].side
        neck = parts[hood].roles.get("neck", ())
        yield from _joint(parts, _run(hood, neck), _half_neck(parts, side), "hood to neck", (-0.04, 0.06))


def _half_neck(parts: Sequence[Part], side: int) -> tuple[Side, ...]:
    """Half of the neckline, in the order in which a hood or collar on that side meets it against its direction."""
    halves = {}
    for kind in ("front", "back"):
        for panel in _of(parts, kind):
            part = parts[panel]
            if part.side not in (BOTH, side):
                continue
            neck = part.roles.get("neck", ())
            if part.side == BOTH:  # the loop runs from +x to -x along a neck; half of it where it was parted
                if part.mirror is None or len(neck) % 2:
                    continue
                half = len(neck) // 2
                neck = neck[:half] if _mark(part, side) == "+" else neck[half:]
            if neck:
                halves[kind] = _run(panel, neck, True)
    if len(halves) < 2:
        return ()
    halves["sleeve"] = ()
    if is_raglan(parts):
        halves["sleeve"] = next(
            (
                _run(sleeve, parts[sleeve].roles.get("neck", ()), True)
                for sleeve in _of(parts, "sleeve")
                if sleeve_side(parts, sleeve) == side
            ),
            (),
        )
    # a hood's neck runs counter-clockwise, seen from outside: on the wearer's left from the face back at -x to +x
    order = ("front", "back") if side == LEFT else ("back", "front")
    return (*halves[order[0]], *halves["sleeve"], *halves[order[1]])


def _skirts(parts: Sequence[Part]) -> Iterable[Joint]:
    fronts, backs = _of(parts, "skirt_front"), _of(parts, "skirt_back")
    for front in fronts:
        for back in backs:
            for side in (LEFT, RIGHT):
                one, other = _role(parts, front, "side", side), _role(parts, back, "side", side)
                if parts[front].side == BOTH and parts[back].side == BOTH:
                    yield from _joint(parts, _run(front, one), _run(back, other, True), "side")
    for kind in ("front", "back"):
        for top in _of(parts, kind):
            for skirt in _of(parts, f"skirt_{kind}"):
                if parts[top].side == parts[skirt].side == BOTH:
                    waist = _run(skirt, parts[skirt].roles.get("waist", ()))
                    hem = _run(top, parts[top].roles.get("hem", ()), True)
                    yield from _joint(parts, waist, hem, "waist", (-0.02, 1.0), 0.9)


def _bands(parts: Sequence[Part]) -> Iterable[Joint]:
    """Collars, waistbands, cuffs and bands at the hem: round a ring of edges, their ends together."""
    for band in _of(parts, "collar", "waistband", "cuff", "hem_band"):
        part = parts[band]
        if "long" not in part.roles:
            continue
        ring = _ring(parts, band)
        if not ring:
            continue
        best = [
            joint
            for role in ("long", "long2")
            for joint in _joint(parts, _run(band, part.roles[role]), ring, part.kind.replace("_", " "), (-0.4, 0.04))
        ]
        joint = max(best, key=lambda each: each.confidence)
        yield joint
        ends = _joint(parts, _run(band, part.roles["end"]), _run(band, part.roles["end2"], True), f"{part.kind} ends")
        yield from (each for each in ends if joint.confidence >= SEWN_FROM)


def _ring(parts: Sequence[Part], band: int) -> tuple[Side, ...]:
    """The closed run of edges that a band goes round, from the middle of the back, or an underarm or inner seam."""
    kind = parts[band].kind
    if kind == "collar":
        left, right = _half_neck(parts, LEFT), _half_neck(parts, RIGHT)
        return (*right, *left) if left and right else ()
    if kind == "cuff":
        side = parts[band].side or (RIGHT if parts[band].twin is not None and (parts[band].twin or 0) < band else LEFT)
        for sleeve in _of(parts, "sleeve"):
            if sleeve_side(parts, sleeve) == side:
                return _run(sleeve, parts[sleeve].roles.get("hem", ()), True)
        for leg in _of(parts, "leg"):
            if parts[leg].side == side:
                return _run(leg, parts[leg].roles.get("hem", ()), True)
        legs = {parts[leg].kind: leg for leg in _of(parts, "leg_front", "leg_back") if parts[leg].side == side}
        runs = [_run(leg, parts[leg].roles.get("hem", ()), True) for leg in legs.values()]
        return tuple(each for run in runs for each in run) if len(runs) == 2 else ()
    if kind == "hem_band":
        return _around(parts, ("front",), ("back",), "hem", True)
    whole = {parts[leg].side: _run(leg, parts[leg].roles.get("waist", ()), True) for leg in _of(parts, "leg")}
    if all(whole.get(side) for side in (LEFT, RIGHT)):
        return (*whole[RIGHT], *whole[LEFT])  # from the middle of the back
    legs_or_skirt = _around(parts, ("leg_front", "skirt_front"), ("leg_back", "skirt_back"), "waist", False)
    return legs_or_skirt or _around(parts, ("front",), ("back",), "hem", True)


def _around(
    parts: Sequence[Part], fronts: tuple[str, ...], backs: tuple[str, ...], role: str, low: bool
) -> tuple[Side, ...]:
    """The edges of this role all round the trunk, each against its direction, from a side or the centre back."""
    runs: dict[tuple[bool, int], tuple[Side, ...]] = {}
    for panel, part in enumerate(parts):
        if part.kind in fronts or part.kind in backs:
            run = _run(panel, part.roles.get(role, ()), True)
            if run and (part.kind in fronts, part.side) not in runs:
                runs[part.kind in fronts, part.side] = run
    # upper edges run from the wearer's left to the right in front, so against them it is right to left
    turn = [(True, RIGHT), (True, BOTH), (True, LEFT), (False, LEFT), (False, BOTH), (False, RIGHT)]
    if low:
        turn = [(True, LEFT), (True, BOTH), (True, RIGHT), (False, RIGHT), (False, BOTH), (False, LEFT)]
    found = [runs[key] for key in turn if key in runs]
    faces = {key[0] for key in runs}
    return tuple(side for run in found for side in run) if len(faces) == 2 else ()


def _leftovers(parts: Sequence[Part], used: set[Side]) -> Iterable[Joint]:
    """Pairs of edges of pieces that are not told by name: of equal length, bow and notches, and of no other's."""
    free = [
        Side(panel, edge)
        for panel, part in enumerate(parts)
        for edge in range(len(part.edges))
        if Side(panel, edge) not in used and (not part.roles or (part.sure < 1.0 and not part.kind))
    ]
    everything = [
        Side(panel, edge) for panel, part in enumerate(parts) for edge in range(len(part.edges))
        if Side(panel, edge) not in used
    ]  # fmt: skip
    if len(free) * len(everything) > 200_000:
        return
    length = {side: parts[side.panel].edges[side.edge].length for side in everything}
    bow = {side: parts[side.panel].shape.bow(side.edge) / max(length[side], 1e-9) for side in everything}
    for one in free:
        alike = [
            other
            for other in everything
            if other.panel != one.panel
            and abs(length[one] - length[other]) <= 0.005 * length[one] + 5e-4
            and (abs(bow[one] + bow[other]) < 0.04 or abs(bow[one] - bow[other]) < 0.04)
        ]
        alike = [other for other in alike if length[other] > 0.03]
        for other in alike:
            sure = LEFTOVER / len(alike)
            shares = notch_fractions(parts[one.panel], one.edge)
            there = 1.0 - notch_fractions(parts[other.panel], other.edge)[::-1]
            notched = len(shares) >= 2 and len(shares) == len(there)
            if notched and float(np.abs(shares - there).max()) * length[one] < 2e-3 and len(alike) == 1:
                sure = 0.8
            yield Joint((one,), (other,), round(sure, 3), f"of one length, {length[one] * 1e3:.0f} mm")

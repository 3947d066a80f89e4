"""Seams proposed for sleeves: of one piece or two, upper and under or front and back, set in or raglan."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product

import numpy as np

from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.joints import Joint
from warp_cloth.pattern.kinds import BOTH, HALF_SLEEVES, LEFT, RIGHT
from warp_cloth.pattern.lower_sleeves import AS_WIDE, LOWER_SLEEVE
from warp_cloth.pattern.runs import face_run, faces_of, joint_of, length_of, parts_of_kind, run_of
from warp_cloth.pattern.specification import Side

CAP_EASE, RAGLAN_EASE = (-0.01, 0.12), (-0.03, 0.05)
# Of puff sleeves, gathered at the cap, and how sure that is; from where it is surer than a set-in sleeve too long
GATHERED_CAP_EASE, GATHERED_SURE, GATHERED_FROM = (0.2, 1.0), 0.9, 0.17
LOWER_EASE = (-AS_WIDE, AS_WIDE)
SURELY_APART = 0.02  # relative: by which one under sleeve fits better than the next
DOUBTFUL = 0.7  # factor on the confidence where it does not
HOLLOW = 5e-3  # [m] by which the front seam of an upper sleeve bows farther in than the back one


def proposed_sleeves(parts: Sequence[Part]) -> Iterable[Joint]:
    """Underarm seams, caps and raglans; of sleeves of two pieces the seams between these."""
    holes: dict[int, list[tuple[tuple[Side, ...], tuple[Side, ...]]]] = {LEFT: [], RIGHT: []}
    for side, found in holes.items():
        for front in faces_of(parts, "front"):
            for back in faces_of(parts, "back"):
                one, other = face_run(parts, front, "armhole", side, True), face_run(parts, back, "armhole", side, True)
                if one and other:
                    found.append((one, other))
    for sleeve in parts_of_kind(parts, "sleeve"):
        part = parts[sleeve]
        side = sleeve_side(parts, sleeve)
        under = under_sleeve_of(parts, sleeve)
        cap = run_of(sleeve, part.roles.get("cap", ()))
        if under is not None:
            yield from _between(parts, sleeve, *under)
            cap = _whole_cap(parts, sleeve, under[0])
        else:
            seams = part.roles.get("under+", ()), part.roles.get("under-", ())
            yield from joint_of(parts, run_of(sleeve, seams[0]), run_of(sleeve, seams[1], True), "underarm")
        yield from _lower(parts, sleeve, side)
        for front_run, back_run in holes[side]:
            # the cap runs from +x to -x; its front is at -x on the wearer's left, as seen from outside
            others = (*back_run, *front_run) if side == LEFT else (*front_run, *back_run)
            if is_raglan(parts):
                runs = back_run, front_run
                for mark, run in zip("+-" if side == LEFT else "-+", runs, strict=True):
                    own = run_of(sleeve, part.roles.get(f"raglan{mark}", ()))
                    yield from joint_of(parts, own, run, "raglan", RAGLAN_EASE)
                continue
            yield from _set_in(parts, cap, others, side)
    for side in (LEFT, RIGHT):
        yield from _halves(parts, side, holes[side])


def _lower(parts: Sequence[Part], sleeve: int, side: int) -> Iterable[Joint]:
    """The seams of a sleeve's lower piece: beneath the arm, and to the hem of the upper one."""
    lower = end_of_sleeve(parts, sleeve, side)
    if lower == sleeve:
        return
    own, hem = parts[lower].roles, parts[sleeve].roles.get("hem", ())
    seams = own.get("under+", ()), own.get("under-", ())
    yield from joint_of(parts, run_of(lower, seams[0]), run_of(lower, seams[1], True), "underarm")
    yield from joint_of(parts, run_of(lower, own.get("cap", ())), run_of(sleeve, hem, True), "lower sleeve", LOWER_EASE)


def end_of_sleeve(parts: Sequence[Part], sleeve: int, side: int) -> int:
    """The lower piece of a sleeve that is cut across; or the sleeve."""
    lowers = [each for each in parts_of_kind(parts, LOWER_SLEEVE) if sleeve_side(parts, each) == side]
    return lowers[0] if len(lowers) == 1 else sleeve


def _set_in(parts: Sequence[Part], cap: tuple[Side, ...], hole: tuple[Side, ...], side: int) -> Iterable[Joint]:
    """A cap eased into its armhole; or gathered, if that is a whole one: with a yoke missing it would be too short."""
    more = length_of(parts, cap) / max(length_of(parts, hole), 1e-9) - 1.0
    is_whole = all(
        face_run(parts, each, "shoulder", side) for face in ("front", "back") for each in faces_of(parts, face)
    )
    if more > GATHERED_FROM and is_whole:
        yield from joint_of(parts, cap, hole, "sleeve cap", GATHERED_CAP_EASE, GATHERED_SURE)
    else:
        yield from joint_of(parts, cap, hole, "sleeve cap", CAP_EASE)


def _halves(
    parts: Sequence[Part], side: int, holes: Sequence[tuple[tuple[Side, ...], tuple[Side, ...]]]
) -> Iterable[Joint]:
    """The seams of a sleeve of a front and a back half: along the arm, and each to its own side of the armhole."""
    for front, back in product(*(half_sleeves(parts, kind, side) for kind in HALF_SLEEVES)):
        for role, reason in (("over", "overarm"), ("under", "underarm")):
            one, other = (run_of(half, parts[half].roles.get(role, ())) for half in (front, back))
            yield from joint_of(parts, one, other[::-1], reason, (-0.03, 0.03))
        reason, ease = ("raglan", RAGLAN_EASE) if is_raglan(parts) else ("sleeve cap", CAP_EASE)
        for front_run, back_run in holes:
            for half, run in ((front, front_run), (back, back_run)):
                yield from joint_of(parts, run_of(half, parts[half].roles.get("cap", ())), run, reason, ease)


def half_sleeves(parts: Sequence[Part], kind: str, side: int) -> list[int]:
    """The front, or back, halves of the sleeve on this side."""
    return [half for half in parts_of_kind(parts, kind) if parts[half].side == side]


def under_sleeve_of(parts: Sequence[Part], sleeve: int) -> tuple[int, float] | None:
    """The under sleeve that belongs to an upper one, and how sure that is; None of sleeves of one piece.

    Their seams are as long, and bow alike: outwards at the elbow, inwards in front. Of a pair one fits, its mirror
    image does not.
    """
    found = []
    for under in parts_of_kind(parts, "under_sleeve"):
        if BOTH in (parts[sleeve].side, parts[under].side) or parts[under].side == parts[sleeve].side:
            apart = 0.0
            for mark, against in ("+-", "-+"):
                one, other = parts[sleeve].roles.get(f"under{mark}", ()), parts[under].roles.get(f"under{against}", ())
                if not one or not other:
                    return None
                a, b = parts[sleeve].shape, parts[under].shape
                long = max(a.length(one), b.length(other))
                bows = sum(a.bow(k) for k in one) - sum(b.bow(k) for k in other)
                apart += (abs(a.length(one) - b.length(other)) + abs(bows)) / long
            found.append((apart, under))
    if not found:
        return None
    found.sort()
    doubtful = len(found) > 1 and found[1][0] - found[0][0] < SURELY_APART
    return found[0][1], DOUBTFUL if doubtful else 1.0


def _between(parts: Sequence[Part], sleeve: int, under: int, sure: float) -> Iterable[Joint]:
    """The two seams between an upper and an under sleeve."""
    front = "-" if sleeve_side(parts, sleeve) == LEFT else "+"
    for mark, against in ("+-", "-+"):
        one = run_of(sleeve, parts[sleeve].roles.get(f"under{mark}", ()))
        other = run_of(under, parts[under].roles.get(f"under{against}", ()), True)
        reason = "front sleeve seam" if mark == front else "back sleeve seam"
        yield from joint_of(parts, one, other, reason, (-0.03, 0.04), sure)


def _whole_cap(parts: Sequence[Part], sleeve: int, under: int) -> tuple[Side, ...]:
    """The top of an upper and an under sleeve, as a cap of one piece runs: from the underarm over the upper one."""
    top = parts[under].roles.get("cap", ())
    low = [float(parts[under].shape.turned[k].start[1]) for k in top[1:]]
    if not low:
        return ()
    first = 1 + low.index(min(low))  # the corner at the underarm, see panel_roles.parted_at_underarm
    cap = run_of(sleeve, parts[sleeve].roles.get("cap", ()))
    return (*run_of(under, top[first:]), *cap, *run_of(under, top[:first])) if cap else ()


def is_raglan(parts: Sequence[Part]) -> bool:
    """Whether fronts and backs have armholes that run up to the neck, and sleeves that fill the rest of it."""
    bodices = [parts[index] for index in parts_of_kind(parts, "front", "back")]
    shoulders = any(role.startswith("shoulder") for part in bodices for role in part.roles)
    has_neck = any("raglan+" in part.roles or (part.kind in HALF_SLEEVES and "neck" in part.roles) for part in parts)
    return bool(bodices) and not shoulders and has_neck


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
    if parts_of_kind(parts, "under_sleeve"):  # of two pieces: its seam in front is hollow, at -x on the wearer's left
        bows = [sum(shape.bow(k) for k in part.roles.get(f"under{mark}", ())) for mark in "+-"]
        if abs(bows[0] - bows[1]) > HOLLOW:
            return LEFT if bows[1] < bows[0] else RIGHT
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

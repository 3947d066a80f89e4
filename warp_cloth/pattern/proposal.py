"""Seams proposed for pieces of a file that states none: by what pieces and edges are, their lengths and notches.

Each proposal has a confidence: how sure the kinds of both pieces are, times how well lengths agree, times how well
notches do. Edges of unknown pieces are compared by length and bow alone, which is never enough to sew them unasked,
unless their notches agree, too.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from warp_cloth.pattern.band_rings import (
    are_unshaped_skirts,
    around,
    has_rival,
    is_round_armhole,
    opens_between_fronts,
    ring_of,
    skirt_fronts_cross,
)
from warp_cloth.pattern.bands_in_two import proposed_halves
from warp_cloth.pattern.bibs_on_bands import proposed_bibs
from warp_cloth.pattern.collars import proposed_collars
from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.godets import with_godets
from warp_cloth.pattern.gussets import proposed_crotch_gussets, proposed_gussets, slits_of, without_gaps
from warp_cloth.pattern.joints import Joint, notch_fractions
from warp_cloth.pattern.kinds import BOTH, LEFT, RIGHT, named
from warp_cloth.pattern.leg_yokes import has_loose_yokes, leg_run, proposed_leg_yokes
from warp_cloth.pattern.neckline import half_neck, neck_from_front
from warp_cloth.pattern.runs import (
    DOUBTED,
    PLAIN_EASE,
    face_run,
    faces_of,
    joint_of,
    length_of,
    parts_of_kind,
    role_of,
    run_of,
)
from warp_cloth.pattern.sleeves import proposed_sleeves
from warp_cloth.pattern.slits import is_slit
from warp_cloth.pattern.specification import Side
from warp_cloth.pattern.straps import lack_straps, proposed_straps
from warp_cloth.pattern.tiers import proposed_tiers
from warp_cloth.pattern.yokes import proposed_yokes

SEWN_FROM = 0.75  # confidence from which a proposed seam is sewn without a word
SHOWN_FROM = 0.3  # and from which it is written into the table at all
LEFTOVER = 0.6  # most that lengths alone make sure
FRONT_CENTRE = 0.5  # a front's two halves are as often closed by a zip, or left open
LEG_EASE = (-0.03, 0.03)
SKIRT_FRONT_CENTRE = LEGGED_CENTRE = 0.9
PRINCESS_EASE = (-0.04, 0.02)  # a side panel is eased over the bust
BAND_EASE = (-0.4, 0.04)  # a band gathers what it goes round, or stretches
ARMHOLE_EASE = (-0.25, 0.04)  # of a band round an armhole, which a cuff that has lost its sleeve is too short for
GATHERED_WAIST_EASE = (-0.02, 1.0)  # of a skirt to a bodice
# Of skirts as wide at the waist as at the hem, gathered to a third; how sure gathers are
FULL_BAND_EASE, FULL_WAIST_EASE, FULL_SURE = (-0.68, 0.04), (-0.02, 2.1), 0.9
RUFFLE_EASE = (-0.02, 2.1)  # of a strip gathered to what it is sewn to
WAIST_EASE = (-0.05, 0.03)  # of trousers to a bodice, which blouses over them
RIVAL = 0.05  # of confidence, by which the surest seam of an edge is to be surer than the next


def proposed_joints(parts: Sequence[Part]) -> tuple[Joint, ...]:
    """Joints in the order of their confidence, none naming an edge that a surer one names."""
    found = [
        *_darts(parts),
        *_bodices(parts),
        *proposed_gussets(parts),
        *proposed_yokes(parts),
        *proposed_straps(parts),
        *proposed_bibs(parts),
        *proposed_sleeves(parts),
        *_legs(parts),
        *_hoods(parts),
        *_skirts(parts),
        *proposed_tiers(parts),
        *_jumpsuits(parts),
        *_gores(parts),
        *proposed_collars(parts),
        *_bands(parts),
    ]
    found = with_godets(parts, found)
    kept = _doubted(_without_conflicts(found), found)
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


def _doubted(kept: Sequence[Joint], found: Sequence[Joint]) -> list[Joint]:
    """Joints, with less confidence in those that have a rival: another for one of their edges, about as sure."""
    at: dict[Side, list[Joint]] = {}
    for joint in found:
        for side in (*joint.one, *joint.other):
            at.setdefault(side, []).append(joint)
    out = []
    for joint in kept:
        others = {id(each): each for side in (*joint.one, *joint.other) for each in at[side] if each is not joint}
        rival = any(each.confidence >= joint.confidence - RIVAL for each in others.values())
        if rival:
            reason = f"{joint.reason}, another seam fits as well"
            joint = replace(joint, confidence=round(DOUBTED * joint.confidence, 3), reason=reason)
        out.append(joint)
    return out


def _darts(parts: Sequence[Part]) -> Iterable[Joint]:
    has_gusset = bool(parts_of_kind(parts, "gusset"))
    for panel, part in enumerate(parts):
        slits = [slit for side in (LEFT, RIGHT) for slit in slits_of(parts, panel, side)] if has_gusset else []
        for one, other in part.shape.darts:
            is_open = is_slit(part, (one, other))
            sure = DOUBTED if (one, other) in slits or is_open else 1.0
            reason = "dart, or a slit that stays open" if is_open else "dart"
            yield from joint_of(parts, (Side(panel, one),), (Side(panel, other),), reason, sure=sure)


def _bodices(parts: Sequence[Part]) -> Iterable[Joint]:
    fronts, backs = faces_of(parts, "front"), faces_of(parts, "back")
    has_gusset = bool(parts_of_kind(parts, "gusset"))
    for front in fronts:
        for back in backs:
            for side in (LEFT, RIGHT):
                for role in ("shoulder", "side"):
                    one, other = face_run(parts, front, role, side), face_run(parts, back, role, side, True)
                    ease = (-0.06, 0.02) if role == "shoulder" else PLAIN_EASE
                    faces = [parts[face[0]] for face in (front, back)]
                    is_short = role == "shoulder" and lack_straps(parts, faces, side)
                    apart = without_gaps(one), without_gaps(other)  # a gusset goes into slits between them
                    if has_gusset and role == "side" and len(apart[0]) == len(apart[1]):
                        for pair in zip(*apart, strict=True):
                            yield from joint_of(parts, *pair, role, ease)
                    else:
                        yield from joint_of(parts, one, other, role, ease, DOUBTED if is_short else 1.0)
            if parts[front[0]].side == parts[back[0]].side:  # of bodysuits
                crotches = (parts[face[0]].roles.get("crotch", ()) for face in (front, back))
                one, other = (run_of(face[0], run) for face, run in zip((front, back), crotches, strict=True))
                yield from joint_of(parts, one, other[::-1], "crotch", LEG_EASE)
    yield from _between_panels(parts, (*fronts, *backs))
    legged = [face[0] for face in fronts if "inseam" in parts[face[0]].roles]  # in one with a leg: closed to its fork
    yield from _centres(parts, legged, LEGGED_CENTRE, "centre front")
    yield from _centres(parts, [face[0] for face in fronts if face[0] not in legged], FRONT_CENTRE, "centre front")
    yield from _centres(parts, [face[0] for face in backs], 1.0, "centre back")
    for ahead in legged:
        for behind in (face[0] for face in backs if parts[face[0]].side == parts[ahead].side):
            runs = parts[ahead].roles["inseam"], parts[behind].roles.get("inseam", ())
            yield from joint_of(parts, run_of(ahead, runs[0]), run_of(behind, runs[1], True), "inseam", LEG_EASE)


def _between_panels(parts: Sequence[Part], faces: Iterable[tuple[int, ...]]) -> Iterable[Joint]:
    """The seams between middle and side panels."""
    for middle, *side_panels in faces:
        for panel in side_panels:
            one = run_of(middle, role_of(parts, middle, "princess", parts[panel].side))
            other = run_of(panel, parts[panel].roles.get("princess", ()), True)
            yield from joint_of(parts, one, other, "princess", PRINCESS_EASE)


def _centres(
    parts: Sequence[Part], panels: Sequence[int], sure: float, reason: str, role: str = "centre"
) -> list[Joint]:
    """The middles of left and right halves."""
    out = []
    for one in panels:
        other = parts[one].twin
        if other is not None and one < other and parts[one].side != BOTH:
            out += joint_of(parts, leg_run(parts, one, role), leg_run(parts, other, role)[::-1], reason, sure=sure)
    return out


def _legs(parts: Sequence[Part]) -> Iterable[Joint]:
    fronts, backs = parts_of_kind(parts, "leg_front"), parts_of_kind(parts, "leg_back")
    outseam = DOUBTED if has_loose_yokes(parts) else 1.0
    is_between = bool(parts_of_kind(parts, "gusset")) and not parts_of_kind(parts, "front", "back")
    fork = DOUBTED if is_between else 1.0  # a gusset belongs into some of these seams, unless it is at an underarm
    yield from proposed_leg_yokes(parts)
    for front in fronts:
        for back in backs:
            if BOTH not in (parts[front].side, parts[back].side) and parts[front].side == parts[back].side:
                for role in ("outseam", "inseam"):
                    runs = leg_run(parts, front, role), leg_run(parts, back, role)[::-1]
                    yield from joint_of(parts, *runs, role, LEG_EASE, outseam if role == "outseam" else fork)
    yield from _centres(parts, fronts, fork, "front crotch", "crotch")
    yield from _centres(parts, backs, fork, "back crotch", "crotch")
    for leg in parts_of_kind(parts, "leg"):
        part, twin = parts[leg], parts[leg].twin
        seams = part.roles.get("inseam+", ()), part.roles.get("inseam-", ())
        yield from joint_of(parts, run_of(leg, seams[0]), run_of(leg, seams[1], True), "inseam", (-0.05, 0.05), fork)
        if twin is None or twin < leg:
            continue
        for mark, against in ("+-", "-+"):
            face = "back" if (mark == "+") == (part.side == LEFT) else "front"
            one, other = part.roles.get(f"crotch{mark}", ()), parts[twin].roles.get(f"crotch{against}", ())
            crotch = run_of(leg, one), run_of(twin, other, True)
            yield from joint_of(parts, *crotch, f"{face} crotch", sure=fork)


def _hoods(parts: Sequence[Part]) -> Iterable[Joint]:
    hoods = [index for index in parts_of_kind(parts, "hood") if parts[index].side != BOTH]
    strips = [index for index in parts_of_kind(parts, "hood") if "long" in parts[index].roles]
    yield from _centres(parts, hoods, DOUBTED if strips else 1.0, "hood centre")
    if strips:
        yield from _hood_of_three(parts, {parts[hood].side: hood for hood in hoods}, strips)
    for hood in hoods if not strips else ():
        side = parts[hood].side
        neck = parts[hood].roles.get("neck", ())
        yield from joint_of(parts, run_of(hood, neck), half_neck(parts, side), "hood to neck", (-0.04, 0.06))


def _hood_of_three(parts: Sequence[Part], halves: Mapping[int, int], strips: Sequence[int]) -> Iterable[Joint]:
    """A strip between the halves of a hood, from the face to the neck, where its end goes on between theirs."""
    if len(strips) != 1 or {*halves} != {LEFT, RIGHT}:
        return
    (strip,), left, right = strips, halves[LEFT], halves[RIGHT]
    own = parts[strip].roles
    ways = []
    for on_right, on_left, end in (("long", "long2", "end2"), ("long2", "long", "end")):
        found: list[Joint] = []
        for half, role in ((right, on_right), (left, on_left)):
            centre = run_of(half, parts[half].roles.get("centre", ()), True)
            found += joint_of(parts, run_of(strip, own[role]), centre, "hood strip", (-0.03, 0.03))
        necks = [run_of(half, parts[half].roles.get("neck", ())) for half in (left, right)]
        if all(necks):
            neck = (*necks[0], *run_of(strip, own[end]), *necks[1])
            found += joint_of(parts, neck, neck_from_front(parts), "hood to neck", (-0.04, 0.06))
        ways.append(found)
    yield from max(ways, key=lambda found: sum(joint.confidence for joint in found))


def _skirts(parts: Sequence[Part]) -> Iterable[Joint]:
    fronts, backs = faces_of(parts, "skirt_front"), faces_of(parts, "skirt_back")
    for front in fronts:
        for back in backs:
            for side in (LEFT, RIGHT):
                if all(parts[face[0]].side in (BOTH, side) for face in (front, back)):
                    one, other = face_run(parts, front, "side", side), face_run(parts, back, "side", side, True)
                    yield from joint_of(parts, one, other, "side")
    ahead, behind = (_half_ring(parts, f"skirt_{face}", "crotch") for face in ("front", "back"))  # of briefs
    has_gusset = bool(parts_of_kind(parts, "gusset"))
    yield from joint_of(parts, ahead[::-1], behind, "crotch", LEG_EASE, DOUBTED if has_gusset else 1.0)
    yield from proposed_crotch_gussets(parts, ahead, behind)
    yield from _between_panels(parts, (*fronts, *backs))
    closed = FRONT_CENTRE if skirt_fronts_cross(parts) else SKIRT_FRONT_CENTRE
    yield from _centres(parts, [face[0] for face in fronts], closed, "centre front")
    yield from _centres(parts, [face[0] for face in backs], 1.0, "centre back")
    for kind in ("front", "back"):
        tops, skirts = parts_of_kind(parts, kind), parts_of_kind(parts, f"skirt_{kind}")
        pairs = [(top, skirt) for top in tops for skirt in skirts if parts[top].side == parts[skirt].side]
        runs = [
            (
                run_of(skirt, parts[skirt].roles.get("waist", ())),
                run_of(top, parts[top].roles.get("hem", ()), True),
            )
            for top, skirt in pairs
        ]
        for waist, hem in runs or [(_half_ring(parts, f"skirt_{kind}", "waist"), _half_ring(parts, kind, "hem"))]:
            ease = FULL_WAIST_EASE if are_unshaped_skirts(parts, waist) else GATHERED_WAIST_EASE
            yield from joint_of(parts, waist, hem, "waist", ease, FULL_SURE)


def _jumpsuits(parts: Sequence[Part]) -> Iterable[Joint]:
    """A bodice sewn to trousers, as long at the waist, where no waistband is there for them."""
    if parts_of_kind(parts, "waistband", "hem_band"):
        return
    found = []
    for face in ("front", "back"):
        waist, hem = (_half_ring(parts, kind, role) for kind, role in ((f"leg_{face}", "waist"), (face, "hem")))
        found += joint_of(parts, waist, hem, "waist", WAIST_EASE)
    if len(found) == 2 and min(joint.confidence for joint in found) >= SEWN_FROM:
        yield from found


def _half_ring(parts: Sequence[Part], kind: str, role: str) -> tuple[Side, ...]:
    """A front's edges of a role from the wearer's left to the right, or a back's the other way, as waists run."""
    own = parts_of_kind(parts, kind)
    order = (LEFT, BOTH, RIGHT) if kind.endswith("front") else (RIGHT, BOTH, LEFT)
    if len({parts[index].side for index in own}) < len(own):
        return ()
    along = sorted(own, key=lambda index: order.index(parts[index].side))
    runs = [run_of(index, parts[index].roles.get(role, ())) for index in along]
    runs = runs if role == "waist" else [run[::-1] for run in runs]  # lower edges run the other way
    return tuple(side for run in runs for side in run)


def _gores(parts: Sequence[Part]) -> Iterable[Joint]:
    """Each gore sewn to the next one, and all of them to a bodice, from its right side on by the back."""
    gores = parts_of_kind(parts, "gore")
    for gore, following in zip(gores, [*gores[1:], *gores[:1]], strict=True):
        one, other = parts[gore].roles.get("side+", ()), parts[following].roles.get("side-", ())
        yield from joint_of(parts, run_of(gore, one), run_of(following, other, True), "gore")
    if gores and parts_of_kind(parts, "front", "back"):
        waist = tuple(side for gore in gores[::-1] for side in run_of(gore, parts[gore].roles.get("waist", ())))
        hem = around(parts, ("front",), ("back",), "hem", True)
        behind = tuple(side for side in hem if parts[side.panel].kind.endswith("back"))
        ahead = tuple(side for side in hem if side not in behind)
        yield from joint_of(parts, waist, (*behind, *ahead), "waist", GATHERED_WAIST_EASE, FULL_SURE)


def _bands(parts: Sequence[Part]) -> Iterable[Joint]:
    """Collars, waistbands, cuffs and bands at the hem: round a ring of edges, their ends together if that is closed."""
    for kind in ("waistband", "hem_band"):
        yield from proposed_halves(parts, kind)
    for band in parts_of_kind(parts, "collar", "waistband", "cuff", "hem_band"):
        part = parts[band]
        others = [each for each in parts_of_kind(parts, part.kind) if each not in (band, part.twin)]
        sure = DOUBTED if others and part.kind != "cuff" else 1.0  # a stand and its collar: which goes on the neck?
        if part.kind == "waistband" and has_loose_yokes(parts):
            sure = DOUBTED
        if "end" not in part.roles or "neck" in part.roles:
            continue
        ring = ring_of(parts, band)
        if not ring:
            continue
        sure *= DOUBTED if part.kind == "hem_band" and has_rival(parts, ring) else 1.0
        ease = ARMHOLE_EASE if is_round_armhole(parts, band) else BAND_EASE
        if part.kind == "waistband" and are_unshaped_skirts(parts, ring):
            is_full = length_of(parts, run_of(band, part.roles["long"])) < (1.0 + ease[0]) * length_of(parts, ring)
            ease, sure = (FULL_BAND_EASE, sure * FULL_SURE) if is_full else (ease, sure)
        if named(part.name).is_ruffle and part.kind != "waistband":
            ease, sure = RUFFLE_EASE, sure * FULL_SURE
        best = [
            joint
            for role in ("long", "long2")
            for joint in joint_of(parts, run_of(band, part.roles[role]), ring, part.kind.replace("_", " "), ease, sure)
        ]
        joint = max(best, key=lambda each: each.confidence)
        yield joint
        if opens_between_fronts(parts, ring):
            continue
        ends = joint_of(
            parts, run_of(band, part.roles["end"]), run_of(band, part.roles["end2"], True), f"{part.kind} ends"
        )
        yield from (each for each in ends if joint.confidence >= SEWN_FROM)


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
            notched = notched and other.panel != parts[one.panel].twin  # a mirror image has the same notches
            if notched and float(np.abs(shares - there).max()) * length[one] < 2e-3 and len(alike) == 1:
                sure = 0.8
            yield Joint((one,), (other,), round(sure, 3), f"of one length, {length[one] * 1e3:.0f} mm")

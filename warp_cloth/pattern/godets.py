"""Godets: wedges set into the lower ends of seams, or into slits up from a hem."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.joints import Joint
from warp_cloth.pattern.parting import marks_along, parted
from warp_cloth.pattern.runs import DOUBTED, joint_of, parts_of_kind
from warp_cloth.pattern.specification import Side

EASE = (-0.02, 0.02)
ALIKE = 0.02  # relative, of an edge that a godet's leg is sewn to


def with_marks_of_godets(parts: Sequence[Part]) -> tuple[Part, ...]:
    """The parts; where a notch is as far up from a hem as a godet is tall, the edge there ends at it."""
    long = _leg(parts, godets_of(parts)[:1])
    return tuple(part if part.kind == "godet" else _parted(part, long) for part in parts) if long else tuple(parts)


def _parted(part: Part, long: float) -> Part:
    """A part whose edges up from a hem end at notches at this length [m]."""
    for edge in range(len(part.edges))[::-1]:  # from the last on: those before keep their numbers
        if not _is_at_hem(part, edge):
            continue
        rises = (edge - 1) % len(part.edges) in part.roles["hem"]
        place = long if rises else part.edges[edge].length - long
        if any(abs(mark - place) <= ALIKE * long for mark in marks_along(part, (edge,))):
            part, _ = parted(part, (edge,), [place])
    return part


def godets_of(parts: Sequence[Part]) -> list[int]:
    return [panel for panel in parts_of_kind(parts, "godet") if "legs" in parts[panel].roles]


def _leg(parts: Sequence[Part], godets: Sequence[int]) -> float:
    """The length of the legs of godets [m]; 0 of none."""
    return max((parts[godet].edges[parts[godet].roles["legs"][0]].length for godet in godets), default=0.0)


def with_godets(parts: Sequence[Part], joints: Sequence[Joint]) -> list[Joint]:
    """The joints, those that a godet may go into sewn only above it, and to its legs below.

    It goes in where both sides of a seam end at a hem in an edge as long as its legs. Where there are more or fewer
    such places than godets, a person is to say which: these seams are doubted, or, where there is no such place, all
    that end at a hem.
    """
    godets = godets_of(parts)
    if not godets:
        return list(joints)
    long = _leg(parts, godets[:1])
    ends = {index: low for index, joint in enumerate(joints) if (low := _lower_end(parts, joint)) is not None}
    fits = [
        index
        for index, low in ends.items()
        if all(abs(parts[side.panel].edges[side.edge].length - long) <= ALIKE * long for side in low)
    ]
    sure = 1.0 if len(fits) == len(godets) else DOUBTED
    doubted = {*(fits or ends)} if sure < 1.0 else set()
    out = [
        replace(joint, confidence=round(DOUBTED * joint.confidence, 3)) if index in doubted else joint
        for index, joint in enumerate(joints)
        if index in doubted or index not in fits
    ]
    for index, godet in zip(fits if sure == 1.0 else (), godets, strict=False):
        out += _set_in(parts, joints[index], ends[index], godet)
    return out


def _lower_end(parts: Sequence[Part], joint: Joint) -> tuple[Side, Side] | None:
    """The edges of both sides of a joint that meet at a hem; None: it ends at none."""
    for end in (0, -1):
        low = joint.one[end], joint.other[end]
        if all(_is_at_hem(parts[side.panel], side.edge) for side in low):
            return low
    return None


def _is_at_hem(part: Part, edge: int) -> bool:
    """Whether an edge, which is of no hem, is next to one."""
    hem, count = part.roles.get("hem", ()), len(part.edges)
    return edge not in hem and bool({(edge - 1) % count, (edge + 1) % count} & {*hem})


def _set_in(parts: Sequence[Part], joint: Joint, low: tuple[Side, Side], godet: int) -> Iterable[Joint]:
    """The seam above a godet, and those of its two legs."""
    above = [tuple(side for side in run if side not in low) for run in (joint.one, joint.other)]
    if all(above):
        yield from joint_of(parts, above[0], above[1], joint.reason.split(",")[0])
    up, down = parts[godet].roles["legs"]
    for side in low:  # against its leg: an edge up from the hem meets the one down from the tip
        rises = (side.edge - 1) % len(parts[side.panel].edges) in parts[side.panel].roles["hem"]
        yield from joint_of(parts, (side,), (Side(godet, down if rises else up),), "godet", EASE)

"""Gussets: diamonds set into slits at the underarm, where sleeves are cut in one, and strips between crotches."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.joints import Joint
from warp_cloth.pattern.kinds import LEFT, RIGHT
from warp_cloth.pattern.roles import BENT
from warp_cloth.pattern.runs import Run, joint_of, parts_of_kind, role_of, run_of
from warp_cloth.pattern.specification import Side

EASE = (-0.03, 0.03)


def proposed_gussets(parts: Sequence[Part]) -> Iterable[Joint]:
    """The four seams of each gusset, on the side where they fit best."""
    gussets = parts_of_kind(parts, "gusset")
    found: dict[tuple[int, int], list[Joint]] = {}
    for gusset in gussets:
        for side in (LEFT, RIGHT):
            for front in parts_of_kind(parts, "front"):
                for back in parts_of_kind(parts, "back"):
                    joints = _set_in(parts, gusset, (front, back), side)
                    if _least(joints) > _least(found.get((gusset, side), [])):
                        found[gusset, side] = joints
    gone: set[int] = set()
    filled: set[int] = set()
    for gusset, side in sorted(found, key=lambda key: (-_least(found[key]), key[0], -key[1])):
        if gusset not in gone and side not in filled:
            yield from found[gusset, side]
            gone.add(gusset)
            filled.add(side)


def proposed_crotch_gussets(parts: Sequence[Part], ahead: tuple[Side, ...], behind: tuple[Side, ...]) -> list[Joint]:
    """The seams of a gusset between the crotches of a front and a back, at two of its sides across from each other.

    Args:
        parts: of the garment.
        ahead: the front's crotch, against its loop.
        behind: the back's, too.
    """
    gussets = parts_of_kind(parts, "gusset")
    own = _sides_of(parts[gussets[0]]) if len(gussets) == 1 else []
    if len(own) != 4 or not ahead or not behind:
        return []
    ways = []
    for turn in range(4):
        joints: list[Joint] = []
        for run, mate in ((own[turn], ahead), (own[(turn + 2) % 4], behind)):
            joints += joint_of(parts, run_of(gussets[0], run), mate, "gusset", EASE)
        ways.append(joints)
    return max(ways, key=_least)


def _least(joints: Sequence[Joint]) -> float:
    return min((joint.confidence for joint in joints), default=0.0)


def _set_in(parts: Sequence[Part], gusset: int, faces: tuple[int, int], side: int) -> list[Joint]:
    """The gusset's four edges sewn to the slits of a front and a back, turned as it fits best.

    Against its loop come the front's slit and the back's, whose outer ends meet at the side and at the underarm.
    """
    slits = [slit for face in faces for slit in slits_of(parts, face, side)]
    own = _sides_of(parts[gusset])
    if len(slits) != 2 or len(own) != 4:
        return []
    there = [Side(face, edge) for face, slit in zip(faces, slits, strict=True) for edge in slit[::-1]]
    ways = []
    for turn in range(4):
        joints: list[Joint] = []
        for run, mate in zip([*own[turn:], *own[:turn]], there, strict=True):
            joints += joint_of(parts, run_of(gusset, run), (mate,), "gusset", EASE)
        ways.append(joints)
    return max(ways, key=_least)


def slits_of(parts: Sequence[Part], panel: int, side: int) -> list[tuple[int, int]]:
    """Darts that open in the side of a front or back: where a gusset may be set in."""
    run, count = role_of(parts, panel, "side", side), len(parts[panel].edges)
    return [(one, two) for one, two in parts[panel].shape.darts if {(one - 1) % count, (two + 1) % count} <= {*run}]


def without_gaps(run: Sequence[Side]) -> list[tuple[Side, ...]]:
    """A run of edges parted where one does not follow the one before in its panel, as at a slit."""
    groups: list[list[Side]] = []
    for side in run:
        last = groups[-1][-1] if groups else None
        if last is not None and (last.panel != side.panel or abs(last.edge - side.edge) == 1):
            groups[-1].append(side)
        else:
            groups.append([side])
    return [tuple(group) for group in groups]


def _sides_of(part: Part) -> list[Run]:
    """The edges from corner to corner."""
    shape, count = part.shape, len(part.edges)
    firsts = [k for k in range(count) if abs(shape.turn_after(k - 1)) > 0.5 * BENT]
    ends = [*firsts[1:], *(first + count for first in firsts[:1])]
    return [tuple(k % count for k in range(first, end)) for first, end in zip(firsts, ends, strict=True)]

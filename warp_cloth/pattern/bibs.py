"""Bibs of overalls: a front or back above trousers, as long at its lower edge as their waist, hollow at its sides.

No shoulder tells which way up it is, and its hollow edges are wider below, where a bodice's armholes are above: what
is as long as the waist is its lower edge. Its sides stay open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.drawn_darts import turned
from warp_cloth.pattern.kinds import BOTH
from warp_cloth.pattern.part_roles import roles_of
from warp_cloth.pattern.runs import parts_of_kind
from warp_cloth.pattern.specification import short

AS_LONG = 0.02  # relative: to which a bib's lower edge is as long as the trousers' waist on that face
DOUBTED = 0.7  # factor on how sure what may be one is, so that nothing of it is sewn unasked
HALF_TURN = -np.eye(2)
BIB = "bib"  # a role without edges, which tells that a front or back is one


def with_bibs(parts: Sequence[Part]) -> tuple[tuple[Part, ...], list[str]]:
    """The parts, fronts and backs above trousers as bibs, their lower edges below; and a note where no straps are.

    A bodice with shoulders, or a waistband between, is no such garment. What has the shape of a bib, and is not as long
    as the waist, is doubted: its sides would be sewn.
    """
    tops = parts_of_kind(parts, "front", "back")
    has_shoulders = any(role.startswith("shoulder") for index in tops for role in parts[index].roles)
    if has_shoulders or parts_of_kind(parts, "waistband", "sleeve", "collar", "hood"):
        return tuple(parts), []
    out = list(parts)
    bibs = []
    for index in tops:
        part = parts[index]
        legs = parts_of_kind(parts, f"leg_{part.kind}")
        waist = sum(parts[leg].shape.length(parts[leg].roles.get("waist", ())) for leg in legs)
        shaped = [way for way in (part, _upside_down(part)) if waist and _is_hollow_at_sides(way)]
        ways = [way for way in shaped if abs(way.shape.length(way.roles["hem"]) / waist - 1.0) <= AS_LONG]
        if len(ways) == 1:
            sides = {f"armhole{mark}": ways[0].roles[f"side{mark}"] for mark in "+-"}
            ends = {role: ways[0].roles[role] for role in ("hem", "neck")}
            out[index] = replace(ways[0], roles={**ends, **sides, BIB: ()})
            bibs.append(f'"{short(part.name)}"')
        elif shaped:
            out[index] = replace(part, sure=DOUBTED * part.sure)
    is_held = not bibs or bool(parts_of_kind(parts, "strap"))
    note = f"no straps are there for {', '.join(bibs)} to hang from: what is not held up folds down"
    return tuple(out), [] if is_held else [note]


def _is_hollow_at_sides(part: Part) -> bool:
    """Whether a whole part has hollow sides between a lower edge and a top, and nothing else."""
    shape, roles = part.shape, part.roles
    if part.side != BOTH or part.mirror is None or {*roles} != {"hem", "neck", "side+", "side-"}:
        return False
    return all(any(shape.is_concave(k) for k in roles[f"side{mark}"]) for mark in "+-")


def _upside_down(part: Part) -> Part:
    nowhere = np.zeros(2)
    made = replace(
        part,
        edges=tuple(edge.turned(HALF_TURN, nowhere) for edge in part.edges),
        notches=part.notches @ HALF_TURN,
        lines=tuple(line @ HALF_TURN for line in part.lines),
        holes=tuple(tuple(edge.turned(HALF_TURN, nowhere) for edge in hole) for hole in part.holes),
        darts=tuple(turned(dart, HALF_TURN, nowhere) for dart in part.darts),
    )
    return replace(made, roles=roles_of(part.kind, made.shape, part.mirror is not None, False, False))

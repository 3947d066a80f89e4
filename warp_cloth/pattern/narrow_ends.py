"""Fronts and backs that both end as narrow as a crotch, and have no leg openings that corners part from their sides.

They may be briefs whose openings run smoothly into the sides: sewn as a skirt or a top they would be a bag. No skirt is
so narrow at its waist or hem, and a halter top only in front.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from warp_cloth.pattern.briefs import DOUBTED, SURE_UP_TO
from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.kinds import BOTH
from warp_cloth.pattern.runs import parts_of_kind

LEAST_WIDE = 0.3  # [m] of the other end; what is less is for a doll
ENDS = ("hem", "waist", "neck")


def with_narrow_ends_doubted(parts: Sequence[Part]) -> tuple[Part, ...]:
    """The parts, whole fronts and backs doubted where all of both faces end so."""
    out = list(parts)
    for front, back in (("front", "back"), ("skirt_front", "skirt_back")):
        own = parts_of_kind(parts, front, back)
        are_panelled = bool(parts_of_kind(parts, f"side_{front}", f"side_{back}"))
        if {parts[index].kind for index in own} != {front, back} or are_panelled:
            continue
        if all(_ends_narrow(parts[index]) for index in own):
            for index in own:
                out[index] = replace(parts[index], sure=DOUBTED * parts[index].sure)
    return tuple(out)


def _ends_narrow(part: Part) -> bool:
    told = "crotch" in part.roles or any(role.startswith("shoulder") for role in part.roles)
    ends = sorted(part.shape.length(part.roles[role]) for role in ENDS if part.roles.get(role))
    return part.side == BOTH and not told and len(ends) == 2 and ends[0] <= SURE_UP_TO and ends[1] >= LEAST_WIDE

"""Slits that an outline shows as it shows darts: a keyhole at the neck's middle, a vent at a hem. They stay open."""

from __future__ import annotations

from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.kinds import SKIRTS

LOWER = ("gore", "leg", "leg_front", "leg_back", *SKIRTS)  # kinds whose hem is fitted to nothing


def is_slit(part: Part, dart: tuple[int, int]) -> bool:
    """Whether what looks like a dart may be a slit, so that only a person can tell whether it is closed.

    It opens in the middle of the neck or hem of a front or back, or anywhere in the hem of a skirt or leg. No dart
    shapes a body there: those of a bodice's hem lie below the breasts and shoulder blades, those of a neck at its back
    are two.
    """
    one, other = dart
    ends = {(one - 1) % len(part.edges), (other + 1) % len(part.edges)}
    opens_at = {role for role, run in part.roles.items() if ends <= {*run}}
    if part.kind in LOWER:
        return "hem" in opens_at
    is_middle = part.mirror is not None and part.mirror[one] == other
    return is_middle and part.kind in ("front", "back") and bool(opens_at & {"neck", "hem"})

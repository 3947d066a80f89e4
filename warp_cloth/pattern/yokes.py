"""Backs with a yoke: which edges are sewn where, of the yoke and of the back below it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.joints import Joint
from warp_cloth.pattern.kinds import BOTH
from warp_cloth.pattern.runs import joint_of, parts_of_kind, run_of

PLEATED = (-0.02, 0.35)  # a back may be laid in a pleat, or gathered, below its yoke


def proposed_yokes(parts: Sequence[Part]) -> Iterable[Joint]:
    """The seams between yokes and the backs below them."""
    for yoke in parts_of_kind(parts, "yoke"):
        for back in parts_of_kind(parts, "back"):
            if parts[yoke].side == parts[back].side or BOTH in (parts[yoke].side, parts[back].side):
                one, other = parts[back].roles.get("top", ()), parts[yoke].roles.get("hem", ())
                yield from joint_of(parts, run_of(back, one), run_of(yoke, other, True), "yoke", PLEATED)

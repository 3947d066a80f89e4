"""Fronts and backs with a yoke: how it is sewn to what begins below it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.joints import Joint
from warp_cloth.pattern.kinds import BOTH, YOKE_OF
from warp_cloth.pattern.runs import joint_of, length_of, parts_of_kind, run_of

PLEATED = (-0.02, 0.35)  # a back may be laid in a pleat, or gathered, below its yoke
GATHERED, GATHERED_SURE = (-0.02, 1.0), 0.9  # a dress is gathered more; as at a waist


def proposed_yokes(parts: Sequence[Part]) -> Iterable[Joint]:
    """The seams between yokes and the fronts and backs below them."""
    for face, kind in YOKE_OF.items():
        for yoke in parts_of_kind(parts, kind):
            for below in parts_of_kind(parts, face):
                if parts[yoke].side == parts[below].side or BOTH in (parts[yoke].side, parts[below].side):
                    one = run_of(below, parts[below].roles.get("top", ()))
                    other = run_of(yoke, parts[yoke].roles.get("hem", ()), True)
                    is_gathered = length_of(parts, one) > (1.0 + PLEATED[1]) * length_of(parts, other)
                    ease, sure = (GATHERED, GATHERED_SURE) if is_gathered else (PLEATED, 1.0)
                    yield from joint_of(parts, one, other, "yoke", ease, sure)

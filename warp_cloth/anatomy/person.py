"""All that is understood of a body from its mesh alone."""

from __future__ import annotations

from dataclasses import dataclass

from warp_cloth.anatomy.measures import Measure, measures_of
from warp_cloth.anatomy.skeleton import Skeleton, skeleton_or_reason
from warp_cloth.anatomy.stance import Stance, stance_of
from warp_cloth.base.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Person:
    """A body, and its limbs, pose and measures, where it is a person's."""

    body: Mesh
    skeleton: Skeleton | None
    stance: Stance | None
    measures: tuple[Measure, ...]  # empty where there are no limbs
    reason: str  # why no limbs can be told: a clause; else empty


def understand(body: Mesh) -> Person:
    """What a body's mesh shows: limbs, pose and measures."""
    found = skeleton_or_reason(body)
    if isinstance(found, str):
        return Person(body, None, None, (), found)
    return Person(body, found, stance_of(found), measures_of(body, found), "")

"""Spare pieces of a DXF file, left out: small ones whose names say nothing, sewn to nothing (tapes, plackets)."""

from __future__ import annotations

from collections.abc import Sequence

from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.joints import Joint
from warp_cloth.pattern.kinds import named
from warp_cloth.pattern.loose import SMALL


def spare_of(parts: Sequence[Part], joints: Sequence[Joint]) -> frozenset[int]:
    """The parts that are left out of the garment, as they are small, sewn to nothing and of no known name.

    What a name tells (a cuff, a strap, a side panel) is of the garment, and a person is asked for its seams.
    """
    sewn = {side.panel for joint in joints for side in (*joint.one, *joint.other)}
    areas = [abs(sum(edge.area for edge in part.edges)) for part in parts]
    least = SMALL * max((areas[index] for index in sewn), default=0.0)
    return frozenset(
        index
        for index, part in enumerate(parts)
        if index not in sewn and areas[index] < least and not (part.kind or part.holes or named(part.name).panel)
    )

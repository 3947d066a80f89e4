"""Waistbands and hem bands in two pieces, one in front and one behind, sewn to each other at the sides."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby, permutations

from warp_cloth.pattern.band_rings import opens_between_fronts, ring_of
from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.joints import Joint
from warp_cloth.pattern.runs import joint_of, parts_of_kind, run_of
from warp_cloth.pattern.specification import Side

EASE = (-0.4, 0.04)  # a band may gather what it is sewn to


def proposed_halves(parts: Sequence[Part], kind: str) -> Iterable[Joint]:
    """Seams of two bands of a kind, each as long as the front or the back of the ring that a band of it goes round.

    Of two that are each as long as the whole ring none is sewn so.
    """
    bands = [each for each in parts_of_kind(parts, kind) if "end" in parts[each].roles]
    ring = ring_of(parts, bands[0]) if len(bands) == 2 else ()
    halves = [] if opens_between_fronts(parts, ring) else _faces(parts, ring)
    if len(halves) != 2:
        return
    ways = []
    for own in permutations(bands):
        found: list[Joint] = []
        for band, half in zip(own, halves, strict=True):
            found += joint_of(parts, run_of(band, parts[band].roles["long"]), half, kind.replace("_", " "), EASE)
        ways.append((min((joint.confidence for joint in found), default=0.0), own, found))
    least, own, found = max(ways, key=lambda way: way[0])
    yield from found
    for one, other in (own, own[::-1]):
        ends = run_of(one, parts[one].roles["end"]), run_of(other, parts[other].roles["end2"], True)
        yield from (joint for joint in joint_of(parts, *ends, f"{kind} ends") if least > 0.0)


def _faces(parts: Sequence[Part], ring: Sequence[Side]) -> list[tuple[Side, ...]]:
    """A closed ring parted where front and back meet."""

    def is_front(side: Side) -> bool:
        return parts[side.panel].kind.endswith("front")

    first = next((k for k in range(len(ring)) if is_front(ring[k]) and not is_front(ring[k - 1])), 0)
    return [tuple(own) for _, own in groupby((*ring[first:], *ring[:first]), key=is_front)]

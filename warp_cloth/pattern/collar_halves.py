"""Collars cut twice as halves that meet behind: made whole at the end that lies there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.half_bands import made_whole
from warp_cloth.pattern.kinds import BOTH, COLLARS
from warp_cloth.pattern.layers import without_parts
from warp_cloth.pattern.neckline import neck_from_front, opens_in_front
from warp_cloth.pattern.runs import length_of, parts_of_kind
from warp_cloth.pattern.specification import short

HALF = 0.55  # of the neckline, that the inner edge of half a collar is long at most
SQUARE = np.radians(5.0)  # to which both long edges meet the end that is sewn to the other half's
ALONG, ASLANT = np.radians((1.0, 3.0))  # from the grain or across it, of that end at most, of the other at least


def are_halves(parts: Sequence[Part], one: int, other: int) -> bool:
    """Whether two collars are halves: mirror images, each no longer than half the neckline at its shorter edge."""
    if parts[one].twin != other or parts[one].mirror is not None:
        return False
    part = parts[one]
    lengths = [part.shape.length(part.roles[role]) for role in ("long", "long2") if role in part.roles]
    neck = length_of(parts, neck_from_front(parts))
    return bool(lengths) and min(lengths) <= HALF * neck


def with_whole_collars(parts: Sequence[Part]) -> tuple[tuple[Part, ...], list[str]]:
    """The parts, with the only collar made whole where it is of two halves; and a note on that."""
    collars = parts_of_kind(parts, *COLLARS)
    if len(collars) != 2 or not opens_in_front(parts) or not are_halves(parts, *collars):
        return tuple(parts), []
    first, second = collars
    made = _opened(parts[first])
    if made is None:
        return tuple(parts), []
    out = [*parts]
    out[first] = made
    note = f'piece "{short(made.name)}" is half a collar, cut twice: made whole at its end behind'
    return without_parts(out, {second}), [note]


def _opened(part: Part) -> Part | None:
    """Half a collar mirrored at its straight end that meets both long edges squarely; None: it has not one such end.

    Where both do, the one along the grain, or across it, lies behind.
    """
    shape, count = part.shape, len(part.edges)
    longs = {*part.roles.get("long", ()), *part.roles.get("long2", ())}
    ends = [k for k in range(count) if k not in longs]
    if len(longs) != 2 or len(ends) != 2 or not all(shape.is_straight(k) for k in ends):
        return None
    off = [max(abs(shape.turn_after(each) - 0.5 * np.pi) for each in ((k - 1) % count, k)) for k in ends]
    aslant = [float(np.arctan2(*np.sort(np.abs(shape.chord(k))))) for k in ends]
    square = [k for k, own, grain in zip(ends, off, aslant, strict=True) if own <= SQUARE and grain <= ALONG]
    others = [own > SQUARE or grain >= ASLANT for own, grain in zip(off, aslant, strict=True)]
    if len(square) != 1 or sum(others) != 1:
        return None
    whole = made_whole(part, square)
    return None if whole is None else replace(whole, side=BOTH)

"""Bands and yokes that a file has in two layers, outer and inner, as pieces of their own: one of them is sewn."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import replace
from itertools import combinations

import numpy as np

from warp_cloth.pattern.band_rings import ring_of
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.kinds import YOKES, named
from warp_cloth.pattern.runs import length_of, parts_of_kind
from warp_cloth.pattern.specification import short

ALIKE = 0.03  # relative: lengths and widths of two layers of one piece
WHOLE = 0.6  # of the edges it goes round, that a band for all of them is long at least
BANDS = ("waistband", "hem_band", "cuff")


def with_single_layers(parts: Sequence[Part]) -> tuple[tuple[Part, ...], list[str]]:
    """The parts with one layer of each waistband, band at the hem, cuff and yoke; and notes on those left out."""
    gone: set[int] = set()
    notes = []
    for kind in (*BANDS, *YOKES):
        firsts = [each for each in parts_of_kind(parts, kind) if (parts[each].twin or len(parts)) > each]
        for one, other in combinations(firsts, 2):
            if gone.isdisjoint((one, other)) and _are_layers(parts, one, other):
                gone |= {other} | {twin for twin in (parts[other].twin,) if twin is not None}
                names = f'pieces "{short(parts[one].name)}" and "{short(parts[other].name)}"'
                notes.append(f"{names} are layers of one {kind.replace('_', ' ')}: the first is sewn")
    return without_parts(parts, gone), notes


def without_parts(parts: Sequence[Part], gone: Set[int]) -> tuple[Part, ...]:
    kept = [index for index in range(len(parts)) if index not in gone]
    new = {index: place for place, index in enumerate(kept)}
    return tuple(replace(parts[k], twin=new.get(-1 if (t := parts[k].twin) is None else t)) for k in kept)


def _are_layers(parts: Sequence[Part], one: int, other: int) -> bool:
    """Whether two parts of a kind are as large, and one goes all round; of halves each would go half round."""
    a, b = parts[one], parts[other]
    if named(a.name).face != named(b.name).face:  # one for the front and one for the back
        return False
    if a.side != b.side or (a.twin is None) != (b.twin is None) or not a.roles or not b.roles:
        return False
    sizes = _sizes(a), _sizes(b)
    if not (np.abs(sizes[0] - sizes[1]) <= ALIKE * np.maximum(*sizes)).all():
        return False
    if a.kind in YOKES:
        return True
    ring = length_of(parts, ring_of(parts, one))
    return ring > 0.0 and "long" in a.roles and a.shape.length(a.roles["long"]) > WHOLE * ring


def _sizes(part: Part) -> Floats:
    """Length of the outline [m], and width and height [m], shape [3]."""
    extent = np.ptp(np.array(part.shape.box), axis=0)
    return np.array([part.shape.length(range(len(part.edges))), *np.sort(extent)])

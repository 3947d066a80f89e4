"""Tiers of skirts: strips or panels gathered one below another, each to the hem of the one above.

Names tell that pieces are tiers, and their numbers which is above which, or else widths do: each is wider than what it
is gathered to. Where these do not agree, or do not tell, none is sewn.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.joints import Joint
from warp_cloth.pattern.kinds import BOTH, LEFT, RIGHT, named
from warp_cloth.pattern.runs import joint_of, parts_of_kind, role_of, run_of

WIDER, AS_WIDE = 1.05, 0.98  # waist of a tier over that of the one above, at least; where numbers tell their order
DOUBTED = 0.7  # factor on how sure they are in no sure order, so that nothing of them is sewn unasked
EASE, SURE = (-0.02, 2.1), 0.9  # of a tier to the hem above, gathered to a third at most; how sure gathers are
FACES = ("front", "back")


def with_tiers(parts: Sequence[Part]) -> tuple[Part, ...]:
    """The parts, fronts and backs of skirts below the uppermost ones as tiers, with their number from above.

    Where their order is not sure, they are doubted.
    """
    own = {face: parts_of_kind(parts, f"skirt_{face}") for face in FACES}
    is_told = any(parts[n].level or named(parts[n].name).is_tier for each in own.values() for n in each)
    if max(map(len, own.values())) < 2 or not is_told:
        return tuple(parts)
    out = list(parts)
    orders = {face: _from_above(parts, each) for face, each in own.items()}
    if {len(order) for order in orders.values()} != {max(map(len, own.values()))}:
        for index in (*own["front"], *own["back"]):
            out[index] = replace(parts[index], sure=DOUBTED * parts[index].sure)
        return tuple(out)
    for face, order in orders.items():
        for level, index in enumerate(order):
            if level:
                out[index] = replace(parts[index], kind=f"tier_{face}", level=level)
    return tuple(out)


def _from_above(parts: Sequence[Part], own: Sequence[int]) -> list[int]:
    """The fronts or backs of a skirt from the uppermost on, by their numbers, or else by how wide they are.

    Empty: neither tells, or they do not agree.
    """
    if any(parts[index].side != BOTH or not parts[index].roles.get("hem") for index in own):
        return []
    wide = {index: parts[index].shape.length(parts[index].roles.get("waist", ())) for index in own}
    if any(parts[index].level for index in own):  # told by how they fit
        return sorted(own, key=lambda index: parts[index].level)
    numbers = {index: number_of(parts[index].name) for index in own}
    is_numbered = None not in numbers.values() and len({*numbers.values()}) == len(own)
    order = sorted(own, key=lambda index: ((numbers[index] or 0) if is_numbered else 0, wide[index]))
    least = AS_WIDE if is_numbered else WIDER
    return order if all(wide[below] >= least * wide[above] for above, below in pairwise(order)) else []


def number_of(name: str) -> int | None:
    """The number of a tier that its name states."""
    found = re.search(r"(?<!\d)([1-9])(?!\d)", name)
    return int(found[1]) if found else None


def proposed_tiers(parts: Sequence[Part]) -> Iterable[Joint]:
    """The sides of each tier, and its seam to the hem above."""
    levels = {(part.kind[5:], part.level): index for index, part in enumerate(parts) if part.kind.startswith("tier_")}
    for face, level in levels:
        index = levels[face, level]
        above = levels.get((face, level - 1), next(iter(parts_of_kind(parts, f"skirt_{face}")), None))
        if above is not None:
            runs = (
                run_of(index, parts[index].roles.get("waist", ())),
                run_of(above, parts[above].roles.get("hem", ()), True),
            )
            yield from joint_of(parts, *runs, "tier", EASE, SURE)
        behind = levels.get(("back", level))
        if face == "front" and behind is not None:
            for side in (LEFT, RIGHT):
                one, other = (run_of(each, role_of(parts, each, "side", side)) for each in (index, behind))
                yield from joint_of(parts, one, other[::-1], "side")


def above_of(parts: Sequence[Part], index: int) -> float:
    """How far below a skirt's waist a tier begins [m]: by the tiers above it, in front or behind."""
    face = parts[index].kind.removeprefix("tier_")
    kinds = (f"tier_{face}", f"skirt_{face}")
    own = [part for part in parts if part.kind in kinds and part.level < parts[index].level]
    return float(sum(np.ptp(part.shape.box, axis=0)[1] for part in own))

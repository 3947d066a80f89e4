"""Side panels of skirts: which of their two long edges is sewn to the middle panel, and so on which side they are worn.

Both edges run from waist to hem and are nearly as long, so all ways of sewing front and back are compared by lengths
and notches. Where another way fits nearly as well, the panels are less sure than what is sewn unasked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.kinds import BOTH, LEFT, RIGHT
from warp_cloth.pattern.roles import Roles
from warp_cloth.pattern.runs import length_of, notches_agree, parts_of_kind, run_of

NEAR = 0.004  # [m] by which the best way's lengths agree better than the next's: inner seams do to 2 mm, as drafted
NOTCHES_APART = 0.01  # [m] that count for notches which do not meet
DOUBTED = 0.7  # factor on how sure panels are that may as well be sewn otherwise
OTHER = {"+": "-", "-": "+"}
Way = tuple[tuple[int, str], ...]  # of each panel, the mark of its inner edge


def with_skirt_panels(parts: Sequence[Part]) -> list[Part]:
    """The parts, with princess seams and sides of skirts that have a pair of side panels in front, behind or both."""
    out = list(parts)
    faces = []
    for face in ("skirt_front", "skirt_back"):
        middles, panels = parts_of_kind(parts, face), parts_of_kind(parts, f"side_{face}")
        pair = len(panels) == 2 and parts[panels[0]].twin == panels[1]
        is_whole = len(middles) == 1 and parts[middles[0]].side == BOTH
        if pair and is_whole and all(_has_sides(parts[index]) for index in (middles[0], panels[0])):
            faces.append((face, middles[0], panels[0]))
    if not faces:
        return out
    panels = [panel for *_, panel in faces]
    marks = ["+-" if parts[panel].mirror is None else "-" for panel in panels]  # of a symmetric one both are the same
    ways: list[Way] = [tuple(zip(panels, way, strict=True)) for way in product(*marks)]
    fits = sorted(((_fit(parts, faces, way), way) for way in ways), key=lambda each: each[0])
    best, chosen = fits[0]
    sure = DOUBTED if len(fits) > 1 and fits[1][0] - best < NEAR else 1.0
    for (face, middle, panel), (_, inner) in zip(faces, chosen, strict=True):
        front = face == "skirt_front"
        twin = parts[panel].twin
        side = LEFT if (inner == "-") == front else RIGHT
        out[middle] = _renamed(out[middle], {f"side{mark}": f"princess{mark}" for mark in "+-"})
        out[panel] = _as_side_panel(parts[panel], inner, side, sure)
        if twin is not None:
            out[twin] = _as_side_panel(parts[twin], OTHER[inner], -side, sure)
    return out


def _has_sides(part: Part) -> bool:
    return all(part.roles.get(f"side{mark}") for mark in "+-")


def _renamed(part: Part, names: dict[str, str]) -> Part:
    roles: Roles = {names.get(role, role): run for role, run in part.roles.items()}
    return replace(part, roles=roles)


def _as_side_panel(part: Part, inner: str, side: int, sure: float) -> Part:
    return replace(_renamed(part, {f"side{inner}": "princess"}), side=side, sure=sure * part.sure)


def _fit(parts: Sequence[Part], faces: Sequence[tuple[str, int, int]], way: Way) -> float:
    """How far lengths and notches disagree, of all seams [m]."""
    seams = []
    for (_, middle, panel), (_, inner) in zip(faces, way, strict=True):
        seams.append((middle, f"side{OTHER[inner]}", panel, f"side{inner}"))
    (one, mark), (other, its) = way[0], way[-1]
    if len(faces) == 2:
        seams.append((one, f"side{OTHER[mark]}", other, f"side{OTHER[its]}"))
    else:  # its outer seam meets a front or back of one piece
        there = parts_of_kind(parts, "skirt_back" if faces[0][0] == "skirt_front" else "skirt_front")
        seams += [(one, f"side{OTHER[mark]}", middle, f"side{mark}") for middle in there]
    apart = 0.0
    for panel, role, against, its_role in seams:
        first = run_of(panel, parts[panel].roles.get(role, ()))
        second = run_of(against, parts[against].roles.get(its_role, ()), True)
        apart += abs(length_of(parts, first) - length_of(parts, second))
        apart += NOTCHES_APART if notches_agree(parts, first, second) < 1.0 else 0.0
    return apart

"""Runs of edges by role, and how surely two of them are sewn together by their lengths and notches."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.joints import Joint, notch_fractions
from warp_cloth.pattern.kinds import BOTH, LEFT, RIGHT, YOKE_OF
from warp_cloth.pattern.specification import Side

PLAIN_EASE = (-0.02, 0.02)  # longer side over shorter, less 1: as drafted
DOUBTED = 0.7  # factor on the confidence of a seam that has a rival, or that another piece may belong into
NOTCH_NEAR = 6e-3  # [m] between notches that belong together

FRONTS = ("front", "front_yoke", "skirt_front", "side_front", "side_skirt_front", "tier_front", "bib")

Run = tuple[int, ...]


def run_of(panel: int, run: Run, against: bool = False) -> tuple[Side, ...]:
    return tuple(Side(panel, edge) for edge in (run[::-1] if against else run))


def length_of(parts: Sequence[Part], run: Sequence[Side]) -> float:
    return sum(parts[side.panel].edges[side.edge].length for side in run)


def joint_of(
    parts: Sequence[Part],
    one: tuple[Side, ...],
    other: tuple[Side, ...],
    reason: str,
    ease: tuple[float, float] = PLAIN_EASE,
    sure: float = 1.0,
) -> list[Joint]:
    """A joint with its confidence; ``ease``: by how much the first side may be longer than the other, relatively."""
    if not one or not other:
        return []
    more = length_of(parts, one) / max(length_of(parts, other), 1e-9) - 1.0
    beyond = max(ease[0] - more, more - ease[1], 0.0)
    kinds = min(parts[side.panel].sure for side in (*one, *other))
    confidence = sure * kinds * float(np.clip(1.0 - 3.0 * beyond, 0.0, 1.0)) * notches_agree(parts, one, other)
    note = f"{reason}, {length_of(parts, one) * 1e3:.0f} to {length_of(parts, other) * 1e3:.0f} mm"
    return [Joint(one, other, round(confidence, 3), note)]


def notches_agree(parts: Sequence[Part], one: Sequence[Side], other: Sequence[Side]) -> float:
    """1.02 where notches of both sides meet, 0.97 where both have notches that do not; 1 where a side has none."""
    spots = []
    for run, against in ((one, False), (other, True)):
        reached, found = 0.0, []
        for side in run:
            length = parts[side.panel].edges[side.edge].length
            shares = notch_fractions(parts[side.panel], side.edge)
            found += (reached + length * (1.0 - shares[::-1] if against else shares)).tolist()
            reached += length
        spots.append(np.array(found) / reached * max(length_of(parts, one), length_of(parts, other)))
    if not len(spots[0]) or not len(spots[1]):
        return 1.0
    few, many = sorted(spots, key=len)
    met = sum(bool(np.abs(many - spot).min() <= NOTCH_NEAR + 0.02 * many.max()) for spot in few)
    return 1.02 if met == len(few) else 0.97


def parts_of_kind(parts: Sequence[Part], *kinds: str) -> list[int]:
    return [index for index, part in enumerate(parts) if part.kind in kinds]


def side_mark(part: Part, side: int) -> str:
    """The side of a whole piece's own frame that is on this side of the wearer: a back is seen from behind."""
    high = side == LEFT if part.kind in FRONTS else side == RIGHT
    return "+" if high else "-"


def role_of(parts: Sequence[Part], panel: int, role: str, side: int) -> Run:
    part = parts[panel]
    return part.roles.get(role + side_mark(part, side), ()) if part.side in (BOTH, side) else ()


def faces_of(parts: Sequence[Part], face: str) -> list[tuple[int, ...]]:
    """Each front, or back, with the side panels that go on where it ends: the middle panel first."""
    side_panels = parts_of_kind(parts, f"side_{face}")
    return [
        (
            middle,
            *(
                panel
                for panel in side_panels
                if BOTH in (parts[middle].side, parts[panel].side) or parts[panel].side == parts[middle].side
            ),
        )
        for middle in parts_of_kind(parts, face)
    ]


def face_run(
    parts: Sequence[Part], face: Sequence[int], role: str, side: int, against: bool = False
) -> tuple[Side, ...]:
    """The edges of a role on one side of a front or back of one or several panels, as the loop runs or against it.

    It goes on in its yoke, if there is one.
    """
    runs = [run_of(panel, role_of(parts, panel, role, side)) for panel in face]
    if "top" in parts[face[0]].roles and parts[face[0]].side in (BOTH, side):
        yokes = parts_of_kind(parts, YOKE_OF[parts[face[0]].kind]) if role in ("armhole", "shoulder") else []
        runs = [*(run for yoke in yokes if (run := run_of(yoke, role_of(parts, yoke, role, side)))), *runs]
    if side_mark(parts[face[0]], side) == "+":  # there the loop runs up the side to the neck
        runs = runs[::-1]
    whole = tuple(each for run in runs for each in run)
    return whole[::-1] if against else whole

"""The line along which a piece is sewn: its sew line, or its cut line without the seam allowance; notches cut into it.

Sew lines come as one loop, or edge by edge: then they stop before the corners, or run on to the cut line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.pattern.corner_ends import mitred
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.dxf_drawn import CUT, FOLD, SEW, Drawn
from warp_cloth.pattern.labels import name_of
from warp_cloth.pattern.lattice import inside
from warp_cloth.pattern.loops import area_of, chained, cleaned, gaps_of, inset
from warp_cloth.pattern.marks import NO_POINTS
from warp_cloth.pattern.notched import unnotched
from warp_cloth.pattern.specification import LARGEST, NO_LENGTH, SMALLEST, short

OPEN_GAP = 2e-3  # [m] that an outline may be open without a note
WIDEST_ALLOWANCE = 0.08  # [m] from cut to sew line, at a hem
MOST_PAIRS = 2_000_000  # of a point and a side that are measured
LEAST_THICK = 0.1  # of its extent squared, the area of an outline of which one side is not drawn
SAME_LINE = 2e-3  # relative, of the areas of a sew line and a cut line that are one
SAME_SHARE = 0.5  # of the area of the largest loop: others are of other sizes


@dataclass(frozen=True, eq=False)
class SewnLine:
    """The line to sew along [m], the ends of the lines that draw it, and loops of the cut line within it."""

    points: Floats  # counter-clockwise, shape [n, 2]
    ends: Floats
    inner: list[Floats]
    notches: Floats  # that were cut into the outline, shape [N, 2]
    notes: tuple[str, ...]


def sewn_line(file: str, drawn: Drawn, metres: float, allowance: float) -> SewnLine:
    """The sew line of a piece, or its cut line without the stated allowance.

    Args:
        file: for messages.
        drawn: the piece.
        metres: metres in a unit of the file.
        allowance: [m].

    Raises:
        InputError: no outline is closed, or its size is impossible.
    """
    place, notes = f'{file}: piece "{short(name_of(drawn))}"', list[str]()
    cut, within = _cut_line(drawn, metres, notes)
    sew_lines = mitred(drawn.lines.get(SEW, []))
    sew = _sew_line(drawn, sew_lines, metres, cut, notes)
    if cut is None and sew is None:
        raise InputError(place, "its outline is not closed", "close the line on layer 1 (the cut line)")
    loop = sew if sew is not None else cut
    assert loop is not None
    loop, notches = unnotched(loop)
    ends = [metres * line[[0, -1]] for line in (sew_lines if sew is not None else drawn.lines[CUT])]
    if sew is None and allowance > 0.0:
        inner = cleaned(inset(loop, allowance), NO_LENGTH)
        if len(inner) < 3 or not 0.0 < area_of(inset(loop, allowance)) < area_of(loop):
            raise InputError(place, f"is too narrow for a seam allowance of {1e3 * allowance:g} mm", "make it smaller")
        loop, ends = inner, []
    extent = float(np.ptp(loop, axis=0).max())
    if not SMALLEST <= extent <= LARGEST:
        raise InputError(place, f"is {1e3 * extent:.4g} mm across, which no piece is", "check the unit of the file")
    if area_of(loop) < 1e-4 * extent**2:
        raise InputError(place, "its outline has no area", "correct it")
    if not 1 < len(ends) < 0.25 * len(loop):  # each side is a line of its own, or all are one
        ends = []
    return SewnLine(loop, np.concatenate(ends) if ends else NO_POINTS, within, notches, tuple(notes))


def closed_loops(lines: Sequence[Floats], metres: float) -> list[Floats]:
    """Loops that lines draw [m]."""
    loops = [cleaned(metres * loop, NO_LENGTH) for loop in chained(lines)]
    return [loop for loop in loops if len(loop) > 2]


def _cut_line(drawn: Drawn, metres: float, notes: list[str]) -> tuple[Floats | None, list[Floats]]:
    """The largest loop of the cut line, and the smaller ones within it."""
    lines = drawn.lines.get(CUT, [])
    closed = closed_loops(lines, metres) or closed_loops([*lines, *drawn.lines.get(FOLD, [])], metres)
    if not closed and len(lines) == 1:  # a line that ends where only its first side is missing
        loop = cleaned(metres * lines[0], NO_LENGTH)
        thick = len(loop) > 3 and area_of(loop) > LEAST_THICK * float(np.ptp(loop, axis=0).max()) ** 2
        closed = [loop] if thick else []
    if not closed:
        return None, []
    cut = max(closed, key=area_of)
    (gap,) = gaps_of([metres * line for line in lines], [cut])
    if gap > OPEN_GAP:
        notes.append(f"its outline was open by {1e3 * gap:.0f} mm: closed")
    others = [loop for loop in closed if loop is not cut]
    alike = [loop for loop in others if area_of(loop) >= SAME_SHARE * area_of(cut)]
    if alike:
        notes.append(f"{len(alike) + 1} outlines lie in each other: the largest is used")
    return cut, [loop for loop in others if area_of(loop) < SAME_SHARE * area_of(cut)]


def _sew_line(
    drawn: Drawn, lines: Sequence[Floats], metres: float, cut: Floats | None, notes: list[str]
) -> Floats | None:
    """The loop of these sew lines that goes round the piece."""
    if not lines:
        return None
    closed = closed_loops(lines, metres)
    if not closed or (cut is not None and max(map(area_of, closed)) < SAME_SHARE * area_of(cut)):
        # not drawn along the fold
        closed += closed_loops(mitred([*drawn.lines[SEW], *drawn.lines.get(FOLD, [])]), metres)
    if cut is None:
        return max(closed, key=area_of, default=None)
    areas = [area_of(loop) / area_of(cut) for loop in closed]
    if any(area > 1.0 + SAME_LINE for area in areas):
        notes.append("layer 14 has outlines larger than the cut line: not taken as sew lines")
        return None
    around = [loop for loop in closed if goes_round(loop, cut)]
    if not around:
        notes.append("its sew line does not go round it: the cut line is used")
    return max(around, key=area_of, default=None)


def goes_round(sew: Floats, cut: Floats) -> bool:
    """Whether a loop is a cut line less a seam allowance: within it, and nowhere far from it."""
    if area_of(sew) >= (1.0 - SAME_LINE) * area_of(cut):
        return True
    if inside(cut, sew).mean() < 0.9:
        return area_of(sew) > SAME_SHARE * area_of(cut)
    along = np.roll(sew, -1, axis=0) - sew
    square = np.maximum((along**2).sum(axis=1), 1e-300)
    away = cut[:: 1 + len(cut) * len(sew) // MOST_PAIRS, None] - sew[None]
    share = np.clip((away * along).sum(axis=2) / square, 0.0, 1.0)
    apart = np.hypot(*np.moveaxis(away - share[..., None] * along, 2, 0)).min(axis=1)
    return bool(apart.max() <= WIDEST_ALLOWANCE)

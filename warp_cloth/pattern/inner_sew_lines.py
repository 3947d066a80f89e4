"""Sew lines that are drawn as inner lines (layer 8), as Valentina's AAMA files have them, put where they belong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.dxf_drawn import CUT, INTERNAL, SEW, Drawn
from warp_cloth.pattern.loops import area_of
from warp_cloth.pattern.sewn_line import closed_loops, goes_round

MOST_PIECES = 0.5  # of a file's, that have such a line: in a few it is a seam for looks
FEWEST_LINES = 3  # points of a line that is closed by itself


def with_inner_sew_lines(pieces: Sequence[Drawn], metres: float) -> tuple[list[Drawn], list[str]]:
    """The pieces, inner loops that run along the cut line all round as their sew lines, and a note on it.

    Only where no piece of the file has a sew line, and most have such a loop.

    Args:
        pieces: all of a file.
        metres: metres in a unit of the file.
    """
    if any(SEW in piece.lines for piece in pieces):
        return list(pieces), []
    sew_lines = [_sew_line(piece, metres) for piece in pieces]
    count = sum(line is not None for line in sew_lines)
    if not count or count < MOST_PIECES * len(pieces):
        return list(pieces), []
    out = []
    for piece, line in zip(pieces, sew_lines, strict=True):
        if line is not None:
            rest = [each for each in piece.lines[INTERNAL] if each is not line]
            piece = replace(piece, lines=piece.lines | {INTERNAL: rest, SEW: [line]})
        out.append(piece)
    return out, [f"the sew lines of {count} of {len(pieces)} pieces are drawn as inner lines (layer 8): taken as such"]


def _sew_line(piece: Drawn, metres: float) -> Floats | None:
    """The inner line of a piece that is its sew line, the outermost if there are several."""
    cut = max(closed_loops(piece.lines.get(CUT, []), metres), key=area_of, default=None)
    if cut is None:
        return None
    found: list[tuple[float, Floats]] = []
    for line in piece.lines.get(INTERNAL, []):
        loops = closed_loops([line], metres) if len(line) > FEWEST_LINES else []
        if loops and area_of(loops[0]) <= area_of(cut) and goes_round(loops[0], cut):
            found.append((area_of(loops[0]), line))
    return max(found, key=lambda each: each[0], default=(0.0, None))[1]

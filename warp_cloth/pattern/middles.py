"""Middle panels of fronts and backs that their names do not tell, next to side panels whose names do.

"SIDE BACK" may be the side panel of a back, or the back on the wearer's right; it is the latter only where nothing
could be the middle of the former.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from warp_cloth.pattern.bodices import bodice_roles
from warp_cloth.pattern.kinds import SIDE_PANEL, Named
from warp_cloth.pattern.panel_roles import middle_side, side_panel_roles
from warp_cloth.pattern.piece import Piece
from warp_cloth.pattern.roles import Shape, upright

SMALLEST = 0.5  # of a side panel's area, of a piece that may be the middle one next to it: a pocket is smaller
ALIKE = 0.04  # relative difference of the lengths of a princess seam's edges
SURE = 0.85  # of what these seams tell


def with_middles(pieces: Sequence[Piece]) -> tuple[list[Piece], list[str]]:
    """The pieces, with middle panels told by the seams that side panels have; and notes on that.

    Side panels where no piece could be the middle one are taken for fronts or backs on one side of the wearer.
    """
    out = list(pieces)
    faces = [face for face in ("front", "back") if _side_panels(pieces, face) and not _has_middle(pieces, face)]
    unknown = [index for index, piece in enumerate(pieces) if not (piece.what.kind or piece.what.panel)]
    fits: dict[str, list[int]] = {}
    for face in faces:
        panels = _side_panels(pieces, face)
        smallest = SMALLEST * min(_area(pieces[panel]) for panel in panels)
        large = [index for index in unknown if _area(pieces[index]) >= smallest]
        if not large:
            for panel in panels:
                out[panel] = replace(pieces[panel], what=replace(pieces[panel].what, panel=""))
        fits[face] = [
            index for index in large if all(_are_sewn(pieces[index], pieces[panel], face) for panel in panels)
        ]
    told = []
    for face, own in fits.items():
        if len(own) == 1 and sum(own[0] in others for others in fits.values()) == 1:
            out[own[0]] = replace(pieces[own[0]], what=Named(face, pieces[own[0]].what.side, sure=SURE))
            told.append(f"{pieces[own[0]].name}: {face}")
    return out, [f"by the seams of the panels next to it, {', '.join(told)}"] if told else []


def _side_panels(pieces: Sequence[Piece], face: str) -> list[int]:
    return [n for n, piece in enumerate(pieces) if piece.what.panel == SIDE_PANEL and piece.what.kind == face]


def _has_middle(pieces: Sequence[Piece], face: str) -> bool:
    return any(piece.what.kind == face and not piece.what.panel for piece in pieces)


def _area(piece: Piece) -> float:
    return abs(sum(edge.area for edge in piece.edges))


def _are_sewn(middle: Piece, panel: Piece, face: str) -> bool:
    """Whether a piece has a neck, and a princess seam on each side that it has, as long as a side panel's."""
    whole = middle.mirror is not None
    shape = Shape(middle.edges, upright(middle.edges, face))
    side = Shape(panel.edges, upright(panel.edges, f"side_{face}"))
    if min(len(shape.order), len(side.order)) < 4:
        return False
    roles = bodice_roles(shape, whole, middle_side)
    seams = [run for mark in "+-" if (run := roles.get(f"princess{mark}"))]
    hollow = any(shape.is_concave(k) for k in roles.get("neck", ()))
    long = side.length(side_panel_roles(side).get("princess", ()))
    alike = all(abs(shape.length(run) - long) <= ALIKE * long for run in seams)
    return hollow and alike and len(seams) == (2 if whole else 1) and (whole or bool(roles.get("centre")))

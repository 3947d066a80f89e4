"""Bands of one panel that a specification places flat: laid as rings where they are sewn on.

A collar, cuff or waistband whose ends are sewn to each other goes round a limb. Placed flat, on one side of that limb
or through it, it would be sewn next to it, and where its edges lie does not tell which way round they are sewn. What it
is sewn to lies round the limb already, so the band starts there, going on where that ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.seam import Piece, Seam
from warp_cloth.pattern.sewing import seams_of
from warp_cloth.pattern.specification import Panel, Pattern, Side, short
from warp_cloth.pattern.wrap import Ring

NARROW = 0.35  # height of a band over its length at most: sleeves are wider
OPEN = 0.5  # of its length, by which the ends of a band are apart where it is placed flat
AGREE = 0.3  # length of the mean direction in which what a band is sewn to goes on; shorter where it lies flat
SAMPLES = 17  # of each piece of an edge
BEYOND = 1e-3  # [m] from an edge, to tell in which direction a panel goes on


def with_rings(pattern: Pattern) -> Pattern:
    """The pattern, its flat bands of one panel laid as rings onto what they are sewn to."""
    bands = {index: sides for index in range(len(pattern.panels)) if (sides := _band(pattern, index)) is not None}
    if not bands:
        return pattern
    seams, panels, told = seams_of(pattern, misplaced=bands), list(pattern.panels), []
    while bands:
        found = {}
        for index, (ends, run) in bands.items():
            ring = _ring(panels, seams, index, ends, run, waiting=bands.keys() - {index})
            if ring is not None:
                found[index] = ring
        if not found:
            break
        for index, ring in found.items():
            panels[index] = replace(panels[index], wrap=ring)
            told.append(
                f'panel "{short(panels[index].name)}" is a band placed flat: it starts as a ring where it is sewn'
            )
            del bands[index]
    return replace(pattern, panels=tuple(panels), notes=(*pattern.notes, *told))


def _band(pattern: Pattern, index: int) -> tuple[tuple[int, int], tuple[int, ...]] | None:
    """The ends of a flat band that are sewn to each other, and the run between them that is sewn to other panels."""
    panel, count = pattern.panels[index], len(pattern.panels[index].edges)
    inner = [stitch.sides for stitch in pattern.stitches if all(side.panel == index for side in stitch.sides)]
    if panel.wrap is not None or panel.cut_out or len(inner) != 1 or inner[0][0] == inner[0][1]:
        return None
    one, other = (side.edge for side in inner[0])
    sewn = {side for stitch in pattern.stitches for side in stitch.sides}
    for first, last in ((one, other), (other, one)):
        run = tuple((first + step) % count for step in range(1, (last - first) % count))
        if run and all(Side(index, edge) in sewn for edge in run) and _is_flat_band(panel, (first, last), run):
            return (first, last), run
    return None


def _is_flat_band(panel: Panel, ends: tuple[int, int], run: Sequence[int]) -> bool:
    """Whether a panel is long and narrow, its ends far apart as it is placed."""
    length = sum(panel.edges[edge].curve.length for edge in run)
    height = max(panel.edges[edge].curve.length for edge in ends)
    middles = panel.placed(np.concatenate([panel.edges[edge].curve.at(np.array([0.5])) for edge in ends]))
    return height < NARROW * length and float(np.linalg.norm(middles[1] - middles[0])) > OPEN * length


@dataclass(frozen=True, eq=False)
class _Sewn:
    """A piece of a band's edge, and points of the other panel there, and beyond it [m], shape [SAMPLES, 3]."""

    piece: Piece
    places: Floats
    beyond: Floats


def _ring(
    panels: Sequence[Panel],
    seams: Sequence[Seam],
    index: int,
    ends: tuple[int, int],
    run: Sequence[int],
    *,
    waiting: set[int],
) -> Ring | None:
    """A band as a ring on the seams of its run; None while a panel there is ``waiting`` to be laid itself."""
    panel = panels[index]
    pairs = [
        (seam, which)
        for seam in seams
        for which, piece in enumerate(seam.pieces)
        if piece.side.panel == index and piece.side.edge in run
    ]
    if any(seam.pieces[1 - which].side.panel in waiting for seam, which in pairs):
        return None
    sewn = [_sewn_to(panels, seam, which) for seam, which in pairs]
    sewn.sort(key=lambda each: (run.index(each.piece.side.edge), each.piece.low))
    lengths = [panel.edges[each.piece.side.edge].curve.length * (each.piece.high - each.piece.low) for each in sewn]
    starts = np.cumsum([0.0, *lengths])
    shares = np.linspace(0.0, 1.0, SAMPLES)
    along = np.concatenate([start + shares * length for start, length in zip(starts, lengths, strict=False)])
    places = np.concatenate([each.places for each in sewn])
    beyond = np.concatenate([each.beyond for each in sewn])
    weights = np.repeat(lengths, SAMPLES)
    up = (weights[:, None] * beyond).sum(axis=0) / weights.sum()
    if float(np.linalg.norm(up)) < AGREE:
        middle = places.mean(axis=0)
        up = np.cross(places - middle, np.roll(places, -1, axis=0) - middle).sum(axis=0)
        up = up * np.sign(up @ (panel.placed(_points(panel, range(len(panel.edges)))).mean(axis=0) - middle))
    length = float(np.linalg.norm(up))
    if not length > 0.0:
        return None
    at = np.concatenate([panel.edges[each.piece.side.edge].curve.at(
        each.piece.low + shares * (each.piece.high - each.piece.low)) for each in sewn])  # fmt: skip
    first, last = (_points(panel, [edge]) for edge in ends)
    return Ring.of(first, last, at, along / starts[-1], places, up / length)


def _sewn_to(panels: Sequence[Panel], seam: Seam, which: int) -> _Sewn:
    piece, there = seam.pieces[which], seam.pieces[1 - which]
    other = panels[there.side.panel]
    shares = np.linspace(0.0, 1.0, SAMPLES)
    shares = there.low + (shares[::-1] if seam.reverse else shares) * (there.high - there.low)
    points = other.edges[there.side.edge].curve.at(shares)
    along = np.gradient(points, axis=0) * (-1.0 if seam.reverse else 1.0) * np.sign(other.area)
    aside = np.column_stack([along[:, 1], -along[:, 0]]) / np.maximum(np.hypot(*along.T), 1e-12)[:, None]
    places = other.placed(points)
    beyond = (other.placed(points + BEYOND * aside) - places) / BEYOND
    return _Sewn(piece, places, beyond)


def _points(panel: Panel, edges: Sequence[int]) -> Floats:
    return np.concatenate([panel.edges[edge].curve.at(np.linspace(0.0, 1.0, SAMPLES)) for edge in edges])

"""Short edges between others that no seam needs, left out: a mesh would be as fine there, and rest no sooner."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from warp_cloth.pattern.curve import Curve, Floats
from warp_cloth.pattern.specification import Edge, Panel, Pattern, Side, short

SHORT = 1e-3  # [m]; as wide as a drawn line
FEWEST = 4  # edges of an outline that may lose one


def without_short_edges(pattern: Pattern) -> Pattern:
    """The pattern less edges up to SHORT that are not sewn, next to one that is not; that one takes their place.

    So seams keep their lengths. Each is told in ``notes``.
    """
    sewn = {side for stitch in pattern.stitches for side in stitch.sides}
    panels, places, notes = [], {}, list(pattern.notes)
    for index, panel in enumerate(pattern.panels):
        own = [number for number in range(len(panel.edges)) if Side(index, number) in sewn]
        edges = _kept(panel, own)
        gone = [edge for edge in panel.edges if edge.number not in {kept.number for kept in edges}]
        for edge in gone:
            told = f"is {1e3 * edge.curve.length:.2g} mm long and not sewn: dropped"
            notes.append(f'panel "{short(panel.name)}", edge {edge.number} {told}')
        place = {edge.number: new for new, edge in enumerate(edges)}
        for old, edge in enumerate(panel.edges):
            if edge.number in place:
                places[Side(index, old)] = Side(index, place[edge.number])
        panels.append(replace(panel, edges=tuple(edges)) if gone else panel)
    if len(notes) == len(pattern.notes):
        return pattern
    stitches = [replace(each, sides=(places[each.sides[0]], places[each.sides[1]])) for each in pattern.stitches]
    return replace(pattern, panels=tuple(panels), stitches=tuple(stitches), notes=tuple(notes))


def _kept(panel: Panel, sewn: Collection[int]) -> list[Edge]:
    """The panel's edges less those that are left out; ``sewn``: places of those that are sewn."""
    edges = [(edge, place in sewn) for place, edge in enumerate(panel.edges)]
    place = 0
    while place < len(edges):
        (edge, is_sewn), before, after = edges[place], place - 1, (place + 1) % len(edges)
        free = [each for each in (before, after) if not edges[each][1]]
        if is_sewn or not free or edge.curve.length > SHORT or len(edges) < FEWEST:
            place += 1
            continue
        other, _ = edges[free[0]]
        moved = (-1, edge.curve.end) if free[0] == before else (0, edge.curve.start)
        edges[free[0]] = replace(other, curve=_with_end(other.curve, *moved)), False
        del edges[place]
    return [edge for edge, _ in edges]


def _with_end(curve: Curve, end: int, point: Floats) -> Curve:
    """The curve with its start (0) or end (-1) at a point."""
    points = curve.points.copy()
    points[end] = point
    return Curve(points, curve.turn)

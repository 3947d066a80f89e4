"""Edges in the order of the loops that they draw, however a file lists them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.specification import NO_LENGTH

Ends = Sequence[tuple[int, int]]  # the vertices at which each edge starts and ends


def loops_of(ends: Ends, corners: Floats) -> tuple[list[list[tuple[int, bool]]], bool]:
    """The closed loops of edges, the outline first, and whether they were put in order.

    Each is a list of an edge's number and whether it runs against the loop; vertices [m], shape [N, 2], in one place
    are taken as one where loops do not close otherwise. No loops: the edges draw none, or come to a vertex twice.
    """
    if len({start for start, _ in ends}) == len(ends) and all(
        ends[number - 1][1] == start for number, (start, _) in enumerate(ends)
    ):
        return [[(number, False) for number in range(len(ends))]], False
    loops = _walked(ends)
    if not loops:
        loops = _walked([(_first(corners, a), _first(corners, b)) for a, b in ends])
    if len(loops) > 1:
        loops = _outline_first(loops, ends, corners)
    in_order = all(not turned for loop in loops for _, turned in loop) and all(
        [number for number, _ in loop] == list(range(loop[0][0], loop[0][0] + len(loop))) for loop in loops
    )
    return loops, not in_order


def _first(corners: Floats, vertex: int) -> int:
    """The first vertex in the same place."""
    return int(np.flatnonzero(np.hypot(*(corners - corners[vertex]).T) <= NO_LENGTH)[0])


def _walked(ends: Ends) -> list[list[tuple[int, bool]]]:
    at: dict[int, list[int]] = {}
    for number, (a, b) in enumerate(ends):
        if a == b:
            return []
        at.setdefault(a, []).append(number)
        at.setdefault(b, []).append(number)
    if any(len(edges) != 2 for edges in at.values()):
        return []
    free, loops = set(range(len(ends))), []
    while free:
        number = min(free)
        loop, turned = [], False
        while number in free:
            free.remove(number)
            loop.append((number, turned))
            tip = ends[number][0 if turned else 1]
            number = next(each for each in at[tip] if each != number) if len(set(at[tip])) == 2 else number
            turned = ends[number][0] != tip
        loops.append(loop)
    return loops


def _outline_first(loops: list[list[tuple[int, bool]]], ends: Ends, corners: Floats) -> list[list[tuple[int, bool]]]:
    """The loops with the one of the largest extent first, if it encloses the others; none otherwise."""
    boxes = []
    for loop in loops:
        points = corners[[vertex for number, _ in loop for vertex in ends[number]]]
        boxes.append((points.min(axis=0), points.max(axis=0)))
    outline = max(range(len(loops)), key=lambda k: float(np.prod(boxes[k][1] - boxes[k][0])))
    low, high = boxes[outline]
    if not all((low <= own_low).all() and (own_high <= high).all() for own_low, own_high in boxes):
        return []
    return [loops[outline], *(loop for k, loop in enumerate(loops) if k != outline)]

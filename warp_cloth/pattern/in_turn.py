"""The order in which an edge is sewn to runs of edges of several panels, one after another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.specification import Pattern, Side

Run = tuple[Side, ...]
_End = tuple[int, int]  # a run, and 0 for the end where it starts, 1 for the other


@dataclass(frozen=True)
class InTurn:
    """The runs that an edge is sewn to, in its direction."""

    order: tuple[int, ...]  # numbers of the runs
    reverse: tuple[bool | None, ...]  # whether each is met from its end; None: not known
    cuts: tuple[float, ...]  # where on the edge each begins, and the last one ends, of its length


def runs_in_turn(
    pattern: Pattern,
    side: Side,
    runs: Sequence[Run],
    places: Sequence[float],
    lengths: Floats,
    stated: Sequence[bool | None],
) -> InTurn:
    """The runs of edges that an edge is sewn to, one after another.

    Runs that follow each other along an edge end at one seam: their panels' next edges are sewn to each other, as the
    sides of a skirt below a waistband. Where these seams lead through all runs, they decide, as the placement of a band
    that lies flat does not; which run is the first, and which way round, is as ``stated``, of each run whether it is
    met from its end, else what is nearest as placed. Else only ``places`` tell, where along the edge, from 0 to 1, each
    run lies nearest.
    """
    placed = tuple(sorted(range(len(runs)), key=lambda k: (places[k], k)))
    chain, is_ring = _chain(_links(pattern, runs), len(runs))
    if len(chain) < len(runs):
        return InTurn(placed, (None,) * len(runs), _cuts(lengths, placed))
    turns = [chain[k:] + chain[:k] for k in range(len(chain))] if is_ring else [chain]
    turns += [[(run, 1 - end) for run, end in turn[::-1]] for turn in turns]
    turns = [turn for turn in turns if all(stated[run] in (None, bool(end)) for run, end in turn)] or turns
    ways = [
        InTurn(order, tuple(bool(end) for _, end in turn), _cuts(lengths, order))
        for turn in turns
        if (order := tuple(run for run, _ in turn))
    ]
    middles = np.array([_middle(pattern, run) for run in runs])

    def apart(way: InTurn) -> float:
        spots = pattern.panels[side.panel].placed(
            pattern.panels[side.panel].edges[side.edge].curve.at(0.5 * (np.array(way.cuts[:-1]) + way.cuts[1:]))
        )
        return float(np.linalg.norm(spots - middles[list(way.order)], axis=1).sum())

    best = min(ways, key=apart)
    kept = next((way for way in ways if way.order == placed), None)
    return best if kept is None else InTurn(placed, (None,) * len(runs), kept.cuts)


def _cuts(lengths: Floats, order: Sequence[int]) -> tuple[float, ...]:
    """Where an edge is cut as the lengths of what it is sewn to divide it, of its length."""
    cuts = np.concatenate([[0.0], np.cumsum(lengths[list(order)]) / lengths.sum()])
    return (*(float(cut) for cut in cuts[:-1]), 1.0)


def _middle(pattern: Pattern, run: Run) -> Floats:
    """The mean of the middles of a run's edges, as placed [m]."""
    panel = pattern.panels[run[0].panel]
    points = [panel.placed(panel.edges[each.edge].curve.at(np.array([0.5]))) for each in run]
    return np.asarray(np.mean(points, axis=(0, 1)))


def _links(pattern: Pattern, runs: Sequence[Run]) -> list[tuple[_End, _End]]:
    """Ends of runs whose panels' next edges are sewn to each other."""
    beyond: dict[Side, list[_End]] = {}
    for number, run in enumerate(runs):
        count = len(pattern.panels[run[0].panel].edges)
        for end, edge in enumerate((run[0].edge - 1, run[-1].edge + 1)):
            beyond.setdefault(Side(run[0].panel, edge % count), []).append((number, end))
    found: dict[tuple[_End, _End], None] = {}
    for stitch in pattern.stitches:
        for one in beyond.get(stitch.sides[0], ()):
            for other in beyond.get(stitch.sides[1], ()):
                if one[0] != other[0]:
                    found[min(one, other), max(one, other)] = None
    return list(found)


def _chain(links: Sequence[tuple[_End, _End]], count: int) -> tuple[list[_End], bool]:
    """The runs from link to link, each with the end at which it is entered, and whether the last leads to the first.

    No run where an end has two links.
    """
    following: dict[_End, _End] = {}
    for one, other in links:
        if one in following or other in following:
            return [], False
        following[one], following[other] = other, one
    loose = [(run, end) for run in range(count) for end in (0, 1) if (run, end) not in following]
    at = loose[0] if loose else (0, 0)
    chain: list[_End] = []
    while at[0] not in {run for run, _ in chain}:
        chain.append(at)
        after = following.get((at[0], 1 - at[1]))
        if after is None:
            return chain, False
        at = after
    return chain, True

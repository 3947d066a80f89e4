"""A part's edges parted where only some of their length is sewn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.joints import notch_fractions

AT_END = 2e-3  # [m] from an edge's end, within which nothing is parted off
ON_EDGE = 2e-3  # [m] from the end of a line within a part to the edge that it marks


def marks_along(part: Part, run: Sequence[int]) -> list[float]:
    """Where notches, ends of inner lines and corners are along a run of edges, as lengths from its start [m]."""
    found = []
    reached = 0.0
    for k in run:
        edge = part.edges[k]
        found += [reached + edge.length * share for share in notch_fractions(part, k).tolist()]
        shares = np.linspace(0.0, 1.0, 257)
        points = edge.at(shares)
        for line in part.lines:
            for end in (line[0], line[-1]):
                apart = np.hypot(*(points - end).T)
                if apart.min() < max(ON_EDGE, edge.length / 256):
                    found.append(reached + edge.length * float(shares[int(apart.argmin())]))
        reached += edge.length
        found.append(reached)
    found = sorted(mark for mark in found if AT_END < mark < reached - AT_END)
    return [mark for n, mark in enumerate(found) if not n or mark - found[n - 1] > AT_END]


def parted(part: Part, run: Sequence[int], places: Sequence[float]) -> tuple[Part, list[tuple[int, ...]]]:
    """A part whose edges end at places along a run [m], too, renumbered; and the run in pieces between the places.

    The part is no longer told as symmetric.
    """
    cuts: dict[int, list[float]] = {}
    owner: list[tuple[int, int]] = []  # of each piece of an edge of the run: the edge, and which piece of the run
    reached, group = 0.0, 0
    waiting = sorted(places)
    for k in run:
        length = part.edges[k].length
        shares = []
        owner.append((k, group))
        while waiting and waiting[0] < reached + length - AT_END:
            place = waiting.pop(0)
            group += 1
            if place <= reached + AT_END:
                owner[-1] = (k, group)
            else:
                shares.append((place - reached) / length)
                owner.append((k, group))
        cuts[k] = shares
        reached += length
    edges: list[Chain] = []
    numbers: dict[int, tuple[int, ...]] = {}
    for k, edge in enumerate(part.edges):
        ends = [0.0, *cuts.get(k, ()), 1.0]
        numbers[k] = tuple(range(len(edges), len(edges) + len(ends) - 1))
        edges += [edge.part(a, b) for a, b in pairwise(ends)] if len(ends) > 2 else [edge]
    pieces: list[list[int]] = [[] for _ in range(len(places) + 1)]
    seen: dict[int, int] = {}
    for k, which in owner:
        pieces[which].append(numbers[k][seen.get(k, 0)])
        seen[k] = seen.get(k, 0) + 1
    roles = {role: tuple(new for k in own for new in numbers[k]) for role, own in part.roles.items()}
    whole = replace(part, edges=tuple(edges), numbers=tuple(range(len(edges))), mirror=None, roles=roles)
    return whole, [tuple(piece) for piece in pieces]

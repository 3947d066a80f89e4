"""Joints, what is sewn to what along whole runs of edges, and the stitches of single edges that they come to."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NoReturn

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.shared_cuts import LEAST, Pair, Span, shared_cuts
from warp_cloth.pattern.specification import Side, Stitch, short

SAME_PLACE = (0.03, 0.015)  # of a joint's length, and [m]: corners of both sides that are sewn together
TO_NOTCH = 0.04  # of a joint's length, to a notch at which the other side's corner is sewn


@dataclass(frozen=True)
class Joint:
    """Two runs of edges that are sewn together; the ``other`` in the order in which they meet the first, each
    against its own direction."""

    one: tuple[Side, ...]
    other: tuple[Side, ...]
    confidence: float = 1.0
    reason: str = "stated"
    right_to_wrong: bool = False
    is_layer: bool = False  # one of several of the same seam


@dataclass(frozen=True)
class StatedSeam:
    """A seam as a scene states it: two sides, such as "FRONT 3" and "BACK 5 + BACK 6", or more: layers."""

    sew: tuple[str, ...]
    right_to_wrong: bool = False


def side_text(parts: Sequence[Part], run: Sequence[Side]) -> str:
    """A run of edges as scenes state it."""
    return " + ".join(f"{parts[side.panel].name} {parts[side.panel].numbers[side.edge]}" for side in run)


def stated_joints(file: str, parts: Sequence[Part], seams: Sequence[StatedSeam]) -> tuple[Joint, ...]:
    """The joints that a scene states.

    Raises:
        InputError: a piece or an edge is not there, or is sewn twice.
    """
    used: dict[Side, int] = {}
    joints = []
    for number, seam in enumerate(seams):
        place = f"{file}: seam {number}"
        runs = [_run(place, text, parts) for text in seam.sew]
        for side in (side for run in runs for side in run):
            if side in used:
                name = side_text(parts, [side])
                remedy = "sew each edge once; a seam of three panels is one seam of three sides"
                _refuse(place, f'"{short(name)}" is sewn by seam {used[side]}, too', remedy)
            used[side] = number
        for layer in runs[1:]:
            other = layer[::-1] if _one_panel(layer) else layer
            joints.append(Joint(runs[0], other, 1.0, "stated", seam.right_to_wrong, len(runs) > 2))
    return tuple(_in_order(parts, joints))


def _refuse(place: str, problem: str, remedy: str) -> NoReturn:
    raise InputError(place, problem, remedy)


def _one_panel(run: Sequence[Side]) -> bool:
    return len({side.panel for side in run}) == 1


def _run(place: str, text: str, parts: Sequence[Part]) -> tuple[Side, ...]:
    """The edges that a text names, those of one panel in the order of its loop."""
    sides = []
    names = {part.name: index for index, part in enumerate(parts)}
    for entry in text.split(" + ") if " + " in text else text.split("+"):
        found = re.fullmatch(r"\s*(.*\S)[\s:]+(\d{1,6})\s*", entry)
        if found is None:
            _refuse(place, f'"{short(entry)}" names no edge', 'write "PIECE NUMBER", such as "FRONT 3"')
        name, number = found[1], int(found[2])
        if name not in names:
            listed = ", ".join(f'"{short(each)}"' for each in list(names)[:12])
            _refuse(place, f'there is no piece "{short(name)}"', f"the pieces are {listed}")
        numbers = parts[names[name]].numbers
        if number not in numbers:
            problem = f'piece "{short(name)}" has no edge {number}; its edges are 0 to {len(numbers) - 1}'
            _refuse(place, problem, "`warp-cloth pattern` draws the numbers")
        sides.append(Side(names[name], numbers.index(number)))
    if len(set(sides)) < len(sides):
        _refuse(place, f'"{short(text)}" names an edge twice', "name it once")
    if not _one_panel(sides):
        return tuple(sides)
    count = len(parts[sides[0].panel].edges)
    own = {side.edge for side in sides}
    first = next((edge for edge in sorted(own) if (edge - 1) % count not in own), min(own))
    return tuple(sorted(sides, key=lambda side: (side.edge - first) % count))


def _in_order(parts: Sequence[Part], joints: Sequence[Joint]) -> list[Joint]:
    """Joints whose runs go over several panels turned so that neighbours in a run meet at a corner that others sew."""
    corners = _Corners(parts, joints)
    out = []
    for joint in joints:
        one, other = joint.one, joint.other
        if len(other) > 1 and not _one_panel(other) and corners.breaks(other) > corners.breaks(other[::-1]):
            other = other[::-1]
        if len(one) > 1 and not _one_panel(one) and corners.breaks(one[::-1]) > corners.breaks(one):
            one = one[::-1]
        out.append(replace(joint, one=one, other=other))
    return out


class _Corners:
    """Corners of panels that joints of single edges sew together."""

    def __init__(self, parts: Sequence[Part], joints: Sequence[Joint]) -> None:
        self.counts = [len(part.edges) for part in parts]
        self.above: dict[tuple[int, int], tuple[int, int]] = {}
        for joint in joints:
            if len(joint.one) == len(joint.other):
                for a, b in zip(joint.one, joint.other, strict=True):
                    self._join((a.panel, a.edge), self._end(b))
                    self._join(self._end(a), (b.panel, b.edge))

    def _end(self, side: Side) -> tuple[int, int]:
        return side.panel, (side.edge + 1) % self.counts[side.panel]

    def _top(self, corner: tuple[int, int]) -> tuple[int, int]:
        while corner in self.above:
            corner = self.above[corner]
        return corner

    def _join(self, one: tuple[int, int], other: tuple[int, int]) -> None:
        a, b = self._top(one), self._top(other)
        if a != b:
            self.above[a] = b

    def breaks(self, run: Sequence[Side]) -> int:
        """Neighbours in a run, each taken against its direction, that do not meet."""
        return sum(self._top((a.panel, a.edge)) != self._top(self._end(b)) for a, b in pairwise(run))


@dataclass(frozen=True, eq=False)
class Cut:
    """Panels whose edges are cut so that each is sewn to one, with the stitches; see ``cut``."""

    edges: tuple[tuple[tuple[int, Chain], ...], ...]  # of each panel: number as drawn, and the curve
    stitches: tuple[Stitch, ...]


def cut(parts: Sequence[Part], joints: Sequence[Joint]) -> Cut:
    """Edges cut where a corner of what they are sewn to comes; at the nearest notch, if one is near.

    Both sides of a joint are divided as the lengths on the side that has the corner say, so that ease is spread evenly
    from one corner to the next.
    """
    at: dict[Side, set[float]] = {}
    found_pairs = [_pairs(parts, joint) for joint in joints]
    pairs = shared_cuts(found_pairs, lambda side: parts[side.panel].edges[side.edge].length)
    for side, low, _ in (span for own in pairs for pair in own for span in pair):
        at.setdefault(side, set()).add(low)
    places: dict[tuple[Side, float], int] = {}
    edges = []
    for index, part in enumerate(parts):
        made: list[tuple[int, Chain]] = []
        for k, edge in enumerate(part.edges):
            lows = sorted({0.0, *at.get(Side(index, k), ())})
            for low, high in zip(lows, [*lows[1:], 1.0], strict=True):
                places[Side(index, k), low] = len(made)
                made.append((part.numbers[k], edge if (low, high) == (0.0, 1.0) else edge.part(low, high)))
        edges.append(tuple(made))
    stitches = [
        Stitch(
            number,
            (Side(a.panel, places[a, low]), Side(b.panel, places[b, start])),
            joint.right_to_wrong,
            joint.is_layer,
        )
        for number, (joint, found) in enumerate(zip(joints, pairs, strict=True))
        for (a, low, _), (b, start, _) in found
    ]
    return Cut(tuple(edges), tuple(stitches))


def _pairs(parts: Sequence[Part], joint: Joint) -> list[Pair]:
    """Pieces of both sides that meet."""
    runs = []
    for run in (joint.one, joint.other):
        lengths = np.array([parts[side.panel].edges[side.edge].length for side in run])
        runs.append(np.concatenate([[0.0], np.cumsum(lengths)]) / lengths.sum())
    total = max(sum(parts[s.panel].edges[s.edge].length for s in run) for run in (joint.one, joint.other))
    least = LEAST / total
    near = max(min(SAME_PLACE[0], SAME_PLACE[1] / total), least)
    stops: list[tuple[float, float]] = [(0.0, 0.0)]
    a, b = [*map(float, runs[0][1:-1])], [*map(float, runs[1][1:-1])]
    while a or b:
        if a and b and abs(a[0] - b[0]) <= near:
            stops.append((a.pop(0), b.pop(0)))
        elif a and (not b or a[0] < b[0]):
            free = stops[-1][1], b[0] if b else 1.0
            stops.append((a[0], _to_notch(parts, joint.other, runs[1], a.pop(0), free, True)))
        else:
            free = stops[-1][0], a[0] if a else 1.0
            stops.append((_to_notch(parts, joint.one, runs[0], b[0], free, False), b.pop(0)))
    stops.append((1.0, 1.0))
    pairs = []
    for (low, start), (high, end) in pairwise(stops):
        one = _place(joint.one, runs[0], low, high, False)
        other = _place(joint.other, runs[1], start, end, True)
        pairs.append((one, other))
    return pairs


def _place(run: Sequence[Side], reach: Floats, low: float, high: float, against: bool) -> Span:
    """The edge of a run on which a piece lies, and the fractions of that edge from which to which it reaches."""
    index = int(np.clip(np.searchsorted(reach, 0.5 * (low + high)) - 1, 0, len(run) - 1))
    span = reach[index + 1] - reach[index]
    ends = (reach[index + 1] - high, reach[index + 1] - low) if against else (low - reach[index], high - reach[index])
    first, last = (float(end / span) for end in ends)
    return run[index], first if first > 1e-9 else 0.0, last if last < 1.0 - 1e-9 else 1.0


def _to_notch(
    parts: Sequence[Part], run: Sequence[Side], reach: Floats, place: float, free: tuple[float, float], against: bool
) -> float:
    """A place along a run, as a fraction, moved to the nearest notch if one is near; always within ``free``."""
    low, high = free[0] + 0.02 * (free[1] - free[0]), free[1] - 0.02 * (free[1] - free[0])
    place = min(max(place, low), high)
    index = int(np.clip(np.searchsorted(reach, place) - 1, 0, len(run) - 1))
    side, span = run[index], float(reach[index + 1] - reach[index])
    found = notch_fractions(parts[side.panel], side.edge)
    if not len(found):
        return place
    spots = reach[index] + span * (1.0 - found if against else found)
    nearest = float(spots[np.abs(spots - place).argmin()])
    return nearest if abs(nearest - place) <= TO_NOTCH and low < nearest < high else place


def notch_fractions(part: Part, k: int) -> Floats:
    """Where an edge has notches, as fractions of its length, in order."""
    edge = part.edges[k]
    found = []
    for notch in part.notches:
        fractions = np.linspace(0.0, 1.0, 257)
        apart = np.hypot(*(edge.at(fractions) - notch).T)
        if apart.min() < max(2e-3, edge.length / 256):
            found.append(float(fractions[int(apart.argmin())]))
    inner = sorted(share for share in found if 0.01 < share < 0.99)
    return np.array([share for n, share in enumerate(inner) if not n or share - inner[n - 1] > 0.005])

"""What is sewn to what: stitches as pairs of pieces of edges, each with its direction."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warp_cloth.pattern.specification import Pattern, Side, Stitch

# How many times nearer the ends of a stitch must be one way round than the other. In 2,271 stitches of 96 GarmentCode
# designs, whose loops all run counter-clockwise as seen from outside, the wrong way was never nearer by more than 1.1.
DECISIVE = 1.2  # the placement decides, whatever other stitches imply
CONTRARY = 1.1  # a stitch that runs along the loops shows that some loops run clockwise
# and then this decides between panels that no surer stitches have joined. With half of the loops reversed at random and
# no sides stated, 2,255 of the 2,271 were right (2,002 with DECISIVE alone).
LIKELY = 1.01


@dataclass(frozen=True)
class Piece:
    """A part of an edge, from one fraction of its length to another."""

    side: Side
    low: float = 0.0
    high: float = 1.0


@dataclass(frozen=True)
class Seam:
    """Two pieces that are sewn together over their whole lengths; ``reverse``: the first's start to the second's end.

    Loops run counter-clockwise as seen from outside, so a seam that continues the outer side is in reverse.
    """

    stitch: int
    pieces: tuple[Piece, Piece]
    reverse: bool


@dataclass(frozen=True)
class _Joint:
    """An edge, and the run of following edges of one panel that it is sewn to."""

    one: Side
    run: tuple[Side, ...]
    stitches: tuple[Stitch, ...]  # of each edge of the run

    @property
    def stated(self) -> bool | None:
        """Whether right is sewn to wrong side, if any stitch states it."""
        return next((stitch.right_to_wrong for stitch in self.stitches if stitch.right_to_wrong is not None), None)


def seams_of(pattern: Pattern) -> tuple[Seam, ...]:
    """The pieces that are sewn together.

    Raises:
        InputError: edges are sewn to several others that do not follow each other, or a stitch twists the cloth into
            a one-sided band.
    """
    joints = _joints(pattern)
    reverse = _directions(pattern, joints)
    return tuple(seam for joint, turned in zip(joints, reverse, strict=True) for seam in _cut(pattern, joint, turned))


def _joints(pattern: Pattern) -> list[_Joint]:
    uses: dict[Side, list[Stitch]] = defaultdict(list)
    for stitch in pattern.stitches:
        for side in dict.fromkeys(stitch.sides):
            uses[side].append(stitch)
    joints = []
    done: set[int] = set()
    for side, stitches in uses.items():
        if len(stitches) > 1:
            joints.append(_one_to_many(pattern, side, stitches, uses))
            done.update(stitch.number for stitch in stitches)
    for stitch in pattern.stitches:
        if stitch.number not in done:
            joints.append(_Joint(stitch.sides[0], (stitch.sides[1],), (stitch,)))
    return joints


def _one_to_many(pattern: Pattern, side: Side, stitches: Sequence[Stitch], uses: dict[Side, list[Stitch]]) -> _Joint:
    """The joint of an edge that several stitches name."""
    numbers = ", ".join(str(stitch.number) for stitch in stitches[:6])
    place = f"stitches {numbers}"
    other = {stitch.sides[0] if stitch.sides[1] == side else stitch.sides[1]: stitch for stitch in stitches}
    if side in other:
        pattern.refuse(place, f"{pattern.edge_name(side)} is sewn to itself and to others", "remove one")
    for partner in other:
        if len(uses[partner]) > 1:
            problem = f"{pattern.edge_name(side)} and {pattern.edge_name(partner)} are each sewn to several edges"
            pattern.refuse(place, problem, "sew each edge to one, or one edge to several that follow each other")
    panel = next(iter(other)).panel
    count = len(pattern.panels[panel].edges)
    own = {partner.edge for partner in other if partner.panel == panel}
    firsts = [edge for edge in own if (edge - 1) % count not in own]
    if len(own) < len(other) or len(firsts) != 1:
        problem = f"{pattern.edge_name(side)} is sewn to {len(other)} edges that do not follow each other in one panel"
        pattern.refuse(place, problem, "cloth has at most two panels at a seam")
    run = tuple(Side(panel, (firsts[0] + step) % count) for step in range(len(own)))
    return _Joint(side, run, tuple(other[partner] for partner in run))


def _directions(pattern: Pattern, joints: Sequence[_Joint]) -> list[bool]:
    """Whether each joint is sewn in reverse: as stated, else as the placement decides, else so that sides agree.

    Panels are joined in the order of how sure their joints are. Where the placement is not decisive, the outer sides
    decide that surer joints imply; where there are none, the panels' loops, if no joint contradicts them.
    """
    ways = [_ways(pattern, joint) for joint in joints]
    pairs = list(zip(joints, ways, strict=True))
    sure = [np.inf if joint.stated is not None else way for joint, (_, way) in pairs]
    contradicted = any(joint.stated is None and way >= CONTRARY and not across for joint, (across, way) in pairs)
    enough = LIKELY if contradicted else DECISIVE
    outer = _OuterSides(len(pattern.panels))
    reverse = [True] * len(joints)
    for index in sorted(range(len(joints)), key=lambda i: (-sure[i], i)):
        joint = joints[index]
        implied = outer.agree(joint.one.panel, joint.run[0].panel)
        if joint.one in joint.run:
            reverse[index] = True  # folded in half
        elif joint.stated is not None:
            reverse[index] = not joint.stated
        elif ways[index][1] >= DECISIVE or (implied is None and ways[index][1] >= enough):
            reverse[index] = ways[index][0]
        else:
            reverse[index] = implied is not False
        if implied is not None and implied != reverse[index]:
            place = f"stitch {joint.stitches[0].number}"
            problem = (
                f"twists the cloth into a one-sided (Moebius) band, {pattern.edge_name(joint.one)} to "
                f"{pattern.edge_name(joint.run[0])}"
            )
            pattern.refuse(place, problem, "turn a panel, or correct the stitch")
        outer.join(joint.one.panel, joint.run[0].panel, reverse[index])
    return reverse


def _ways(pattern: Pattern, joint: _Joint) -> tuple[bool, float]:
    """Whether the ends of a joint are nearer in reverse as placed, and how many times nearer."""
    one = pattern.panels[joint.one.panel]
    other = pattern.panels[joint.run[0].panel]
    curve = one.edges[joint.one.edge].curve
    a, b = one.placed(np.array([curve.start, curve.end]))
    ends = [other.edges[joint.run[0].edge].curve.start, other.edges[joint.run[-1].edge].curve.end]
    c, d = other.placed(np.array(ends))
    across = float(np.linalg.norm(a - d) + np.linalg.norm(b - c))
    along = float(np.linalg.norm(a - c) + np.linalg.norm(b - d))
    short, long = sorted((across, along))
    return across <= along, long / max(short, 1e-9)


class _OuterSides:
    """Panels joined so far, and whether their loops have the same outer side: union-find with signs."""

    def __init__(self, count: int) -> None:
        self.above = list(range(count))
        self.same = [True] * count  # as the panel above

    def _top(self, panel: int) -> tuple[int, bool]:
        same = True
        while self.above[panel] != panel:
            same = same == self.same[panel]
            panel = self.above[panel]
        return panel, same

    def agree(self, one: int, other: int) -> bool | None:
        """Whether two panels' loops have the same outer side; None: not joined yet."""
        (top, first), (other_top, second) = self._top(one), self._top(other)
        return None if top != other_top else first == second

    def join(self, one: int, other: int, same: bool) -> None:
        (top, first), (other_top, second) = self._top(one), self._top(other)
        if top != other_top:
            self.above[other_top] = top
            self.same[other_top] = (first == second) == same


def _cut(pattern: Pattern, joint: _Joint, reverse: bool) -> list[Seam]:
    """A joint as seams of one piece to one: the edge is cut as the lengths of the run divide it."""
    if joint.run == (joint.one,):
        halves = Piece(joint.one, 0.0, 0.5), Piece(joint.one, 0.5, 1.0)
        return [Seam(joint.stitches[0].number, halves, True)]
    run = list(zip(joint.run, joint.stitches, strict=True))
    if reverse:
        run.reverse()
    lengths = [pattern.panels[side.panel].edges[side.edge].curve.length for side, _ in run]
    cuts = np.concatenate([[0.0], np.cumsum(lengths) / sum(lengths)])
    cuts[-1] = 1.0
    return [
        Seam(stitch.number, (Piece(joint.one, float(low), float(high)), Piece(side)), reverse)
        for (side, stitch), low, high in zip(run, cuts[:-1], cuts[1:], strict=True)
    ]

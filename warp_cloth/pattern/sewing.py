"""What is sewn to what: stitches as pairs of pieces of edges, each with its direction."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.handles import handle_count
from warp_cloth.pattern.in_turn import runs_in_turn
from warp_cloth.pattern.seam import Piece, Seam
from warp_cloth.pattern.specification import Panel, Pattern, Side, Stitch

# How many times nearer the ends of a stitch must be one way round than the other. In 2,271 stitches of 96 GarmentCode
# designs, whose loops all run counter-clockwise as seen from outside, the wrong way was never nearer by more than 1.1.
DECISIVE = 1.2  # the placement decides, whatever other stitches imply
CONTRARY = 1.1  # a stitch that runs along the loops shows that some loops run clockwise
# and then this decides between panels that no surer stitches have joined. With half of the loops reversed at random and
# no sides stated, 2,255 of the 2,271 were right (2,002 with DECISIVE alone).
LIKELY = 1.01
OPPOSITE = 0.7  # cosine between panels' normals and the way from one to the other, from which they lie opposite
LOOP_SAMPLES = np.array([0.0, 0.25, 0.5, 0.75])  # of each edge
SAME_STOP = 1e-9  # of an edge's length, within which two layers are cut at one place
APART = 0.25  # of an edge, between the middles of what is sewn to it: they lie side by side, and are no layers
UNEQUAL = 1.6  # times: an edge and what it is sewn to, over several panels; more is gathered on one panel alone


@dataclass(frozen=True)
class _Joint:
    """A part of an edge, and the run of following edges of one panel that it is sewn to."""

    one: Side
    run: tuple[Side, ...]
    stitches: tuple[Stitch, ...]  # of each edge of the run
    low: float = 0.0  # of the edge's length, from which it is sewn
    high: float = 1.0
    layer: bool = False  # a third panel or more at a seam, which may lie either way round
    led: bool | None = None  # whether it is sewn in reverse, if the order of runs along the edge tells

    @property
    def stated(self) -> bool | None:
        """Whether right is sewn to wrong side, if any stitch states it."""
        return next((stitch.right_to_wrong for stitch in self.stitches if stitch.right_to_wrong is not None), None)


def seams_of(pattern: Pattern, *, misplaced: Collection[int] = ()) -> tuple[Seam, ...]:
    """The pieces that are sewn together.

    Args:
        misplaced: panels whose placement does not tell which way round they are sewn.

    Raises:
        InputError: edges are sewn to several others that are neither as long together nor each, or a stitch twists
            the cloth into a one-sided band.
    """
    joints = _joints(pattern)
    reverse = _directions(pattern, joints, misplaced)
    stops: dict[Side, list[float]] = defaultdict(list)  # where layers of a seam are cut, all of them are
    for joint, turned in zip(joints, reverse, strict=True):
        stops[joint.one] += _stops(pattern, joint, turned)
    return tuple(
        seam
        for joint, turned in zip(joints, reverse, strict=True)
        for seam in _cut(pattern, joint, turned, stops[joint.one])
    )


def _joints(pattern: Pattern) -> list[_Joint]:
    uses: dict[Side, list[Stitch]] = defaultdict(list)
    for stitch in pattern.stitches:
        for side in dict.fromkeys(stitch.sides):
            uses[side].append(stitch)
    joints = []
    done: set[int] = set()
    # the edge with the most partners first, so that those of a seam of many layers are all sewn to one
    for side, stitches in sorted(uses.items(), key=lambda item: -len(item[1])):
        stitches = [stitch for stitch in stitches if id(stitch) not in done]
        if len(stitches) > 1 and (chain := _layers_in_turn(pattern, side, uses)):
            joints += chain
            done.update(id(stitch) for joint in chain for each in (joint.one, *joint.run) for stitch in uses[each])
        elif len(stitches) > 1:
            joints += _one_to_many(pattern, side, stitches, uses)
            done.update(map(id, stitches))
            partners = {partner for stitch in stitches for partner in stitch.sides}
            done.update(id(stitch) for stitch in pattern.stitches if partners.issuperset(stitch.sides))
    for stitch in pattern.stitches:
        if id(stitch) not in done:
            joints.append(_Joint(stitch.sides[0], (stitch.sides[1],), (stitch,)))
    return joints


def _layers_in_turn(pattern: Pattern, side: Side, uses: dict[Side, list[Stitch]]) -> list[_Joint]:
    """The joints of layers that are sewn each to the next one, from this edge on; none where these are no such.

    Layers are edges of one length and of a panel each, of which more than one is sewn to several.
    """
    reached, joints = [side], list[_Joint]()
    for one in reached:
        for stitch in uses[one]:
            other = stitch.sides[stitch.sides[0] == one]
            if other not in reached:
                reached.append(other)
                joints.append(_Joint(one, (other,), (stitch,), layer=bool(joints)))
    is_tree = len({id(stitch) for one in reached for stitch in uses[one]}) == len(joints)
    is_star = all(joint.one == side for joint in joints)
    lengths = np.log([_length(pattern, [each]) for each in reached])
    alike = float(np.ptp(lengths)) <= np.log(UNEQUAL)
    apart = len({each.panel for each in reached}) == len(reached)
    return joints if alike and apart and is_tree and not is_star else []


def _one_to_many(
    pattern: Pattern, side: Side, stitches: Sequence[Stitch], uses: dict[Side, list[Stitch]]
) -> list[_Joint]:
    """The joints of an edge that several stitches name: to a run of edges, to runs one after another, or to layers."""
    numbers = ", ".join(str(stitch.number) for stitch in stitches[:6])
    place = f"stitches {numbers}"
    other = {stitch.sides[0] if stitch.sides[1] == side else stitch.sides[1]: stitch for stitch in stitches}
    if side in other:
        pattern.refuse(place, f"{pattern.edge_name(side)} is sewn to itself and to others", "remove one")
    together = {side, *other}
    for partner in other:
        if any(not together.issuperset(stitch.sides) for stitch in uses[partner]):
            problem = f"{pattern.edge_name(side)} and {pattern.edge_name(partner)} are each sewn to several edges"
            pattern.refuse(place, problem, "sew each edge to one, or one edge to several that follow each other")
    runs = _following(pattern, list(other))
    if len(runs) == 1:
        return [_Joint(side, runs[0], tuple(other[partner] for partner in runs[0]))]
    whole = _length(pattern, [side])
    lengths = np.array([_length(pattern, run) for run in runs])
    in_turn, as_layers = abs(float(np.log(lengths.sum() / whole))), float(np.abs(np.log(lengths / whole)).max())
    places = _along(pattern, side, runs)
    are_stated = all(stitch.is_layer for stitch in stitches)
    are_layers = are_stated or (as_layers < in_turn and float(np.ptp(places)) < APART)
    if (as_layers if are_layers else in_turn) > np.log(UNEQUAL):
        listed = " and ".join(f"{1e3 * length:.0f}" for length in lengths[:4])
        problem = (
            f"{pattern.edge_name(side)} of {1e3 * whole:.0f} mm is sewn to {len(runs)} panels' edges of {listed} mm"
        )
        pattern.refuse(place, problem, "they are to be as long as it together, or each of them as a layer")
    if are_layers:
        if len({run[0].panel for run in runs}) < len(runs):
            problem = (
                f"{pattern.edge_name(side)} is sewn to {len(other)} edges that do not follow each other in one panel"
            )
            pattern.refuse(place, problem, "layers of a seam are of different panels")
        return [_Joint(side, run, tuple(other[partner] for partner in run), layer=k > 0) for k, run in enumerate(runs)]
    if any(run_side.panel == side.panel for run in runs for run_side in run):
        pattern.refuse(place, f"{pattern.edge_name(side)} is sewn to edges of its own panel and of others",
                       "divide the edge where they meet")  # fmt: skip
    stated = [_Joint(side, run, tuple(other[each] for each in run)).stated for run in runs]
    reversed_ = [None if each is None else not each for each in stated]
    turn = runs_in_turn(pattern, side, runs, places, lengths, reversed_)
    spans = pairwise(turn.cuts)
    return [
        _Joint(side, runs[k], tuple(other[partner] for partner in runs[k]), low, high, led=led)
        for k, led, (low, high) in zip(turn.order, turn.reverse, spans, strict=True)
    ]


def _following(pattern: Pattern, sides: Sequence[Side]) -> list[tuple[Side, ...]]:
    """Edges as runs that follow each other in one panel, in the order in which their panels are named."""
    runs = []
    for panel in dict.fromkeys(side.panel for side in sides):
        count = len(pattern.panels[panel].edges)
        own = {side.edge for side in sides if side.panel == panel}
        firsts = [edge for edge in sorted(own) if (edge - 1) % count not in own] or [min(own)]
        for first in firsts:
            run = [Side(panel, first)]
            while (run[-1].edge + 1) % count in own and len(run) < len(own):
                run.append(Side(panel, (run[-1].edge + 1) % count))
            runs.append(tuple(run))
    return runs


def _length(pattern: Pattern, run: Sequence[Side]) -> float:
    return sum(pattern.panels[side.panel].edges[side.edge].curve.length for side in run)


def _along(pattern: Pattern, side: Side, runs: Sequence[tuple[Side, ...]]) -> list[float]:
    """Where along an edge, from 0 to 1, the middles of runs lie nearest, as placed."""
    panel = pattern.panels[side.panel]
    share = np.linspace(0.0, 1.0, 33)
    spots = panel.placed(panel.edges[side.edge].curve.at(share))
    at = []
    for run in runs:
        own = pattern.panels[run[0].panel]
        middle = np.mean([own.placed(own.edges[each.edge].curve.at(np.array([0.5]))) for each in run], axis=0)
        at.append(float(share[np.linalg.norm(spots - middle, axis=1).argmin()]))
    return at


def _directions(pattern: Pattern, joints: Sequence[_Joint], misplaced: Collection[int]) -> list[bool]:
    """Whether each joint is sewn in reverse: as stated, else as the placement decides, else so that sides agree.

    Panels are joined in the order of how sure their joints are. Where the placement is not decisive, the outer sides
    decide that surer joints imply; where there are none, the panels' loops, if no joint contradicts them and the panels
    do not lie with these to each other. The other way round is taken where it makes fewer handles.
    """
    ways = [_likely_way(pattern, joint, misplaced) for joint in joints]
    pairs = list(zip(joints, ways, strict=True))
    sure = [np.inf if joint.stated is not None else way for joint, (_, way) in pairs]
    contradicted = any(joint.stated is None and way >= CONTRARY and not across for joint, (across, way) in pairs)
    enough = LIKELY if contradicted else DECISIVE
    outer = _OuterSides(len(pattern.panels))
    reverse = [True] * len(joints)
    for index in sorted(range(len(joints)), key=lambda i: (-sure[i], i)):
        joint = joints[index]
        implied = None if joint.layer else outer.agree(joint.one.panel, joint.run[0].panel)
        if joint.one in joint.run:
            reverse[index] = True  # folded in half
        elif joint.stated is not None:
            reverse[index] = not joint.stated
        elif ways[index][1] >= DECISIVE:
            reverse[index] = ways[index][0]
        elif implied is None:
            way, nearer = ways[index]
            is_told = nearer >= enough or (not way and not _face_alike(pattern, joint))
            reverse[index] = way or not is_told
            if not joint.layer and _makes_more_handles(pattern, joints, index, reverse[index], outer):
                reverse[index] = not reverse[index]
        else:
            reverse[index] = implied is not False
        if implied is not None and implied != reverse[index]:
            place = f"stitch {joint.stitches[0].number}"
            problem = (
                f"twists the cloth into a one-sided (Moebius) band, {pattern.edge_name(joint.one)} to "
                f"{pattern.edge_name(joint.run[0])}"
            )
            pattern.refuse(place, problem, "turn a panel, or correct the stitch")
        if not joint.layer:
            outer.join(joint.one.panel, joint.run[0].panel, reverse[index])
    return reverse


def _likely_way(pattern: Pattern, joint: _Joint, misplaced: Collection[int]) -> tuple[bool, float]:
    """Whether a joint is sewn in reverse, and how sure this is, as how many times nearer the ends then are."""
    if joint.led is not None:
        return joint.led, np.inf
    if {joint.one.panel, joint.run[0].panel}.intersection(misplaced):
        return True, 1.0
    return _ways(pattern, joint)


def _face_alike(pattern: Pattern, joint: _Joint) -> bool:
    """Whether the loops of two panels run alike as seen from outside; alike, too, where places do not tell.

    Panels that lie opposite each other, as a front and a back, have their outer sides away from each other.
    """
    panels = joint.one.panel, joint.run[0].panel
    placed = [pattern.panels[index].placed(_corners(pattern.panels[index])) for index in panels]
    apart = placed[0].mean(axis=0) - placed[1].mean(axis=0)
    facing = [float(_normal(points) @ away) for points, away in zip(placed, (apart, -apart), strict=True)]
    is_clear = min(abs(share) for share in facing) > OPPOSITE * float(np.linalg.norm(apart))
    return not is_clear or (facing[0] > 0.0) == (facing[1] > 0.0)


def _corners(panel: Panel) -> Floats:
    return np.concatenate([edge.curve.at(LOOP_SAMPLES) for edge in panel.edges])


def _normal(loop: Floats) -> Floats:
    """The unit vector from which a loop is seen to run counter-clockwise; about zero where it is bent to a ring."""
    area = 0.5 * np.cross(loop, np.roll(loop, -1, axis=0)).sum(axis=0)
    return np.asarray(area / max(float(np.linalg.norm(area)), 1e-12))


def _makes_more_handles(
    pattern: Pattern, joints: Sequence[_Joint], index: int, reverse: bool, outer: _OuterSides
) -> bool:
    """Whether two groups of panels, joined so by a joint, get more handles than if one of them is turned over."""
    counts, group = [], joints[index].one.panel

    def joined(way: bool) -> _OuterSides:
        made = outer.copy()
        made.join(group, joints[index].run[0].panel, way)
        return made

    met = joined(reverse)
    ends = [(joint.one.panel, joint.run[0].panel) for joint in joints if not joint.layer]
    between = (outer.agree(*pair) is None and met.agree(*pair) is not None for pair in ends)
    if sum(between) < 2:  # one seam alone makes the same of both ways
        return False
    for tried in (met, joined(not reverse)):
        seams: list[Seam] = []
        for joint in joints:
            same = tried.agree(joint.one.panel, joint.run[0].panel)
            if same is None or joint.layer or tried.agree(joint.one.panel, group) is None:
                continue
            turned = same or joint.one in joint.run
            seams += _cut(pattern, joint, turned, _stops(pattern, joint, turned))
        counts.append(handle_count(pattern, seams))
    return counts[0] > counts[1]


def _ways(pattern: Pattern, joint: _Joint) -> tuple[bool, float]:
    """Whether the ends of a joint are nearer in reverse as placed, and how many times nearer."""
    one = pattern.panels[joint.one.panel]
    other = pattern.panels[joint.run[0].panel]
    a, b = one.placed(one.edges[joint.one.edge].curve.at(np.array([joint.low, joint.high])))
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

    def copy(self) -> _OuterSides:
        made = _OuterSides(0)
        made.above, made.same = [*self.above], [*self.same]
        return made

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


def _stops(pattern: Pattern, joint: _Joint, reverse: bool) -> list[float]:
    """Where on a joint's edge its pieces end: as the lengths of the run divide it."""
    if joint.run == (joint.one,):
        return [0.0, 0.5, 1.0]
    run = joint.run[::-1] if reverse else joint.run
    shares = np.cumsum([_length(pattern, [side]) for side in run]) / _length(pattern, run)
    inner = [joint.low + float(share) * (joint.high - joint.low) for share in shares[:-1]]
    return [joint.low, *inner, joint.high]


def _cut(pattern: Pattern, joint: _Joint, reverse: bool, stops: Sequence[float]) -> list[Seam]:
    """A joint as seams of one piece to one: the edge is cut as the run divides it, and as other layers do."""
    if joint.run == (joint.one,):
        halves = Piece(joint.one, 0.0, 0.5), Piece(joint.one, 0.5, 1.0)
        return [Seam(joint.stitches[0].number, halves, True)]
    run = list(zip(joint.run, joint.stitches, strict=True))
    if reverse:
        run.reverse()
    seams = []
    own = _stops(pattern, joint, reverse)
    for (side, stitch), low, high in zip(run, own[:-1], own[1:], strict=True):
        inner = sorted({stop for stop in stops if low + SAME_STOP < stop < high - SAME_STOP})
        inner = [stop for k, stop in enumerate(inner) if not k or stop - inner[k - 1] > SAME_STOP]
        ends = [next(s for s in (*stops, stop) if abs(s - stop) <= SAME_STOP) for stop in (low, *inner, high)]
        for start, end in pairwise(ends):
            a, b = (min(max((stop - low) / (high - low), 0.0), 1.0) for stop in (start, end))
            a, b = (0.0 if start == ends[0] else a), (1.0 if end == ends[-1] else b)
            there = Piece(side, 1.0 - b, 1.0 - a) if reverse else Piece(side, a, b)
            seams.append(Seam(stitch.number, (Piece(joint.one, start, end), there), reverse))
    return seams

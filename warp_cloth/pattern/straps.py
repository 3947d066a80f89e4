"""Straps over the shoulders: from the top of a front to that of a back, which have no shoulders of their own.

A strap ends at a short edge of a top as wide as it, on either side of a point, at the corner of a level top (a bib's),
or on a level top that runs from side to side: there at a notch, or as far from the middle as the other end. Edges are
parted so that each part is sewn or open as a whole; the role "strap+" or "strap-" says which.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warp_cloth.pattern.bibs import BIB
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.joints import Joint
from warp_cloth.pattern.kinds import BOTH, HALF_SLEEVES, LEFT, RIGHT, YOKES
from warp_cloth.pattern.levels import armpit_of
from warp_cloth.pattern.parting import marks_along, parted
from warp_cloth.pattern.roles import SHOULDER_FALL, Roles, Shape
from warp_cloth.pattern.runs import joint_of, parts_of_kind, role_of, run_of, side_mark

STRAP_EASE = (-0.4, 2.5)  # a strap is folded lengthwise, or gathered, where it is sewn on
AS_WIDE = (0.35, 1.7)  # of the strap's width, how long an edge is at which it ends
POINTED = np.radians(50.0)  # least turn at the corner on either side of which a strap is sewn
MOST_WIDE = 3.0  # of the strap's width, how long a level edge is on whose middle it ends
# Of a garment's width in front and behind, that is the way from armpit to armpit at least: by straps narrower than the
# shoulders, and by others
OVER_SHOULDER = 0.34, 0.42
LOW = 0.3, 0.3  # of the width, and [m], up to which that way is of a top that hangs from what is no piece
FLAT = 0.35  # |dy| over |dx| of a level top
NEAR_NOTCH = 0.05  # [m] from where the strap's other end is, across, within which a notch marks this one
AT_NOTCH, ACROSS = 1.0, 0.88  # how sure the place on a level top is: at a notch, or as far out as the other end
BESIDE = 0.02  # [m] from the middle, within which no strap ends
STRAP = "strap"


@dataclass(frozen=True)
class _End:
    """Where a strap ends on a part: along a run of edges, from one place to another [m]; how sure that is."""

    run: tuple[int, ...]
    places: tuple[float, float]
    sure: float = 1.0


def with_straps(parts: Sequence[Part]) -> tuple[Part, ...]:
    """The parts, their edges parted where the two straps of a garment end; unchanged where these fit nowhere."""
    straps = pair_of_straps(parts)
    tops = [parts_of_kind(parts, face) for face in ("front", "back")]
    if not straps or not all(tops) or parts_of_kind(parts, "sleeve", "hood", "yoke", "front_yoke", "collar", "stand"):
        return tuple(parts)
    out = list(parts)
    wide = [min(out[strap].shape.length(out[strap].roles[end]) for strap in straps) for end in ("end", "end2")]
    sure = 1.0
    for side in (LEFT, RIGHT):
        owners = [[index for index in own if out[index].side in (BOTH, side)] for own in tops]
        if any(len(own) != 1 for own in owners):
            return tuple(parts)
        panels = [own[0] for own in owners]
        if _have_shoulders([out[panel] for panel in panels], side, wide):
            return tuple(parts)
        ends = [end_of_strap(out[panel], side, width) for panel, width in zip(panels, wide, strict=True)]
        for here, there in ((0, 1), (1, 0)):
            known = ends[there]
            if ends[here] is None and known is not None:
                ends[here] = _end_across(out[panels[here]], side, wide[here], across_of(out[panels[there]], known))
        for panel, end in zip(panels, ends, strict=True):
            if end is None:
                return tuple(parts)
            out[panel] = with_end(out[panel], side, end)
            sure = min(sure, end.sure)
    for strap, side in zip(straps, (LEFT, RIGHT), strict=True):
        out[strap] = replace(out[strap], side=side, sure=sure * out[strap].sure)
    return tuple(out)


def proposed_straps(parts: Sequence[Part]) -> Iterable[Joint]:
    """The seams at both ends of each strap whose ends ``with_straps`` found."""
    for strap in (index for index in parts_of_kind(parts, STRAP) if parts[index].side != BOTH):
        for faces, end in ((("front", BIB), "end"), (("back", "waistband"), "end2")):
            for top in parts_of_kind(parts, *faces):
                run = run_of(top, role_of(parts, top, STRAP, parts[strap].side), True)
                yield from joint_of(parts, run_of(strap, parts[strap].roles[end]), run, STRAP, STRAP_EASE)


def has_straps(part: Part) -> bool:
    """Whether a front or back hangs from straps."""
    return any(role.startswith(STRAP) for role in part.roles)


def pair_of_straps(parts: Sequence[Part]) -> tuple[int, ...]:
    """The left and the right one of two straps; empty where there are not two."""
    straps = [index for index in parts_of_kind(parts, STRAP) if "end" in parts[index].roles]
    if len(straps) != 2 or len(parts_of_kind(parts, STRAP)) != 2:
        return ()
    return tuple(sorted(straps, key=lambda index: (-parts[index].side, index)))


def _have_shoulders(parts: Sequence[Part], side: int, wide: Sequence[float]) -> bool:
    """Whether a front and a back meet on the shoulder by themselves: as high above their sides as the way over it is.

    That way is long for a garment's width. What is called straps there are epaulettes, or tabs. Where straps are as
    wide as the shoulders it is to be longer, as they may belong there; a wider edge that falls is a shoulder anyway.
    """
    # without an armhole it is the slanting edge of a top that hangs from straps
    shoulders = [role_of([part], 0, "shoulder", side) if role_of([part], 0, "armhole", side) else () for part in parts]
    if not any(shoulders):
        return False
    lengths = [part.shape.length(run) for part, run in zip(parts, shoulders, strict=True)]
    wider = [k for k, (long, width) in enumerate(zip(lengths, wide, strict=True)) if long > AS_WIDE[1] * width]
    if any(_falls(parts[k].shape, shoulders[k]) for k in wider):
        return True
    return _way_over_shoulder(parts, side) > OVER_SHOULDER[0 if wider else 1]


def _way_over_shoulder(parts: Sequence[Part], side: int) -> float:
    """From armpit to armpit, of the width of a front and a back."""
    return sum(armpit_of(part) for part in parts) / max(sum(_chest(part, side) for part in parts), 1e-9)


def lack_straps(parts: Sequence[Part], faces: Sequence[Part], side: int) -> bool:
    """Whether a front and a back end far below the shoulder, so that a strap or tie of no piece belongs between."""
    if parts_of_kind(parts, "sleeve", *HALF_SLEEVES, *YOKES) or not all(
        role_of([face], 0, "armhole", side) for face in faces
    ):
        return False
    return _way_over_shoulder(faces, side) < LOW[0] and sum(armpit_of(face) for face in faces) < LOW[1]


def _falls(shape: Shape, run: Sequence[int]) -> bool:
    x, y = np.abs(np.sum([shape.chord(k) for k in run], axis=0))
    return bool(y > SHOULDER_FALL * x)


def _chest(part: Part, side: int) -> float:
    """How wide a part is where its sides end, or half of it is twice [m]."""
    tops = [part.shape.turned[k].points for k in role_of([part], 0, "side", side)]
    points = np.concatenate(tops) if tops else np.array(part.shape.box)
    return 2.0 * abs(float(points[points[:, 1].argmax(), 0]) - _middle(part))


def _sign(part: Part, side: int) -> float:
    """On which side of a part's own frame a side of the wearer is."""
    return 1.0 if side_mark(part, side) == "+" else -1.0


def _middle(part: Part) -> float:
    """Where across a part the wearer's middle is [m]."""
    low, high = part.shape.box
    if part.side == BOTH:
        return float(0.5 * (low[0] + high[0]))
    return float(low[0] if _sign(part, part.side) > 0.0 else high[0])


def end_of_strap(part: Part, side: int, wide: float) -> _End | None:
    """Where a strap of a width ends at the highest place of a part's half, if the shape tells it."""
    shape, order = part.shape, part.shape.order
    middle, sign = _middle(part), _sign(part, side)
    corners = [n for n, k in enumerate(order) if sign * (float(shape.turned[k].start[0]) - middle) > BESIDE]
    if not corners:
        return None
    tip = max(corners, key=lambda n: (round(float(shape.turned[order[n]].start[1]), 3), -sign * n))
    before, after = order[tip - 1], order[tip]
    fitting = [k for k in (before, after) if _is_tip_edge(shape, k, wide) and _is_on(shape, k, middle, sign)]
    if fitting:
        best = min(fitting, key=lambda k: abs(shape.length((k,)) - wide))
        return _End((best,), (0.0, shape.length((best,))))
    at_side = {k for role, run in part.roles.items() if role[:-1] == "side" or role in ("hem", "centre") for k in run}
    if at_side & {before, after} or shape.turn_after(before) < POINTED:
        return None
    levels = [run for step in (-1, 1) if (run := _level_run(shape, tip, step))]
    if levels or BIB in part.roles:
        return _end_at_corner(shape, levels[0], tip, wide, middle) if len(levels) == 1 else None
    if min(shape.length((before,)), shape.length((after,))) < wide:
        return None
    long = shape.length((before,))
    return _End((before, after), (long - 0.5 * wide, long + 0.5 * wide))


def _is_tip_edge(shape: Shape, k: int, wide: float) -> bool:
    low, high = AS_WIDE
    return bool(low * wide <= shape.length((k,)) <= high * wide and shape.is_straight(k) and shape.chord(k)[0] < 0.0)


def _is_on(shape: Shape, k: int, middle: float, sign: float) -> bool:
    return bool(sign * (float(shape.middle(k)[0]) - middle) > 0.0)


def _level_run(shape: Shape, tip: int, step: int) -> tuple[int, ...]:
    """The level top that begins at a corner, the edges from there on in a direction of the order: as the loop runs."""
    run: list[int] = []
    place = tip if step > 0 else tip - 1
    while len(run) < len(shape.order):
        k = shape.order[place % len(shape.order)]
        x, y = np.abs(shape.chord(k))
        if not (y <= FLAT * x and shape.is_straight(k) and shape.chord(k)[0] < 0.0):
            break
        run.append(k)
        place += step
    return tuple(run[::step])


def _end_at_corner(shape: Shape, run: tuple[int, ...], tip: int, wide: float, middle: float) -> _End:
    """The end of a level top that is at a corner, as long as a strap is wide, or half of it all."""
    long = shape.length(run)
    if AS_WIDE[1] * wide < long <= MOST_WIDE * wide:  # as a shoulder's: on its middle
        return _End(run, (0.5 * (long - wide), 0.5 * (long + wide)), ACROSS)
    is_both = (shape.turned[run[0]].start[0] - middle) * (shape.turned[run[-1]].end[0] - middle) < 0.0
    taken = min(wide, 0.5 * long if is_both else long)
    return _End(run, (0.0, taken) if run[0] == shape.order[tip] else (long - taken, long))


def across_of(part: Part, end: _End) -> float:
    """How far from the middle a strap ends [m]."""
    return abs(float(_at(part, end.run, 0.5 * sum(end.places))[0]) - _middle(part))


def _at(part: Part, run: Sequence[int], place: float) -> Floats:
    """The point of a part, turned up, at a place along a run of edges [m], shape [2]."""
    for k in run:
        length = part.shape.length((k,))
        if place <= length:
            return np.asarray(part.shape.turned[k].at(np.array([place / length]))[0])
        place -= length
    return np.asarray(part.shape.turned[run[-1]].end)


def _end_across(part: Part, side: int, wide: float, far: float) -> _End | None:
    """Where a strap ends on a top that runs level from side to side, as far out as its other end."""
    run = part.roles.get("neck", ())
    shape = part.shape
    if not run or not all(shape.runs_across(k) for k in run):
        return None
    long = shape.length(run)
    wanted = _middle(part) + _sign(part, side) * far

    def off(place: float) -> float:
        return abs(float(_at(part, run, place)[0]) - wanted)

    marked = [mark for mark in marks_along(part, run) if off(mark) < NEAR_NOTCH]
    place = min(marked or np.linspace(0.0, long, 257).tolist(), key=off)
    first, last = place - 0.5 * wide, place + 0.5 * wide
    if first < 0.0 or last > long or off(place) > NEAR_NOTCH:
        return None
    return _End(run, (first, last), AT_NOTCH if len(marked) == 1 else ACROSS)


def with_end(part: Part, side: int, end: _End) -> Part:
    """A part whose edges are parted where a strap ends, and are no shoulder there."""
    long = part.shape.length(end.run)
    inner = [place for place in end.places if 1e-9 < place < long - 1e-9]
    made, runs = parted(part, end.run, inner)
    own = runs[1] if end.places[0] > 1e-9 else runs[0]
    roles: Roles = {
        role: run for role, run in made.roles.items() if not (role.startswith("shoulder") and {*run} & {*own})
    }
    return replace(made, roles={**roles, STRAP + side_mark(part, side): own})

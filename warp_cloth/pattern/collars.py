"""Collars: which piece goes on the neckline, which on a stand's upper edge, and between which points of these.

A shirt's collar is of two pieces: the stand, sewn to the neckline, and the fall, sewn to the stand's upper edge between
the centre fronts. A front that opens may run on beyond where the stand ends, in a facing that is folded back: its
neckline ends at a mark there. Edges are parted at these points, so that each part is sewn or open as a whole.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np

from warp_cloth.pattern.collar_halves import are_halves, with_whole_collars
from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.joints import Joint
from warp_cloth.pattern.kinds import BOTH, COLLARS, LEFT, RIGHT, is_named_stand
from warp_cloth.pattern.layers import without_parts
from warp_cloth.pattern.neckline import neck_from_front, opens_in_front, with_neck_to_hem
from warp_cloth.pattern.parting import marks_along, parted
from warp_cloth.pattern.roles import Shape
from warp_cloth.pattern.runs import joint_of, length_of, parts_of_kind, run_of
from warp_cloth.pattern.specification import short

STAND, FALL = "stand", "fall"
STAND_EASE = (-0.04, 0.03)  # of a stand or collar, against the neckline between its ends
FALL_EASE = (-0.04, 0.02)  # of a fall, against the stand between its marks
AS_LONG = 0.02  # relative: a neckline that is as long as the collar ends where it ends
AT_MARKS = 0.012  # relative: to which a length between marks is to agree
WHOLE = 0.6  # of the neckline, that a collar for all of it is long at least
LAYERS = 0.03  # relative: lengths and widths of two layers of one collar
FACING = 0.14  # [m] of neckline that may be folded back in front, on either side
EXTENSION = 0.06  # [m] by which a stand goes on beyond its fall, at either end
ROUNDED = (0.03, np.radians(40.0))  # [m] from an end within which an upper edge turns, and by how much at least
DIFFERENT = 0.01  # relative: by which the outer edge of a fall is longer, so that this tells it
RIVAL, DOUBTED = 0.05, 0.7  # as in proposal.py


@dataclass(frozen=True)
class _Way:
    """One way in which collars are sewn, with how sure it is."""

    sure: float
    parts: tuple[Part, ...]


def with_collars(parts: Sequence[Part]) -> tuple[tuple[Part, ...], list[str]]:
    """The parts with one layer of each collar, their edges parted where they begin to be sewn; and notes.

    A collar's role "neck" is sewn to the neckline, or of a fall to the role "top" of the stand.
    """
    parts, halves = with_whole_collars(parts)
    parts, notes = _single_layers(parts)
    notes = [*halves, *notes]
    collars = parts_of_kind(parts, *COLLARS)
    if len(collars) == 1:
        parts = with_neck_to_hem(parts, [parts[collars[0]].shape.length(run) for run in _runs(parts[collars[0]])])
    neck = neck_from_front(parts)
    if not collars or len(collars) > 2 or not neck:
        return parts, notes
    if len(collars) == 1:
        (only,) = collars
        if parts[only].kind != "collar" or not opens_in_front(parts):
            return parts, notes
        made = _on_neck(parts, only)
        return made, [*notes, *_left_open(made)]
    ways = [way for stand, fall in (collars, collars[::-1]) if (way := _way(parts, stand, fall)) is not None]
    ways.sort(key=lambda way: -way.sure)
    if not ways or (len(ways) > 1 and ways[0].sure < ways[1].sure + RIVAL):
        return parts, notes
    return ways[0].parts, [*notes, *_left_open(ways[0].parts)]


def _left_open(parts: Sequence[Part]) -> list[str]:
    """Notes on necklines that go on beyond where the collar ends."""
    notes = []
    for part in (parts[panel] for panel in parts_of_kind(parts, "front")):
        if beyond := part.roles.get("facing", ()):
            long, name = f"{1e3 * part.shape.length(beyond):.0f}", f"{short(part.name)} {part.numbers[beyond[0]]}"
            notes.append(f'the collar ends {long} mm before the front edge: "{name}" is left open, as a facing')
    return notes


def proposed_collars(parts: Sequence[Part]) -> Iterable[Joint]:
    """The seams of collars whose edges ``with_collars`` found; others are bands."""
    neck = neck_from_front(parts)
    for stand in parts_of_kind(parts, "collar", STAND):
        run = run_of(stand, parts[stand].roles.get("neck", ()))
        reason = "stand" if parts[stand].kind == STAND else "collar"
        yield from joint_of(parts, run, neck, reason, STAND_EASE)
        for fall in parts_of_kind(parts, FALL):
            own, top = parts[fall].roles.get("neck", ()), parts[stand].roles.get("top", ())
            yield from joint_of(parts, run_of(fall, own), run_of(stand, top, True), "fall", FALL_EASE)


def _single_layers(parts: tuple[Part, ...]) -> tuple[tuple[Part, ...], list[str]]:
    """The parts with one layer of each collar; a collar is cut twice, but for halves that meet behind."""
    neck = length_of(parts, neck_from_front(parts))
    gone: set[int] = set()
    notes = []
    collars = [index for index in parts_of_kind(parts, *COLLARS) if "long" in parts[index].roles]
    for one, other in combinations(collars, 2):
        if one in gone or other in gone or not neck or are_halves(parts, one, other):
            continue
        sizes = [_size(parts[index]) for index in (one, other)]
        alike = bool((np.abs(sizes[0] - sizes[1]) <= LAYERS * np.maximum(*sizes)).all())
        is_stand = [is_named_stand(parts[index].name) for index in (one, other)]
        if alike and is_stand[0] == is_stand[1] and sizes[0][0] > WHOLE * neck:
            gone.add(other)
            names = f'pieces "{short(parts[one].name)}" and "{short(parts[other].name)}"'
            notes.append(f"{names} are layers of one collar: the first is sewn")
    return without_parts(parts, gone), notes


def _size(part: Part) -> np.ndarray:
    """Length of the longer long edge, and width [m], shape [2]."""
    return np.array([part.shape.length(part.roles["long"]), np.ptp(np.array(part.shape.box), axis=0).min()])


def _way(parts: tuple[Part, ...], stand: int, fall: int) -> _Way | None:
    """A piece as the stand and another as the fall; None where names or shapes say otherwise."""
    if parts[stand].kind == FALL or parts[fall].kind == STAND:
        return None
    names = [is_named_stand(parts[index].name) for index in (stand, fall)]
    if names[0] == names[1]:  # a stand's ends are rounded, a fall's are not
        names = [any(_is_rounded(part.shape, run) for run in _runs(part)) for part in (parts[stand], parts[fall])]
    if names == [False, True] and {parts[stand].kind, parts[fall].kind} == {"collar"}:
        return None
    made = list(parts)
    made[stand], made[fall] = replace(parts[stand], kind=STAND), replace(parts[fall], kind=FALL)
    parts = _on_neck(tuple(made), stand)
    parts = _on_stand(parts, stand, fall)
    found = list(proposed_collars(parts))
    return _Way(min(joint.confidence for joint in found), parts) if len(found) == 2 else None


def _on_neck(parts: tuple[Part, ...], collar: int) -> tuple[Part, ...]:
    """The parts with a collar's role "neck", and the neckline of an open front only as far as the collar goes."""
    part = parts[collar]
    runs = _runs(part)
    plain = [run for run in runs if not _is_rounded(part.shape, run)] or runs
    tried = []
    for run in plain:
        cut = _neck_cut(parts, part.shape.length(run))
        made = list(cut)
        made[collar] = replace(part, roles={**part.roles, "neck": run, "top": _other(runs, run)})
        found = list(joint_of(made, run_of(collar, run), neck_from_front(made), "", STAND_EASE))
        off = abs(length_of(made, neck_from_front(made)) / part.shape.length(run) - 1.0)
        tried.append((-round(found[0].confidence, 2) if found else 0.0, off, tuple(made)))
    return min(tried, key=lambda each: each[:2])[2] if tried else parts


def _runs(part: Part) -> list[tuple[int, ...]]:
    """The long edges of a collar."""
    return [run for role in ("long", "long2") if (run := part.roles.get(role))]


def _other(runs: Sequence[tuple[int, ...]], run: tuple[int, ...]) -> tuple[int, ...]:
    return next((each for each in runs if each != run), ())


def _is_rounded(shape: Shape, run: Sequence[int]) -> bool:
    """Whether a run goes round the end of a stand, as its upper edge does."""
    points = np.concatenate([shape.edges[k].at(np.linspace(0.0, 1.0, 65)) for k in run])
    reach = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    step, far = 0.1 * ROUNDED[0], ROUNDED[0]
    if reach[-1] < 4.0 * far:
        return False
    ends = np.array([0.0, step, far, far + step])
    for at in (ends, reach[-1] - ends):
        a, b, c, d = np.stack([np.interp(at, reach, points[:, axis]) for axis in range(2)], axis=1)
        one, other = b - a, d - c
        cosine = one @ other / max(float(np.hypot(*one) * np.hypot(*other)), 1e-12)
        if np.arccos(np.clip(cosine, -1.0, 1.0)) > ROUNDED[1]:
            return True
    return False


def _neck_cut(parts: tuple[Part, ...], wanted: float) -> tuple[Part, ...]:
    """The parts with the necklines of an open front's halves parted where facings begin, so that it is ``wanted`` long.

    Where they begin is marked: by notches, lines within, or corners; what comes nearest in length is taken.
    """
    whole = length_of(parts, neck_from_front(parts))
    if not opens_in_front(parts) or abs(whole - wanted) <= AS_LONG * wanted or whole < wanted:
        return parts
    fronts = [panel for side in (LEFT, RIGHT) for panel in parts_of_kind(parts, "front") if parts[panel].side == side]
    if len(fronts) != 2:
        return parts
    marks = [[0.0, *(mark for mark in _from_centre(parts[panel]) if mark < FACING)] for panel in fronts]
    best = min(product(*marks), key=lambda pair: (round(abs(whole - sum(pair) - wanted), 4), abs(pair[0] - pair[1])))
    if abs(whole - sum(best) - wanted) > AT_MARKS * wanted:
        return parts
    made = list(parts)
    for panel, beyond in zip(fronts, best, strict=True):
        if beyond > 0.0:
            made[panel] = _without_facing(parts[panel], beyond)
    return tuple(made)


def _starts_at_centre(part: Part) -> bool:
    """Whether a half front's neckline, as its loop runs, begins at the centre: where that is at +x."""
    return bool(part.roles["neck"] and part.roles.get("centre") and part.roles["neck"][0] != part.roles["centre"][0]
                and (part.roles["centre"][-1] + 1) % len(part.edges) == part.roles["neck"][0])  # fmt: skip


def _from_centre(part: Part) -> list[float]:
    """Marks along a half front's neckline, as lengths from its centre [m]."""
    run = part.roles.get("neck", ())
    if not run:
        return []
    total = part.shape.length(run)
    marks = marks_along(part, run)
    return sorted(marks if _starts_at_centre(part) else [total - mark for mark in marks])


def _without_facing(part: Part, beyond: float) -> Part:
    """A half front whose neckline ends this far from its centre."""
    run = part.roles["neck"]
    total = part.shape.length(run)
    at_start = _starts_at_centre(part)
    part, pieces = parted(part, run, [beyond if at_start else total - beyond])
    neck, beyond_it = pieces[::-1] if at_start else pieces
    return replace(part, roles={**part.roles, "neck": neck, "facing": beyond_it})


def _on_stand(parts: tuple[Part, ...], stand: int, fall: int) -> tuple[Part, ...]:
    """The parts with a fall's role "neck", and a stand's "top" only where the fall is sewn."""
    own = parts[fall]
    runs = sorted(_runs(own), key=own.shape.length)
    top = parts[stand].roles.get("top", ())
    if not runs or not top:
        return parts
    lengths = [own.shape.length(run) for run in runs]
    if len(runs) > 1 and lengths[1] <= (1.0 + DIFFERENT) * lengths[0]:  # alike: the hollow one is the inner one
        runs.sort(key=lambda run: sum(own.shape.bow(k) for k in run))
    wanted = own.shape.length(runs[0])
    made = list(parts)
    made[fall] = replace(own, roles={**own.roles, "neck": runs[0]}, side=BOTH)
    spans = _spans(parts[stand], top, wanted)
    if spans:
        part, pieces = parted(parts[stand], top, spans)
        made[stand] = replace(part, roles={**part.roles, "top": pieces[len(pieces) // 2]})
    return tuple(made)


def _spans(part: Part, top: tuple[int, ...], wanted: float) -> list[float]:
    """From where to where along its upper edge a stand carries a fall this long [m]; empty: all along."""
    total = part.shape.length(top)
    marks = [mark for mark in marks_along(part, top) if 0.0 < mark < total]
    pairs = [(a, b) for a, b in combinations(marks, 2) if FALL_EASE[0] <= wanted / (b - a) - 1.0 <= AT_MARKS]
    near = [(a, b) for a, b in pairs if abs(a - (total - b)) < EXTENSION]  # alike at both ends
    if near:
        return [*min(near, key=lambda pair: abs(wanted - (pair[1] - pair[0])))]
    beyond = 0.5 * (total - wanted)
    return [beyond, total - beyond] if AT_MARKS * wanted < beyond <= EXTENSION else []

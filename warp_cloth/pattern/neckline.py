"""The neckline of a garment, as the runs of edges that collars and hoods meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.kinds import BOTH, LEFT, RIGHT, YOKE_OF
from warp_cloth.pattern.runs import parts_of_kind, run_of, side_mark
from warp_cloth.pattern.sleeves import half_sleeves, is_raglan, sleeve_side
from warp_cloth.pattern.specification import Side

AS_LONG = 0.03  # relative: to which a band is as long as a neckline and both edges of a front


def half_neck(parts: Sequence[Part], side: int) -> tuple[Side, ...]:
    """Half of the neckline, in the order in which a hood or collar on that side meets it against its direction."""
    halves = {}
    for kind in ("front", "back"):
        for panel in parts_of_kind(parts, kind, YOKE_OF[kind]):
            part = parts[panel]
            if part.side not in (BOTH, side):
                continue
            neck = part.roles.get("neck", ())
            if part.side == BOTH:  # the loop runs from +x to -x along a neck; half of it where it was parted
                if part.mirror is None or len(neck) % 2:
                    continue
                half = len(neck) // 2
                neck = neck[:half] if side_mark(part, side) == "+" else neck[half:]
            if neck:
                halves[kind] = run_of(panel, neck, True)
    if len(halves) < 2:
        return ()
    # a hood's neck runs counter-clockwise, seen from outside: on the wearer's left from the face back at -x to +x
    order = ("front", "back") if side == LEFT else ("back", "front")
    between = _sleeve_neck(parts, side, order) if is_raglan(parts) else ()
    return (*halves[order[0]], *between, *halves[order[1]])


def _sleeve_neck(parts: Sequence[Part], side: int, order: Sequence[str]) -> tuple[Side, ...]:
    """The neck of a raglan sleeve, of one piece or of two halves; ``order``: of the faces that they are at."""
    whole = [sleeve for sleeve in parts_of_kind(parts, "sleeve") if sleeve_side(parts, sleeve) == side]
    halves = [half for face in order for half in half_sleeves(parts, f"{face}_sleeve", side)]
    return tuple(each for one in whole[:1] or halves for each in run_of(one, parts[one].roles.get("neck", ()), True))


def neck_from_back(parts: Sequence[Part]) -> tuple[Side, ...]:
    """The whole neckline from the middle of the back, as a band meets it; empty where a half is not known."""
    left, right = half_neck(parts, LEFT), half_neck(parts, RIGHT)
    return (*right, *left) if left and right else ()


def neck_from_front(parts: Sequence[Part]) -> tuple[Side, ...]:
    """The whole neckline from the middle of the front, as a collar that opens there meets it."""
    left, right = half_neck(parts, LEFT), half_neck(parts, RIGHT)
    return (*left, *right) if left and right else ()


def opens_in_front(parts: Sequence[Part]) -> bool:
    """Whether the front is of a left and a right half, which a shirt or jacket leaves open."""
    sides = {parts[panel].side for panel in parts_of_kind(parts, "front")}
    return sides == {LEFT, RIGHT}


def with_neck_to_hem(parts: Sequence[Part], bands: Sequence[float]) -> tuple[Part, ...]:
    """The parts, necklines of an open front led on along its edges to the hem, if a band is as long as all that.

    A robe's band is sewn round its neck and down both fronts; ``bands``: lengths of the one collar's long edges [m].
    """
    if not opens_in_front(parts):
        return tuple(parts)
    made = tuple(_with_centre_in_neck(part) if part.kind == "front" else part for part in parts)
    led_on, plain = (
        sum(each[side.panel].edges[side.edge].length for side in neck_from_front(each)) for each in (made, parts)
    )
    is_led_on = any(abs(band / led_on - 1.0) <= AS_LONG for band in bands) if led_on > plain else False
    return made if is_led_on else tuple(parts)


def _with_centre_in_neck(part: Part) -> Part:
    """Half a front whose role "neck" goes on along its centre."""
    neck, centre = part.roles.get("neck", ()), part.roles.get("centre", ())
    follows = bool(neck and centre) and (centre[-1] + 1) % len(part.edges) == neck[0]
    return replace(part, roles={**part.roles, "neck": (*centre, *neck) if follows else (*neck, *centre), "centre": ()})

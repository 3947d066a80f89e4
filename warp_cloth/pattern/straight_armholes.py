"""Armholes that are straight, as below dropped shoulders: the upper part of a side, told by the sleeve's cap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.runs import parts_of_kind

CAP = (-0.02, 0.04)  # a straight cap over its armhole, less 1
ALIKE = 0.1  # relative: to which its halves in front and behind agree


def with_straight_armholes(parts: Sequence[Part]) -> tuple[Part, ...]:
    """The parts; fronts and backs without any armhole with one from a corner of their sides up, if it fits the sleeve.

    There is none where several ways to part the sides fit, or a shoulder is missing, as in a raglan.
    """
    fronts, backs = parts_of_kind(parts, "front"), parts_of_kind(parts, "back")
    bodices = [parts[panel] for panel in (*fronts, *backs)]
    caps = {round(length, 3) for part in parts if part.kind == "sleeve" if (length := _length(part, "cap")) > 0.0}
    roles = {role[:-1] for part in bodices for role in part.roles}
    if len(caps) != 1 or not fronts or not backs or "armhole" in roles or "shoulder" not in roles:
        return tuple(parts)
    (cap,) = caps
    ways = [
        (ahead, behind)
        for ahead, behind in product(_uppers(parts[fronts[0]]), _uppers(parts[backs[0]]))
        if CAP[0] <= cap / (ahead + behind) - 1.0 <= CAP[1] and abs(ahead - behind) <= ALIKE * max(ahead, behind)
    ]
    if len(ways) != 1:
        return tuple(parts)
    out = list(parts)
    for panels, upper in zip((fronts, backs), ways[0], strict=True):
        for panel in panels:
            out[panel] = _with_armholes(parts[panel], upper)
    return tuple(out)


def _length(part: Part, role: str) -> float:
    return part.shape.length(part.roles.get(role, ()))


def _uppers(part: Part) -> list[float]:
    """Lengths of a side's upper part, from each of its corners up to the shoulder [m]."""
    side = part.roles.get("side+") or part.roles.get("side-", ())[::-1]
    return [part.shape.length(side[first:]) for first in range(1, len(side))]


def _with_armholes(part: Part, long: float) -> Part:
    """A front or back with an armhole of a length at the upper end of each side, where a corner is there."""
    roles = dict(part.roles)
    for mark, step in (("+", 1), ("-", -1)):
        side = roles.get(f"side{mark}", ())[::step]
        for first in range(1, len(side)):
            if abs(part.shape.length(side[first:]) - long) <= ALIKE * ALIKE * long:
                roles[f"side{mark}"], roles[f"armhole{mark}"] = side[:first][::step], side[first:][::step]
    return replace(part, roles=roles)

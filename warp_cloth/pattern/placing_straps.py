"""Where straps start: from the top of the front up, over the shoulder, and down to the top of the back."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warp_cloth.base.curves import arc_lengths
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.figure import Figure
from warp_cloth.pattern.joints import Joint
from warp_cloth.pattern.levels import LEVELS, armpit_of
from warp_cloth.pattern.runs import parts_of_kind
from warp_cloth.pattern.straps import STRAP, has_straps
from warp_cloth.pattern.wrap import Laid, Wrap

OVER = 0.6  # of the way from the trunk's middle to cloth in front or behind, where a strap bends over the shoulder
MIDWAY = np.linspace(0.0, 1.0, 9)


def strap(
    parts: Sequence[Part], joints: Sequence[Joint], found: Sequence[Laid | None], index: int, figure: Figure
) -> Wrap | None:
    """A strap as an arch over the shoulder between its two seams; None: it is not sewn at both ends."""
    part = parts[index]
    ends = [part.roles.get(role, ()) for role in ("end", "end2")]
    front, back = (_sewn_at(parts, joints, found, index, own) for own in ends)
    if front is None or back is None:
        return None
    top = max(float(figure.neck[1]), float(front[1]), float(back[1]))
    path = [front, _raised(front, top, figure), _raised(back, top, figure)]
    line = np.array([*path, back])
    middles = [np.mean([part.edges[k].at(MIDWAY).mean(axis=0) for k in own], axis=0) for own in ends]
    along = (middles[1] - middles[0]) / max(float(np.linalg.norm(middles[1] - middles[0])), 1e-9)
    levels = np.linspace(float(middles[0] @ along), float(middles[1] @ along), LEVELS)
    reached = arc_lengths(line)
    at = np.linspace(0.0, float(reached[-1]), LEVELS)
    origin = np.column_stack([np.interp(at, reached, axis) for axis in line.T])
    toward = np.gradient(origin, axis=0)
    across = np.tile(figure.left, (LEVELS, 1))
    outward = np.cross(across, toward)
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
    aside = np.array([along[1], -along[0]])
    centre = np.linspace(float(middles[0] @ aside), float(middles[1] @ aside), LEVELS)
    return Wrap(along, levels, centre, np.zeros(LEVELS), origin, across, outward)


def _raised(spot: Floats, top: float, figure: Figure) -> Floats:
    """Where the strap from a place bends over the shoulder, nearer to the trunk's middle."""
    nearer = (OVER - 1.0) * float((spot - figure.middle) @ figure.forward)
    return np.array([spot[0], top, spot[2]]) + nearer * figure.forward


def _sewn_at(
    parts: Sequence[Part], joints: Sequence[Joint], found: Sequence[Laid | None], index: int, own: Sequence[int]
) -> Floats | None:
    """The middle of what an end of a strap is sewn to, where that starts, shape [3]."""
    mine = {(index, k) for k in own}
    for joint in joints:  # a stated seam may name either side first
        for one, other in ((joint.one, joint.other), (joint.other, joint.one)):
            if {(side.panel, side.edge) for side in one} == mine:
                laid = [
                    wrap.placed(parts[side.panel].edges[side.edge].at(MIDWAY))
                    for side in other
                    if (wrap := found[side.panel]) is not None
                ]
                return np.concatenate(laid).mean(axis=0) if laid else None
    return None


def below_straps(parts: Sequence[Part], index: int, figure: Figure) -> float:
    """How far below the neck a front or back starts that hangs from straps [m]: both with their armpits as high.

    The straps take the way over the shoulder in equal shares.
    """
    if not has_straps(parts[index]):
        return 0.0
    lengths = [float(max(np.ptp(np.array(parts[each].shape.box), axis=0))) for each in parts_of_kind(parts, STRAP)]
    lowered = max(0.5 * (max(lengths) - figure.front - figure.back), 0.0)
    deepest = max(armpit_of(part) for part in parts if has_straps(part))
    return lowered + deepest - armpit_of(parts[index])

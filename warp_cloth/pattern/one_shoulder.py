"""Tops with one shoulder: a whole front and back, neither of them symmetric, whose other side ends under the arm.

By their shape they look like halves: the side without a shoulder like the middle, and the neckline that slants across
the chest like half a neck, or like a waist. No half is cut so: its neck would be wider than deep, and still deep.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warp_cloth.pattern.bodices import arm_side, bodice_roles
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.piece import Piece
from warp_cloth.pattern.roles import SHOULDER_FALL, Roles, Shape, upright

# Of the width, that such a neckline runs across at least; how far it falls on its way, and of the whole height
ACROSS, STEEP, DEEP = 0.6, 0.3, 0.25
DIP = 0.01  # [m] that half a neck or waist rises on its way down to the middle, at most
SIDES_ALIKE = 0.02  # relative: to which its two sides are as long, and front and back at what is sewn
SHOULDER = (0.03, 0.2)  # [m] long


def one_shoulder_roles(shape: Shape) -> Roles:
    """hem, neck; side at "+" and "-", shoulder and armhole at one of them; empty where it is none such.

    The armhole begins where the side is as long as the other one.
    """
    half = bodice_roles(shape, False, arm_side)
    centre, neck = half.get("centre", ()), half.get("neck", ())
    mark = next((mark for mark in "+-" if half.get(f"shoulder{mark}")), "")
    if not centre or not neck or not mark or not slants(shape, neck):
        return {}
    up = [k for role in ("side", "armhole", "shoulder") for k in half.get(f"{role}{mark}", ())[:: _step(mark)]]
    shoulder = up[-1]
    x, y = np.abs(shape.chord(shoulder))
    is_one = shape.is_straight(shoulder) and SHOULDER[0] < shape.length((shoulder,)) < SHOULDER[1]
    long = shape.length(centre)
    fits = [n for n in range(1, len(up) - 1) if abs(shape.length(up[:n]) - long) <= SIDES_ALIKE * long]
    if not is_one or y < SHOULDER_FALL * x or len(fits) != 1:
        return {}
    parted = {"side": up[: fits[0]], "armhole": up[fits[0] : -1], "shoulder": up[-1:]}
    sides: Roles = {f"{role}{mark}": tuple(run)[:: _step(mark)] for role, run in parted.items()}
    return {"hem": half["hem"], "neck": neck, f"side{'-' if mark == '+' else '+'}": centre} | sides


def _step(mark: str) -> int:
    return 1 if mark == "+" else -1


def slants(shape: Shape, run: Sequence[int]) -> bool:
    """Whether the upper edge of what seems half a piece runs down across most of it, as no neck or waist does."""
    across, along = np.abs(_chord(shape, run))
    width, height = np.ptp(np.array(shape.box), axis=0)
    return bool(across > ACROSS * width and along > max(STEEP * across, DEEP * height))


def is_no_half(shape: Shape, roles: Roles) -> bool:
    """Whether what seems half a front or back is a whole one that is not symmetric, by its neck, shoulder or waist.

    One of them slants, or goes down and up again over the neck of both sides; or an armhole rises outwards.
    """
    upper = roles.get("waist", roles.get("neck", ()))
    runs = [upper, *(run for role, run in roles.items() if role.startswith("shoulder"))]
    rises = [_step(mark) * float(_chord(shape, roles.get(f"armhole{mark}", ()))[1]) for mark in "+-"]
    return slants(shape, upper) or min(rises) < -DIP or any(_dips(shape, run) for run in runs if run)


def _dips(shape: Shape, run: Sequence[int]) -> bool:
    """Whether a run of edges does not go down all the way from its higher end."""
    heights = np.concatenate([shape.turned[k].at(np.linspace(0.0, 1.0, 33))[:, 1] for k in run])
    downward = heights if heights[0] >= heights[-1] else heights[::-1]
    return bool((downward - np.minimum.accumulate(downward)).max() > DIP)


def _chord(shape: Shape, run: Sequence[int]) -> Floats:
    return np.asarray(sum((shape.chord(k) for k in run), np.zeros(2)))


def have_one_shoulder(pieces: Sequence[Piece]) -> bool:
    """Whether the only front and the only back have one shoulder, with seams as long on both, and on one side."""
    found = []
    for face in ("front", "back"):
        own = [piece for piece in pieces if piece.what.kind == face]
        if len(own) != 1 or own[0].mirror is not None or own[0].what.panel or sum(own[0].copies or (1, 0)) != 1:
            return False
        shape = Shape(own[0].edges, upright(own[0].edges, face))
        roles = one_shoulder_roles(shape)
        if not roles:
            return False
        mark = "+" if "shoulder+" in roles else "-"
        lengths = [shape.length(roles[f"{role}{mark}"]) for role in ("shoulder", "side")]
        found.append((mark, lengths))
    (front, here), (back, there) = found
    alike = all(abs(a - b) <= SIDES_ALIKE * max(a, b) for a, b in zip(here, there, strict=True))
    return front != back and alike  # a front and a back are each seen from outside

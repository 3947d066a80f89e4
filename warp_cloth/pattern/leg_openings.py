"""Fronts and backs that end between the legs, like a bodysuit's: a narrow crotch, and openings for legs."""

from __future__ import annotations

from itertools import takewhile

from warp_cloth.pattern.roles import Roles, Shape

CROTCH_UP_TO = 0.2  # [m] of the lower edge of a whole front or back; no garment that hangs down is as narrow
REACH = 0.06  # [m] that an opening runs outwards from it at least


def with_leg_openings(shape: Shape, roles: Roles, whole: bool) -> Roles:
    """The roles of a front or back; of one that ends between the legs, crotch for hem, and legs apart from sides."""
    crotch = roles.get("hem", ())
    if not crotch or shape.length(crotch) * (1.0 if whole else 2.0) > CROTCH_UP_TO:
        return roles
    made = {role: run for role, run in roles.items() if role != "hem"} | {"crotch": crotch}
    reach = [float(shape.chord(k)[0]) for k in range(len(shape.edges))]  # outwards on both sides: up at +x, down at -x
    for mark in "+-":
        side = roles.get(f"side{mark}", ())
        if not side:
            continue
        legs = tuple(takewhile(lambda k: reach[k] > 0.0, side if mark == "+" else side[::-1]))
        if len(legs) == len(side) or sum(reach[k] for k in legs) < REACH:
            return roles
        made[f"leg{mark}"] = tuple(k for k in side if k in legs)
        made[f"side{mark}"] = tuple(k for k in side if k not in legs)
    return made

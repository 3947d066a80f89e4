"""Fronts and backs that end between the legs, like a bodysuit's: a narrow crotch, and openings for legs."""

from __future__ import annotations

from itertools import takewhile

import numpy as np

from warp_cloth.pattern.panel_roles import smooth_runs
from warp_cloth.pattern.roles import Roles, Shape

CROTCH_UP_TO = 0.2  # [m] of the lower edge of a whole front or back; no garment that hangs down is as narrow
REACH = 0.06  # [m] that an opening runs outwards from it at least
LEVEL_CROTCH = 0.25  # rise over run of one at most: a waistcoat's front ends in a point
SLANT = 0.15  # run over rise of an opening's edges at least; a side seam above it is steeper
RISE = 0.08  # [m] that one rises at least which lies in what was taken for the hem: a hem's end may be rounded


def with_leg_openings(shape: Shape, roles: Roles, whole: bool) -> Roles:
    """The roles of a front or back; of one that ends between the legs, crotch for hem, and legs apart from sides."""
    crotch = _crotch(shape, roles, whole)
    if not crotch or shape.length(crotch) * (1.0 if whole else 2.0) > CROTCH_UP_TO:
        return roles
    made = {role: run for role, run in roles.items() if role != "hem"} | {"crotch": crotch}
    hem = roles["hem"]
    reach = [float(shape.chord(k)[0]) for k in range(len(shape.edges))]  # outwards on both sides: up at +x, down at -x
    rise = [abs(float(shape.chord(k)[1])) for k in range(len(shape.edges))]
    for mark in "+-":
        side = roles.get(f"side{mark}", ())
        if not side:
            continue
        step = 1 if mark == "+" else -1
        flat = hem[hem.index(crotch[-1]) + 1 :] if mark == "+" else hem[: hem.index(crotch[0])][::-1]
        legs = (*flat, *takewhile(lambda k: reach[k] > SLANT * rise[k], side[::step]))
        if {*side} <= {*legs} or sum(reach[k] for k in legs) < REACH:
            return roles
        if flat and sum(rise[k] for k in legs) < RISE:
            return roles
        made[f"leg{mark}"] = legs[::step]
        made[f"side{mark}"] = tuple(k for k in side if k not in legs)
    return made


def _crotch(shape: Shape, roles: Roles, whole: bool) -> tuple[int, ...]:
    """The lower edge without openings for legs that run flat: from corner to corner at the middle, if it is level."""
    hem = roles.get("hem", ())
    runs = smooth_runs(shape, hem)
    if len(runs) != (3 if whole else 2):
        return hem
    middle = runs[1] if whole or "side-" in roles else runs[0]
    x, y = np.abs(sum(shape.chord(k) for k in middle))
    return middle if y < LEVEL_CROTCH * x else hem

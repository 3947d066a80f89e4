"""Edges of panels that are parts of a front, back or sleeve: princess seams, and under sleeves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warp_cloth.pattern.bodices import arm_side, bodice_roles
from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.piece import Piece
from warp_cloth.pattern.roles import BENT, UPWARDS, Roles, Shape, ends_of, sleeve_roles

SHARP = 0.5 * BENT  # turn at which one seam ends and another begins
PLUMB = 0.01  # across over along, of the middle of half a skirt
LONG = 0.3  # of a skirt's height, that its middle runs straight at least
# Of a front's or back's height, between which the fork of a leg in one with it is, and [m] by which it stands out
FORK_AT, FORK_OUT = (0.05, 0.62), 0.02
TIP, LEGS_ALIKE = np.radians(90.0), 0.02  # turn at a godet's tip, at least, and relative difference of its legs
NECK_UP_TO = 0.12  # [m] of a raglan's neck, on half of a sleeve
TO_NOTCH = 0.06  # of the top of an under sleeve, from its lowest point to the notch at the side seam


def side_panel_roles(shape: Shape) -> Roles:
    """hem, princess; side, armhole and shoulder at "+" or "-".

    The highest corner ends the princess seam, whether it comes from the armhole or from the shoulder. That seam has no
    corner; on the other side the armhole begins at one.
    """
    (hem_first, hem_end), _ = ends_of(shape)
    starts = [float(shape.turned[k].start[1]) for k in shape.order]
    tip = int(np.argmax(starts))
    right, left = shape.run(hem_end, tip), shape.run(tip, hem_first)
    roles: Roles = {"hem": shape.run(hem_first, hem_end)}
    if not right or not left:
        return roles
    corners = [float(len(smooth_runs(shape, path))) for path in (right, left)]
    if corners[0] == corners[1]:
        corners = [-shape.length(path) for path in (right, left)]
    if corners[0] < corners[1]:
        return roles | {"princess": right} | _outer_side(shape, left, "-")
    return roles | {"princess": left} | _outer_side(shape, right, "+")


def legged_roles(shape: Shape) -> Roles:
    """Of half a front or back in one with a leg: hem, inseam, centre, neck, and what its other side has; else empty.

    Its inner side has a corner at the fork, which stands out below a hollow crotch.
    """
    (hem_first, hem_end), _ = ends_of(shape)
    tip = int(np.argmax([float(shape.turned[k].start[1]) for k in shape.order]))
    paths = {"+": shape.run(hem_end, tip), "-": shape.run(tip, hem_first)}
    for mark, other in ("+-", "-+"):
        inner, outer = paths[mark], paths[other]
        fork = _fork(shape, inner, 1.0 if mark == "+" else -1.0)
        if fork is None or len(outer) < 2:
            continue
        below, above = (inner[:fork], inner[fork:]) if mark == "+" else (inner[fork:], inner[:fork])
        runs = smooth_runs(shape, above)
        neck, *rest = runs[::-1] if mark == "+" else runs
        centre = tuple(k for k in above if k not in neck)
        arm = arm_side(shape, outer if other == "+" else outer[::-1], other)
        hollow = all(any(shape.is_concave(k) for k in run) for run in (neck, centre))
        if not rest or not hollow or len(arm) < 3:  # an underarm's corner beside a straight centre is no fork
            continue
        roles = {"hem": shape.run(hem_first, hem_end), "inseam": below, "centre": centre, "neck": neck}
        return roles | arm
    return {}


def _fork(shape: Shape, path: Sequence[int], sign: float) -> int | None:
    """The place in a path of the edge that begins at its outermost corner, if that stands out in the lower part."""
    if len(path) < 3:
        return None
    corners = np.array([shape.turned[k].start for k in path[1:]])
    outs = sign * corners[:, 0]
    place = int(outs.argmax())
    low, high = shape.box
    share = float((corners[place, 1] - low[1]) / (high[1] - low[1]))
    upper = float(outs[corners[:, 1] > corners[place, 1]].max(initial=-np.inf))
    stands_out = float(outs[place]) - upper > FORK_OUT
    return 1 + place if FORK_AT[0] < share < FORK_AT[1] and stands_out else None


def yoke_roles(shape: Shape, whole: bool) -> Roles:
    """Of a yoke at the neck: hem, neck; shoulder and armhole at "+" and "-"; of a half also centre, with one side."""
    roles = bodice_roles(shape, whole, _yoke_side)
    marks = [mark for mark in "+-" if roles.get(f"shoulder{mark}") and roles.get(f"armhole{mark}")]
    hollow = any(shape.is_concave(k) for k in roles.get("neck", ()))
    return roles if hollow and len(marks) == 1 + whole and (whole or roles.get("centre")) else {}


def _yoke_side(shape: Shape, up: Sequence[int], mark: str) -> Roles:
    """Armhole and shoulder of a yoke's edges from its hem up to the neck; runs as the loop runs."""
    as_loop = slice(None, None, 1 if mark == "+" else -1)
    return {f"armhole{mark}": tuple(up[:-1])[as_loop], f"shoulder{mark}": tuple(up[-1:])}


def yoked_roles(shape: Shape, whole: bool) -> Roles:
    """Of a front or back below a yoke: hem, top; side and armhole at "+" and "-"; a half also has a centre."""
    (hem_first, hem_end), (top_first, top_end) = ends_of(shape)
    roles: Roles = {"hem": shape.run(hem_first, hem_end), "top": shape.run(top_first, top_end)}
    for mark, path in (("+", shape.run(hem_end, top_first)), ("-", shape.run(top_end, hem_first))):
        if not path:
            return {}
        if not whole and all(shape.is_straight(k) for k in path):
            roles["centre"] = path
            continue
        runs = smooth_runs(shape, path)
        top = runs[-1] if mark == "+" else runs[0]
        if len(runs) < 2 or not any(shape.is_concave(k) for k in top):
            return {}
        roles |= {f"side{mark}": tuple(k for k in path if k not in top), f"armhole{mark}": top}
    return roles


def half_skirt_roles(shape: Shape) -> Roles:
    """Of half a skirt's front or back: hem, waist, centre, and side at "+" or "-"; empty where none is its middle.

    Its middle runs straight down from the waist, its side does not: it is bowed over the hip, or slants.
    """
    (hem_first, hem_end), (waist_first, waist_end) = ends_of(shape)
    runs = {"+": shape.run(hem_end, waist_first), "-": shape.run(waist_end, hem_first)}
    if not all(runs.values()):
        return {}
    uppermost = {"+": runs["+"][-1], "-": runs["-"][0]}
    plumb = [mark for mark, edge in uppermost.items() if _is_plumb(shape, edge)]
    if len(plumb) != 1:
        return {}
    side = "-" if plumb[0] == "+" else "+"
    ends = {"hem": shape.run(hem_first, hem_end), "waist": shape.run(waist_first, waist_end)}
    return ends | {"centre": runs[plumb[0]], f"side{side}": runs[side]}


def _is_plumb(shape: Shape, k: int) -> bool:
    """Whether an edge is long, straight and along the grain."""
    x, y = np.abs(shape.chord(k))
    height = float(np.ptp(np.array(shape.box), axis=0)[1])
    return bool(x < PLUMB * y and y > LONG * height and abs(shape.bow(k)) < PLUMB * y)


def _outer_side(shape: Shape, path: tuple[int, ...], mark: str) -> Roles:
    """Side, armhole and shoulder of a side panel; no shoulder where the princess seam comes from the armhole."""
    runs = smooth_runs(shape, path)
    top = runs[-1] if mark == "+" else runs[0]
    if len(runs) < 2 or not any(shape.is_concave(k) for k in top):
        return arm_side(shape, path if mark == "+" else path[::-1], mark)
    return {f"side{mark}": tuple(k for k in path if k not in top), f"armhole{mark}": top}


def middle_side(shape: Shape, up: Sequence[int], mark: str) -> Roles:
    """princess, armhole and shoulder of a middle panel's edges from the hem up to the neck; runs as the loop runs."""
    along = tuple(up) if mark == "+" else tuple(up)[::-1]
    runs = smooth_runs(shape, along)
    runs = runs if mark == "+" else runs[::-1]
    names = ("princess", "shoulder") if len(runs) == 2 else ("princess", "armhole", "shoulder")
    return {f"{name}{mark}": run for name, run in zip(names, runs, strict=False)} if len(runs) in (2, 3) else {}


def smooth_runs(shape: Shape, path: Sequence[int]) -> list[tuple[int, ...]]:
    """A path along the loop parted at its sharp corners."""
    runs: list[tuple[int, ...]] = []
    for place, k in enumerate(path):
        if place and abs(shape.turn_after(path[place - 1])) <= SHARP:
            runs[-1] = (*runs[-1], k)
        else:
            runs.append((k,))
    return runs


def half_sleeve_roles(shape: Shape) -> Roles:
    """Of the front or back half of a sleeve: hem, under and over along the arm, and cap; of a raglan's also neck.

    "inner+" or "inner-" tells on which side its seam beneath the arm is: the shorter one. What is between the hem and
    the corner at the underarm is that seam, what goes on from there the cap; a raglan's ends at a short neck.
    """
    count = len(shape.edges)
    (hem_first, hem_end), _ = ends_of(shape)
    hem = shape.run(hem_first, hem_end)
    runs = smooth_runs(shape, shape.run(hem_end, hem_first))
    if len(runs) < 3 or len(shape.order) < count:
        return {}
    mark = "+" if shape.length(runs[0]) < shape.length(runs[-1]) else "-"
    under, cap, *others = runs if mark == "+" else runs[::-1]
    is_raglan = len(others) > 1 and shape.length(others[0]) < NECK_UP_TO
    neck, over = (others[0], others[1:]) if is_raglan else ((), others)
    along = tuple(k for run in (over if mark == "+" else over[::-1]) for k in run)
    return {"hem": hem, "under": under, "cap": cap, "over": along, f"inner{mark}": ()} | (
        {"neck": neck} if neck else {}
    )


def godet_roles(shape: Shape) -> Roles:
    """Of a godet its two legs, as its loop runs: up to the tip, and down from it; empty where it has none."""
    count = len(shape.edges)
    found = []
    for up, down in ((k, (k + 1) % count) for k in range(count)):
        lengths = shape.edges[up].length, shape.edges[down].length
        are_straight = shape.is_straight(up) and shape.is_straight(down)
        if are_straight and shape.turn_after(up) > TIP and min(lengths) > (1.0 - LEGS_ALIKE) * max(lengths):
            found.append((max(lengths), (up, down)))
    return {"legs": max(found)[1]} if found else {}


def is_cut_across(piece: Piece) -> bool:
    """Whether a sleeve's lower piece has straight ends: a forearm, and no under sleeve, whose top is hollow."""
    shape = Shape(piece.edges, UPWARDS)
    return all(shape.is_straight(k) for k in shape.order if shape.runs_across(k))


def parted_at_underarm(edges: tuple[Chain, ...], up: Floats, notches: Floats) -> tuple[Chain, ...]:
    """An under sleeve whose top ends where the side seam meets it: at its lowest point, or the notch near that."""
    shape = Shape(edges, up)
    top = sleeve_roles(shape).get("cap", ())
    if not top:
        return edges
    shares = np.linspace(0.0, 1.0, 257)
    lowest = min(top, key=lambda k: float(shape.turned[k].at(shares)[:, 1].min()))
    edge = edges[lowest]
    at = float(shares[int(shape.turned[lowest].at(shares)[:, 1].argmin())])
    for notch in notches:
        apart = np.hypot(*(edge.at(shares) - notch).T)
        near = float(shares[int(apart.argmin())])
        if apart.min() < 3e-3 and abs(near - at) < TO_NOTCH:
            at = near
            break
    if not 0.05 < at < 0.95:
        return edges
    return (*edges[:lowest], edge.part(0.0, at), edge.part(at, 1.0), *edges[lowest + 1 :])

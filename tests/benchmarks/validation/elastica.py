"""The heavy elastica, solved by SciPy's boundary-value solver: what strips of cloth must look like.

A strip of weight w per area bends in a plane, its length kept. s runs along it, theta is its angle over the horizontal,
M the moment per width, and (H, V) the force per width that the part beyond s pulls with:

    x' = cos theta    z' = sin theta    theta' = curvature(M)    M' = H sin theta - V cos theta    H' = 0    V' = w

The model's law is M = b curvature^2 / 2 (``power`` 1/2), a laboratory's line M = B curvature (``power`` 1). Friction
adds up to h either way (``Slider``). Lengths here are in l = (b / 2 w)^(1/4), which is 1.047 bending lengths c.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid, solve_bvp
from scipy.optimize import brentq

from warp_cloth.material.laboratory import MATCHED_FOLD

Floats = NDArray[np.float64]

LENGTH = MATCHED_FOLD**-0.25  # l over the bending length c
SOFT = 1e-5  # moments below are taken as linear: the root's slope at 0 is infinite
POINTS = 401
BISECTIONS = 45


@dataclass(frozen=True)
class Strip:
    """Half a strip that is held at both ends, up to its middle; or a whole one, whose end is free."""

    span: float  # its length, in l
    first: float  # angle at the clamp [rad]
    last: float | None = None  # angle in the middle [rad]; None: the end is free
    reach: float = 0.0  # x in the middle


@dataclass(frozen=True, eq=False)
class Shape:
    """A strip's line, shape [N] each."""

    s: Floats
    x: Floats
    z: Floats
    curvature: Floats | None = None  # where it was solved for


@dataclass(frozen=True, eq=False)
class Slider:
    """Friction that resists a change of curvature from the one that the strip was laid into; units of l and w."""

    moment: float
    clinging: float  # change at which the moment is reached
    laid: Shape | None = None  # whose curvature the strip was laid into; None: flat


def curvature(moment: Floats, power: float) -> Floats:
    """Curvature at a moment, both in the units of l and w."""
    if power == 1.0:
        return np.asarray(moment / LENGTH**-3)  # M = B k, B = w c^3
    return np.asarray(moment * (moment**2 + SOFT**2) ** (0.5 * (power - 1.0)))


def rubbing_curvature(s: Floats, moment: Floats, slider: Slider) -> Floats:
    """Curvature where M = k |k| + h min(max((k - laid) / clinging, -1), 1), found by bisection."""
    laid = 0.0 * s
    if slider.laid is not None and slider.laid.curvature is not None:
        laid = np.interp(s, slider.laid.s, slider.laid.curvature)
    reach = np.sqrt(np.abs(moment) + slider.moment) + SOFT
    low, high = -reach, reach
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        held = slider.moment * np.clip((middle - laid) / slider.clinging, -1.0, 1.0)
        below = middle * np.abs(middle) + held < moment
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.asarray(0.5 * (low + high))


def guess(strip: Strip) -> tuple[Floats, Floats]:
    """A smooth line with the right ends: length along it and angle. Simulated strips start so, too."""
    t = np.linspace(0.0, 1.0, POINTS)
    if strip.last is None:
        return strip.span * t, np.asarray(strip.first - 1.2 * t)
    straight = strip.first + (strip.last - strip.first) * t

    def missed(bulge: float) -> float:
        angle = straight + bulge * np.sin(np.pi * t)
        return float(strip.span * np.trapezoid(np.cos(angle), t) - strip.reach)

    down = -1.0 if strip.last == strip.first else 1.0  # such a strip sags
    tried = down * np.concatenate([np.linspace(0.0, 2.2, 45), np.linspace(0.0, -2.2, 45)])
    values = [missed(bulge) for bulge in tried]
    at = next(i for i in range(len(tried) - 1) if values[i] * values[i + 1] <= 0.0)
    return strip.span * t, np.asarray(straight + brentq(missed, tried[at], tried[at + 1]) * np.sin(np.pi * t))


def line(s: Floats, angle: Floats) -> Shape:
    x, z = (np.asarray(cumulative_trapezoid(part, s, initial=0.0)) for part in (np.cos(angle), np.sin(angle)))
    return Shape(s, x, z)


def solve(strip: Strip, power: float = 0.5, slider: Slider | None = None, heavier: float = 1.0) -> Shape:
    """The strip's line at rest, under a multiple of its weight. This grows from nearly none: the solver follows it.

    Raises:
        RuntimeError: the solver finds none.
    """
    s, angle = guess(strip)
    start = line(s, angle)
    moment = np.gradient(angle, s)
    state, pull = np.stack([start.x, start.z, angle, moment * np.abs(moment)]), np.array([0.0])
    if power == 1.0:
        state[3] = moment * LENGTH**-3
    found = None
    for fraction in (0.03, 0.1, 0.2, 0.4, 0.7, 1.0):
        weight = fraction * heavier

        def change(at: Floats, y: Floats, p: Floats, weight: float = weight) -> Floats:
            below = weight * (at - strip.span)  # V
            turn = p[0] * np.sin(y[2]) - below * np.cos(y[2])
            bent = curvature(y[3], power) if slider is None else rubbing_curvature(at, y[3], slider)
            return np.stack([np.cos(y[2]), np.sin(y[2]), bent, turn])

        def ends(a: Floats, b: Floats, p: Floats) -> Floats:
            held = [a[0], a[1], a[2] - strip.first]
            if strip.last is None:
                return np.array([*held, b[3], p[0]])
            return np.array([*held, b[0] - strip.reach, b[2] - strip.last])

        found = solve_bvp(change, ends, s, state, p=pull, tol=1e-6, max_nodes=100_000)
        if not found.success:
            raise RuntimeError(f"{strip} at {weight} of its weight: {found.message}")
        s, state, pull = found.x, found.y, found.p
    bent = curvature(state[3], power) if slider is None else rubbing_curvature(s, state[3], slider)
    return Shape(s, state[0], state[1], bent)

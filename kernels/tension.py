"""Tension of an edge: the paper's asymmetric quadratic law (section 2.2 a), weaker when pushed than when pulled."""

from typing import Any

import warp as wp


@wp.func
def tension_force(length: Any, rest: Any, pull: Any, push: Any):
    """Signed force of an edge [N], positive where it pulls its ends together.

    f = pull (r - L)^2 for r > L, f = -push (L - r)^2 for r < L, with push = c pull.
    """
    stretch = length - rest
    stiffness = wp.where(stretch > type(length)(0.0), pull, push)
    return stiffness * stretch * wp.abs(stretch)


@wp.func
def tension_energy(length: Any, rest: Any, pull: Any, push: Any):
    """Energy of an edge [J], E = k/3 |r - L|^3, whose gradient is ``tension_force``."""
    stretch = length - rest
    stiffness = wp.where(stretch > type(length)(0.0), pull, push)
    return stiffness * stretch * stretch * wp.abs(stretch) / type(length)(3.0)


@wp.func
def tension_stiffness(length: Any, rest: Any, pull: Any, push: Any, reach: Any):
    """Largest slope of the force [N/m] while the edge changes its length by no more than ``reach`` [m].

    f' = 2 k |r - L|; the stiffness across the edge, f / r, is smaller wherever the edge is pulled.
    """
    stretch = length - rest
    stiffness = wp.where(stretch + reach > type(length)(0.0), pull, push)
    return type(length)(2.0) * stiffness * (wp.abs(stretch) + reach)

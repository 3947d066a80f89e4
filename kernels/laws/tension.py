"""Tension: the paper's asymmetric quadratic law (section 2.2 a), weaker when pushed together than when pulled.

With s the stretch of an edge (current length less rest length) or of a yarn of unit rest length:

    f = pull s^2 for s > 0,  f = -push s^2 for s < 0,  push = c pull,  0 < c < 1

All functions take one edge, a packet of eight edges or, where they say so, the four yarns of a triangle.
"""

from typing import Any

import warp as wp

from warp_cloth.kernels.base.options import SpringField
from warp_cloth.kernels.math.operators import add, div, mul, sub  # noqa: F401  what + - * / below call for packets
from warp_cloth.kernels.math.packet import absolute, component, dot, maximum, minimum, where_greater
from warp_cloth.kernels.math.real import single, where_positive

SHORTEST = wp.constant(single(1.0e-20))  # of what collapsed cloth would divide by


@wp.func
def spring_constants(spring: Any):
    """Rest length [m], pull and push [N/m2] of an edge."""
    return (
        component(spring, SpringField.LENGTH),
        component(spring, SpringField.PULL),
        component(spring, SpringField.PUSH),
    )


@wp.func
def tension_force(stretch: Any, pull: Any, push: Any):
    """Signed force of an edge [N], positive where it pulls its ends together.

    f = k s |s|, with k = pull where s > 0, else push.
    """
    return where_positive(stretch, pull, push) * stretch * absolute(stretch)


@wp.func
def tension_stiffness(stretch: Any, pull: Any, push: Any, allowance: Any):
    """Largest slope of the force [N/m] while the stretch changes by no more than ``allowance``; of yarns, too.

    f' = 2 k |s|, so at most 2 k (|s| + allowance), with k = pull where s + allowance > 0, else push. The stiffness
    across an edge, f / r, is smaller wherever the edge is pulled.
    """
    two = type(stretch)(2.0)
    return two * where_positive(stretch + allowance, pull, push) * (absolute(stretch) + allowance)


@wp.func
def transverse_fraction(length: Any, force: Any, stiffness: Any, change: Any, horizon: Any):
    """Fraction of an edge's stiffness bound that acts across it.

    a = min(|f| / (r k) + (horizon change / r)^2, 1): across an edge acts its force, by |f| / r (pushed together it does
    not resist there, but buckles no faster than by that), and what of its stiffness k comes to lie there as it turns,
    by the square of the angle: ``horizon`` times as far as the last displacements turned it.

    Args:
        length: r [m].
        force: ``tension_force`` f [N].
        stiffness: its bound k [N/m].
        change: how far the last displacements moved the ends against each other [m].
        horizon: how many such changes ahead the edge may turn.
    """
    zero, one = type(length)(0.0), type(length)(1.0)
    rotation = change * horizon / length
    fraction = absolute(force) / maximum(length * stiffness, type(length)(SHORTEST))
    across = minimum(fraction + rotation * rotation, one)
    return where_greater(minimum(length, stiffness), zero, across, one)


@wp.func
def damped_change(side: Any, rest: Any, change: Any, fraction: Any, buckling: Any):
    """The part of a change that an edge damps: all of it along the edge, across it only ``fraction``.

    Where a step goes further across, as much damping there as along would hold it back: folds, half of whose yarns are
    always shortened, would creep. Buckling is to be held back: of an edge shorter than ``rest`` [m] at least the
    fraction ``buckling`` is damped.
    """
    square = maximum(dot(side, side), type(fraction)(SHORTEST))
    along = side * (dot(side, change) / square)
    across = where_greater(square, rest * rest, fraction, maximum(fraction, type(fraction)(buckling)))
    return along + (change - along) * across

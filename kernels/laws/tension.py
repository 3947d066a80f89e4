"""Tension of an edge: the paper's asymmetric quadratic law (section 2.2 a), weaker when pushed than when pulled."""

from typing import Any

import warp as wp

from warp_cloth.kernels.math.packet import (
    above,
    alike,
    differences,
    dot,
    least,
    most,
    products,
    scaled,
    sizes,
    sums,
    times,
)
from warp_cloth.kernels.math.real import quotient

SHORTEST = wp.constant(1.0e-20)  # of what collapsed cloth would divide by


@wp.func
def tension_force(length: Any, rest: Any, pull: Any, push: Any):
    """Signed force of an edge [N], positive where it pulls its ends together.

    f = pull (r - L)^2 for r > L, f = -push (L - r)^2 for r < L, with push = c pull.
    """
    return stretch_force(differences(length, rest), pull, push)


@wp.func
def stretch_force(stretch: Any, pull: Any, push: Any):
    """``tension_force`` by r - L [m]."""
    stiffness = above(stretch, alike(stretch, float(0.0)), pull, push)
    return products(products(stiffness, stretch), sizes(stretch))


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
    stretch = differences(length, rest)
    stiffness = above(sums(stretch, reach), alike(length, float(0.0)), pull, push)
    return products(products(alike(length, float(2.0)), stiffness), sums(sizes(stretch), reach))


@wp.func
def share_across(length: Any, rest: Any, pull: Any, push: Any, stiffness: Any, change: Any, horizon: Any):
    """Share of an edge's bound of stiffness [N/m] that acts across it.

    That is its force, by |f| / r (pushed together it does not resist there, but buckles no faster than by that), and
    what of its stiffness comes to lie there as it turns, by the square of the angle: ``horizon`` times as far as the
    last displacements turned it, which changed it by ``change`` [m].
    """
    none, one = alike(length, float(0.0)), alike(length, float(1.0))
    turn = quotient(times(change, horizon), length)
    force = sizes(tension_force(length, rest, pull, push))
    share = quotient(force, most(products(length, stiffness), alike(length, SHORTEST)))
    across = least(sums(share, products(turn, turn)), one)
    return above(least(length, stiffness), none, across, one)


@wp.func
def drag_across(way: Any, rest: Any, change: Any, share: Any, buckling: Any):
    """The part of a change that an edge along ``way`` drags: across itself this share only.

    Where a step goes further across, as much drag there as along would hold it back: folds, half of whose threads
    are always shortened, would creep. Buckling it is to hold back: a shortened edge drags ``buckling`` at least.
    """
    square = most(dot(way, way), alike(share, SHORTEST))
    along = scaled(way, quotient(dot(way, change), square))
    across = above(square, products(rest, rest), share, most(share, alike(share, buckling)))
    return sums(along, scaled(differences(change, along), across))

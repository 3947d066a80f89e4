"""Bending of a hinge: the paper's cosine law (section 2.2 b, equations 1 to 3) on the wings, completed on the axis.

E = C (|theta| - sin |theta|); torque C (1 - cos theta) back to flat, largest at 180 degrees. No inverse trigonometry.
A hinge with a rest angle t0 has the same law in theta - t0: its second normal is turned back by t0 beforehand.
"""

from typing import Any

import warp as wp

from warp_cloth.kernels.math.packet import (
    above,
    alike,
    any_above,
    cross,
    least,
    most,
    opposite,
    products,
    scaled,
    sizes,
    sums,
)
from warp_cloth.kernels.math.real import fused, inner, quotient, root, scaled_sum


@wp.func
def hinge_fold(axis: Any, wing_0: Any, wing_1: Any):
    """Unit normals of the two triangles and twice their areas [m2]; zero normals where a triangle has no area.

    All three arguments are relative to the axis' first vertex [m]. Flat cloth has equal normals.
    """
    normal_0 = wp.cross(axis, wing_0)
    normal_1 = wp.cross(wing_1, axis)
    return wp.normalize(normal_0), wp.normalize(normal_1), wp.length(normal_0), wp.length(normal_1)


# A triangle thinner than this share of its axis has no usable direction, and 1 / d no bound: as it collapses the
# hinge's torque fades with it, for both wings alike, so that forces stay balanced and bounded.
THINNEST = wp.constant(1.0e-3)
SMALLEST = wp.constant(1.0e-30)  # twice the area [m2] of what has none; its inverse is still a float32
SHORTEST = wp.constant(1.0e-20)  # of an axis [m]; what divides by it stays finite


@wp.func
def unit_normal(side_1: Any, side_2: Any):
    """Unit normal of a triangle and the inverse of twice its area [1/m2], from the sides that leave its first corner.

    Both are zero where it has no area.
    """
    normal = cross(side_1, side_2)
    area = root(inner(normal, normal))
    none, one = alike(area, float(0.0)), alike(area, float(1.0))
    inverse = above(area, alike(area, SMALLEST), quotient(one, area), none)
    # corrected as a quotient is: flat cloth has equal normals to the last bit
    unit = scaled(normal, inverse)
    return scaled_sum(scaled_sum(unit, opposite(area), normal), inverse, unit), inverse


@wp.func
def turned_back(normal: Any, axis: Any, rest: Any):
    """The second triangle's unit normal, turned about the axis by minus a rest angle of this cosine and sine.

    The angle counts as theta does: positive where (n0 x n1) . axis is.
    """
    length = wp.max(wp.length(axis), type(rest[0])(SMALLEST))
    return normal * rest[0] - wp.cross(axis, normal) * (rest[1] / length)


@wp.func
def hinge_turn(
    normal_0: Any, inverse_0: Any, normal_1: Any, inverse_1: Any, axis: Any, length: Any, stiffness: Any, reach: Any
):
    """Torque of a hinge over the length L of its axis [N], and a bound of its stiffness [N/m].

    The torque unfolds the hinge: C (1 - cos theta), sign from (n0 x n1) . axis. 1 - cos theta is taken as
    |n0 - n1|^2 / 2, which keeps its digits where the hinge is nearly flat. The force on a wing is the torque over its
    distance from the axis, along its triangle's normal (equation 3): turn times L^2 over twice the triangle's area.

    The bound holds for any of the hinge's vertices while these move by no more than ``reach`` [m]: |C| (|sin theta| +
    angle that ``reach`` can add) (1 / h0 + 1 / h1)^2, with |sin theta| <= |n0 - n1|. Normals and inverse areas as of
    ``unit_normal``; the axis as it runs in the first triangle, and how long it is, at least SHORTEST; C is negative
    where the second triangle is wound likewise.
    """
    none, one = alike(stiffness, float(0.0)), alike(stiffness, float(1.0))
    difference = scaled_sum(normal_1, above(none, stiffness, one, opposite(one)), normal_0)
    bend = inner(difference, difference)
    size = sizes(stiffness)
    torque = products(products(size, alike(size, float(0.5))), bend)
    smaller = least(inverse_0, inverse_1)
    bounded_0, bounded_1 = inverse_0, inverse_1
    thin = products(alike(length, THINNEST), products(length, length))
    thinness = products(most(inverse_0, inverse_1), thin)
    if any_above(thinness, one):
        at_most = quotient(one, thin)
        bounded_0 = above(thinness, one, least(inverse_0, at_most), inverse_0)
        bounded_1 = above(thinness, one, least(inverse_1, at_most), inverse_1)
        faded = products(products(torque, quotient(bounded_0, inverse_0)), quotient(bounded_1, inverse_1))
        torque = above(thinness, one, above(smaller, none, faded, torque), torque)
    per_height = products(length, sums(bounded_0, bounded_1))
    fold = least(fused(reach, per_height, root(bend)), alike(bend, float(2.0)))
    # n0 x n1 = (n0 - n1) x n0
    turn = above(none, inner(cross(difference, normal_0), axis), opposite(torque), torque)
    bound = products(products(products(size, fold), per_height), per_height)
    return above(smaller, none, turn, none), above(smaller, none, bound, none)


@wp.func
def fold_energy(normal_0: Any, normal_1: Any, stiffness: Any):
    """Energy [J], E = C (|theta| - sin |theta|), of which the forces by ``hinge_turn`` are minus the gradient.

    Near flat the difference is taken from its series, which keeps its digits.
    """
    one = type(stiffness)(1.0)
    angle = type(stiffness)(2.0) * wp.atan2(wp.length(normal_0 - normal_1), wp.length(normal_0 + normal_1))
    square = angle * angle
    series = one - square / type(stiffness)(42.0) * (one - square / type(stiffness)(72.0))
    excess = angle * square / type(stiffness)(6.0) * (one - square / type(stiffness)(20.0) * series)
    if angle > type(stiffness)(0.1):
        excess = angle - wp.sin(angle)
    return stiffness * excess

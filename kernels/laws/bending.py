"""Bending of a hinge: the paper's cosine law (section 2.2 b, equations 1 to 3) on the wings, completed on the axis.

    E = C (|theta| - sin |theta|),  torque C (1 - cos theta) back to flat, largest at 180 degrees

No inverse trigonometry. A hinge with a rest angle t0 has the same law in theta - t0: its second normal is rotated back
by t0 beforehand (``hinge.rotated_back``).
"""

from typing import Any

import warp as wp

from warp_cloth.kernels.math.operators import add, div, mul, sub  # noqa: F401  what + - * / below call for packets
from warp_cloth.kernels.math.packet import absolute, any_greater, cross, maximum, minimum, negative, where_greater
from warp_cloth.kernels.math.real import fused, inner, root, scaled_sum, single

# A triangle thinner than this fraction of its axis has no usable direction, and 1 / d no bound: as it collapses the
# hinge's torque fades with it, for both wings alike, so that forces stay balanced and bounded.
THINNEST = wp.constant(1.0e-3)
_THINNEST = wp.constant(single(1.0e-3))
SMALLEST = wp.constant(single(1.0e-30))  # twice the area [m2] of what has none; its inverse is still a float32
SHORTEST = wp.constant(single(1.0e-20))  # of an axis [m]; what divides by it stays finite


@wp.func
def unit_normal(side_1: Any, side_2: Any):
    """Unit normal of a triangle and the inverse of twice its area [1/m2], from the sides that leave its first corner.

    n = (side_1 x side_2) / |side_1 x side_2|; both are zero where it has no area.
    """
    normal = cross(side_1, side_2)
    area = root(inner(normal, normal))
    zero, one = type(area)(0.0), type(area)(1.0)
    inverse = where_greater(area, type(area)(SMALLEST), one / area, zero)
    # corrected as a quotient is: flat cloth has equal normals to the last bit
    unit = normal * inverse
    return scaled_sum(scaled_sum(unit, negative(area), normal), inverse, unit), inverse


@wp.func
def hinge_torque(
    normal_0: Any, inverse_0: Any, normal_1: Any, inverse_1: Any, axis: Any, length: Any, stiffness: Any, allowance: Any
):
    """Torque of a hinge [N m], and a bound of its stiffness [N/m].

    The torque unfolds the hinge: C (1 - cos theta), sign from (n0 x n1) . axis. 1 - cos theta is taken as
    |n0 - n1|^2 / 2, which keeps its digits where the hinge is nearly flat. The force on a wing is the torque over its
    distance from the axis, along its triangle's normal (equation 3): torque times L over twice the triangle's area.

    The bound holds for any of the hinge's vertices while these move by no more than ``allowance`` [m]: |C| (1 / h0 +
    1 / h1)^2 (|sin theta| + angle that ``allowance`` can add), with |sin theta| <= |n0 - n1|. Normals and inverse areas
    are those of ``unit_normal``; the axis as it runs in the first triangle, and how long it is, at least SHORTEST; C is
    negative where the second triangle is wound likewise.
    """
    zero, one = type(stiffness)(0.0), type(stiffness)(1.0)
    difference = scaled_sum(normal_1, where_greater(zero, stiffness, one, -one), normal_0)  # n0 - n1
    bend = inner(difference, difference)
    size = absolute(stiffness)
    torque = size * type(size)(0.5) * bend
    smaller = minimum(inverse_0, inverse_1)
    bounded_0, bounded_1 = inverse_0, inverse_1
    thin = type(length)(_THINNEST) * (length * length)
    thinness = maximum(inverse_0, inverse_1) * thin
    if any_greater(thinness, one):
        at_most = one / thin
        bounded_0 = where_greater(thinness, one, minimum(inverse_0, at_most), inverse_0)
        bounded_1 = where_greater(thinness, one, minimum(inverse_1, at_most), inverse_1)
        faded = torque * (bounded_0 / inverse_0) * (bounded_1 / inverse_1)
        torque = where_greater(thinness, one, where_greater(smaller, zero, faded, torque), torque)
    per_height = length * (bounded_0 + bounded_1)
    fold = minimum(fused(allowance, per_height, root(bend)), type(bend)(2.0))
    bound = size * fold * per_height * per_height
    # n0 x n1 = (n0 - n1) x n0
    signed = where_greater(zero, inner(cross(difference, normal_0), axis), negative(torque), torque)
    return where_greater(smaller, zero, signed, zero), where_greater(smaller, zero, bound, zero)

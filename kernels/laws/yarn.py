"""Yarns of a woven triangle: the paper's tension law (section 2.2 a) along the cloth's own directions.

An edge pulls along itself, so a mesh of edges is stiff where its edges happen to run. A woven triangle carries yarns
along weft, warp and both biases instead. A yarn is an edge whose ends are fixed to the triangle: a unit of cloth along
it has become the vector t, and area times the law of ``tension`` acts on |t| against 1.

    E = A sum over the four yarns of K/3 | |t| - 1 |^3  (times c where |t| < 1)

Exact for any triangle, whatever the mesh. A bias vector is (t_weft + t_warp) / sqrt 2 or (t_weft - t_warp) / sqrt 2.

Four figures, of the weft, the warp and both biases, are a vec4; functions take one triangle's or a packet's. A
triangle's ``slope`` is its second and third corner's along weft, then along warp [1/m]: t = slope_1 side_1 + slope_2
side_2, with the sides that leave its first corner. The first corner's slope is minus the sum of the others'.
"""

from typing import Any

import warp as wp

from warp_cloth.kernels.base.options import SlopeField, Yarn, YarnField
from warp_cloth.kernels.laws.tension import tension_stiffness
from warp_cloth.kernels.math.operators import add, div, mul, sub  # noqa: F401  what + - * below call for packets
from warp_cloth.kernels.math.packet import absolute, component, maximum, minimum, vector4
from warp_cloth.kernels.math.real import inner, reciprocal, root, scaled_sum, where_positive

SHORTEST = wp.constant(1.0e-20)  # of a yarn that has collapsed; what divides by it stays finite
FAINTEST = wp.constant(1.0e-30)  # bound of stiffness [J]; likewise
DIAGONAL = wp.constant(0.5**0.5)  # of weft and warp in a bias


@wp.func
def yarn_stiffness(yarns: Any):
    """K A of the four yarns where they are stretched (pull) and where they are shortened (push = c pull) [J].

    The one place that takes a triangle's ``yarns`` apart. Either bias yarn has the stiffness ``shear``.
    """
    weft, warp = component(yarns, YarnField.WEFT), component(yarns, YarnField.WARP)
    shear, compression = component(yarns, YarnField.SHEAR), component(yarns, YarnField.COMPRESSION)
    pull = vector4(weft, warp, shear, shear)
    return pull, pull * vector4(compression, compression, compression, compression)


@wp.func
def weft_vector(slope: Any, side_1: Any, side_2: Any):
    """What a unit of cloth along the weft has become; sides are those from the triangle's first corner."""
    return scaled_sum(side_2, component(slope, SlopeField.WEFT_2), side_1 * component(slope, SlopeField.WEFT_1))


@wp.func
def warp_vector(slope: Any, side_1: Any, side_2: Any):
    """What a unit of cloth along the warp has become."""
    return scaled_sum(side_2, component(slope, SlopeField.WARP_2), side_1 * component(slope, SlopeField.WARP_1))


@wp.func
def bias_vectors(weft: Any, warp: Any):
    """What a unit of cloth along both biases has become; of one triangle."""
    diagonal = type(weft[0])(DIAGONAL)
    return diagonal * (weft + warp), diagonal * (weft - warp)


@wp.func
def yarn_of(yarn: int, weft: Any, warp: Any, diagonal: Any):
    """The figure of one of the four yarns, from those of weft and warp; ``diagonal`` is DIAGONAL. Of one triangle."""
    if yarn == Yarn.WEFT:
        return weft
    if yarn == Yarn.WARP:
        return warp
    return weft * diagonal + warp * wp.where(yarn == Yarn.PLUS, diagonal, -diagonal)


@wp.func
def yarn_slopes(slope: Any):
    """Slopes of the second and of the third corner along the four yarns, the biases' times sqrt 2."""
    weft_1, weft_2 = component(slope, SlopeField.WEFT_1), component(slope, SlopeField.WEFT_2)
    warp_1, warp_2 = component(slope, SlopeField.WARP_1), component(slope, SlopeField.WARP_2)
    first = vector4(weft_1, warp_1, weft_1 + warp_1, weft_1 - warp_1)
    return first, vector4(weft_2, warp_2, weft_2 + warp_2, weft_2 - warp_2)


@wp.func
def slope_fractions(slope_1: Any, slope_2: Any):
    """Twice the fraction of a yarn's stiffness that each corner bears [1/m2]: |b_i| (|b_0| + |b_1| + |b_2|).

    b are the corners' slopes, with b_0 = -b_1 - b_2. A yarn that runs along an edge of length L gives 1 / L^2 to both
    its ends, as the edge itself would.
    """
    size_0, size_1, size_2 = absolute(slope_1 + slope_2), absolute(slope_1), absolute(slope_2)
    sum = size_0 + size_1 + size_2
    return sum * size_0, sum * size_1, sum * size_2


@wp.func
def yarn_squares(weft: Any, warp: Any):
    """|t|^2 of the four yarns, from weft and warp: |(u +- v) / sqrt 2|^2 = (|u|^2 + |v|^2) / 2 +- u . v."""
    weft_2, warp_2, both = inner(weft, weft), inner(warp, warp), inner(weft, warp)
    zero, mean = type(both)(0.0), (weft_2 + warp_2) * type(both)(0.5)
    return vector4(weft_2, warp_2, maximum(mean + both, zero), maximum(mean - both, zero))


@wp.func
def yarn_products(weft: Any, warp: Any, weft_change: Any, warp_change: Any):
    """t . d of the four yarns, d what changed them."""
    weft_2, warp_2 = inner(weft, weft_change), inner(warp, warp_change)
    half = type(weft_2)(0.5)
    both = (inner(weft, warp_change) + inner(warp, weft_change)) * half
    mean = (weft_2 + warp_2) * half
    return vector4(weft_2, warp_2, mean + both, mean - both)


@wp.func
def weft_and_warp(figure: Any):
    """What the four yarns' figures are along weft, along warp and from each to the other: sums of f t t^T."""
    plus, minus = component(figure, Yarn.PLUS), component(figure, Yarn.MINUS)
    half = type(plus)(0.5)
    mean, across = (plus + minus) * half, (plus - minus) * half
    return component(figure, Yarn.WEFT) + mean, component(figure, Yarn.WARP) + mean, across


@wp.func
def yarn_tension(length: Any, stretch: Any, change: Any, pull: Any, push: Any, allowance: Any):
    """Tension of the four yarns over their lengths, per unit of their corners' slopes [J], and stiffness bounds [J].

    k s |s| / |t|, with the law of ``tension_force`` (s |s| is rounded first here), and ``tension_stiffness``.

    Args:
        length: |t| of the yarns.
        stretch: s = |t| - 1.
        change: square of what the corners' last displacements changed t by.
        pull: K A [J].
        push: that where they are shorter than 1.
        allowance: how many such changes the bound allows for.
    """
    inverse = reciprocal(maximum(length, type(length)(SHORTEST)))
    tension = where_positive(stretch, pull, push) * (stretch * absolute(stretch)) * inverse
    return tension, tension_stiffness(stretch, pull, push, root(change) * allowance)


@wp.func
def yarn_transverse_fractions(square: Any, change: Any, tension: Any, bound: Any, horizon: Any):
    """``transverse_fraction`` of the four yarns, and the inverses of their lengths.

    Args:
        square: |t|^2.
        change: square of what the corners' last displacements changed t by.
        tension: over the lengths, and
        bound: of stiffness, both of ``yarn_tension``.
        horizon: how many such changes ahead the yarns may turn.
    """
    inverse = reciprocal(maximum(root(square), type(square)(SHORTEST)))
    rotation = root(change) * horizon * inverse
    stiffness = maximum(bound, type(bound)(FAINTEST))
    fraction = absolute(tension) * reciprocal(stiffness) + rotation * rotation
    return minimum(fraction, type(fraction)(1.0)), inverse


@wp.func
def split_damping(
    damping: Any, square: Any, change: Any, product: Any, tension: Any, bound: Any, horizon: Any, buckling: Any
):
    """``damped_change`` of the four yarns: damping in all directions, and along the yarns only, over |t|^2.

    ``product`` is of ``yarn_products``, the others are arguments of ``yarn_transverse_fractions`` and
    ``damped_change``.
    """
    fraction, inverse = yarn_transverse_fractions(square, change, tension, bound, horizon)
    shortened = maximum(fraction, type(fraction)(buckling))
    across = damping * where_positive(square - type(square)(1.0), fraction, shortened)
    return across, (damping - across) * product * inverse * inverse

"""Loads of a triangle's yarns and of its sides' hinges on its corners, which ``scatter`` and ``gather`` sum.

A load is a force [N] and what ``Accumulate`` names. A hinge rotates its two triangles, each of which answers along its
own normal: so a hinge's forces are summed triangle by triangle, of three hinges at a time.
"""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_cloth.kernels.base.options import Accumulate, SlopeField, Terms, Yarn
from warp_cloth.kernels.base.types import cloth_types, difference_function, takes_exact_stretch
from warp_cloth.kernels.laws.bending import unit_normal
from warp_cloth.kernels.laws.shear_hysteresis import shear_friction_tension
from warp_cloth.kernels.laws.yarn import (
    slope_fractions,
    split_damping,
    warp_vector,
    weft_and_warp,
    weft_vector,
    yarn_products,
    yarn_slopes,
    yarn_squares,
    yarn_stiffness,
    yarn_tension,
)
from warp_cloth.kernels.math.lanes import lane_types
from warp_cloth.kernels.math.operators import add, div, mul, sub  # noqa: F401  what + - * / below call for packets
from warp_cloth.kernels.math.packet import absolute, component, negative, vector3, vector4
from warp_cloth.kernels.math.real import fused, inner, reciprocal, root, scaled_sum


@wp.func
def with_fourth(force: Any, more: Any):
    """A load: a force and its fourth component."""
    return vector4(component(force, 0), component(force, 1), component(force, 2), more)


@functools.cache
def triangle_functions(precision: str, accumulate: Accumulate) -> SimpleNamespace:
    """Functions ``triangle_sides`` and ``triangle_normal``."""
    types = cloth_types(precision)
    point, vec3, vec4, Sides = types.point, types.vec3, types.vec4, types.Sides
    difference, exact = difference_function(precision), takes_exact_stretch(precision, accumulate)

    @wp.func
    def triangle_sides(origin: point, second: point, third: point, move: vec3, second_move: vec3, third_move: vec3):
        """A triangle as it lies, and what last moved it."""
        sides = Sides()
        sides.side_1 = difference(second, origin)
        sides.side_2 = difference(third, origin)
        sides.side_0 = difference(third, second)
        if wp.static(exact):
            sides.exact_1 = second - origin
            sides.exact_2 = third - origin
        if wp.static(accumulate.is_bound):
            sides.change_1 = second_move - move
            sides.change_2 = third_move - move
        return sides

    @wp.func
    def triangle_normal(origin: point, second: point, third: point):
        """Unit normal, and the inverse of twice the area [1/m2]."""
        normal, inverse = unit_normal(difference(second, origin), difference(third, origin))
        return vec4(normal[0], normal[1], normal[2], inverse)

    return SimpleNamespace(triangle_sides=triangle_sides, triangle_normal=triangle_normal)


@functools.cache
def corner_fold_function(precision: str, accumulate: Accumulate, lanes: int = 1) -> wp.Function:
    """The function that adds what a triangle's hinges do to its corners to their loads."""
    types = lane_types(cloth_types(precision).real, lanes)
    vec3, vec4, corner_folds = types.vec3, types.vec4, _fold_function(precision, accumulate, lanes)

    @wp.func
    def with_fold(load: vec4, normal: vec4, along: types.real, more: types.real):
        """Load of a corner and what ``corner_folds`` adds to it."""
        return vector4(
            fused(component(normal, 0), along, component(load, 0)),
            fused(component(normal, 1), along, component(load, 1)),
            fused(component(normal, 2), along, component(load, 2)),
            component(load, 3) + more,
        )

    @wp.func
    def with_folds(normal: vec4, fold_0: vec3, fold_1: vec3, fold_2: vec3, first: vec4, second: vec4, third: vec4):
        """Loads of the corners and of the hinges of the triangle's sides."""
        along, more = corner_folds(component(normal, 3), fold_0, fold_1, fold_2)
        return (
            with_fold(first, normal, component(along, 0), component(more, 0)),
            with_fold(second, normal, component(along, 1), component(more, 1)),
            with_fold(third, normal, component(along, 2), component(more, 2)),
        )

    return with_folds


@functools.cache
def sides_type(precision: str, lanes: int = 1) -> type:
    """The struct of a triangle's sides, or of a packet of triangles'."""
    types = lane_types(cloth_types(precision).real, lanes)

    @wp.struct
    class PacketSides:
        """Sides of a packet of triangles; fields of Sides."""

        side_1: types.vec3
        side_2: types.vec3
        change_1: types.vec3
        change_2: types.vec3

    return PacketSides if lanes > 1 else cloth_types(precision).Sides


@functools.cache
def corner_function(precision: str, accumulate: Accumulate, terms: Terms, lanes: int = 1) -> wp.Function:
    """The function ``corner_loads``: what a triangle, or a packet, does to its corners by all terms."""
    types, Step = lane_types(cloth_types(precision).real, lanes), cloth_types(precision).Step
    vec3, vec4, Sides = types.vec3, types.vec4, sides_type(precision, lanes)
    with_folds = corner_fold_function(precision, accumulate, lanes)
    yarn_loads, exact_excess = yarn_function(precision, accumulate, terms, lanes), _excess_function(precision)

    @wp.func
    def corner_loads(  # nine arguments: packets of the sides' folds are loaded one by one
        normal: vec4,
        fold_0: vec3,
        fold_1: vec3,
        fold_2: vec3,
        sides: Sides,
        slope: vec4,
        yarns: vec4,
        slider: vec3,
        step: Step,
    ):
        """Loads of the corners: of the triangle's yarns, then of the hinges of its sides."""
        first = vec4()
        second = vec4()
        third = vec4()
        if wp.static(terms.yarns):
            excess = vec4()
            if wp.static(takes_exact_stretch(precision, accumulate)):
                excess = exact_excess(sides, slope)
            force_0, force_1, force_2, more = yarn_loads(sides, excess, slope, yarns, slider, step)
            first = with_fourth(force_0, component(more, 0))
            second = with_fourth(force_1, component(more, 1))
            third = with_fourth(force_2, component(more, 2))
        if wp.static(terms.folds):
            first, second, third = with_folds(normal, fold_0, fold_1, fold_2, first, second, third)
        return first, second, third

    return corner_loads


def _fold_function(precision: str, accumulate: Accumulate, lanes: int) -> wp.Function:
    types = lane_types(cloth_types(precision).real, lanes)
    one, vec3 = types.real, types.vec3

    @wp.func
    def foot(own: one, other: one, opposite_side: one):
        """Dot product of two sides that leave a corner, from the squares of all three."""
        return (own + other - opposite_side) * one(0.5)

    @wp.func
    def corner_folds(inverse: one, fold_0: vec3, fold_1: vec3, fold_2: vec3):
        """What the hinges of a triangle's sides do to its corners: forces along its normal [N], and ``Accumulate``.

        With p_i the torque of side i over its length and twice the area, it pushes corner i by p_i L_i^2 and the
        side's ends by -p_i times the dot product of the sides that leave the other end: each end's part of L_i^2 by the
        foot of the corner's perpendicular. So no net force is left, nor with the other triangle's a net torque.

        Args:
            inverse: of twice the area [1/m2].
            fold_0: ``edge_fold`` of the side opposite to the first corner, its torque as the triangle is wound.
            fold_1: that of the next.
            fold_2: that of the last.
        """
        square_0, square_1, square_2 = component(fold_0, 2), component(fold_1, 2), component(fold_2, 2)
        dot_0 = foot(square_1, square_2, square_0)
        dot_1 = foot(square_2, square_0, square_1)
        dot_2 = foot(square_0, square_1, square_2)
        p_0, p_1 = component(fold_0, 0) * inverse, component(fold_1, 0) * inverse
        p_2 = component(fold_2, 0) * inverse
        along_1 = fused(p_1, square_1, negative(fused(p_0, dot_2, p_2 * dot_0)))
        along_2 = fused(p_2, square_2, negative(fused(p_0, dot_1, p_1 * dot_0)))
        amounts = vec3()
        if wp.static(accumulate.is_bound):
            # a wing's bound is in its own triangle, an axis' in both of the hinge's
            bound_0, bound_1, bound_2 = component(fold_0, 1), component(fold_1, 1), component(fold_2, 1)
            half = one(0.5)
            both = (bound_0 + bound_1 + bound_2) * half
            amounts = vector3(fused(bound_0, half, both), fused(bound_1, half, both), fused(bound_2, half, both))
        if wp.static(accumulate is Accumulate.MAGNITUDE):
            amounts = vec3(
                wp.abs(p_0) * square_0 + wp.abs(p_1 * dot_2) + wp.abs(p_2 * dot_1),
                wp.abs(p_1) * square_1 + wp.abs(p_0 * dot_2) + wp.abs(p_2 * dot_0),
                wp.abs(p_2) * square_2 + wp.abs(p_0 * dot_1) + wp.abs(p_1 * dot_0),
            )
        return vector3(negative(along_1 + along_2), along_1, along_2), amounts

    return corner_folds


def _yarn_amounts_function(precision: str, accumulate: Accumulate, lanes: int) -> wp.Function:
    real, types = cloth_types(precision).real, lane_types(cloth_types(precision).real, lanes)
    one, vec4 = types.real, types.vec4
    # of the weft and warp yarns' figures, and of those of both biases, whose slopes are taken sqrt(2) times too large
    straight = wp.constant(real(0.5 if accumulate.is_bound else 1.0))
    bias = wp.constant(real(0.25 if accumulate.is_bound else 0.5**0.5))

    @wp.func
    def corner_fractions(slope_1: one, slope_2: one):
        """What a yarn's figure counts for at each corner: stiffness by ``slope_fractions``, magnitude by the slopes."""
        fraction_0, fraction_1, fraction_2 = absolute(slope_1 + slope_2), absolute(slope_1), absolute(slope_2)
        if wp.static(accumulate.is_bound):
            fraction_0, fraction_1, fraction_2 = slope_fractions(slope_1, slope_2)
        return vector3(fraction_0, fraction_1, fraction_2)

    @wp.func
    def corner_amounts(slope: vec4, figure: vec4):
        """What the corners accumulate, from the figures of the weft, warp and both bias yarns."""
        first, second = yarn_slopes(slope)
        weft, warp = component(figure, Yarn.WEFT) * straight, component(figure, Yarn.WARP) * straight
        plus, minus = component(figure, Yarn.PLUS) * bias, component(figure, Yarn.MINUS) * bias
        amounts = corner_fractions(component(first, Yarn.WEFT), component(second, Yarn.WEFT)) * weft
        amounts = scaled_sum(corner_fractions(component(first, Yarn.WARP), component(second, Yarn.WARP)), warp, amounts)
        amounts = scaled_sum(corner_fractions(component(first, Yarn.PLUS), component(second, Yarn.PLUS)), plus, amounts)
        return scaled_sum(corner_fractions(component(first, Yarn.MINUS), component(second, Yarn.MINUS)), minus, amounts)

    return corner_amounts


def _excess_function(precision: str) -> wp.Function:
    types = cloth_types(precision)
    real, wide, vec4, Sides = types.real, types.wide, types.vec4, types.Sides
    half, one = wp.constant(wide(0.5)), wp.constant(wide(1.0))

    @wp.func
    def exact_excess(sides: Sides, slope: vec4):
        """|t|^2 - 1 of the four yarns, in the positions' own precision."""
        weft = sides.exact_1 * wide(slope[SlopeField.WEFT_1]) + sides.exact_2 * wide(slope[SlopeField.WEFT_2])
        warp = sides.exact_1 * wide(slope[SlopeField.WARP_1]) + sides.exact_2 * wide(slope[SlopeField.WARP_2])
        weft_2, warp_2, both = inner(weft, weft) - one, inner(warp, warp) - one, inner(weft, warp)
        mean = half * (weft_2 + warp_2)
        return vec4(real(weft_2), real(warp_2), real(mean + both), real(mean - both))

    return exact_excess


@wp.func
def corner_forces(slope: Any, on_weft: Any, on_warp: Any):
    """Forces on a triangle's corners by what acts on its weft and its warp, u = w1 e1 + w2 e2 of both sides e."""
    weft_1, warp_1 = component(slope, SlopeField.WEFT_1), component(slope, SlopeField.WARP_1)
    weft_2, warp_2 = component(slope, SlopeField.WEFT_2), component(slope, SlopeField.WARP_2)
    force_1 = negative(scaled_sum(on_weft, weft_1, on_warp * warp_1))
    force_2 = negative(scaled_sum(on_weft, weft_2, on_warp * warp_2))
    return negative(force_1 + force_2), force_1, force_2


@functools.cache
def yarn_function(precision: str, accumulate: Accumulate, terms: Terms, lanes: int = 1) -> wp.Function:
    """The function ``yarn_loads`` of a woven triangle, with friction or not; or of a packet of them, without."""
    real, Step = cloth_types(precision).real, cloth_types(precision).Step
    vec3, vec4, Sides = lane_types(real, lanes).vec3, lane_types(real, lanes).vec4, sides_type(precision, lanes)
    corner_amounts = _yarn_amounts_function(precision, accumulate, lanes)

    @wp.func
    def yarn_loads(sides: Sides, excess: vec4, slope: vec4, yarns: vec4, slider: vec3, step: Step):
        """Forces of the four yarns on the corners, and the corners' bounds or magnitudes.

        ``excess`` is |t|^2 - 1 of the yarns where that is taken exactly, from which |t| - 1 = excess / (|t| + 1).
        ``slider`` is as of Weave.shear_hysteresis, read where there is friction.
        """
        weft = weft_vector(slope, sides.side_1, sides.side_2)
        warp = warp_vector(slope, sides.side_1, sides.side_2)
        weft_change = vec3()
        warp_change = vec3()
        square = yarn_squares(weft, warp)
        change = vec4()
        if wp.static(accumulate.is_bound):
            weft_change = weft_vector(slope, sides.change_1, sides.change_2)
            warp_change = warp_vector(slope, sides.change_1, sides.change_2)
            change = yarn_squares(weft_change, warp_change)
        pull, push = yarn_stiffness(yarns)
        length, one = root(square), vec4(real(1.0))
        stretch = length - one
        if wp.static(takes_exact_stretch(precision, accumulate)):
            stretch = excess * reciprocal(length + one)
        tension, bound = yarn_tension(length, stretch, change, pull, push, step.allowance)
        if wp.static(terms.shear_hysteresis):
            friction, stiffer = shear_friction_tension(weft, warp, square, slider)
            tension += friction
            bound += stiffer
        on_weft = vec3()
        on_warp = vec3()
        amounts = vec3()
        if wp.static(accumulate.is_bound):
            # resists the yarns' changing, as an edge's load does
            damping = bound * step.viscosity
            if wp.static(accumulate is Accumulate.ANISOTROPIC_STIFFNESS):
                product = yarn_products(weft, warp, weft_change, warp_change)
                damping, more = split_damping(
                    damping, square, change, product, tension, bound, step.horizon, step.buckling
                )
                tension = tension + more
            own_weft, own_warp, across = weft_and_warp(damping)
            on_weft = scaled_sum(weft_change, own_weft, warp_change * across)
            on_warp = scaled_sum(warp_change, own_warp, weft_change * across)
            amounts = corner_amounts(slope, bound)
        if wp.static(accumulate is Accumulate.MAGNITUDE):
            amounts = corner_amounts(slope, absolute(tension) * length)
        # what the biases pull along weft and warp, each along itself and along the other
        own_weft, own_warp, across = weft_and_warp(tension)
        on_weft = scaled_sum(warp, across, scaled_sum(weft, own_weft, on_weft))
        on_warp = scaled_sum(weft, across, scaled_sum(warp, own_warp, on_warp))
        force_0, force_1, force_2 = corner_forces(slope, on_weft, on_warp)
        return force_0, force_1, force_2, amounts

    return yarn_loads

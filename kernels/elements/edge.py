"""Load of an edge's tension on its ends, and the torque of its hinge; of one edge or of a packet.

A load is a force [N] and what ``Accumulate`` names.
"""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_cloth.kernels.base.options import Accumulate, SliderField, Terms
from warp_cloth.kernels.base.types import cloth_types, difference_function, takes_exact_stretch
from warp_cloth.kernels.laws.bending import SHORTEST, hinge_torque
from warp_cloth.kernels.laws.hinge import rotated_back
from warp_cloth.kernels.laws.hysteresis import friction_torque
from warp_cloth.kernels.laws.tension import (
    damped_change,
    spring_constants,
    tension_force,
    tension_stiffness,
    transverse_fraction,
)
from warp_cloth.kernels.math.lanes import lane_types
from warp_cloth.kernels.math.operators import add, div, mul, sub  # noqa: F401  what + - * / below call for packets
from warp_cloth.kernels.math.packet import component, maximum, vector3, vector4
from warp_cloth.kernels.math.real import inner, root, scaled_sum


@functools.cache
def span_type(precision: str, lanes: int = 1) -> type:
    """The struct of an edge as it lies, or of a packet of them."""
    types = lane_types(cloth_types(precision).real, lanes)

    @wp.struct
    class Spans:
        """A packet of edges as they lie; fields of Span."""

        side: types.vec3
        length: types.real
        inverse: types.real
        change: types.vec3
        move: types.real

    return Spans if lanes > 1 else cloth_types(precision).Span


@functools.cache
def span_functions(precision: str, accumulate: Accumulate) -> SimpleNamespace:
    """Functions ``edge_span`` and ``side_span``, of one edge."""
    types = cloth_types(precision)
    real, point, vec3, Span = types.real, types.point, types.vec3, types.Span
    difference, exact = difference_function(precision), takes_exact_stretch(precision, accumulate)

    @wp.func
    def side_span(side: vec3, first_move: vec3, second_move: vec3, size: real):
        """An edge from its first end to its second, and what last moved it; ``size`` of the first end's move [m]."""
        span = Span()
        span.side = side
        span.length = edge_length(span.side)
        span.inverse = real(1.0) / span.length
        if wp.static(accumulate.is_bound):
            span.change = second_move - first_move
            span.move = size
        return span

    @wp.func
    def edge_span(first: point, second: point, first_move: vec3, second_move: vec3, size: real):
        """An edge as it lies, and what last moved it; ``size`` of the first end's last displacement [m]."""
        span = side_span(difference(second, first), first_move, second_move, size)
        if wp.static(exact):
            span.exact = second - first
        return span

    return SimpleNamespace(edge_span=edge_span, side_span=side_span)


@functools.cache
def edge_functions(precision: str, accumulate: Accumulate, terms: Terms, lanes: int = 1) -> SimpleNamespace:
    """Functions ``edge_load`` (its tension) and ``edge_fold`` (its hinge, flat at rest or not, with friction or not).

    Of one edge, with ``edge_span``; or of a packet, none of which is measured exactly, has a rest angle or friction.
    """
    types, shapes = cloth_types(precision), lane_types(cloth_types(precision).real, lanes)
    real, wide, vec2, Step = types.real, types.wide, types.vec2, types.Step
    one, vec3, vec4 = shapes.real, shapes.vec3, shapes.vec4
    Span, exact = span_type(precision, lanes), takes_exact_stretch(precision, accumulate)

    @wp.func
    def edge_load(span: Span, spring: vec3, step: Step):
        """Load of an edge's tension on its first end; on the second the force is the opposite."""
        rest, pull, push = spring_constants(spring)
        stretch = span.length - rest
        if wp.static(exact):
            # r - L = (r^2 - L^2) / (r + L)
            stretch = real(inner(span.exact, span.exact) - wide(rest) * wide(rest)) / (span.length + rest)
        tension = tension_force(stretch, pull, push)
        force = span.side * (tension * span.inverse)
        bound = one(0.0)
        if wp.static(accumulate.is_bound):
            size = root(inner(span.change, span.change))
            bound = tension_stiffness(stretch, pull, push, size * step.allowance)
            change = span.change
            if wp.static(accumulate is Accumulate.ANISOTROPIC_STIFFNESS):
                fraction = transverse_fraction(span.length, tension, bound, size, step.horizon)
                change = damped_change(span.side, rest, span.change, fraction, step.buckling)
            # calms neighbours that swing against each other, leaves what moves together its momentum, nothing at rest
            force = scaled_sum(change, bound * step.viscosity, force)
        if wp.static(accumulate is Accumulate.MAGNITUDE):
            bound = wp.length(force)
        return vector4(component(force, 0), component(force, 1), component(force, 2), bound)

    @wp.func
    def edge_fold(
        span: Span, first: vec4, second: vec4, hinge_stiffness: one, rest: vec2, slider: types.vec4, step: Step
    ):
        """Torque of an edge's hinge over its length L [N], bound of its stiffness [N/m] and L^2 [m2].

        ``first`` and ``second`` are of ``triangle_normal``; ``rest`` and ``slider`` as of Edges, read where in use.
        """
        normal_0 = vector3(component(first, 0), component(first, 1), component(first, 2))
        normal_1 = vector3(component(second, 0), component(second, 1), component(second, 2))
        laid = normal_1
        if wp.static(terms.angles):
            normal_1 = rotated_back(normal_1, span.side, rest)
        allowance = span.move * step.allowance
        torque, bound = hinge_torque(
            normal_0, component(first, 3), normal_1, component(second, 3),
            span.side, span.length, hinge_stiffness, allowance,
        )  # fmt: skip
        if wp.static(terms.hysteresis):
            laid = rotated_back(laid, span.side, vec2(slider[SliderField.COSINE], slider[SliderField.SINE]))
            friction, stiffer = friction_torque(
                normal_0, component(first, 3), laid, component(second, 3), span.side, span.length,
                hinge_stiffness, slider,
            )  # fmt: skip
            torque += friction
            bound += stiffer
        return vector3(torque * span.inverse, bound, inner(span.side, span.side))

    spans = span_functions(precision, accumulate)
    return SimpleNamespace(
        edge_span=spans.edge_span, side_span=spans.side_span, edge_load=edge_load, edge_fold=edge_fold
    )


@wp.func
def edge_length(side: Any):
    """Length of an edge [m], never 0."""
    length = root(inner(side, side))
    return maximum(length, type(length)(SHORTEST))

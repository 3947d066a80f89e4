"""What an edge and its hinge do to their vertices, in one precision; of one edge or of eight.

A load is a force [N] and a fourth part (one of cloth.FOURTH_PARTS).
"""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_cloth.kernels.base.types import BOUNDS, cloth_types, difference_function, takes_exact_stretch
from warp_cloth.kernels.laws.bending import SHORTEST, hinge_turn, turned_back
from warp_cloth.kernels.laws.tension import drag_across, share_across, stretch_force, tension_force, tension_stiffness
from warp_cloth.kernels.math.packet import alike, four, most, part, products, scaled, three, times
from warp_cloth.kernels.math.real import inner, quotient, root, scaled_sum, shaped


@functools.cache
def spans_type(precision: str) -> type:
    """The struct of eight edges that is what ``Span`` is of one."""
    types = shaped(cloth_types(precision).real, True)

    @wp.struct
    class Spans:
        """Eight edges as they lie; fields of Span."""

        side: types.vec3
        length: types.real
        inverse: types.real
        change: types.vec3
        move: types.real

    return Spans


@functools.cache
def span_functions(precision: str, fourth: str) -> SimpleNamespace:
    """Functions ``edge_span`` and ``side_span``, of one edge."""
    types = cloth_types(precision)
    real, point, vec3, Span = types.real, types.point, types.vec3, types.Span
    difference, exact = difference_function(precision), takes_exact_stretch(precision, fourth)

    @wp.func
    def side_span(side: vec3, first_move: vec3, second_move: vec3, size: real):
        """An edge from its first end to its second, and what last moved it; ``size`` of the first end's move [m]."""
        span = Span()
        span.side = side
        span.length = edge_length(span.side)
        span.inverse = quotient(real(1.0), span.length)
        if wp.static(fourth in BOUNDS):
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
def edge_functions(precision: str, fourth: str, angles: bool, eight: bool = False) -> SimpleNamespace:
    """Functions ``edge_load`` (its tension) and ``edge_fold`` (its hinge, with rest angles or flat).

    Of one edge, with ``edge_span``; or of ``eight``, none of which is measured exactly or has a rest angle.
    """
    types, shapes = cloth_types(precision), shaped(cloth_types(precision).real, eight)
    real, wide, vec2, Step = types.real, types.wide, types.vec2, types.Step
    one, vec3, vec4 = shapes.real, shapes.vec3, shapes.vec4
    Span, exact = spans_type(precision) if eight else types.Span, takes_exact_stretch(precision, fourth)

    @wp.func
    def edge_load(span: Span, law: vec3, step: Step):
        """Load of an edge's tension on its first end; on the second the force is the opposite."""
        rest, pull, push = part(law, 0), part(law, 1), part(law, 2)
        tension = tension_force(span.length, rest, pull, push)
        if wp.static(exact):
            # r - L = (r^2 - L^2) / (r + L)
            excess = real(inner(span.exact, span.exact) - wide(law[0]) * wide(law[0]))
            tension = stretch_force(quotient(excess, span.length + law[0]), law[1], law[2])
        force = scaled(span.side, products(tension, span.inverse))
        bound = alike(rest, real(0.0))
        if wp.static(fourth in BOUNDS):
            size = root(inner(span.change, span.change))
            bound = tension_stiffness(span.length, rest, pull, push, times(size, step.reach))
            change = span.change
            if wp.static(fourth == "leeway"):
                share = share_across(span.length, rest, pull, push, bound, size, step.horizon)
                change = drag_across(span.side, rest, span.change, share, step.buckling)
            # calms neighbours that swing against each other, leaves what moves together its momentum, nothing at rest
            force = scaled_sum(change, times(bound, step.viscosity), force)
        if wp.static(fourth == "size"):
            bound = wp.length(force)
        return four(part(force, 0), part(force, 1), part(force, 2), bound)

    @wp.func
    def edge_fold(span: Span, first: vec4, second: vec4, stiffness: one, rest: vec2, step: Step):
        """Turn of an edge's hinge [N], bound of its stiffness [N/m] and L^2 [m2], from its triangles' normals."""
        normal_0 = three(part(first, 0), part(first, 1), part(first, 2))
        normal_1 = three(part(second, 0), part(second, 1), part(second, 2))
        if wp.static(angles):
            normal_1 = turned_back(normal_1, span.side, rest)
        inverse_0, inverse_1, reach = part(first, 3), part(second, 3), times(span.move, step.reach)
        turn, bound = hinge_turn(normal_0, inverse_0, normal_1, inverse_1, span.side, span.length, stiffness, reach)
        return three(products(turn, span.inverse), bound, inner(span.side, span.side))

    spans = span_functions(precision, fourth)
    return SimpleNamespace(
        edge_span=spans.edge_span, side_span=spans.side_span, edge_load=edge_load, edge_fold=edge_fold
    )


@wp.func
def edge_length(side: Any):
    """Length of an edge [m], never 0."""
    length = root(inner(side, side))
    return most(length, alike(length, SHORTEST))

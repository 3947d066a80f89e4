"""Forces by kernels that work eight edges or eight triangles out at a time and add to their vertices, one by one.

For the CPU's iterations; the same bits as of ``scatter``.
"""

import functools

import warp as wp

from warp_cloth.kernels.base.options import Accumulate, Terms
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.elements.edge import edge_functions, edge_length, spans_type
from warp_cloth.kernels.elements.triangle import corner_fold_function, yarn_function
from warp_cloth.kernels.laws.bending import unit_normal
from warp_cloth.kernels.math.lanes import WIDTH, lane_types
from warp_cloth.kernels.math.operators import add, div, mul, sub  # noqa: F401  what + - * / below call for packets
from warp_cloth.kernels.math.packet import component, vector3, vector4
from warp_cloth.kernels.math.packet_memory import (
    active_lanes_function,
    add_packets,
    first_of_packet,
    load_packet,
    load_packet_at,
    load_packet_signed,
    load_sides,
    load_signs,
    store_packet,
)
from warp_cloth.kernels.math.real import inner, root


@functools.cache
def eight_normals_kernel(precision: str) -> wp.Kernel:
    """Kernel ``measure_normals``, which goes first where cloth bends."""
    types = cloth_types(precision)
    vec4, Model, State, Triangles, Step = types.vec4, types.Model, types.State, types.Triangles, types.Step
    like, packets = wp.constant(types.real(0.0)), lane_types(types.real, WIDTH)
    active_lanes = active_lanes_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def measure_normals(
        model: Model,
        state: State,
        triangles: Triangles,
        step: Step,
        normal_out: wp.array(dtype=vec4),  # unit normal and inverse of twice the area [1/m2], shape [F]
        sides_out: wp.array(dtype=packets.vec3),  # both sides of eight triangles' first corners [m], shape [F / 8, 2]
    ):
        """Writes eight triangles' normals and sides."""
        number = wp.tid()
        if active_lanes(model, triangles.corners, number) == 0:
            return
        first = first_of_packet(number, triangles.corners.shape[0])
        side_1 = load_sides(like, state.position, triangles.corners, first, 0, 1)
        side_2 = load_sides(like, state.position, triangles.corners, first, 0, 2)
        sides_out[2 * number] = side_1
        sides_out[2 * number + 1] = side_2
        normal, inverse = unit_normal(side_1, side_2)
        store_packet(
            normal_out, first, vector4(component(normal, 0), component(normal, 1), component(normal, 2), inverse)
        )

    return measure_normals


@functools.cache
def eight_edges_kernel(precision: str, accumulate: Accumulate, terms: Terms) -> wp.Kernel:
    """Kernel ``add_edges``, of edges that are flat at rest; ``accumulate``: beside the forces."""
    types, Spans = cloth_types(precision), spans_type(precision)
    real, vec2, vec4, Model, State, Step, Edges = (
        types.real,
        types.vec2,
        types.vec4,
        types.Model,
        types.State,
        types.Step,
        types.Edges,
    )
    like = wp.constant(real(0.0))
    functions = edge_functions(precision, accumulate, angles=False, lanes=WIDTH)
    edge_load, edge_fold = functions.edge_load, functions.edge_fold
    active_lanes = active_lanes_function(precision)

    @wp.func
    def spans_of(state: State, ends: wp.array(dtype=wp.vec2i), first: int):
        """Eight edges as they lie, and what last moved them."""
        spans = Spans()
        spans.side = load_sides(like, state.position, ends, first, 0, 1)
        spans.length = edge_length(spans.side)
        spans.inverse = type(spans.length)(real(1.0)) / spans.length
        spans.change = load_sides(like, state.displacement, ends, first, 0, 1)
        move = load_packet_at(state.displacement, ends, first, 0)
        spans.move = root(inner(move, move))
        return spans

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def add_edges(
        model: Model,
        state: State,
        edges: Edges,
        normal: wp.array(dtype=vec4),  # of measure_normals, shape [F]
        step: Step,
        fold_out: wp.array(dtype=vec4),  # turn [N], bound [N/m] and L^2 [m2] of each edge's hinge, shape [E]
        load_out: wp.array(dtype=vec4),  # force [N] and what is accumulated, shape [V]
    ):
        """Adds eight edges' tensions to their ends, and works out their hinges."""
        number = wp.tid()
        lanes = active_lanes(model, edges.ends, number)
        if lanes == 0:
            return
        start = first_of_packet(number, edges.ends.shape[0])
        spans = spans_of(state, edges.ends, start)
        if wp.static(terms.edges):
            load = edge_load(spans, load_packet(edges.law, start), step)
            back = vector4(-component(load, 0), -component(load, 1), -component(load, 2), component(load, 3))
            add_packets(load_out, edges.ends, start, lanes, load, back)
        if wp.static(terms.folds):
            first, second = (
                load_packet_at(normal, edges.beside, start, 0),
                load_packet_at(normal, edges.beside, start, 1),
            )
            fold = edge_fold(spans, first, second, load_packet(edges.fold, start), vec2(), step)
            store_packet(
                fold_out, start, vector4(component(fold, 0), component(fold, 1), component(fold, 2), spans.length)
            )

    return add_edges


@functools.cache
def eight_triangles_kernel(precision: str, accumulate: Accumulate, terms: Terms) -> wp.Kernel:
    """Kernel ``add_triangles``; ``accumulate``: beside the forces."""
    types, packets = cloth_types(precision), lane_types(cloth_types(precision).real, WIDTH)
    vec4, Model, State, Step, Triangles = types.vec4, types.Model, types.State, types.Step, types.Triangles
    like = wp.constant(types.real(0.0))
    yarn_loads, with_folds = (
        yarn_function(precision, accumulate, WIDTH),
        corner_fold_function(precision, accumulate, WIDTH),
    )
    active_lanes = active_lanes_function(precision)

    @wp.func
    def yarn_corners(
        state: State, triangles: Triangles, start: int, side_1: packets.vec3, side_2: packets.vec3, step: Step
    ):
        """Loads of eight triangles' yarns on their corners."""
        change_1 = load_sides(like, state.displacement, triangles.corners, start, 0, 1)
        change_2 = load_sides(like, state.displacement, triangles.corners, start, 0, 2)
        slope, law = load_packet(triangles.slope, start), load_packet(triangles.yarns, start)
        force_0, force_1, force_2, parts = yarn_loads(
            side_1, side_2, packets.vec4(), change_1, change_2, slope, law, step
        )
        first = vector4(component(force_0, 0), component(force_0, 1), component(force_0, 2), component(parts, 0))
        second = vector4(component(force_1, 0), component(force_1, 1), component(force_1, 2), component(parts, 1))
        third = vector4(component(force_2, 0), component(force_2, 1), component(force_2, 2), component(parts, 2))
        return first, second, third

    @wp.func
    def side_folds(fold: wp.array(dtype=vec4), edges: wp.array(dtype=wp.vec3i), start: int, which: int):
        """Hinges of a side of eight triangles, their turns as these are wound."""
        found = load_packet_signed(fold, edges, start, which)
        turn = component(found, 0)
        return vector3(turn * load_signs(turn, edges, start, which), component(found, 1), component(found, 2))

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def add_triangles(
        model: Model,
        state: State,
        triangles: Triangles,
        normal: wp.array(dtype=vec4),  # of measure_normals, shape [F]
        sides: wp.array(dtype=packets.vec3),  # likewise, where cloth bends
        fold: wp.array(dtype=vec4),  # of add_edges, shape [E]
        step: Step,
        load_out: wp.array(dtype=vec4),  # force [N] and what is accumulated, shape [V]
    ):
        """Adds the hinges and yarns of eight triangles to their corners."""
        number = wp.tid()
        lanes = active_lanes(model, triangles.corners, number)
        if lanes == 0:
            return
        start = first_of_packet(number, triangles.corners.shape[0])
        first, second, third = packets.vec4(), packets.vec4(), packets.vec4()
        if wp.static(terms.yarns):
            if wp.static(terms.folds):
                side_1, side_2 = sides[2 * number], sides[2 * number + 1]
            else:
                side_1 = load_sides(like, state.position, triangles.corners, start, 0, 1)
                side_2 = load_sides(like, state.position, triangles.corners, start, 0, 2)
            first, second, third = yarn_corners(state, triangles, start, side_1, side_2, step)
        if wp.static(terms.folds):
            own = load_packet(normal, start)
            fold_0, fold_1 = side_folds(fold, triangles.edges, start, 0), side_folds(fold, triangles.edges, start, 1)
            fold_2 = side_folds(fold, triangles.edges, start, 2)
            first, second, third = with_folds(own, fold_0, fold_1, fold_2, first, second, third)
        add_packets(load_out, triangles.corners, start, lanes, first, second, third)

    return add_triangles

"""Forces by a kernel per edge and one per triangle that add to their vertices: scatter, for the CPU.

There Warp runs a launch on one thread: the order of the additions is fixed, so the same input gives the same bits. On
CUDA the order would be left to chance; there ``gather`` serves. A kernel takes one element at a time, or (``lanes`` is
WIDTH) a packet of eight and adds these one by one: the same bits, in a third of the time.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.base.access import element
from warp_cloth.kernels.base.active_set import active_element
from warp_cloth.kernels.base.options import Accumulate, Terms
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, rests, takes_exact_stretch
from warp_cloth.kernels.elements.edge import edge_functions, edge_length, span_type
from warp_cloth.kernels.elements.triangle import corner_function, sides_type, triangle_functions
from warp_cloth.kernels.laws.bending import unit_normal
from warp_cloth.kernels.math.lane_memory import lane_memory
from warp_cloth.kernels.math.lanes import WIDTH, lane_types
from warp_cloth.kernels.math.operators import add, div, mul, sub  # noqa: F401  what + - * / below call for packets
from warp_cloth.kernels.math.packet import component, vector3, vector4
from warp_cloth.kernels.math.packet_memory import active_lanes, first_of_packet, load_sides, store_packet
from warp_cloth.kernels.math.real import inner, root
from warp_cloth.kernels.patches.packing import order_functions


@functools.cache
def normals_kernel(precision: str, packed: bool = False) -> wp.Kernel:
    """Kernel ``measure_normals``, which goes first where cloth bends; ``packed``: as of packing.order_functions."""
    types = cloth_types(precision)
    position_at = order_functions(precision, packed).position_at
    vec4, Model, State, Triangles = types.vec4, types.Model, types.State, types.Triangles
    triangle_normal = triangle_functions(precision, Accumulate.NONE).triangle_normal

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def measure_normals(
        model: Model,
        state: State,
        triangles: Triangles,
        groups: wp.array(dtype=wp.int32),  # of kernels.base.active_set, of triangles
        normal_out: wp.array(dtype=vec4),  # unit normal and inverse of twice the area [1/m2], shape [F]
    ):
        """Writes each triangle's normal."""
        triangle = active_element(groups, wp.tid())
        if triangle >= triangles.corners.shape[0]:
            return
        corners = element(triangles.corners, triangle)
        if rests(model, corners[0]):
            return
        origin = position_at(state, corners[0])
        second, third = position_at(state, corners[1]), position_at(state, corners[2])
        normal_out[triangle] = triangle_normal(origin, second, third)

    return measure_normals


@functools.cache
def packet_normals_kernel(precision: str) -> wp.Kernel:
    """Kernel ``measure_normals`` of packets, whose sides it stores for ``add_triangles``."""
    types = cloth_types(precision)
    vec4, Model, State, Triangles = types.vec4, types.Model, types.State, types.Triangles
    like, packets = wp.constant(types.real(0.0)), lane_types(types.real, WIDTH)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def measure_normals(
        model: Model,
        state: State,
        triangles: Triangles,
        normal_out: wp.array(dtype=vec4),  # unit normal and inverse of twice the area [1/m2], shape [F]
        sides_out: wp.array(dtype=packets.vec3),  # both sides of eight triangles' first corners [m], shape [F / 8, 2]
    ):
        """Stores the normals and sides of a packet of triangles."""
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
def edges_kernel(precision: str, accumulate: Accumulate, terms: Terms, lanes: int = 1) -> wp.Kernel:
    """Kernel ``add_edges``; ``accumulate``: what is summed besides forces.

    Of packets it is a bound, and hinges are flat at rest and have no friction.
    """
    types, packets = cloth_types(precision), lane_types(cloth_types(precision).real, lanes)
    Model, State, Step, Edges, Span = types.Model, types.State, types.Step, types.Edges, span_type(precision, lanes)
    vec2, vec4, like, memory = types.vec2, types.vec4, wp.constant(types.real(0.0)), lane_memory(precision, lanes)
    first_of, active, load_at, store, add_to = memory.first, memory.active, memory.load_at, memory.store, memory.add
    load, load_sides = memory.load, memory.load_sides
    functions = edge_functions(precision, accumulate, terms, lanes)
    edge_load, edge_fold = functions.edge_load, functions.edge_fold

    @wp.func
    def span_of(state: State, ends: wp.array(dtype=wp.vec2i), first: int):
        """Edges as they lie, and what last moved them."""
        span = Span()
        span.side = load_sides(like, state.position, ends, first, 0, 1)
        span.length = edge_length(span.side)
        span.inverse = packets.real(types.real(1.0)) / span.length
        if wp.static(accumulate.is_bound):
            span.change = load_sides(like, state.displacement, ends, first, 0, 1)
            displacement = load_at(state.displacement, ends, first, 0)
            span.move = root(inner(displacement, displacement))
        if wp.static(takes_exact_stretch(precision, accumulate)):
            span.exact = load_at(state.position, ends, first, 1) - load_at(state.position, ends, first, 0)
        return span

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def add_edges(
        model: Model,
        state: State,
        edges: Edges,
        normal: wp.array(dtype=vec4),  # of measure_normals, shape [F]
        step: Step,
        fold_out: wp.array(dtype=vec4),  # torque over L [N], bound [N/m], L^2 [m2] and L [m] of each hinge, shape [E]
        load_out: wp.array(dtype=vec4),  # force [N] and what is accumulated, shape [V]
    ):
        """Adds the tensions of edges to their ends, and measures their hinges."""
        number = wp.tid()
        some = active(model, edges.ends, number)
        if some == 0:
            return
        first = first_of(number, edges.ends.shape[0])
        span = span_of(state, edges.ends, first)
        if wp.static(terms.edges):
            own = edge_load(span, load(edges.spring, first), step)
            back = vector4(-component(own, 0), -component(own, 1), -component(own, 2), component(own, 3))
            add_to(load_out, edges.ends, first, some, own, back)
        if wp.static(terms.folds):
            rest, slider = vec2(), vec4()
            if wp.static(terms.angles):
                rest = element(edges.rest, first)
            if wp.static(terms.hysteresis):
                slider = element(edges.hysteresis, first)
            normal_0, normal_1 = (
                load_at(normal, edges.adjacent_triangles, first, 0),
                load_at(normal, edges.adjacent_triangles, first, 1),
            )
            fold = edge_fold(span, normal_0, normal_1, load(edges.hinge_stiffness, first), rest, slider, step)
            store(fold_out, first, vector4(component(fold, 0), component(fold, 1), component(fold, 2), span.length))

    return add_edges


@functools.cache
def sides_function(precision: str, accumulate: Accumulate, packed: bool = False, in_order: bool = False) -> wp.Function:
    """The function that reads a triangle as it lies; ``packed`` and ``in_order``: as of packing.order_functions."""
    types = cloth_types(precision)
    vec3, State = types.vec3, types.State
    order = order_functions(precision, packed, in_order)
    position_at, displacement_at = order.position_at, order.displacement_at
    triangle_sides = triangle_functions(precision, accumulate).triangle_sides

    @wp.func
    def sides_of(state: State, corners: wp.vec3i):
        """A triangle as it lies, and what last moved it."""
        move_0, move_1, move_2 = vec3(), vec3(), vec3()
        if wp.static(accumulate.is_bound):
            move_0, move_1 = displacement_at(state, corners[0]), displacement_at(state, corners[1])
            move_2 = displacement_at(state, corners[2])
        origin, second = position_at(state, corners[0]), position_at(state, corners[1])
        return triangle_sides(origin, second, position_at(state, corners[2]), move_0, move_1, move_2)

    return sides_of


def _triangle_readers(precision: str, accumulate: Accumulate, terms: Terms, lanes: int) -> SimpleNamespace:
    """The functions ``sides_of`` and ``side_fold``, by which ``add_triangles`` reads triangles."""
    types, packets = cloth_types(precision), lane_types(cloth_types(precision).real, lanes)
    State, vec4, like, Sides = types.State, types.vec4, wp.constant(types.real(0.0)), sides_type(precision, lanes)
    memory = lane_memory(precision, lanes)
    load_at, load_signed, load_signs, load_sides = (
        memory.load_at, memory.load_signed, memory.load_signs, memory.load_sides,
    )  # fmt: skip

    @wp.func
    def sides_of(
        state: State, corners: wp.array(dtype=wp.vec3i), side: wp.array(dtype=packets.vec3), number: int, first: int
    ):
        """Triangles as they lie, and what last moved them."""
        sides = Sides()
        if wp.static(terms.folds and lanes > 1):
            sides.side_1 = side[2 * number]
            sides.side_2 = side[2 * number + 1]
        else:
            sides.side_1 = load_sides(like, state.position, corners, first, 0, 1)
            sides.side_2 = load_sides(like, state.position, corners, first, 0, 2)
        if wp.static(takes_exact_stretch(precision, accumulate)):
            sides.exact_1 = load_at(state.position, corners, first, 1) - load_at(state.position, corners, first, 0)
            sides.exact_2 = load_at(state.position, corners, first, 2) - load_at(state.position, corners, first, 0)
        if wp.static(accumulate.is_bound):
            sides.change_1 = load_sides(like, state.displacement, corners, first, 0, 1)
            sides.change_2 = load_sides(like, state.displacement, corners, first, 0, 2)
        return sides

    @wp.func
    def side_fold(fold: wp.array(dtype=vec4), edges: wp.array(dtype=wp.vec3i), first: int, which: int):
        """The hinges of one side of triangles, their torques as these are wound."""
        found = load_signed(fold, edges, first, which)
        torque = component(found, 0)
        return vector3(torque * load_signs(torque, edges, first, which), component(found, 1), component(found, 2))

    return SimpleNamespace(sides_of=sides_of, side_fold=side_fold)


@functools.cache
def triangles_kernel(precision: str, accumulate: Accumulate, terms: Terms, lanes: int = 1) -> wp.Kernel:
    """Kernel ``add_triangles``; ``accumulate``: what is summed besides forces.

    Of packets it is a bound, and yarns have no friction.
    """
    types, packets = cloth_types(precision), lane_types(cloth_types(precision).real, lanes)
    Model, State, Step, Triangles = types.Model, types.State, types.Step, types.Triangles
    vec4, Sides, memory = types.vec4, sides_type(precision, lanes), lane_memory(precision, lanes)
    first_of, active, load, add_to = memory.first, memory.active, memory.load, memory.add
    read = _triangle_readers(precision, accumulate, terms, lanes)
    sides_of, side_fold = read.sides_of, read.side_fold
    corner_loads = corner_function(precision, accumulate, terms, lanes)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def add_triangles(
        model: Model,
        state: State,
        triangles: Triangles,
        normal: wp.array(dtype=vec4),  # of measure_normals, shape [F]
        side: wp.array(dtype=packets.vec3),  # likewise, of packets of cloth that bends
        fold: wp.array(dtype=vec4),  # of add_edges, shape [E]
        step: Step,
        load_out: wp.array(dtype=vec4),  # force [N] and what is accumulated, shape [V]
    ):
        """Adds the yarns of triangles and the hinges of their sides to their corners."""
        number = wp.tid()
        some = active(model, triangles.corners, number)
        if some == 0:
            return
        first = first_of(number, triangles.corners.shape[0])
        slope, yarns, slider, sides = packets.vec4(), packets.vec4(), packets.vec3(), Sides()
        if wp.static(terms.yarns):
            slope, yarns = load(triangles.slope, first), load(triangles.yarns, first)
            sides = sides_of(state, triangles.corners, side, number, first)
        if wp.static(terms.shear_hysteresis):
            slider = element(triangles.shear_hysteresis, first)
        own, fold_0, fold_1, fold_2 = packets.vec4(), packets.vec3(), packets.vec3(), packets.vec3()
        if wp.static(terms.folds):
            own = load(normal, first)
            fold_0, fold_1 = side_fold(fold, triangles.edges, first, 0), side_fold(fold, triangles.edges, first, 1)
            fold_2 = side_fold(fold, triangles.edges, first, 2)
        on_0, on_1, on_2 = corner_loads(own, fold_0, fold_1, fold_2, sides, slope, yarns, slider, step)
        add_to(load_out, triangles.corners, first, some, on_0, on_1, on_2)

    return add_triangles

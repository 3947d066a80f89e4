"""Forces by a kernel per edge and one per triangle that add to their vertices.

For the CPU, where Warp runs a launch on one thread: the order of the additions is fixed, so the same input gives the
same bits. On CUDA the order would be left to chance; there ``gather`` serves. What iterations ask for most is worked
out eight at a time (``scatter_eight``).
"""

import functools

import warp as wp

from warp_cloth.kernels.base.access import add_to, element
from warp_cloth.kernels.base.options import Accumulate, Terms
from warp_cloth.kernels.base.subset import listed
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, rest_function
from warp_cloth.kernels.elements.edge import edge_functions
from warp_cloth.kernels.elements.triangle import corner_function, triangle_functions
from warp_cloth.kernels.math.real import inner, root
from warp_cloth.kernels.patches.packing import order_functions


@functools.cache
def normals_kernel(precision: str, packed: bool = False) -> wp.Kernel:
    """Kernel ``measure_normals``, which goes first where cloth bends; ``packed``: as of packing.order_functions."""
    types = cloth_types(precision)
    position_at = order_functions(precision, packed).position_at
    vec4, Model, State, Triangles, Step = types.vec4, types.Model, types.State, types.Triangles, types.Step
    triangle_normal = triangle_functions(precision, Accumulate.NONE).triangle_normal
    rests = rest_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def measure_normals(
        model: Model,
        state: State,
        triangles: Triangles,
        step: Step,
        groups: wp.array(dtype=wp.int32),  # of kernels.base.subset, of triangles
        normal_out: wp.array(dtype=vec4),  # unit normal and inverse of twice the area [1/m2], shape [F]
    ):
        """Writes each triangle's normal."""
        triangle = listed(groups, wp.tid())
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
def edges_kernel(precision: str, accumulate: Accumulate, terms: Terms) -> wp.Kernel:
    """Kernel ``add_edges``; ``accumulate``: beside the forces."""
    types = cloth_types(precision)
    vec2, vec3, vec4, Model, State, Step, Edges = (
        types.vec2,
        types.vec3,
        types.vec4,
        types.Model,
        types.State,
        types.Step,
        types.Edges,
    )
    functions = edge_functions(precision, accumulate, terms.angles)
    edge_span, edge_load, edge_fold = functions.edge_span, functions.edge_load, functions.edge_fold
    rests = rest_function(precision)

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
        """Adds each edge's tension to its ends, and works out its hinge."""
        edge = wp.tid()
        ends = element(edges.ends, edge)
        if rests(model, ends[0]):
            return
        move_0 = vec3()
        move_1 = vec3()
        if wp.static(accumulate.is_bound):
            move_0, move_1 = element(state.displacement, ends[0]), element(state.displacement, ends[1])
        size = root(inner(move_0, move_0))
        span = edge_span(element(state.position, ends[0]), element(state.position, ends[1]), move_0, move_1, size)
        if wp.static(terms.edges):
            load = edge_load(span, element(edges.law, edge), step)
            add_to(load_out, ends[0], load)
            add_to(load_out, ends[1], vec4(-load[0], -load[1], -load[2], load[3]))
        if wp.static(terms.folds):
            beside = element(edges.beside, edge)
            rest = vec2()
            if wp.static(terms.angles):
                rest = element(edges.rest, edge)
            first, second = element(normal, beside[0]), element(normal, beside[1])
            fold = edge_fold(span, first, second, element(edges.fold, edge), rest, step)
            fold_out[edge] = vec4(fold[0], fold[1], fold[2], span.length)

    return add_edges


@functools.cache
def sides_function(precision: str, accumulate: Accumulate, packed: bool = False, in_order: bool = False) -> wp.Function:
    """The function that reads a triangle as it lies; ``packed`` and ``in_order``: as of packing.order_functions."""
    types = cloth_types(precision)
    vec3, State = types.vec3, types.State
    order = order_functions(precision, packed, in_order)
    position_at, move_at = order.position_at, order.move_at
    triangle_sides = triangle_functions(precision, accumulate).triangle_sides

    @wp.func
    def sides_of(state: State, corners: wp.vec3i):
        """A triangle as it lies, and what last moved it."""
        move_0, move_1, move_2 = vec3(), vec3(), vec3()
        if wp.static(accumulate.is_bound):
            move_0, move_1 = move_at(state, corners[0]), move_at(state, corners[1])
            move_2 = move_at(state, corners[2])
        origin, second = position_at(state, corners[0]), position_at(state, corners[1])
        return triangle_sides(origin, second, position_at(state, corners[2]), move_0, move_1, move_2)

    return sides_of


@functools.cache
def fold_reader(precision: str) -> wp.Function:
    """The function that reads the hinges of a triangle's sides."""
    vec3, vec4 = cloth_types(precision).vec3, cloth_types(precision).vec4

    @wp.func
    def side_fold(fold: wp.array(dtype=vec4), edge: int):
        """Hinge of a triangle's side, its turn as the triangle is wound."""
        found = element(fold, wp.where(edge < 0, -1 - edge, edge))
        return vec3(wp.where(edge < 0, -found[0], found[0]), found[1], found[2])

    @wp.func
    def side_folds(fold: wp.array(dtype=vec4), edges: wp.vec3i):
        """Those of all three sides."""
        return side_fold(fold, edges[0]), side_fold(fold, edges[1]), side_fold(fold, edges[2])

    return side_folds


@functools.cache
def triangles_kernel(precision: str, accumulate: Accumulate, terms: Terms) -> wp.Kernel:
    """Kernel ``add_triangles``; ``accumulate``: beside the forces."""
    types = cloth_types(precision)
    vec3, vec4, Model, State, Step, Triangles = (
        types.vec3,
        types.vec4,
        types.Model,
        types.State,
        types.Step,
        types.Triangles,
    )
    corner_loads = corner_function(precision, accumulate, terms)
    sides_of, side_folds = sides_function(precision, accumulate), fold_reader(precision)
    rests = rest_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def add_triangles(
        model: Model,
        state: State,
        triangles: Triangles,
        normal: wp.array(dtype=vec4),  # of measure_normals, shape [F]
        fold: wp.array(dtype=vec4),  # of add_edges, shape [E]
        step: Step,
        load_out: wp.array(dtype=vec4),  # force [N] and what is accumulated, shape [V]
    ):
        """Adds the hinges and yarns of each triangle to its corners."""
        triangle = wp.tid()
        corners = element(triangles.corners, triangle)
        if rests(model, corners[0]):
            return
        own, fold_0, fold_1, fold_2 = vec4(), vec3(), vec3(), vec3()
        if wp.static(terms.folds):
            own = element(normal, triangle)
            fold_0, fold_1, fold_2 = side_folds(fold, element(triangles.edges, triangle))
        slope, law, sides = vec4(), vec4(), types.Sides()
        if wp.static(terms.yarns):
            slope, law = element(triangles.slope, triangle), element(triangles.yarns, triangle)
            sides = sides_of(state, corners)
        first, second, third = corner_loads(own, fold_0, fold_1, fold_2, sides, slope, law, step)
        add_to(load_out, corners[0], first)
        add_to(load_out, corners[1], second)
        add_to(load_out, corners[2], third)

    return add_triangles

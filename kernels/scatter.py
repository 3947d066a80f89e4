"""Forces by a kernel per edge and one per triangle that add to their vertices.

For the CPU, where Warp runs a launch on one thread: the order of the additions is fixed, so the same input gives the
same bits. On CUDA the order would be left to chance; there ``gather`` serves.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.cloth import MODULE_OPTIONS, Terms, cloth_types, rest_function
from warp_cloth.kernels.forces import edge_functions, triangle_functions


@functools.cache
def normals_kernel(precision: str) -> wp.Kernel:
    """Kernel ``measure_normals``, which goes first where cloth bends."""
    types = cloth_types(precision)
    vec4, Cloth, Triangles, Step = types.vec4, types.Cloth, types.Triangles, types.Step
    functions = triangle_functions(precision, "none", Terms(False, False, False))
    triangle_sides, triangle_fold = functions.triangle_sides, functions.triangle_fold
    rests = rest_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def measure_normals(
        cloth: Cloth,
        triangles: Triangles,
        step: Step,
        normal_out: wp.array(dtype=vec4),  # unit normal and inverse of twice the area [1/m2], shape [F]
    ):
        """Writes each triangle's normal."""
        triangle = wp.tid()
        if rests(cloth, triangles.corners[triangle][0]):
            return
        normal_out[triangle] = triangle_fold(triangle_sides(cloth, triangles.corners[triangle]))

    return measure_normals


@functools.cache
def element_functions(precision: str, fourth: str, terms: Terms) -> SimpleNamespace:
    """Functions ``edge_effects`` and ``triangle_effects``, which gather what an edge and a triangle need."""
    types = cloth_types(precision)
    vec2, vec3, vec4, Cloth, Step = types.vec2, types.vec3, types.vec4, types.Cloth, types.Step
    Edges, Triangles = types.Edges, types.Triangles
    edge, triangle = edge_functions(precision, fourth, terms.angles), triangle_functions(precision, fourth, terms)
    edge_span, edge_load, edge_fold = edge.edge_span, edge.edge_load, edge.edge_fold
    triangle_sides, triangle_loads = triangle.triangle_sides, triangle.triangle_loads

    @wp.func
    def edge_effects(cloth: Cloth, edges: Edges, normal: wp.array(dtype=vec4), step: Step, edge: int):
        """Load of an edge's tension on its first end, and its hinge's turn and bound."""
        span = edge_span(cloth, edges.ends[edge])
        load = vec4()
        fold = vec2()
        if wp.static(terms.edges):
            load = edge_load(span, edges.law[edge], step)
        if wp.static(terms.folds):
            beside = edges.beside[edge]
            rest = vec2()
            if wp.static(terms.angles):
                rest = edges.rest[edge]
            fold = edge_fold(span, normal[beside[0]], normal[beside[1]], edges.fold[edge], rest, step)
        return load, fold

    @wp.func
    def triangle_effects(
        cloth: Cloth,
        triangles: Triangles,
        normal: wp.array(dtype=vec4),
        fold: wp.array(dtype=vec2),
        step: Step,
        triangle: int,
    ):
        """Loads of a triangle's hinges and threads on its corners."""
        own = vec4()
        turn = vec3()
        bound = vec3()
        slope = vec4()
        threads = vec4()
        if wp.static(terms.folds):
            own = normal[triangle]
            edges = triangles.edges[triangle]
            for side in range(3):
                edge = edges[side]
                if edge >= 0:
                    turn[side] = fold[edge][0]
                    bound[side] = fold[edge][1]
                else:
                    turn[side] = -fold[-1 - edge][0]
                    bound[side] = fold[-1 - edge][1]
        if wp.static(terms.threads):
            slope = triangles.slope[triangle]
            threads = triangles.threads[triangle]
        sides = triangle_sides(cloth, triangles.corners[triangle])
        return triangle_loads(sides, own, turn, bound, slope, threads, step)

    return SimpleNamespace(edge_effects=edge_effects, triangle_effects=triangle_effects)


@functools.cache
def scatter_kernels(precision: str, fourth: str, terms: Terms) -> SimpleNamespace:
    """Kernels ``add_edges`` and ``add_triangles``; ``fourth`` is one of cloth.FOURTH_PARTS."""
    types = cloth_types(precision)
    vec2, vec4, Cloth, Step, Edges, Triangles = (
        types.vec2, types.vec4, types.Cloth, types.Step, types.Edges, types.Triangles,
    )  # fmt: skip
    functions = element_functions(precision, fourth, terms)
    edge_effects, triangle_effects = functions.edge_effects, functions.triangle_effects
    rests = rest_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def add_edges(
        cloth: Cloth,
        edges: Edges,
        normal: wp.array(dtype=vec4),  # of measure_normals, shape [F]
        step: Step,
        fold_out: wp.array(dtype=vec2),  # turn [N] and bound [N/m] of each edge's hinge, shape [E]
        load_out: wp.array(dtype=vec4),  # force [N] and the fourth part, shape [V]
    ):
        """Adds each edge's tension to its ends, and works out its hinge."""
        edge = wp.tid()
        if rests(cloth, edges.ends[edge][0]):
            return
        load, fold = edge_effects(cloth, edges, normal, step, edge)
        if wp.static(terms.edges):
            ends = edges.ends[edge]
            wp.atomic_add(load_out, ends[0], load)
            wp.atomic_add(load_out, ends[1], vec4(-load[0], -load[1], -load[2], load[3]))
        if wp.static(terms.folds):
            fold_out[edge] = fold

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def add_triangles(
        cloth: Cloth,
        triangles: Triangles,
        normal: wp.array(dtype=vec4),  # of measure_normals, shape [F]
        fold: wp.array(dtype=vec2),  # of add_edges, shape [E]
        step: Step,
        load_out: wp.array(dtype=vec4),  # force [N] and the fourth part, shape [V]
    ):
        """Adds each triangle's hinges and threads to its corners."""
        triangle = wp.tid()
        corners = triangles.corners[triangle]
        if rests(cloth, corners[0]):
            return
        first, second, third = triangle_effects(cloth, triangles, normal, fold, step, triangle)
        wp.atomic_add(load_out, corners[0], first)
        wp.atomic_add(load_out, corners[1], second)
        wp.atomic_add(load_out, corners[2], third)

    return SimpleNamespace(add_edges=add_edges, add_triangles=add_triangles)

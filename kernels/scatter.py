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
    triangle_normal = triangle_functions(precision, "none").triangle_normal
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
        corners = triangles.corners[triangle]
        if rests(cloth, corners[0]):
            return
        normal_out[triangle] = triangle_normal(cloth.position, corners)

    return measure_normals


@functools.cache
def scatter_kernels(precision: str, fourth: str, terms: Terms) -> SimpleNamespace:
    """Kernels ``add_edges`` and ``add_triangles``; ``fourth`` is one of cloth.FOURTH_PARTS."""
    types = cloth_types(precision)
    vec2, vec3, vec4, Cloth, Step = types.vec2, types.vec3, types.vec4, types.Cloth, types.Step
    Edges, Triangles = types.Edges, types.Triangles
    of_edge, of_triangle = edge_functions(precision, fourth, terms.angles), triangle_functions(precision, fourth)
    edge_span, edge_load, edge_fold = of_edge.edge_span, of_edge.edge_load, of_edge.edge_fold
    rests = rest_function(precision)
    corner_folds, fold_load = of_triangle.corner_folds, of_triangle.fold_load
    triangle_sides, thread_loads = of_triangle.triangle_sides, of_triangle.thread_loads

    @wp.func
    def side_fold(fold: wp.array(dtype=vec3), edge: int):
        """Hinge of a triangle's side, its turn as the triangle is wound."""
        way = wp.where(edge < 0, -1 - edge, edge)
        found = fold[way]
        return vec3(wp.where(edge < 0, -found[0], found[0]), found[1], found[2])

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def add_edges(
        cloth: Cloth,
        edges: Edges,
        normal: wp.array(dtype=vec4),  # of measure_normals, shape [F]
        step: Step,
        fold_out: wp.array(dtype=vec3),  # turn [N], bound [N/m] and L^2 [m2] of each edge's hinge, shape [E]
        load_out: wp.array(dtype=vec4),  # force [N] and the fourth part, shape [V]
    ):
        """Adds each edge's tension to its ends, and works out its hinge."""
        edge = wp.tid()
        ends = edges.ends[edge]
        if rests(cloth, ends[0]):
            return
        span = edge_span(cloth.position, cloth.move, ends[0], ends[1])
        if wp.static(terms.edges):
            load = edge_load(span, edges.law[edge], step)
            wp.atomic_add(load_out, ends[0], load)
            wp.atomic_add(load_out, ends[1], vec4(-load[0], -load[1], -load[2], load[3]))
        if wp.static(terms.folds):
            beside = edges.beside[edge]
            rest = vec2()
            if wp.static(terms.angles):
                rest = edges.rest[edge]
            fold_out[edge] = edge_fold(span, normal[beside[0]], normal[beside[1]], edges.fold[edge], rest, step)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def add_triangles(
        cloth: Cloth,
        triangles: Triangles,
        normal: wp.array(dtype=vec4),  # of measure_normals, shape [F]
        fold: wp.array(dtype=vec3),  # of add_edges, shape [E]
        step: Step,
        load_out: wp.array(dtype=vec4),  # force [N] and the fourth part, shape [V]
    ):
        """Adds each triangle's hinges and threads to its corners."""
        triangle = wp.tid()
        corners = triangles.corners[triangle]
        if rests(cloth, corners[0]):
            return
        if wp.static(terms.folds):
            own = normal[triangle]
            edges = triangles.edges[triangle]
            folds = side_fold(fold, edges[0]), side_fold(fold, edges[1]), side_fold(fold, edges[2])
            along, part = corner_folds(own[3], folds[0], folds[1], folds[2])
            for corner in range(3):
                wp.atomic_add(load_out, corners[corner], fold_load(own, along[corner], part[corner]))
        if wp.static(terms.threads):
            sides = triangle_sides(cloth.position, cloth.move, corners)
            slope, law = triangles.slope[triangle], triangles.threads[triangle]
            first, second, third = thread_loads(sides, slope, law, step)
            wp.atomic_add(load_out, corners[0], first)
            wp.atomic_add(load_out, corners[1], second)
            wp.atomic_add(load_out, corners[2], third)

    return SimpleNamespace(add_edges=add_edges, add_triangles=add_triangles)

"""Forces by kernels per edge and triangle that store them and one per vertex that sums what meets there.

For CUDA: no atomics, so the same input gives the same bits however the launch is scheduled. The sums run in the order
of the edges, then of the triangles, as those of ``scatter`` do: both give the same bits.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.cloth import MODULE_OPTIONS, Terms, cloth_types, rest_function
from warp_cloth.kernels.scatter import element_functions


@functools.cache
def gathered_load(precision: str, terms: Terms) -> wp.Function:
    """The function that sums what meets at a vertex."""
    types = cloth_types(precision)
    vec4, StoredRows = types.vec4, types.StoredRows

    @wp.func
    def vertex_load(rows: StoredRows, edge_load: wp.array(dtype=vec4), stored: wp.array(dtype=vec4), vertex: int):
        """Sum of what is stored for the edges and triangles at a vertex."""
        load = vec4()
        if wp.static(terms.edges):
            for row in range(rows.edge_start[vertex], rows.edge_start[vertex + 1]):
                edge = rows.edge[row]
                if edge >= 0:
                    load += edge_load[edge]
                else:
                    other = edge_load[-1 - edge]
                    load += vec4(-other[0], -other[1], -other[2], other[3])
        if wp.static(terms.folds or terms.threads):
            for row in range(rows.start[vertex], rows.start[vertex + 1]):
                load += stored[rows.slot[row]]
        return load

    return vertex_load


@functools.cache
def gather_kernels(precision: str, fourth: str, terms: Terms) -> SimpleNamespace:
    """Kernels ``store_edges``, ``store_triangles``, ``gather_forces``; ``fourth`` is one of cloth.FOURTH_PARTS."""
    types = cloth_types(precision)
    vec2, vec4, Cloth, Step, StoredRows = types.vec2, types.vec4, types.Cloth, types.Step, types.StoredRows
    Edges, Triangles = types.Edges, types.Triangles
    functions = element_functions(precision, fourth, terms)
    edge_effects, triangle_effects = functions.edge_effects, functions.triangle_effects
    vertex_load = gathered_load(precision, terms)
    rests = rest_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def store_edges(
        cloth: Cloth,
        edges: Edges,
        normal: wp.array(dtype=vec4),  # of measure_normals, shape [F]
        step: Step,
        fold_out: wp.array(dtype=vec2),  # turn [N] and bound [N/m] of each edge's hinge, shape [E]
        load_out: wp.array(dtype=vec4),  # force on each edge's first end [N] and fourth part, shape [E]
    ):
        """Stores each edge's tension, and works out its hinge."""
        edge = wp.tid()
        if rests(cloth, edges.ends[edge][0]):
            return
        load, fold = edge_effects(cloth, edges, normal, step, edge)
        if wp.static(terms.edges):
            load_out[edge] = load
        if wp.static(terms.folds):
            fold_out[edge] = fold

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def store_triangles(
        cloth: Cloth,
        triangles: Triangles,
        normal: wp.array(dtype=vec4),  # of measure_normals, shape [F]
        fold: wp.array(dtype=vec2),  # of store_edges, shape [E]
        step: Step,
        stored_out: wp.array2d(dtype=vec4),  # force [N] and fourth part on each corner, shape [3, F]
    ):
        """Stores each triangle's hinges and threads on its corners."""
        triangle = wp.tid()
        if rests(cloth, triangles.corners[triangle][0]):
            return
        first, second, third = triangle_effects(cloth, triangles, normal, fold, step, triangle)
        stored_out[0, triangle] = first
        stored_out[1, triangle] = second
        stored_out[2, triangle] = third

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def gather_forces(
        rows: StoredRows,
        edge_load: wp.array(dtype=vec4),  # from store_edges, shape [E]
        stored: wp.array(dtype=vec4),  # from store_triangles, shape [3 F]
        load_out: wp.array(dtype=vec4),  # force [N] and the fourth part, shape [V]
    ):
        """Sums the forces that meet at each vertex."""
        vertex = wp.tid()
        load_out[vertex] = vertex_load(rows, edge_load, stored, vertex)

    return SimpleNamespace(store_edges=store_edges, store_triangles=store_triangles, gather_forces=gather_forces)

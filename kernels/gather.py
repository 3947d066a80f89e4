"""Forces by kernels per hinge and woven triangle that store them and one per vertex that sums what meets there.

For CUDA: no atomics, so the same input gives the same bits however the launch is scheduled. The sums run in the order
of the edges, then of the hinges, then of the triangles, as those of ``scatter`` do: both give the same bits.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.cloth import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.forces import force_functions


@functools.cache
def gathered_load(precision: str, fourth: str, stores: bool) -> wp.Function:
    """The function that sums what meets at a vertex; arguments as of ``gather_kernels``."""
    types = cloth_types(precision)
    vec4, Cloth, EdgeRows, StoredRows, Step = types.vec4, types.Cloth, types.EdgeRows, types.StoredRows, types.Step
    edge_load = force_functions(precision, fourth).edge_load

    @wp.func
    def vertex_load(
        cloth: Cloth, edges: EdgeRows, rows: StoredRows, stored: wp.array(dtype=vec4), step: Step, vertex: int
    ):
        """Tension over the edges at a vertex and what is stored for its hinges and triangles."""
        load = vec4()
        for row in range(edges.start[vertex], edges.start[vertex + 1]):
            load += edge_load(cloth, step, edges.law[row], vertex, edges.other[row])
        if wp.static(stores):
            for row in range(rows.start[vertex], rows.start[vertex + 1]):
                load += stored[rows.slot[row]]
        return load

    return vertex_load


@functools.cache
def gather_kernels(precision: str, fourth: str, stores: bool) -> SimpleNamespace:
    """Kernels ``store_bending``, ``store_weave`` and ``gather_forces``, which reads what they store where ``stores``.

    ``fourth`` is one of cloth.FOURTH_PARTS.
    """
    types = cloth_types(precision)
    vec4, Cloth, EdgeRows, Hinges, Step = types.vec4, types.Cloth, types.EdgeRows, types.Hinges, types.Step
    Weave, StoredRows = types.Weave, types.StoredRows
    functions = force_functions(precision, fourth)
    hinge_loads, weave_loads = functions.hinge_loads, functions.weave_loads
    vertex_load = gathered_load(precision, fourth, stores)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def store_bending(
        cloth: Cloth,
        hinges: Hinges,
        step: Step,
        stored_out: wp.array2d(dtype=vec4),  # force [N] and fourth part on each corner, shape [4, H]
    ):
        """Stores each hinge's forces on its four vertices."""
        hinge = wp.tid()
        start, end, wing_0, wing_1 = hinge_loads(cloth, hinges, step, hinge)
        stored_out[0, hinge] = start
        stored_out[1, hinge] = end
        stored_out[2, hinge] = wing_0
        stored_out[3, hinge] = wing_1

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def store_weave(
        cloth: Cloth,
        weave: Weave,
        step: Step,
        stored_out: wp.array2d(dtype=vec4),  # force [N] and fourth part on each corner, shape [3, T]
    ):
        """Stores the forces of each woven triangle's threads on its three vertices."""
        triangle = wp.tid()
        first, second, third = weave_loads(cloth, weave, step, triangle)
        stored_out[0, triangle] = first
        stored_out[1, triangle] = second
        stored_out[2, triangle] = third

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def gather_forces(
        cloth: Cloth,
        edges: EdgeRows,
        rows: StoredRows,
        stored: wp.array(dtype=vec4),  # from store_bending and store_weave, shape [4 H + 3 T]
        step: Step,
        load_out: wp.array(dtype=vec4),  # force [N] and the fourth part, shape [V]
    ):
        """Sums the forces that meet at each vertex."""
        vertex = wp.tid()
        load_out[vertex] = vertex_load(cloth, edges, rows, stored, step, vertex)

    return SimpleNamespace(store_bending=store_bending, store_weave=store_weave, gather_forces=gather_forces)

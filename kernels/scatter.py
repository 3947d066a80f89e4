"""Forces by a kernel per edge, per hinge and per woven triangle that add to their vertices.

For the CPU, where Warp runs a launch on one thread: the order of the additions is fixed, so the same input gives the
same bits. On CUDA the order would be left to chance; there ``gather`` serves.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.cloth import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.forces import force_functions


@functools.cache
def scatter_kernels(precision: str, fourth: str) -> SimpleNamespace:
    """Kernels ``add_tension``, ``add_bending``, ``add_weave``; ``fourth`` is one of cloth.FOURTH_PARTS."""
    types = cloth_types(precision)
    vec4, Cloth, Edges, Hinges, Step = types.vec4, types.Cloth, types.Edges, types.Hinges, types.Step
    Weave = types.Weave
    functions = force_functions(precision, fourth)
    edge_load, hinge_loads, weave_loads = functions.edge_load, functions.hinge_loads, functions.weave_loads

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def add_tension(
        cloth: Cloth,
        edges: Edges,
        step: Step,
        load_out: wp.array(dtype=vec4),  # force [N] and the fourth part, shape [V]
    ):
        """Adds each edge's tension f(r) d / r to its two vertices, and the fourth part."""
        edge = wp.tid()
        a = edges.ends[edge][0]
        b = edges.ends[edge][1]
        load = edge_load(cloth, step, edges.law[edge], a, b)
        wp.atomic_add(load_out, a, load)
        wp.atomic_add(load_out, b, vec4(-load[0], -load[1], -load[2], load[3]))

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def add_bending(
        cloth: Cloth,
        hinges: Hinges,
        step: Step,
        load_out: wp.array(dtype=vec4),  # force [N] and the fourth part, shape [V]
    ):
        """Adds each hinge's forces to its four vertices, and the fourth part."""
        hinge = wp.tid()
        corners = hinges.corners[hinge]
        start, end, wing_0, wing_1 = hinge_loads(cloth, hinges, step, hinge)
        wp.atomic_add(load_out, corners[0], start)
        wp.atomic_add(load_out, corners[1], end)
        wp.atomic_add(load_out, corners[2], wing_0)
        wp.atomic_add(load_out, corners[3], wing_1)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def add_weave(
        cloth: Cloth,
        weave: Weave,
        step: Step,
        load_out: wp.array(dtype=vec4),  # force [N] and the fourth part, shape [V]
    ):
        """Adds the forces of each woven triangle's threads to its three vertices, and the fourth part."""
        triangle = wp.tid()
        corners = weave.corners[triangle]
        first, second, third = weave_loads(cloth, weave, step, triangle)
        wp.atomic_add(load_out, corners[0], first)
        wp.atomic_add(load_out, corners[1], second)
        wp.atomic_add(load_out, corners[2], third)

    return SimpleNamespace(add_tension=add_tension, add_bending=add_bending, add_weave=add_weave)

"""Forces by a kernel per edge and a kernel per hinge that add to their vertices.

For the CPU, where Warp runs a launch on one thread: the order of the additions is fixed, so the same input gives the
same bits. On CUDA the order would be left to chance; there ``gather`` serves.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.bending import hinge_forces, hinge_stiffness_bound
from warp_cloth.kernels.cloth import cloth_types, difference_function
from warp_cloth.kernels.tension import edge_drag, tension_force, tension_stiffness


@functools.cache
def scatter_kernels(precision: str, fourth: str) -> SimpleNamespace:
    """Kernels ``add_tension`` and ``add_bending`` in one precision; ``fourth`` is one of cloth.FOURTH_PARTS."""
    types = cloth_types(precision)
    real, vec3, vec4 = types.real, types.vec3, types.vec4
    Cloth, Edges, Hinges, Step = types.Cloth, types.Edges, types.Hinges, types.Step
    difference = difference_function(precision)

    @wp.kernel(module="unique", enable_backward=False)
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
        law = edges.law[edge]
        d = difference(cloth.position[b], cloth.position[a])
        length = wp.length(d)
        if length > real(0.0):
            d = d * (tension_force(length, law[0], law[1], law[2]) / length)
        part = real(0.0)
        if wp.static(fourth == "stiffness"):
            reach = step.reach * wp.length(cloth.move[b] - cloth.move[a])
            part = tension_stiffness(length, law[0], law[1], law[2], reach)
            d += edge_drag(cloth.move[b] - cloth.move[a], part, step.viscosity)
        if wp.static(fourth == "size"):
            part = wp.length(d)
        wp.atomic_add(load_out, a, vec4(d[0], d[1], d[2], part))
        wp.atomic_add(load_out, b, vec4(-d[0], -d[1], -d[2], part))

    @wp.func
    def hinge_sizes(axis: vec3, wing_0: vec3, wing_1: vec3, size_0: real, size_1: real):
        """Sum of the magnitudes that each wing's force brings to the axis' ends and to the wings [N]."""
        square = wp.max(wp.dot(axis, axis), real(1.0e-30))
        foot_0 = wp.dot(wing_0, axis) / square
        foot_1 = wp.dot(wing_1, axis) / square
        start = wp.abs(real(1.0) - foot_0) * size_0 + wp.abs(real(1.0) - foot_1) * size_1
        end = wp.abs(foot_0) * size_0 + wp.abs(foot_1) * size_1
        return vec4(start, end, size_0, size_1)

    @wp.kernel(module="unique", enable_backward=False)
    def add_bending(
        cloth: Cloth,
        hinges: Hinges,
        step: Step,
        load_out: wp.array(dtype=vec4),  # force [N] and the fourth part, shape [V]
    ):
        """Adds each hinge's forces to its four vertices, and the fourth part."""
        hinge = wp.tid()
        corners = hinges.corners[hinge]
        start = cloth.position[corners[0]]
        axis = difference(cloth.position[corners[1]], start)
        wing_0 = difference(cloth.position[corners[2]], start)
        wing_1 = difference(cloth.position[corners[3]], start)
        stiffness = hinges.stiffness[hinge]
        force_0, force_1, force_end = hinge_forces(axis, wing_0, wing_1, stiffness)
        force_start = -(force_0 + force_1 + force_end)
        part = vec4()
        if wp.static(fourth == "stiffness"):
            reach = step.reach * wp.length(cloth.move[corners[0]])
            bound = hinge_stiffness_bound(axis, wing_0, wing_1, stiffness, reach)
            part = vec4(bound, bound, bound, bound)
        if wp.static(fourth == "size"):
            part = hinge_sizes(axis, wing_0, wing_1, wp.length(force_0), wp.length(force_1))
        wp.atomic_add(load_out, corners[0], vec4(force_start[0], force_start[1], force_start[2], part[0]))
        wp.atomic_add(load_out, corners[1], vec4(force_end[0], force_end[1], force_end[2], part[1]))
        wp.atomic_add(load_out, corners[2], vec4(force_0[0], force_0[1], force_0[2], part[2]))
        wp.atomic_add(load_out, corners[3], vec4(force_1[0], force_1[1], force_1[2], part[3]))

    return SimpleNamespace(add_tension=add_tension, add_bending=add_bending)

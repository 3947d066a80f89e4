"""What one edge and one hinge do to their vertices, in one precision; ``scatter`` and ``gather`` sum it."""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.bending import hinge_forces, hinge_stiffness_bound
from warp_cloth.kernels.cloth import cloth_types, difference_function
from warp_cloth.kernels.tension import edge_drag, tension_force, tension_stiffness


@functools.cache
def force_functions(precision: str, fourth: str) -> SimpleNamespace:
    """Functions ``edge_load`` and ``hinge_loads``; ``fourth`` is one of cloth.FOURTH_PARTS."""
    types = cloth_types(precision)
    real, vec3, vec4 = types.real, types.vec3, types.vec4
    Cloth, Hinges, Step = types.Cloth, types.Hinges, types.Step
    difference = difference_function(precision)

    @wp.func
    def edge_load(cloth: Cloth, step: Step, law: vec3, vertex: int, other: int):
        """Force of an edge on one of its ends [N], and the fourth part; on the other end the force is the opposite."""
        d = difference(cloth.position[other], cloth.position[vertex])
        length = wp.length(d)
        force = vec3()
        if length > real(0.0):
            force = d * (tension_force(length, law[0], law[1], law[2]) / length)
        part = real(0.0)
        if wp.static(fourth == "stiffness"):
            change = cloth.move[other] - cloth.move[vertex]
            part = tension_stiffness(length, law[0], law[1], law[2], step.reach * wp.length(change))
            force = force + edge_drag(change, part, step.viscosity)
        if wp.static(fourth == "size"):
            part = wp.length(force)
        return vec4(force[0], force[1], force[2], part)

    @wp.func
    def hinge_sizes(axis: vec3, wing_0: vec3, wing_1: vec3, size_0: real, size_1: real):
        """Sum of the magnitudes that each wing's force brings to the axis' ends and to the wings [N]."""
        square = wp.max(wp.dot(axis, axis), real(1.0e-30))
        foot_0 = wp.dot(wing_0, axis) / square
        foot_1 = wp.dot(wing_1, axis) / square
        start = wp.abs(real(1.0) - foot_0) * size_0 + wp.abs(real(1.0) - foot_1) * size_1
        end = wp.abs(foot_0) * size_0 + wp.abs(foot_1) * size_1
        return vec4(start, end, size_0, size_1)

    @wp.func
    def hinge_loads(cloth: Cloth, hinges: Hinges, step: Step, hinge: int):
        """Forces of a hinge [N] and the fourth part on the axis' start and end and on the two wings."""
        corners = hinges.corners[hinge]
        origin = cloth.position[corners[0]]
        axis = difference(cloth.position[corners[1]], origin)
        wing_0 = difference(cloth.position[corners[2]], origin)
        wing_1 = difference(cloth.position[corners[3]], origin)
        stiffness = hinges.stiffness[hinge]
        f0, f1, end = hinge_forces(axis, wing_0, wing_1, stiffness)
        start = -(f0 + f1 + end)
        part = vec4()
        if wp.static(fourth == "stiffness"):
            reach = step.reach * wp.length(cloth.move[corners[0]])
            bound = hinge_stiffness_bound(axis, wing_0, wing_1, stiffness, reach)
            part = vec4(bound, bound, bound, bound)
        if wp.static(fourth == "size"):
            part = hinge_sizes(axis, wing_0, wing_1, wp.length(f0), wp.length(f1))
        return (
            vec4(start[0], start[1], start[2], part[0]),
            vec4(end[0], end[1], end[2], part[1]),
            vec4(f0[0], f0[1], f0[2], part[2]),
            vec4(f1[0], f1[1], f1[2], part[3]),
        )

    return SimpleNamespace(edge_load=edge_load, hinge_loads=hinge_loads)

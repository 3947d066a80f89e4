"""What an edge, a hinge and a woven triangle do to their vertices, in one precision; ``scatter``, ``gather`` sum it."""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.bending import hinge_forces, hinge_stiffness_bound
from warp_cloth.kernels.cloth import cloth_types, difference_function
from warp_cloth.kernels.tension import edge_drag, tension_force, tension_stiffness
from warp_cloth.kernels.weave import slope_shares, thread_pull, warp_vector, weft_vector


@functools.cache
def force_functions(precision: str, fourth: str) -> SimpleNamespace:
    """Functions ``edge_load``, ``hinge_loads`` and ``weave_loads``; ``fourth`` is one of cloth.FOURTH_PARTS."""
    return SimpleNamespace(
        edge_load=_edge_function(precision, fourth),
        hinge_loads=_hinge_function(precision, fourth),
        weave_loads=_weave_function(precision, fourth),
    )


def _edge_function(precision: str, fourth: str) -> wp.Function:
    types = cloth_types(precision)
    real, vec3, vec4, Cloth, Step = types.real, types.vec3, types.vec4, types.Cloth, types.Step
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

    return edge_load


def _hinge_function(precision: str, fourth: str) -> wp.Function:
    types = cloth_types(precision)
    real, vec3, vec4, Cloth, Hinges, Step = types.real, types.vec3, types.vec4, types.Cloth, types.Hinges, types.Step
    difference = difference_function(precision)

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

    return hinge_loads


def _thread_parts_function(precision: str, fourth: str) -> wp.Function:
    types = cloth_types(precision)
    real, vec3, vec4 = types.real, types.vec3, types.vec4
    half = wp.constant(real(0.5**0.5))

    @wp.func
    def corner_share(slope_1: real, slope_2: real):
        """What a thread's figure counts for at each corner: stiffness by ``slope_shares``, size by the slopes."""
        part = vec3(wp.abs(slope_1 + slope_2), wp.abs(slope_1), wp.abs(slope_2))
        if wp.static(fourth == "stiffness"):
            share_0, share_1, share_2 = slope_shares(slope_1, slope_2)
            part = vec3(share_0, share_1, share_2)
        return part

    @wp.func
    def corner_parts(slope: vec4, figure: vec4):
        """Fourth parts of the corners from the figures of the weft, warp and both bias threads."""
        part = corner_share(slope[0], slope[1]) * figure[0] + corner_share(slope[2], slope[3]) * figure[1]
        part += corner_share(half * (slope[0] + slope[2]), half * (slope[1] + slope[3])) * figure[2]
        part += corner_share(half * (slope[0] - slope[2]), half * (slope[1] - slope[3])) * figure[3]
        return part

    return corner_parts


def _weave_function(precision: str, fourth: str) -> wp.Function:
    types = cloth_types(precision)
    real, vec3, vec4, Cloth, Weave, Step = types.real, types.vec3, types.vec4, types.Cloth, types.Weave, types.Step
    difference = difference_function(precision)
    corner_parts = _thread_parts_function(precision, fourth)
    half = wp.constant(real(0.5**0.5))

    @wp.func
    def weave_loads(cloth: Cloth, weave: Weave, step: Step, triangle: int):
        """Forces of a triangle's four threads [N] and the fourth part on its corners."""
        corners = weave.corners[triangle]
        slope = weave.slope[triangle]
        law = weave.law[triangle]
        push = law * law[3]
        origin = cloth.position[corners[0]]
        side_1 = difference(cloth.position[corners[1]], origin)
        side_2 = difference(cloth.position[corners[2]], origin)
        along_u = weft_vector(slope, side_1, side_2)
        along_v = warp_vector(slope, side_1, side_2)
        change_u = vec3()
        change_v = vec3()
        viscosity = real(0.0)
        if wp.static(fourth == "stiffness"):
            move = cloth.move[corners[0]]
            move_1 = cloth.move[corners[1]] - move
            move_2 = cloth.move[corners[2]] - move
            change_u = weft_vector(slope, move_1, move_2)
            change_v = warp_vector(slope, move_1, move_2)
            viscosity = step.viscosity
        plus = half * (along_u + along_v)
        minus = half * (along_u - along_v)
        change_p = half * (change_u + change_v)
        change_m = half * (change_u - change_v)
        pull_u, stiff_u = thread_pull(along_u, change_u, law[0], push[0], step.reach, viscosity)
        pull_v, stiff_v = thread_pull(along_v, change_v, law[1], push[1], step.reach, viscosity)
        pull_p, stiff_p = thread_pull(plus, change_p, law[2], push[2], step.reach, viscosity)
        pull_m, stiff_m = thread_pull(minus, change_m, law[2], push[2], step.reach, viscosity)
        part = vec3()
        if wp.static(fourth == "stiffness"):
            part = corner_parts(slope, vec4(stiff_u, stiff_v, stiff_p, stiff_m))
        if wp.static(fourth == "size"):
            sizes = vec4(wp.length(pull_u), wp.length(pull_v), wp.length(pull_p), wp.length(pull_m))
            part = corner_parts(slope, sizes)
        weft = pull_u + half * (pull_p + pull_m)
        warp = pull_v + half * (pull_p - pull_m)
        f1 = -(weft * slope[0] + warp * slope[2])
        f2 = -(weft * slope[1] + warp * slope[3])
        f0 = -(f1 + f2)
        return (
            vec4(f0[0], f0[1], f0[2], part[0]),
            vec4(f1[0], f1[1], f1[2], part[1]),
            vec4(f2[0], f2[1], f2[2], part[2]),
        )

    return weave_loads

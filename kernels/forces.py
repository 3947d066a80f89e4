"""What an edge, its hinge and a triangle do to their vertices, in one precision; ``scatter``, ``gather`` sum it.

A load is a force [N] and a fourth part (one of cloth.FOURTH_PARTS). A hinge turns its two triangles, each of which
answers along its own normal: so a hinge's forces are summed triangle by triangle, of three hinges at a time.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.bending import hinge_turn, triangle_normal, turned_back
from warp_cloth.kernels.cloth import Terms, cloth_types, difference_function
from warp_cloth.kernels.tension import edge_drag, tension_force, tension_stiffness
from warp_cloth.kernels.weave import slope_shares, thread_pull, warp_vector, weft_vector


@functools.cache
def edge_functions(precision: str, fourth: str, angles: bool) -> SimpleNamespace:
    """Functions ``edge_span``, ``edge_load`` (its tension) and ``edge_fold`` (its hinge, with rest angles or flat)."""
    types = cloth_types(precision)
    real, vec2, vec3, vec4 = types.real, types.vec2, types.vec3, types.vec4
    Cloth, Step, Span = types.Cloth, types.Step, types.Span
    difference = difference_function(precision)

    @wp.func
    def edge_span(cloth: Cloth, ends: wp.vec2i):
        """An edge as it lies, and what last moved it."""
        span = Span()
        span.side = difference(cloth.position[ends[1]], cloth.position[ends[0]])
        if wp.static(fourth == "stiffness"):
            move = cloth.move[ends[0]]
            span.change = cloth.move[ends[1]] - move
            span.move = wp.length(move)
        return span

    @wp.func
    def edge_load(span: Span, law: vec3, step: Step):
        """Load of an edge's tension on its first end; on the second the force is the opposite."""
        length = wp.length(span.side)
        force = vec3()
        if length > real(0.0):
            force = span.side * (tension_force(length, law[0], law[1], law[2]) / length)
        part = real(0.0)
        if wp.static(fourth == "stiffness"):
            part = tension_stiffness(length, law[0], law[1], law[2], step.reach * wp.length(span.change))
            force = force + edge_drag(span.change, part, step.viscosity)
        if wp.static(fourth == "size"):
            part = wp.length(force)
        return vec4(force[0], force[1], force[2], part)

    @wp.func
    def edge_fold(span: Span, first: vec4, second: vec4, stiffness: real, rest: vec2, step: Step):
        """Turn [N] of an edge's hinge and bound of its stiffness [N/m], from its triangles' ``triangle_fold``."""
        normal_0 = vec3(first[0], first[1], first[2])
        normal_1 = vec3(second[0], second[1], second[2]) * wp.sign(stiffness)
        if wp.static(angles):
            normal_1 = turned_back(normal_1, span.side, rest)
        reach = step.reach * span.move
        turn, bound = hinge_turn(normal_0, first[3], normal_1, second[3], span.side, wp.abs(stiffness), reach)
        return vec2(turn, bound)

    return SimpleNamespace(edge_span=edge_span, edge_load=edge_load, edge_fold=edge_fold)


@functools.cache
def triangle_functions(precision: str, fourth: str, terms: Terms) -> SimpleNamespace:
    """Functions ``triangle_sides``, ``triangle_fold`` (its normal) and ``triangle_loads`` (hinges and threads)."""
    types = cloth_types(precision)
    vec3, vec4, Cloth, Step, Sides = types.vec3, types.vec4, types.Cloth, types.Step, types.Sides
    difference = difference_function(precision)
    fold_loads = _fold_function(precision, fourth)
    thread_loads = _thread_function(precision, fourth)

    @wp.func
    def triangle_sides(cloth: Cloth, corners: wp.vec3i):
        """A triangle as it lies, and what last moved it."""
        p_0 = cloth.position[corners[0]]
        p_1 = cloth.position[corners[1]]
        p_2 = cloth.position[corners[2]]
        sides = Sides()
        sides.side_0 = difference(p_2, p_1)
        sides.side_1 = difference(p_0, p_2)
        sides.side_2 = difference(p_1, p_0)
        if wp.static(fourth == "stiffness" and terms.threads):
            move = cloth.move[corners[0]]
            sides.change_1 = move - cloth.move[corners[2]]
            sides.change_2 = cloth.move[corners[1]] - move
        return sides

    @wp.func
    def triangle_fold(sides: Sides):
        """Unit normal, and the inverse of twice the area [1/m2]."""
        normal, inverse = triangle_normal(sides.side_2, -sides.side_1)
        return vec4(normal[0], normal[1], normal[2], inverse)

    @wp.func
    def triangle_loads(sides: Sides, own: vec4, turn: vec3, bound: vec3, slope: vec4, threads: vec4, step: Step):
        """Loads of the corners; their forces sum to zero.

        Args:
            own: ``triangle_fold``.
            turn: of the sides' hinges [N], as the triangle is wound.
            bound: of their stiffness [N/m].
            slope: of the threads, as in cloth's Weave.
            threads: their law.
        """
        load_0 = vec4()
        load_1 = vec4()
        load_2 = vec4()
        if wp.static(terms.folds):
            load_0, load_1, load_2 = fold_loads(sides, own, turn, bound)
        if wp.static(terms.threads):
            thread_0, thread_1, thread_2 = thread_loads(sides, slope, threads, step)
            load_0 += thread_0
            load_1 += thread_1
            load_2 += thread_2
        return load_0, load_1, load_2

    return SimpleNamespace(triangle_sides=triangle_sides, triangle_fold=triangle_fold, triangle_loads=triangle_loads)


@functools.cache
def _loads_function(precision: str) -> wp.Function:
    types = cloth_types(precision)
    vec3, vec4 = types.vec3, types.vec4

    @wp.func
    def corner_loads(force_1: vec3, force_2: vec3, part: vec3):
        """Loads of the corners from the forces on the second and third, which the first balances."""
        force_0 = -(force_1 + force_2)
        return (
            vec4(force_0[0], force_0[1], force_0[2], part[0]),
            vec4(force_1[0], force_1[1], force_1[2], part[1]),
            vec4(force_2[0], force_2[1], force_2[2], part[2]),
        )

    return corner_loads


def _fold_function(precision: str, fourth: str) -> wp.Function:
    types = cloth_types(precision)
    real, vec3, vec4, Sides = types.real, types.vec3, types.vec4, types.Sides
    corner_loads = _loads_function(precision)
    half = wp.constant(real(0.5))

    @wp.func
    def fold_loads(sides: Sides, own: vec4, turn: vec3, bound: vec3):
        """Loads of the three sides' hinges on the corners, along the triangle's normal.

        With p_i the turn of side i over twice the area, it pushes corner i by p_i L_i^2 and the side's ends by -p_i
        times the dot product of the sides that leave the other end: each end's share of L_i^2 by the foot of the
        corner's perpendicular. So no net force is left, nor with the other triangle's a net torque.
        """
        s_0, s_1, s_2 = sides.side_0, sides.side_1, sides.side_2
        square_0, square_1, square_2 = wp.dot(s_0, s_0), wp.dot(s_1, s_1), wp.dot(s_2, s_2)
        dot_0, dot_1, dot_2 = -wp.dot(s_1, s_2), -wp.dot(s_2, s_0), -wp.dot(s_0, s_1)
        p_0, p_1, p_2 = turn[0] * own[3], turn[1] * own[3], turn[2] * own[3]
        normal = vec3(own[0], own[1], own[2])
        force_1 = normal * (p_1 * square_1 - p_0 * dot_2 - p_2 * dot_0)
        force_2 = normal * (p_2 * square_2 - p_0 * dot_1 - p_1 * dot_0)
        part = vec3()
        if wp.static(fourth == "stiffness"):
            # a wing's bound is in its own triangle, an axis' in both of the hinge's
            both = half * (bound[0] + bound[1] + bound[2])
            part = vec3(both + half * bound[0], both + half * bound[1], both + half * bound[2])
        if wp.static(fourth == "size"):
            part = vec3(
                wp.abs(p_0) * square_0 + wp.abs(p_1 * dot_2) + wp.abs(p_2 * dot_1),
                wp.abs(p_1) * square_1 + wp.abs(p_0 * dot_2) + wp.abs(p_2 * dot_0),
                wp.abs(p_2) * square_2 + wp.abs(p_0 * dot_1) + wp.abs(p_1 * dot_0),
            )
        return corner_loads(force_1, force_2, part)

    return fold_loads


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


def _thread_function(precision: str, fourth: str) -> wp.Function:
    types = cloth_types(precision)
    real, vec3, vec4, Sides, Step = types.real, types.vec3, types.vec4, types.Sides, types.Step
    corner_loads = _loads_function(precision)
    corner_parts = _thread_parts_function(precision, fourth)
    half = wp.constant(real(0.5**0.5))

    @wp.func
    def thread_loads(sides: Sides, slope: vec4, law: vec4, step: Step):
        """Loads of the four threads on the corners."""
        push = law * law[3]
        along_u = weft_vector(slope, sides.side_2, -sides.side_1)
        along_v = warp_vector(slope, sides.side_2, -sides.side_1)
        change_u = vec3()
        change_v = vec3()
        viscosity = real(0.0)
        if wp.static(fourth == "stiffness"):
            change_u = weft_vector(slope, sides.change_2, -sides.change_1)
            change_v = warp_vector(slope, sides.change_2, -sides.change_1)
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
        force_1 = -(weft * slope[0] + warp * slope[2])
        force_2 = -(weft * slope[1] + warp * slope[3])
        return corner_loads(force_1, force_2, part)

    return thread_loads

"""Coarse vertices that turn: what follows one shifts and turns with it, so that wrinkles between them move as they are.

A vertex at x_i follows coarse ones at c_I, d_i = sum_I P_iI (t_I + w_I x (x_i - c_I)), with shifts t and turns w: hat
functions of shifts alone would stretch every wrinkle that they turn. Of a pair's d_i - d_j coarse vertex I makes
D_I (t_I, w_I), D_I = [a 1, -[v]], [v] u = v x u, with a = P_iI - P_jI and v = P_iI (x_i - c_I) - P_jI (x_j - c_I).
So the pair's stiffness S gives the coarse vertices I and J the 6 x 6 block D_I^T S D_J; what holds a vertex against the
world is a pair of it and of nothing.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.cloth import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.conjugate import allowed_function, conjugate_types
from warp_cloth.kernels.levels import level_types
from warp_cloth.kernels.stiffness import stiffness_types, symmetric_functions


@functools.cache
def turn_types(precision: str) -> SimpleNamespace:
    """Struct ``Turns``."""
    types, own, Rows = cloth_types(precision), stiffness_types(precision), level_types(precision).Rows

    @wp.struct
    class Turns:
        """n coarse vertices and the M blocks of all two that a fine vertex or pair follows, I <= J."""

        up: Rows  # of the fine vertices, from these
        down: Rows  # of these, from the fine vertices
        ends: wp.array(dtype=wp.vec2i)  # of the N fine pairs
        centre: wp.array(dtype=types.point)  # c [m], shape [n]
        two: wp.array(dtype=wp.vec2i)  # I and J of a block, shape [M]
        member_start: wp.array(dtype=wp.int32)  # rows of ``member``, shape [M + 1]
        member: wp.array(dtype=wp.int32)  # the pairs of a block; from N on, vertices with what holds them
        block: wp.array2d(dtype=own.mat3)  # its quarters, of shifts and turns [N/m, N, N, N m], shape [M, 4]
        start: wp.array(dtype=wp.int32)  # rows of ``slot``, shape [n + 1]
        slot: wp.array(dtype=wp.int32)  # 2 block, + 1 where it is J's row
        diagonal: wp.array(dtype=wp.int32)  # the block of a vertex with itself, shape [n]
        divisor: wp.array2d(dtype=own.vec6)  # inverses of its first quarter, and of what that leaves of the last

    return SimpleNamespace(Turns=Turns)


@functools.cache
def block_kernels(precision: str) -> SimpleNamespace:
    """Kernels ``find_centres``, ``gather_turns`` and ``divide_turns``: what couples the coarse vertices."""
    types, own, Rows = cloth_types(precision), stiffness_types(precision), level_types(precision).Rows
    real, vec3, point, mat3, vec6 = types.real, types.vec3, types.point, own.mat3, own.vec6
    Cloth, Turns = types.Cloth, turn_types(precision).Turns
    inverse = symmetric_functions(precision).inverse

    @wp.func
    def full(m: vec6):
        """The symmetric matrix."""
        return mat3(m[0], m[3], m[4], m[3], m[1], m[5], m[4], m[5], m[2])

    @wp.func
    def share(up: Rows, vertex: int, coarse: int):
        """P_iI."""
        result = real(0.0)
        for entry in range(up.start[vertex], up.start[vertex + 1]):
            if up.index[entry] == coarse:
                result = up.weight[entry]
        return result

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def find_centres(cloth: Cloth, turns: Turns):
        """Means of the places that follow the coarse vertices."""
        vertex = wp.tid()
        sum = point()
        weight = real(0.0)
        for entry in range(turns.down.start[vertex], turns.down.start[vertex + 1]):
            weight += turns.down.weight[entry]
            sum += cloth.position[turns.down.index[entry]] * type(sum[0])(turns.down.weight[entry])
        turns.centre[vertex] = sum / type(sum[0])(weight)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def gather_turns(
        cloth: Cloth,
        coupling: wp.array(dtype=vec6),  # of the pairs [N/m], shape [N]
        anchor: wp.array(dtype=vec6),  # against the world [N/m], shape [V]
        turns: Turns,
    ):
        """The blocks."""
        block = wp.tid()
        one, other = turns.two[block][0], turns.two[block][1]
        pairs = coupling.shape[0]
        shift, right, below, turn = mat3(), mat3(), mat3(), mat3()
        for entry in range(turns.member_start[block], turns.member_start[block + 1]):
            member = turns.member[entry]
            first, second = member - pairs, -1
            if member < pairs:
                first, second = turns.ends[member][0], turns.ends[member][1]
                s = full(coupling[member])
            else:
                s = full(anchor[first])
            a, b = share(turns.up, first, one), share(turns.up, first, other)
            v = vec3(cloth.position[first] - turns.centre[one]) * a
            w = vec3(cloth.position[first] - turns.centre[other]) * b
            if second >= 0:
                less, fewer = share(turns.up, second, one), share(turns.up, second, other)
                v -= vec3(cloth.position[second] - turns.centre[one]) * less
                w -= vec3(cloth.position[second] - turns.centre[other]) * fewer
                a -= less
                b -= fewer
            turned, turning = wp.skew(v) * s, wp.skew(w)
            shift += s * (a * b)
            right -= s * turning * a
            below += turned * b
            turn -= turned * turning
        turns.block[block, 0] = shift
        turns.block[block, 1] = right
        turns.block[block, 2] = below
        turns.block[block, 3] = turn

    @wp.func
    def symmetric(m: mat3):
        """As vec6."""
        return vec6(m[0, 0], m[1, 1], m[2, 2], m[0, 1], m[0, 2], m[1, 2])

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def divide_turns(turns: Turns):
        """What each coarse vertex's own block divides by: shifts first, turns by what these leave."""
        vertex = wp.tid()
        block = turns.diagonal[vertex]
        by_shift = inverse(symmetric(turns.block[block, 0]))
        right = turns.block[block, 1]
        turns.divisor[vertex, 0] = by_shift
        left = turns.block[block, 3] - wp.transpose(right) * full(by_shift) * right
        turns.divisor[vertex, 1] = inverse(symmetric(left))

    return SimpleNamespace(find_centres=find_centres, gather_turns=gather_turns, divide_turns=divide_turns)


@functools.cache
def turn_kernels(precision: str) -> SimpleNamespace:
    """Kernels of a solution: ``begin_turns``; each round ``lead_turns``, ``multiply_turns``, ``advance_turns``; and
    ``follow_turns``.

    Shift and turn of coarse vertex I are the vectors 2 I and 2 I + 1; so are the force and the moment on it. Sums over
    a garment come in parts, which every vertex adds up for itself: that is quicker than a kernel more.
    """
    types, Turns = cloth_types(precision), turn_types(precision).Turns
    real, vec3, Cloth = types.real, types.vec3, types.Cloth
    System, allowed = conjugate_types(precision).System, allowed_function(precision)
    times = symmetric_functions(precision).times

    @wp.func
    def total(part: wp.array2d(dtype=wp.float64), garment: int):
        """Sum of a garment's parts."""
        sum = wp.float64(0.0)
        for i in range(part.shape[1]):
            sum += part[garment, i]
        return sum

    @wp.func
    def correct(turns: Turns, coarse: System, vertex: int):
        """The coarse vertex's residual by its own block."""
        force, moment = coarse.residual[2 * vertex], coarse.residual[2 * vertex + 1]
        right = turns.block[turns.diagonal[vertex], 1]
        by_shift = turns.divisor[vertex, 0]
        turn = times(turns.divisor[vertex, 1], moment - wp.transpose(right) * times(by_shift, force))
        coarse.correction[2 * vertex] = times(by_shift, force - right * turn)
        coarse.correction[2 * vertex + 1] = turn

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def begin_turns(cloth: Cloth, turns: Turns, fine: wp.array(dtype=vec3), coarse: System):
        """Force [N] and moment [N m] of what is left on the vertices that follow; the solution begins with nothing."""
        vertex = wp.tid()
        force, moment = vec3(), vec3()
        for entry in range(turns.down.start[vertex], turns.down.start[vertex + 1]):
            i = turns.down.index[entry]
            part = fine[i] * turns.down.weight[entry]
            force += part
            moment += wp.cross(vec3(cloth.position[i] - turns.centre[vertex]), part)
        coarse.residual[2 * vertex] = force
        coarse.residual[2 * vertex + 1] = moment
        coarse.displacement[2 * vertex] = vec3()
        coarse.displacement[2 * vertex + 1] = vec3()
        correct(turns, coarse, vertex)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def lead_turns(
        along: wp.array2d(dtype=wp.float64),  # parts of residual . correction [J]
        before: wp.array2d(dtype=wp.float64),  # the last round's; None in the first
        coarse: System,
    ):
        """The next direction: correction + along / before direction."""
        i = wp.tid()
        share = real(0.0)
        if before:
            garment = coarse.garment[i]
            last = total(before, garment)
            if last > wp.float64(0.0):
                share = real(total(along, garment) / last)
        coarse.direction[i] = coarse.correction[i] + coarse.direction[i] * share

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def multiply_turns(turns: Turns, coarse: System):
        """product = K direction."""
        vertex = wp.tid()
        force, moment = vec3(), vec3()
        for entry in range(turns.start[vertex], turns.start[vertex + 1]):
            block, mirrored = turns.slot[entry] // 2, turns.slot[entry] % 2 == 1
            two = turns.two[block]
            beside = wp.where(mirrored, two[0], two[1])
            shift, turn = coarse.direction[2 * beside], coarse.direction[2 * beside + 1]
            if mirrored:
                force += wp.transpose(turns.block[block, 0]) * shift + wp.transpose(turns.block[block, 2]) * turn
                moment += wp.transpose(turns.block[block, 1]) * shift + wp.transpose(turns.block[block, 3]) * turn
            else:
                force += turns.block[block, 0] * shift + turns.block[block, 1] * turn
                moment += turns.block[block, 2] * shift + turns.block[block, 3] * turn
        coarse.product[2 * vertex] = force
        coarse.product[2 * vertex + 1] = moment

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def advance_turns(
        along: wp.array2d(dtype=wp.float64),  # parts of residual . correction [J]
        across: wp.array2d(dtype=wp.float64),  # of direction . product [J]
        turns: Turns,
        coarse: System,
    ):
        """displacement += step direction, residual -= step product, step = along / across; and the next correction."""
        vertex = wp.tid()
        garment = coarse.garment[2 * vertex]
        step = real(0.0)
        size = total(across, garment)
        if size > wp.float64(0.0):
            step = real(total(along, garment) / size)
        for i in range(2 * vertex, 2 * vertex + 2):
            coarse.displacement[i] = coarse.displacement[i] + coarse.direction[i] * step
            coarse.residual[i] = coarse.residual[i] - coarse.product[i] * step
        correct(turns, coarse, vertex)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def follow_turns(weight: real, cloth: Cloth, turns: Turns, coarse: System, system: System):
        """Adds ``weight`` times what each vertex follows to its correction."""
        vertex = wp.tid()
        sum = vec3()
        for entry in range(turns.up.start[vertex], turns.up.start[vertex + 1]):
            i = turns.up.index[entry]
            arm = vec3(cloth.position[vertex] - turns.centre[i])
            moved = coarse.displacement[2 * i] + wp.cross(coarse.displacement[2 * i + 1], arm)
            sum += moved * turns.up.weight[entry]
        hold = system.hold[vertex]
        system.correction[vertex] = system.correction[vertex] + allowed(sum, system.normal[vertex], hold) * weight

    return SimpleNamespace(
        begin_turns=begin_turns,
        lead_turns=lead_turns,
        multiply_turns=multiply_turns,
        advance_turns=advance_turns,
        follow_turns=follow_turns,
    )

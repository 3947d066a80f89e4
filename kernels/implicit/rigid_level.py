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

from warp_cloth.kernels.base.block import block_of, block_threads, lane_of, wait_for_block
from warp_cloth.kernels.base.reduction import (
    Parts,
    fresh_function,
    lanes_together,
    meet_blocks,
    order_function,
    ratio,
    sum_part,
)
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.elements.stiffness import stiffness_types, symmetric_functions
from warp_cloth.kernels.implicit.coarse_levels import level_types
from warp_cloth.kernels.implicit.conjugate_gradient import allowed_function, conjugate_types

TOGETHER = wp.constant(32)  # blocks that threads which go together read side by side


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
        slot: wp.array(dtype=wp.vec2i)  # where I keeps the block and where J does, or -1: I is J, shape [M]
        start: wp.array(dtype=wp.int32)  # of each vertex's blocks, shape [n + 1]
        beside: wp.array(dtype=wp.int32)  # the other vertex of each, shape [E]
        block: wp.array3d(dtype=types.real)  # their numbers row by row, TOGETHER blocks at a time (``number``)
        diagonal: wp.array(dtype=wp.int32)  # where a vertex keeps its block with itself, shape [n]
        right: wp.array(dtype=own.mat3)  # that block's second quarter, shape [n]
        divisor: wp.array2d(dtype=own.vec6)  # inverses of its first quarter, and of what that leaves of the last
        parts: Parts  # these vertices
        owner: wp.array(dtype=wp.int32)  # the coarse vertex of each entry of ``down``, shape [D]
        pull: wp.array2d(dtype=types.vec3)  # force and moment of each on it [N, N m], shape [D, 2]
        term: wp.array2d(dtype=types.real)  # what of the product each block gives, shape [E, 6]
        residual: wp.array(dtype=types.vec3)  # force and moment left on each vertex [N, N m], shape [2 n]
        correction: wp.array(dtype=types.vec3)  # shift and turn of each by its own block [m, 1], shape [2 n]
        direction: wp.array(dtype=types.vec3)
        other: wp.array(dtype=types.vec3)  # the last round's direction; the two change places
        product: wp.array(dtype=types.real)  # force and moment that resist the direction, shape [6 n]
        displacement: wp.array(dtype=types.vec3)  # the solution
        along: wp.array(dtype=wp.float64)  # residual . correction of each part [J]
        before: wp.array(dtype=wp.float64)  # the last round's; the two change places
        across: wp.array(dtype=wp.float64)  # direction . product of each part [J]
        came: wp.array(dtype=wp.int32)  # how many blocks have met, shape [1]

    return SimpleNamespace(Turns=Turns)


@functools.cache
def block_kernels(precision: str) -> SimpleNamespace:
    """Kernels ``find_centres``, ``gather_turns`` and ``divide_turns``: what couples the coarse vertices."""
    types, own, Rows = cloth_types(precision), stiffness_types(precision), level_types(precision).Rows
    real, vec3, point, mat3, vec6 = types.real, types.vec3, types.point, own.mat3, own.vec6
    State, Turns = types.State, turn_types(precision).Turns
    inverse, add_in_order = symmetric_functions(precision).inverse, order_function(precision, mat3)

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

    @wp.func
    def put(turns: Turns, entry: int, row: int, column: int, quarter: mat3):
        """Puts a quarter of a block where it belongs."""
        for i in range(3):
            for j in range(3):
                turns.block[entry // TOGETHER, 6 * (row + i) + column + j, entry % TOGETHER] = quarter[i, j]

    @wp.func
    def quarter_of(turns: Turns, entry: int, row: int, column: int):
        """A quarter of a block."""
        quarter = mat3()
        for i in range(3):
            for j in range(3):
                quarter[i, j] = turns.block[entry // TOGETHER, 6 * (row + i) + column + j, entry % TOGETHER]
        return quarter

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def find_centres(state: State, turns: Turns):
        """Means of the places that follow the coarse vertices."""
        vertex = wp.tid()
        sum = point()
        weight = real(0.0)
        for entry in range(turns.down.start[vertex], turns.down.start[vertex + 1]):
            weight += turns.down.weight[entry]
            sum += state.position[turns.down.index[entry]] * type(sum[0])(turns.down.weight[entry])
        turns.centre[vertex] = sum / type(sum[0])(weight)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def gather_turns(
        state: State,
        coupling: wp.array(dtype=vec6),  # of the pairs [N/m], shape [N]
        anchor: wp.array(dtype=vec6),  # against the world [N/m], shape [V]
        turns: Turns,
    ):
        """The blocks."""
        block, lane = wp.tid() // lanes_together(), wp.tid() % lanes_together()
        one, other = turns.two[block][0], turns.two[block][1]
        pairs = coupling.shape[0]
        shift, right, below, turn = mat3(), mat3(), mat3(), mat3()
        last = turns.member_start[block + 1]
        for begin in range(turns.member_start[block], last, lanes_together()):
            shift_part, right_part, below_part, turn_part = mat3(), mat3(), mat3(), mat3()
            if begin + lane < last:
                member = turns.member[begin + lane]
                first, second = member - pairs, -1
                if member < pairs:
                    first, second = turns.ends[member][0], turns.ends[member][1]
                    s = full(coupling[member])
                else:
                    s = full(anchor[first])
                a, b = share(turns.up, first, one), share(turns.up, first, other)
                v = vec3(state.position[first] - turns.centre[one]) * a
                w = vec3(state.position[first] - turns.centre[other]) * b
                if second >= 0:
                    less, fewer = share(turns.up, second, one), share(turns.up, second, other)
                    v -= vec3(state.position[second] - turns.centre[one]) * less
                    w -= vec3(state.position[second] - turns.centre[other]) * fewer
                    a -= less
                    b -= fewer
                turned, turning = wp.skew(v) * s, wp.skew(w)
                shift_part = s * (a * b)
                right_part = -(s * turning * a)
                below_part = turned * b
                turn_part = -(turned * turning)
            count = wp.min(last - begin, lanes_together())
            shift = add_in_order(shift, shift_part, count)
            right = add_in_order(right, right_part, count)
            below = add_in_order(below, below_part, count)
            turn = add_in_order(turn, turn_part, count)
        if lane > 0:
            return
        slot = turns.slot[block]
        put(turns, slot[0], 0, 0, shift)
        put(turns, slot[0], 0, 3, right)
        put(turns, slot[0], 3, 0, below)
        put(turns, slot[0], 3, 3, turn)
        if slot[1] >= 0:
            put(turns, slot[1], 0, 0, wp.transpose(shift))
            put(turns, slot[1], 0, 3, wp.transpose(below))
            put(turns, slot[1], 3, 0, wp.transpose(right))
            put(turns, slot[1], 3, 3, wp.transpose(turn))

    @wp.func
    def symmetric(m: mat3):
        """As vec6."""
        return vec6(m[0, 0], m[1, 1], m[2, 2], m[0, 1], m[0, 2], m[1, 2])

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def divide_turns(turns: Turns):
        """What each coarse vertex's own block divides by: shifts first, turns by what these leave."""
        vertex = wp.tid()
        own = turns.diagonal[vertex]
        by_shift = inverse(symmetric(quarter_of(turns, own, 0, 0)))
        right = quarter_of(turns, own, 0, 3)
        turns.right[vertex] = right
        turns.divisor[vertex, 0] = by_shift
        left = quarter_of(turns, own, 3, 3) - wp.transpose(right) * full(by_shift) * right
        turns.divisor[vertex, 1] = inverse(symmetric(left))

    return SimpleNamespace(find_centres=find_centres, gather_turns=gather_turns, divide_turns=divide_turns)


@functools.cache
def turn_kernels(precision: str) -> SimpleNamespace:
    """Kernels ``pull_turns``, ``solve_turns`` and ``follow_turns``.

    Shift and turn of coarse vertex I are the vectors 2 I and 2 I + 1; so are the force and the moment on it.
    """
    types, Turns = cloth_types(precision), turn_types(precision).Turns
    real, vec3, State = types.real, types.vec3, types.State
    System, allowed = conjugate_types(precision).System, allowed_function(precision)
    times, fresh = symmetric_functions(precision).times, fresh_function(precision)
    sums, vectors = wp.array(dtype=wp.float64), wp.array(dtype=vec3)

    @wp.func
    def correct(turns: Turns, vertex: int, force: vec3, moment: vec3):
        """Puts the coarse vertex's residual, and by its own block the correction, and what that gives back."""
        right = turns.right[vertex]
        by_shift = turns.divisor[vertex, 0]
        turn = times(turns.divisor[vertex, 1], moment - wp.transpose(right) * times(by_shift, force))
        shift = times(by_shift, force - right * turn)
        turns.residual[2 * vertex] = force
        turns.residual[2 * vertex + 1] = moment
        turns.correction[2 * vertex] = shift
        turns.correction[2 * vertex + 1] = turn
        turns.parts.dot[vertex] = wp.float64(wp.dot(force, shift)) + wp.float64(wp.dot(moment, turn))

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def pull_turns(state: State, turns: Turns, fine: wp.array(dtype=vec3)):
        """What the forces that are left [N] on each vertex pull at what it follows."""
        entry = wp.tid()
        if entry == 0:
            turns.came[0] = 0
        i = turns.down.index[entry]
        force = fine[i] * turns.down.weight[entry]
        turns.pull[entry, 0] = force
        turns.pull[entry, 1] = wp.cross(vec3(state.position[i] - turns.centre[turns.owner[entry]]), force)

    @wp.func
    def resisted(turns: Turns, i: int):
        """A vector of what resists the direction."""
        return vec3(turns.product[3 * i], turns.product[3 * i + 1], turns.product[3 * i + 2])

    @wp.func
    def pull_of(turns: Turns, vertex: int, which: int):
        """Force or moment on a coarse vertex, added in the order of its row; by eights, which are asked for at once."""
        sum = vec3()
        start, last = turns.down.start[vertex], turns.down.start[vertex + 1]
        for entry in range(start, last - 7, 8):
            for i in range(8):
                sum += turns.pull[entry + i, which]
        for entry in range(start + (last - start) // 8 * 8, last):
            sum += turns.pull[entry, which]
        return sum

    @wp.func
    def begin_part(turns: Turns, part: int, lane: int, lanes: int):
        """Force and moment of what is left; the solution begins with nothing."""
        first, last = turns.parts.first[part], turns.parts.first[part + 1]
        for i in range(2 * first + lane, 2 * last, lanes):
            turns.residual[i] = pull_of(turns, i // 2, i % 2)
            turns.displacement[i] = vec3()
        wait_for_block()
        for vertex in range(first + lane, last, lanes):
            correct(turns, vertex, turns.residual[2 * vertex], turns.residual[2 * vertex + 1])
        sum_part(turns.parts, part, lane, turns.along)

    @wp.func
    def product_of(turns: Turns, vertex: int, i: int):
        """One of the six components of what resists the direction at a vertex, added in the order of its blocks."""
        sum = real(0.0)
        start, last = turns.start[vertex], turns.start[vertex + 1]
        for entry in range(start, last - 3, 4):
            for k in range(4):
                sum += turns.term[entry + k, i]
        for entry in range(start + (last - start) // 4 * 4, last):
            sum += turns.term[entry, i]
        return sum

    @wp.func
    def number(turns: Turns, entry: int, row: int, column: int):
        """One of a block's."""
        return turns.block[entry // TOGETHER, 6 * row + column, entry % TOGETHER]

    @wp.func
    def multiply_part(turns: Turns, part: int, blocks: int, thread: int, share: real, last: vectors, next: vectors):
        """The next direction, correction + share last, found by all who ask for it, and product = K direction."""
        first, end = turns.parts.first[part], turns.parts.first[part + 1]
        lane, lanes, elsewhere = lane_of(thread), block_threads(), blocks > 1
        for entry in range(turns.start[first] + lane, turns.start[end], lanes):
            beside = turns.beside[entry]
            d = fresh(turns.correction, beside, elsewhere) + fresh(last, beside, elsewhere) * share
            for k in range(6):
                by_shift = number(turns, entry, k, 0) * d[0] + number(turns, entry, k, 1) * d[1]
                by_shift += number(turns, entry, k, 2) * d[2]
                by_turn = number(turns, entry, k, 3) * d[3] + number(turns, entry, k, 4) * d[4]
                by_turn += number(turns, entry, k, 5) * d[5]
                turns.term[entry, k] = by_shift + by_turn
        wait_for_block()
        for item in range(lane, 8 * (end - first), lanes):
            if item % 8 < 6:
                turns.product[6 * first + 6 * (item // 8) + item % 8] = product_of(turns, first + item // 8, item % 8)
        wait_for_block()
        for vertex in range(first + lane, end, lanes):
            shift = turns.correction[2 * vertex] + last[2 * vertex] * share
            turn = turns.correction[2 * vertex + 1] + last[2 * vertex + 1] * share
            next[2 * vertex] = shift
            next[2 * vertex + 1] = turn
            taken = wp.float64(wp.dot(shift, resisted(turns, 2 * vertex)))
            turns.parts.dot[vertex] = taken + wp.float64(wp.dot(turn, resisted(turns, 2 * vertex + 1)))
        sum_part(turns.parts, part, lane, turns.across)

    @wp.func
    def advance_part(turns: Turns, part: int, lane: int, lanes: int, step: real, direction: vectors, along: sums):
        """displacement += step direction, residual -= step product; and the next correction."""
        for vertex in range(turns.parts.first[part] + lane, turns.parts.first[part + 1], lanes):
            shift, turn = 2 * vertex, 2 * vertex + 1
            turns.displacement[shift] = turns.displacement[shift] + direction[shift] * step
            turns.displacement[turn] = turns.displacement[turn] + direction[turn] * step
            force = turns.residual[shift] - resisted(turns, shift) * step
            correct(turns, vertex, force, turns.residual[turn] - resisted(turns, turn) * step)
        sum_part(turns.parts, part, lane, along)

    @wp.func
    def go_round(
        turns: Turns,
        number: int,
        block: int,
        blocks: int,
        thread: int,
        along: sums,  # residual . correction of each part [J]
        before: sums,  # the last round's; the next one's in the end
        last: vectors,  # the last round's direction
        next: vectors,
    ):
        """A round of a block; step = along / across, the last direction's share along / before."""
        lane, lanes, parts = lane_of(thread), block_threads(), turns.parts.garment.shape[0]
        meet_blocks(turns.came, blocks, 2 * number + 1)
        for part in range(block, parts, blocks):
            share = real(0.0)
            if number > 0:
                share = real(ratio(turns.parts, along, before, turns.parts.garment[part], blocks > 1))
            multiply_part(turns, part, blocks, thread, share, last, next)
        meet_blocks(turns.came, blocks, 2 * number + 2)
        for part in range(block, parts, blocks):
            step = real(ratio(turns.parts, along, turns.across, turns.parts.garment[part], blocks > 1))
            advance_part(turns, part, lane, lanes, step, next, before)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def solve_turns(turns: Turns, rounds: int, blocks: int):
        """Conjugate gradients, all rounds in one launch: blocks work on a part after another, and wait for all."""
        thread = wp.tid()
        block = block_of(thread)
        for part in range(block, turns.parts.garment.shape[0], blocks):
            begin_part(turns, part, lane_of(thread), block_threads())
        for number in range(rounds):
            if number % 2 == 0:
                go_round(turns, number, block, blocks, thread, turns.along, turns.before, turns.direction, turns.other)
            else:
                go_round(turns, number, block, blocks, thread, turns.before, turns.along, turns.other, turns.direction)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def follow_turns(
        state: State,
        weight: real,
        turns: Turns,
        system: System,
        parts: Parts,  # the fine vertices
        along_out: sums,  # residual . correction of each part [J]
    ):
        """Adds ``weight`` times what each vertex follows to its correction."""
        thread = wp.tid()
        part, lane = block_of(thread), lane_of(thread)
        for vertex in range(parts.first[part] + lane, parts.first[part + 1], block_threads()):
            sum = vec3()
            for entry in range(turns.up.start[vertex], turns.up.start[vertex + 1]):
                i = turns.up.index[entry]
                arm = vec3(state.position[vertex] - turns.centre[i])
                moved = turns.displacement[2 * i] + wp.cross(turns.displacement[2 * i + 1], arm)
                sum += moved * turns.up.weight[entry]
            hold = system.hold[vertex]
            correction = system.correction[vertex] + allowed(sum, system.normal[vertex], hold) * weight
            system.correction[vertex] = correction
            parts.dot[vertex] = wp.float64(wp.dot(system.residual[vertex], correction))
        sum_part(parts, part, lane, along_out)

    return SimpleNamespace(pull_turns=pull_turns, solve_turns=solve_turns, follow_turns=follow_turns)

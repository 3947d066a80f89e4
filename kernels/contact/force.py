"""What pairs of cloth nearer than the thickness do to their vertices, summed for the next move."""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.base.access import element, put
from warp_cloth.kernels.base.block import BLOCK_THREADS, own_memory
from warp_cloth.kernels.base.options import Accumulate
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, place_function
from warp_cloth.kernels.contact.arrays import (
    FORCE_UNIT,
    NEIGHBOURS,
    ROOM_SHARE,
    ROOM_UNIT,
    STIFFNESS_UNIT,
    ContactData,
    apart_function,
    due_after,
    pair_cloth,
)
from warp_cloth.kernels.contact.displacement_bounds import gone_together, turn_on
from warp_cloth.kernels.contact.narrow_phase_queue import (
    ROUNDS,
    first_queued,
    look_due,
    queue_due,
    queue_room,
    queue_stride,
    queued,
)
from warp_cloth.kernels.contact.squeeze import slant_functions
from warp_cloth.kernels.laws.friction import friction_slide
from warp_cloth.kernels.laws.squeeze import squeeze_energy, squeeze_force, squeeze_stiffness
from warp_cloth.kernels.math.real import inner, quotient, root, scaled_sum
from warp_cloth.kernels.patches.packing import order_functions

LEAST_SHARE = 0.02  # of the thickness; nearer than this, force and stiffness grow no more

# Threads lean over by this share of the thickness before one layer slides on the other.
LEAN = 0.2


# Nobody wants to know what was there before: a compiler would have the memory answer.
_ADD_SHARE = """
    const wp::int64 share[4] = {x, y, z, part};
    wp::int64* const to = sum.data + 4 * vertex;
#pragma unroll
    for (int k = 0; k < 4; ++k)
#if defined(__CUDA_ARCH__)
        asm volatile("red.relaxed.gpu.global.add.u64 [%0], %1;" :: "l"(to + k), "l"(share[k]) : "memory");
#else
        to[k] += share[k];
#endif
"""

_NARROW = """
#if defined(__CUDA_ARCH__)
    asm volatile("red.relaxed.gpu.global.min.s32 [%0], %1;" :: "l"(rooms.data + vertex), "r"(room) : "memory");
#else
    if (room < rooms.data[vertex])
        rooms.data[vertex] = room;
#endif
"""


@wp.func_native(_ADD_SHARE)
def add_whole(sum: wp.array2d(dtype=wp.int64), vertex: int, x: wp.int64, y: wp.int64, z: wp.int64, part: wp.int64):
    """Adds to a vertex's sum."""
    wp.atomic_add(sum, vertex, 0, x)


@wp.func_native(_NARROW)
def narrow(rooms: wp.array(dtype=wp.int32), vertex: int, room: int):
    """Leaves a vertex no more than this room."""
    wp.atomic_min(rooms, vertex, room)


@functools.cache
def add_functions(real: type) -> SimpleNamespace:
    """Functions ``add_pair`` and ``add_turns``, which share out forces of a precision to vertices' sums."""
    vec3, vec4 = wp.types.vector(3, real), wp.types.vector(4, real)
    by_force, by_stiffness = wp.constant(real(1.0 / float(FORCE_UNIT))), wp.constant(real(1.0 / float(STIFFNESS_UNIT)))

    @wp.func
    def add_share(sum: wp.array2d(dtype=wp.int64), vertex: int, force: vec3, part: real):
        """Adds a force [N] and a bound or magnitude to a vertex's sum."""
        whole = force * by_force
        add_whole(
            sum, vertex, wp.int64(whole[0]), wp.int64(whole[1]), wp.int64(whole[2]), wp.int64(part * by_stiffness)
        )

    @wp.func
    def add_pair(sum: wp.array2d(dtype=wp.int64), corners: wp.vec4i, weights: vec4, force: vec3, part: real):
        """Adds the force on a pair's first [N], shared out by its weights, and as much of a bound or magnitude."""
        for corner in range(4):
            add_share(sum, corners[corner], weights[corner] * force, wp.abs(weights[corner]) * part)

    @wp.func
    def add_turns(sum: wp.array2d(dtype=wp.int64), corners: wp.vec4i, turn_0: vec3, turn_1: vec3, part: real):
        """Adds what turns two edges away from each other [N], and a bound or magnitude."""
        add_share(sum, corners[0], turn_0, part)
        add_share(sum, corners[1], -turn_0, part)
        add_share(sum, corners[2], turn_1, part)
        add_share(sum, corners[3], -turn_1, part)

    return SimpleNamespace(add_pair=add_pair, add_turns=add_turns)


@wp.func
def leave_room(
    contact: ContactData,
    pair: int,
    kind: int,
    corners: wp.vec4i,
    distance: wp.float64,
    thickness: wp.float64,
    gone: wp.int64,
):
    """Narrows the room of a pair's vertices, or where it is far apart says when to look at it again."""
    if distance > thickness + contact.margin:
        contact.due[pair] = due_after(contact, kind, distance, thickness, gone)
    else:
        room = wp.int32(ROOM_SHARE * distance / ROOM_UNIT)
        for corner in range(4):
            narrow(contact.room, corners[corner], room)


@functools.cache
def turn_function(precision: str, accumulate: Accumulate) -> wp.Function:
    """The function that turns nearly parallel edges, with a bound or magnitude as of ``press_kernel``."""
    types = cloth_types(precision)
    real, vec3 = types.real, types.vec3
    slope, add_turns = slant_functions(real).slope, add_functions(real).add_turns

    @wp.func
    def turn_apart(contact: ContactData, corners: wp.vec4i, along_0: vec3, along_1: vec3, energy: real):
        """Adds what turns two edges away from each other; ``energy`` by the squared sine between them [J]."""
        turn_0 = slope(along_0, along_1) * energy
        turn_1 = slope(along_1, along_0) * energy
        part = real(0.0)
        if wp.static(accumulate is Accumulate.STIFFNESS):
            shorter = wp.min(inner(along_0, along_0), inner(along_1, along_1))
            part = quotient(real(4.0) * energy, wp.max(shorter, real(1.0e-12)))
        if wp.static(accumulate is Accumulate.MAGNITUDE):
            part = root(wp.max(inner(turn_0, turn_0), inner(turn_1, turn_1)))
        add_turns(contact.sum, corners, turn_0, turn_1, part)

    return turn_apart


@functools.cache
def pair_function(precision: str, accumulate: Accumulate, sort: int, in_order: bool) -> wp.Function:
    """The function that presses a pair of a sort (ON_TRIANGLE, ON_EDGE) apart; others as of ``press_kernel``."""
    types = cloth_types(precision)
    State, Step, real, vec2, vec3 = types.State, types.Step, types.real, types.vec2, types.vec3
    at, turn_apart, pair_apart = (
        place_function(precision),
        turn_function(precision, accumulate),
        apart_function(precision, sort),
    )
    move_at = order_functions(precision, packed=False, in_order=in_order).move_at
    slant_share, add_pair = slant_functions(real).share, add_functions(real).add_pair
    one, nothing, least = wp.constant(real(1.0)), wp.constant(real(0.0)), wp.constant(real(LEAST_SHARE))
    most, by_lean = wp.constant(real(1.0 / LEAST_SHARE)), wp.constant(real(1.0 / LEAN))

    @wp.func
    def press_pair(step: Step, state: State, contact: ContactData, pair: int, place: int):
        """Adds what a pair does to its four vertices, and narrows their room; ``place`` of ``turn_on``.

        All that is read of a pair is asked for at once: a GPU waits for memory far longer than it works.
        """
        corners = element(contact.corners, pair)
        kind = element(contact.kind, pair)
        leant = element(contact.lean, pair)
        lean = vec3(real(leant[0]), real(leant[1]), real(leant[2]))
        gone = wp.int64(0)
        if wp.static(accumulate is not Accumulate.MAGNITUDE):
            gone = gone_together(place, contact.way, element(contact.regions, pair))
        x0, x1 = at(state.position, corners[0]), at(state.position, corners[1])
        x2, x3 = at(state.position, corners[2]), at(state.position, corners[3])
        cloth_there = pair_cloth(contact, corners)
        move0, move1, move2, move3 = vec3(), vec3(), vec3(), vec3()
        if wp.static(accumulate is not Accumulate.MAGNITUDE):
            move0, move1 = move_at(state, corners[0]), move_at(state, corners[1])
            move2, move3 = move_at(state, corners[2]), move_at(state, corners[3])
        weights, way, square, distance = pair_apart(x0, x1, x2, x3)
        thickness, modulus = real(cloth_there[0]), real(cloth_there[1])
        if wp.static(accumulate is not Accumulate.MAGNITUDE):
            leave_room(contact, pair, wp.static(sort), corners, wp.float64(distance), wp.float64(cloth_there[0]), gone)
        if kind >= NEIGHBOURS or distance >= thickness or distance <= nothing:
            if wp.static(accumulate is not Accumulate.MAGNITUDE):
                contact.lean[pair] = wp.vec4f()
            return
        # few divisions, each of which takes as long as all else
        inverse, thinness = quotient(one, distance), quotient(one, thickness)  # [1/m]
        normal = way * inverse
        x, inverse = wp.max(distance * thinness, least), wp.min(thickness * inverse, most)
        thick = wp.float64(cloth_there[0])
        y = quotient(real(thick * thick - square), thickness * (thickness + distance))  # 1 - x, to its last digits
        y = wp.clamp(y, nothing, one - least)
        along_0, along_1 = vec3(), vec3()
        share = vec2(one, nothing)
        if wp.static(sort == 1):
            along_0, along_1 = vec3(x1 - x0), vec3(x3 - x2)
            share = slant_share(along_0, along_1)
        push = share[0] * squeeze_force(y, inverse, thickness, modulus)
        # how far the first's nearest point moved in the last iteration against the second's
        change = scaled_sum(move1, weights[1], move0 * weights[0])
        change = scaled_sum(move3, weights[3], scaled_sum(move2, weights[2], change))
        lean += change
        lean -= normal * inner(normal, lean)
        lean -= friction_slide(lean, normal, real(LEAN) * thickness, real(cloth_there[2]))
        grip = push * thinness * by_lean
        force = normal * push - lean * grip
        part = nothing
        if wp.static(accumulate is Accumulate.STIFFNESS):
            approach = -inner(normal, change)
            closing = wp.max(real(step.reach) * approach * thinness, nothing)
            nearer = wp.max(x - closing, real(0.5) * x)
            stiffness = share[0] * squeeze_stiffness(quotient(one, nearer), modulus)
            force += normal * (real(step.viscosity) * stiffness * approach)
            part = real(2.0) * (stiffness + grip)  # the weights' sizes sum to two
        if wp.static(accumulate is Accumulate.MAGNITUDE):
            part = push + grip * root(inner(lean, lean))
        if wp.static(accumulate is not Accumulate.MAGNITUDE):
            put(contact.lean, pair, wp.vec4f(float(lean[0]), float(lean[1]), float(lean[2]), 0.0))
        add_pair(contact.sum, corners, weights, force, part)
        if wp.static(sort == 1):
            if share[1] > nothing:  # nearly parallel edges also turn
                energy = share[1] * squeeze_energy(y, inverse, thickness, modulus)
                turn_apart(contact, corners, along_0, along_1, energy)

    return press_pair


@functools.cache
def queued_function(precision: str, accumulate: Accumulate, sort: int, in_order: bool) -> wp.Function:
    """The function that presses the queued pairs of a sort; arguments as of ``pair_function``."""
    types = cloth_types(precision)
    State, Step = types.State, types.Step
    press_pair = pair_function(precision, accumulate, sort, in_order)
    all = int(accumulate is Accumulate.MAGNITUDE)

    @wp.func
    def press_queued(step: Step, state: State, contact: ContactData, place: int, begin: int, total: int):
        """Presses those of so many that are a thread's."""
        number = first_queued(wp.static(sort))
        while number < total:
            pair = queued(
                place, contact.due, contact.regions, contact.way, begin, wp.static(sort), number, wp.static(all)
            )
            if pair >= 0:
                press_pair(step, state, contact, pair, place)
            number += queue_stride(wp.static(sort))

    return press_queued


@functools.cache
def press_function(precision: str, accumulate: Accumulate, in_order: bool) -> wp.Function:
    """The function that presses a block's share of the pairs; arguments as of ``press_kernel``."""
    types = cloth_types(precision)
    State, Step = types.State, types.Step
    press_on_triangles = queued_function(precision, accumulate, 0, in_order)
    press_on_edges = queued_function(precision, accumulate, 1, in_order)
    all = int(accumulate is Accumulate.MAGNITUDE)

    @wp.func
    def press_share(step: Step, state: State, contact: ContactData, thread: int, blocks: int):
        """Presses the pairs that may be near, one of so many blocks its share; the first of all turns to the next.

        A block first queues those: they are few, and lie anywhere, so that else most threads would wait for others.
        """
        first = int(0)
        room = contact.corners.shape[0]
        dues = look_due(contact.due, first, room, blocks)  # asked for at once with what follows
        regions = look_due(contact.regions, first, room, blocks)
        count = contact.count[0]
        place = own_memory()
        if wp.static(accumulate is not Accumulate.MAGNITUDE):
            turn_on(place, contact.way, contact.stride, contact.turn, contact.region_count)
        if count > room:  # nothing moves: which pairs found room is chance
            count = 0
        anew = int(1)
        while first < count:
            total = queue_due(place, dues, regions, contact.way, first, count, wp.static(all), blocks, anew)
            begin = int(first)
            first += ROUNDS * BLOCK_THREADS * blocks
            dues = look_due(contact.due, first, count, blocks)
            regions = look_due(contact.regions, first, count, blocks)
            anew = int(0)
            if first >= count or total[0] + total[1] > queue_room():
                anew = int(1)
                press_on_triangles(step, state, contact, place, begin, total[0])
                press_on_edges(step, state, contact, place, begin, total[1])

    return press_share


@functools.cache
def press_kernel(precision: str, accumulate: Accumulate, in_order: bool = False) -> wp.Kernel:
    """Kernel ``press_pairs``; it sums ``accumulate`` beside forces; for the certificate (MAGNITUDE) it changes no lean.

    ``in_order``: as of packing.order_functions.
    """
    types = cloth_types(precision)
    State, Step = types.State, types.Step
    press_share = press_function(precision, accumulate, in_order)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False, launch_bounds=BLOCK_THREADS)
    def press_pairs(state: State, step: Step, contact: ContactData, blocks: int):
        """Presses all pairs."""
        press_share(step, state, contact, wp.tid(), blocks)

    return press_pairs

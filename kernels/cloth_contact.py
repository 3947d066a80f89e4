"""Cloth on cloth: pairs nearer than the thickness push apart and hold each other by friction."""

import functools

import warp as wp

from warp_cloth.kernels.box_tree import bit_count, team_lane, team_threads
from warp_cloth.kernels.cloth import MODULE_OPTIONS, cloth_types, place_function
from warp_cloth.kernels.friction import friction_slide
from warp_cloth.kernels.touch import (
    NOTHING,
    WHOLE,
    nearest_on_edges,
    nearest_on_triangle,
    slant_share,
    slant_slope,
    squeeze_energy,
    squeeze_force,
    squeeze_stiffness,
)

# Sums are kept as whole numbers of these units: whole numbers add up to the same in every order, so that pairs may be
# found and summed in any.
FORCE_UNIT = wp.constant(wp.float64(2.0**-36))  # [N]; a vertex weighs 1e7 of them
STIFFNESS_UNIT = wp.constant(wp.float64(2.0**-16))  # [N/m]
ROOM_UNIT = wp.constant(wp.float64(2.0**-33))  # [m]
NO_LIMIT = wp.constant(wp.int32(2**31 - 1))  # room of a vertex with nothing near
PAIRS = wp.constant(wp.int32(64))  # that a team goes over at a time: about a third are near enough to be looked at
EVER = wp.constant(wp.int64(2**62))  # farther than any vertex goes

# Of the distance between two bits of cloth, what each may move in an iteration: less than half, so they never pass.
ROOM_SHARE = wp.constant(wp.float64(0.45))
LEAST_SHARE = wp.constant(wp.float64(0.02))  # of the thickness; nearer than this, force and stiffness grow no more

# Threads lean over by this share of the thickness before one layer slides on the other.
LEAN = wp.constant(wp.float64(0.2))

ON_TRIANGLE = wp.constant(wp.int32(0))  # a vertex and a triangle
ON_EDGE = wp.constant(wp.int32(1))  # two edges
NEIGHBOURS = wp.constant(wp.int32(2))  # added where the two are near in the rest shape: they do not push


@wp.struct
class ClothContact:
    """Which cloth is near which, and what that does to the vertices; P pairs at most, V vertices."""

    # of the garments
    thickness: wp.array(dtype=wp.float32)  # [m], shape [V]
    modulus: wp.array(dtype=wp.float32)  # of squeeze_energy [N/m], shape [V]
    friction: wp.array(dtype=wp.float32)  # shape [V]
    reach: wp.float64  # pairs nearer than this when they were looked for are known [m]
    leeway: wp.float64  # how far a vertex may have moved at the next look, before which another search is due [m]
    ahead: wp.float64  # iterations to that look
    margin: wp.float64  # pairs this much farther apart than thick are left alone till they may be as near again [m]
    far: wp.float64  # the same with the thinnest garment: whatever is left alone is farther apart [m]
    # pairs
    count: wp.array(dtype=wp.int32)  # pairs found, more than P where they did not fit, shape [1]
    corners: wp.array(dtype=wp.vec4i)  # vertex and triangle, or the ends of two edges, shape [P]
    kind: wp.array(dtype=wp.int32)  # ON_TRIANGLE or ON_EDGE, and NEIGHBOURS or not, shape [P]
    lean: wp.array(dtype=wp.vec3f)  # how far the first has been dragged along the second [m], shape [P]
    due: wp.array(dtype=wp.int64)  # how far any vertex has gone when a pair may be near again [ROOM_UNIT], shape [P]
    # how far vertices have gone, the farthest in each iteration [ROOM_UNIT]: what a move reads of the ways and writes
    # for the next one lie apart, so that no thread of a launch reads what another one writes
    way: wp.array(dtype=wp.int64)  # before the last press, and after it, shape [2]
    stride: wp.array(dtype=wp.int32)  # of the last iteration and of this one, in turn, shape [2]
    turn: wp.array(dtype=wp.int32)  # iterations before the last press, and after it, shape [2]
    # what a move reads, and leaves as it was at the start
    sum: wp.array2d(dtype=wp.int64)  # force [FORCE_UNIT] and fourth part [STIFFNESS_UNIT], shape [V, 4]; zero
    room: wp.array(dtype=wp.int32)  # largest displacement [ROOM_UNIT], shape [V]; NO_LIMIT
    # between two searches
    lift: wp.array(dtype=wp.float32)  # how much farther from the avatar than its offset a vertex stays [m], shape [V]
    shift: wp.array(dtype=wp.vec3f)  # displacement in each iteration that untangles [m], shape [V]
    searched: wp.array(dtype=wp.vec3d)  # where vertices were at the last search [m], shape [V]
    moved: wp.array(dtype=wp.int32)  # whether it is time for another, shape [1]


@wp.func
def pair_weights(kind: int, x0: wp.vec3d, x1: wp.vec3d, x2: wp.vec3d, x3: wp.vec3d):
    """Weights of the four vertices whose sum is the way from the second's nearest point to the first's."""
    if kind == ON_TRIANGLE:
        on = nearest_on_triangle(x0 - x1, x2 - x1, x3 - x1)
        return wp.vec4d(WHOLE, -on[0], -on[1], -on[2])
    at = nearest_on_edges(x1 - x0, x3 - x2, x0 - x2)
    return wp.vec4d(WHOLE - at[0], at[0], at[1] - WHOLE, -at[1])


@wp.func
def pair_way(weights: wp.vec4d, x0: wp.vec3d, x1: wp.vec3d, x2: wp.vec3d, x3: wp.vec3d):
    """The way from the second's nearest point to the first's [m], summed from differences."""
    # the weights sum to zero: seen from x1 nothing large cancels
    return weights[0] * (x0 - x1) + weights[2] * (x2 - x1) + weights[3] * (x3 - x1)


@wp.func
def add_share(sum: wp.array2d(dtype=wp.int64), vertex: int, force: wp.vec3d, part: wp.float64):
    """Adds a force [N] and a fourth part to a vertex's sum."""
    wp.atomic_add(sum, vertex, 0, wp.int64(force[0] / FORCE_UNIT))
    wp.atomic_add(sum, vertex, 1, wp.int64(force[1] / FORCE_UNIT))
    wp.atomic_add(sum, vertex, 2, wp.int64(force[2] / FORCE_UNIT))
    wp.atomic_add(sum, vertex, 3, wp.int64(part / STIFFNESS_UNIT))


@wp.func
def contact_room(contact: ClothContact, vertex: int, position: wp.vec3d):
    """How far a vertex may move [m] before it could meet something, known or not; leaves the room open.

    Whatever was farther than the reach at the last search cannot be met within half of it from there. While there is no
    room for all pairs nothing moves.
    """
    count = contact.count[0]
    nearest = contact.room[vertex]
    searched = contact.searched[vertex]
    known = ROOM_SHARE * contact.far
    if nearest != NO_LIMIT:
        known = wp.min(wp.float64(nearest) * ROOM_UNIT, known)
        contact.room[vertex] = NO_LIMIT
    if count > contact.corners.shape[0]:  # some pairs did not fit
        known = NOTHING
    unknown = wp.float64(0.49) * contact.reach - wp.length(position - searched)
    return wp.max(wp.min(known, unknown), NOTHING)


@wp.func
def contact_watch(contact: ClothContact, vertex: int, position: wp.vec3d, move: wp.vec3d):
    """Notes how far a vertex went, and asks for another search where what it touches may not be known any more."""
    length = wp.length(move)
    if wp.length(position - contact.searched[vertex]) + contact.ahead * length > contact.leeway:
        contact.moved[0] = 1
    turn = contact.turn[1]
    even, odd = contact.stride[0], contact.stride[1]  # neither waits for the turn
    gone = wp.int32(length / ROOM_UNIT) + 1
    if gone > wp.where((turn & 1) == 0, even, odd):  # few vertices are the farthest so far
        wp.atomic_max(contact.stride, turn & 1, gone)
    if vertex == 0:
        contact.turn[0] = turn
        contact.way[0] = contact.way[1]


@wp.func
def contact_way(contact: ClothContact, thread: int):
    """How far any vertex may have gone up to now [ROOM_UNIT]; the first thread turns to the next iteration."""
    turn = contact.turn[0]
    even, odd = contact.stride[0], contact.stride[1]  # neither waits for the turn
    way = contact.way[0] + wp.int64(wp.where((turn & 1) == 0, even, odd))
    if thread == 0:
        contact.way[1] = way
        contact.turn[1] = turn + 1
        contact.stride[(turn + 1) & 1] = 0
    return way


@wp.func
def contact_sum(contact: ClothContact, vertex: int):
    """Force [N] and fourth part that contact adds at a vertex; leaves the sum at zero."""
    x = contact.sum[vertex, 0]
    y = contact.sum[vertex, 1]
    z = contact.sum[vertex, 2]
    part = contact.sum[vertex, 3]
    if (x | y | z | part) != wp.int64(0):
        for column in range(4):
            contact.sum[vertex, column] = wp.int64(0)
    force = wp.vec3d(wp.float64(x), wp.float64(y), wp.float64(z)) * FORCE_UNIT
    return wp.vec4d(force[0], force[1], force[2], wp.float64(part) * STIFFNESS_UNIT)


@wp.func
def pair_cloth(contact: ClothContact, corners: wp.vec4i):
    """Thickness [m], modulus [N/m] and friction where two bits of cloth meet: the means of both."""
    first, second = corners[0], corners[3]
    thickness = wp.float64(contact.thickness[first] + contact.thickness[second])
    modulus = wp.float64(contact.modulus[first] + contact.modulus[second])
    friction = wp.float64(contact.friction[first] + contact.friction[second])
    return wp.float64(0.5) * wp.vec3d(thickness, modulus, friction)


@wp.func
def leave_room(
    contact: ClothContact, pair: int, corners: wp.vec4i, distance: wp.float64, thickness: wp.float64, way: wp.int64
):
    """Narrows the room of a pair's vertices, or where it is far apart says when to look at it again."""
    far = thickness + contact.margin
    if distance > far:  # no move is longer than that leaves room for
        contact.due[pair] = way + wp.int64(wp.float64(0.5) * (distance - far) / ROOM_UNIT)
    else:
        room = wp.int32(ROOM_SHARE * distance / ROOM_UNIT)
        for corner in range(4):
            if room < contact.room[corners[corner]]:  # few pairs are the nearest so far
                wp.atomic_min(contact.room, corners[corner], room)


@wp.func
def add_pair(contact: ClothContact, corners: wp.vec4i, weights: wp.vec4d, force: wp.vec3d, part: wp.float64):
    """Adds the force on a pair's first [N], shared out by its weights, and as much of a fourth part."""
    for corner in range(4):
        add_share(contact.sum, corners[corner], weights[corner] * force, wp.abs(weights[corner]) * part)


@wp.func
def add_turns(contact: ClothContact, corners: wp.vec4i, turn_0: wp.vec3d, turn_1: wp.vec3d, part: wp.float64):
    """Adds what turns two edges away from each other [N], and a fourth part."""
    add_share(contact.sum, corners[0], turn_0, part)
    add_share(contact.sum, corners[1], -turn_0, part)
    add_share(contact.sum, corners[2], turn_1, part)
    add_share(contact.sum, corners[3], -turn_1, part)


@functools.cache
def turn_function(fourth: str) -> wp.Function:
    """The function that turns nearly parallel edges, with a fourth part as of ``press_kernel``."""

    @wp.func
    def turn_apart(contact: ClothContact, corners: wp.vec4i, along_0: wp.vec3d, along_1: wp.vec3d, energy: wp.float64):
        """Adds what turns two edges away from each other; ``energy`` by the squared sine between them [J]."""
        turn_0 = slant_slope(along_0, along_1) * energy
        turn_1 = slant_slope(along_1, along_0) * energy
        part = NOTHING
        if wp.static(fourth == "stiffness"):
            shorter = wp.min(wp.length_sq(along_0), wp.length_sq(along_1))
            part = wp.float64(4.0) * energy / wp.max(shorter, wp.float64(1.0e-12))
        if wp.static(fourth == "size"):
            part = wp.max(wp.length(turn_0), wp.length(turn_1))
        add_turns(contact, corners, turn_0, turn_1, part)

    return turn_apart


@functools.cache
def press_function(precision: str, fourth: str) -> wp.Function:
    """The function that presses a pair apart; arguments as of ``press_kernel``."""
    types = cloth_types(precision)
    Cloth, Step = types.Cloth, types.Step
    at, turn_apart = place_function(precision), turn_function(fourth)

    @wp.func
    def press_pair(step: Step, cloth: Cloth, contact: ClothContact, pair: int, gone: wp.int64):
        """Adds what a pair does to its four vertices, and narrows their room; ``gone`` as of ``contact_way``.

        All that is read of a pair is asked for at once: a GPU waits for memory far longer than it works.
        """
        if wp.static(fourth != "size"):
            if contact.due[pair] > gone:
                return
        corners = contact.corners[pair]
        kind = contact.kind[pair]
        lean = wp.vec3d(contact.lean[pair])
        x0, x1 = at(cloth.position, corners[0]), at(cloth.position, corners[1])
        x2, x3 = at(cloth.position, corners[2]), at(cloth.position, corners[3])
        cloth_there = pair_cloth(contact, corners)
        move0, move1, move2, move3 = wp.vec3d(), wp.vec3d(), wp.vec3d(), wp.vec3d()
        if wp.static(fourth != "size"):
            move0, move1 = wp.vec3d(cloth.move[corners[0]]), wp.vec3d(cloth.move[corners[1]])
            move2, move3 = wp.vec3d(cloth.move[corners[2]]), wp.vec3d(cloth.move[corners[3]])
        weights = pair_weights(kind & 1, x0, x1, x2, x3)
        way = pair_way(weights, x0, x1, x2, x3)
        distance = wp.length(way)
        thickness, modulus = cloth_there[0], cloth_there[1]
        if wp.static(fourth != "size"):
            leave_room(contact, pair, corners, distance, thickness, gone)
        if kind >= NEIGHBOURS or distance >= thickness or distance <= NOTHING:
            if wp.static(fourth != "size"):
                contact.lean[pair] = wp.vec3f()
            return
        normal = way / distance
        held = wp.max(distance, LEAST_SHARE * thickness)
        share = wp.vec2d(WHOLE, NOTHING)
        if kind == ON_EDGE:
            share = slant_share(x1 - x0, x3 - x2)
        push = share[0] * squeeze_force(held, thickness, modulus)
        # how far the first's nearest point moved in the last iteration against the second's
        change = weights[0] * move0 + weights[1] * move1 + weights[2] * move2 + weights[3] * move3
        lean += change
        lean -= normal * wp.dot(normal, lean)
        lean -= friction_slide(lean, normal, LEAN * thickness, cloth_there[2])
        grip = push / (LEAN * thickness)
        force = normal * push - lean * grip
        part = NOTHING
        if wp.static(fourth == "stiffness"):
            approach = -wp.dot(normal, change)
            nearer = wp.max(held - wp.max(wp.float64(step.reach) * approach, NOTHING), wp.float64(0.5) * held)
            stiffness = share[0] * squeeze_stiffness(nearer, thickness, modulus)
            force += normal * (wp.float64(step.viscosity) * stiffness * approach)
            part = wp.float64(2.0) * (stiffness + grip)  # the weights' sizes sum to two
        if wp.static(fourth == "size"):
            part = push + grip * wp.length(lean)
        if wp.static(fourth != "size"):
            contact.lean[pair] = wp.vec3f(lean)
        add_pair(contact, corners, weights, force, part)
        if share[1] > NOTHING:  # nearly parallel edges also turn
            turn_apart(contact, corners, x1 - x0, x3 - x2, share[1] * squeeze_energy(held, thickness, modulus))

    return press_pair


_DUE_PAIRS = """
#if defined(__CUDA_ARCH__)
    const int pair = first + (threadIdx.x & 31);
    return __ballot_sync(0xffffffffu, pair < count && due.data[pair] <= gone);
#else
    unsigned int mask = 0;
    for (int k = 0; k < 32 && first + k < count; ++k)
        mask |= (unsigned int)(due.data[first + k] <= gone) << k;
    return mask;
#endif
"""


@wp.func_native(_DUE_PAIRS)
def due_pairs(due: wp.array(dtype=wp.int64), first: int, count: int, gone: wp.int64) -> wp.uint32:
    """Which of the 32 pairs from a first one, of so many in all, may be near: a bit for each; for a team."""
    ...


@wp.func
def set_bit(mask: wp.uint64, number: int):
    """Where a mask's bit stands that is set with so many below it."""
    place = int(0)
    step = int(32)
    while step > 0:
        below = mask & ((wp.uint64(1) << wp.uint64(place + step)) - wp.uint64(1))
        if bit_count(wp.uint32(below)) + bit_count(wp.uint32(below >> wp.uint64(32))) <= number:
            place += step
        step = step // 2
    return place


@functools.cache
def press_kernel(precision: str, fourth: str) -> wp.Kernel:
    """Kernel ``press_pairs``; ``fourth`` is one of cloth.FOURTH_PARTS. "size", the certificate's, changes no lean."""
    types = cloth_types(precision)
    Cloth, Step = types.Cloth, types.Step
    press_pair = press_function(precision, fourth)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False)
    def press_pairs(step: Step, cloth: Cloth, contact: ClothContact, threads: int):
        """Presses all pairs: a team those of PAIRS that may be near, one each."""
        thread = wp.tid()
        gone = EVER
        if wp.static(fourth != "size"):
            gone = contact_way(contact, thread)
        count = contact.count[0]
        if count > contact.corners.shape[0]:  # nothing moves: which pairs found room is chance
            count = 0
        first = PAIRS * (thread // team_threads())
        while first < count:
            near = wp.uint64(due_pairs(contact.due, first, count, gone))
            near = near | wp.uint64(due_pairs(contact.due, first + 32, count, gone)) << wp.uint64(32)
            total = bit_count(wp.uint32(near)) + bit_count(wp.uint32(near >> wp.uint64(32)))
            number = team_lane()
            while number < total:
                press_pair(step, cloth, contact, first + set_bit(near, number), gone)
                number += team_threads()
            first += PAIRS * (threads // team_threads())

    return press_pairs


@functools.cache
def add_kernel(precision: str) -> wp.Kernel:
    """Kernel ``add_contact``, which hands the sums on to what reads a load."""
    types = cloth_types(precision)
    vec4 = types.vec4

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def add_contact(
        contact: ClothContact,
        load: wp.array(dtype=vec4),  # force [N] and fourth part, shape [V]
    ):
        """Adds a vertex's sum to its load, and leaves the sum at zero."""
        vertex = wp.tid()
        load[vertex] = load[vertex] + vec4(contact_sum(contact, vertex))

    return add_contact

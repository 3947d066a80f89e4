"""What pairs of cloth nearer than the thickness do to their vertices, summed for the next move."""

import functools

import warp as wp

from warp_cloth.kernels.block import BLOCK_THREADS, block_threads, lane_of, own_memory
from warp_cloth.kernels.cloth import MODULE_OPTIONS, cloth_types, place_function
from warp_cloth.kernels.cloth_contact import (
    FORCE_UNIT,
    NEIGHBOURS,
    ON_EDGE,
    ROOM_SHARE,
    ROOM_UNIT,
    STIFFNESS_UNIT,
    ClothContact,
    contact_way,
    pair_cloth,
    pair_way,
    pair_weights,
)
from warp_cloth.kernels.friction import friction_slide
from warp_cloth.kernels.touch import (
    NOTHING,
    WHOLE,
    slant_share,
    slant_slope,
    squeeze_energy,
    squeeze_force,
    squeeze_stiffness,
)

ROUNDS = 4  # of a block's threads: how often each looks, at most, for a pair that may be near before they press
EVER = wp.constant(wp.int64(2**62))  # farther than any vertex goes

LEAST_SHARE = wp.constant(wp.float64(0.02))  # of the thickness; nearer than this, force and stiffness grow no more

# Threads lean over by this share of the thickness before one layer slides on the other.
LEAN = wp.constant(wp.float64(0.2))


@wp.func
def add_share(sum: wp.array2d(dtype=wp.int64), vertex: int, force: wp.vec3d, part: wp.float64):
    """Adds a force [N] and a fourth part to a vertex's sum."""
    wp.atomic_add(sum, vertex, 0, wp.int64(force[0] / FORCE_UNIT))
    wp.atomic_add(sum, vertex, 1, wp.int64(force[1] / FORCE_UNIT))
    wp.atomic_add(sum, vertex, 2, wp.int64(force[2] / FORCE_UNIT))
    wp.atomic_add(sum, vertex, 3, wp.int64(part / STIFFNESS_UNIT))


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
def pair_function(precision: str, fourth: str) -> wp.Function:
    """The function that presses a pair apart; arguments as of ``press_kernel``."""
    types = cloth_types(precision)
    Cloth, Step = types.Cloth, types.Step
    at, turn_apart = place_function(precision), turn_function(fourth)

    @wp.func
    def press_pair(step: Step, cloth: Cloth, contact: ClothContact, pair: int, gone: wp.int64):
        """Adds what a pair does to its four vertices, and narrows their room; ``gone`` as of ``contact_way``.

        All that is read of a pair is asked for at once: a GPU waits for memory far longer than it works.
        """
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


_QUEUE = f"""
#if defined(__CUDA_ARCH__)
    int* length = (int*)__cvta_shared_to_generic(place);
    // pairs next to each other come due together: a block takes some here and there
    const int lane = threadIdx.x & 31, ahead = {BLOCK_THREADS} * blocks;
    const int own = first + {BLOCK_THREADS} * (int)blockIdx.x + (int)threadIdx.x;
    bool near[{ROUNDS}];
#pragma unroll
    for (int round = 0; round < {ROUNDS}; ++round) {{
        const int pair = own + round * ahead;
        near[round] = pair < count && due.data[pair] <= gone;
    }}
    __syncthreads();  // till those queued before are done
    if (threadIdx.x == 0)
        *length = 0;
    __syncthreads();
#pragma unroll
    for (int round = 0; round < {ROUNDS}; ++round) {{
        const unsigned int mask = __ballot_sync(0xffffffffu, near[round]);
        int base = 0;
        if (lane == 0 && mask != 0)
            base = atomicAdd(length, __popc(mask));
        base = __shfl_sync(0xffffffffu, base, 0) + __popc(mask & ((1u << lane) - 1u));
        if (near[round])
            length[1 + base] = own + round * ahead;
    }}
    __syncthreads();
    return *length;
#else
    return count - first < {ROUNDS * BLOCK_THREADS} * blocks ? count - first : {ROUNDS * BLOCK_THREADS} * blocks;
#endif
"""

_QUEUED = """
#if defined(__CUDA_ARCH__)
    return ((const int*)__cvta_shared_to_generic(place))[1 + number];
#else
    return due.data[first + number] <= gone ? first + number : -1;
#endif
"""


@wp.func_native(_QUEUE)
def queue_due(place: int, due: wp.array(dtype=wp.int64), first: int, count: int, gone: wp.int64, blocks: int) -> int:
    """Has a block queue its share of the pairs that may be near, of the next so many; how many to ask ``queued`` for.

    Of ROUNDS pairs for each thread of so many blocks, from a first one to before ``count``.
    """
    ...


@wp.func_native(_QUEUED)
def queued(place: int, due: wp.array(dtype=wp.int64), first: int, number: int, gone: wp.int64) -> int:
    """One of those queued; on the CPU, where a block is one thread, -1 where the pair is not near."""
    ...


@functools.cache
def press_function(precision: str, fourth: str) -> wp.Function:
    """The function that presses a block's share of the pairs; arguments as of ``press_kernel``."""
    types = cloth_types(precision)
    Cloth, Step = types.Cloth, types.Step
    press_pair = pair_function(precision, fourth)

    @wp.func
    def press_share(step: Step, cloth: Cloth, contact: ClothContact, thread: int, blocks: int):
        """Presses the pairs that may be near, one of so many blocks its share; the first of all turns to the next.

        A block first queues those: they are few, and lie anywhere, so that else most threads would wait for others.
        """
        gone = EVER
        if wp.static(fourth != "size"):
            gone = contact_way(contact, thread)
        count = contact.count[0]
        if count > contact.corners.shape[0]:  # nothing moves: which pairs found room is chance
            count = 0
        place = own_memory()
        first = int(0)
        while first < count:
            total = queue_due(place, contact.due, first, count, gone, blocks)
            number = lane_of(thread)
            while number < total:
                pair = queued(place, contact.due, first, number, gone)
                if pair >= 0:
                    press_pair(step, cloth, contact, pair, gone)
                number += block_threads()
            first += ROUNDS * BLOCK_THREADS * blocks

    return press_share


@functools.cache
def press_kernel(precision: str, fourth: str) -> wp.Kernel:
    """Kernel ``press_pairs``; ``fourth`` is one of cloth.FOURTH_PARTS. "size", the certificate's, changes no lean."""
    types = cloth_types(precision)
    Cloth, Step = types.Cloth, types.Step
    press_share = press_function(precision, fourth)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False, launch_bounds=BLOCK_THREADS)
    def press_pairs(step: Step, cloth: Cloth, contact: ClothContact, blocks: int):
        """Presses all pairs."""
        press_share(step, cloth, contact, wp.tid(), blocks)

    return press_pairs

"""What pairs of cloth nearer than the thickness do to their vertices, summed for the next move."""

import functools

import warp as wp

from warp_cloth.kernels.block import BLOCK_THREADS, own_memory
from warp_cloth.kernels.cloth import MODULE_OPTIONS, cloth_types, place_function
from warp_cloth.kernels.cloth_contact import (
    EVER,
    FORCE_UNIT,
    NEIGHBOURS,
    ROOM_SHARE,
    ROOM_UNIT,
    STIFFNESS_UNIT,
    ClothContact,
    contact_way,
    due_after,
    pair_cloth,
    pair_way,
    pair_weights,
)
from warp_cloth.kernels.friction import friction_slide
from warp_cloth.kernels.limits import BLOCK_MEMORY
from warp_cloth.kernels.touch import (
    NOTHING,
    WHOLE,
    slant_share,
    slant_slope,
    squeeze_energy,
    squeeze_force,
    squeeze_stiffness,
)

ROUNDS = 4  # of a block's threads: for how many pairs each looks at once whether they may be near
QUEUED = BLOCK_MEMORY // 4 - 2  # pairs that a block has room for; those that may be near are pressed at a time

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
    contact: ClothContact,
    pair: int,
    kind: int,
    corners: wp.vec4i,
    distance: wp.float64,
    thickness: wp.float64,
    way: wp.int64,
):
    """Narrows the room of a pair's vertices, or where it is far apart says when to look at it again."""
    if distance > thickness + contact.margin:
        contact.due[pair] = due_after(contact, kind, distance, thickness, way)
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
def pair_function(precision: str, fourth: str, sort: int) -> wp.Function:
    """The function that presses a pair of a sort (ON_TRIANGLE, ON_EDGE) apart; others as of ``press_kernel``."""
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
        weights = pair_weights(wp.static(sort), x0, x1, x2, x3)
        way = pair_way(weights, x0, x1, x2, x3)
        distance = wp.length(way)
        thickness, modulus = cloth_there[0], cloth_there[1]
        thinness = WHOLE / thickness  # [1/m]
        if wp.static(fourth != "size"):
            leave_room(contact, pair, wp.static(sort), corners, distance, thickness, gone)
        if kind >= NEIGHBOURS or distance >= thickness or distance <= NOTHING:
            if wp.static(fourth != "size"):
                contact.lean[pair] = wp.vec3f()
            return
        # few divisions, each of which takes as long as all else
        inverse = WHOLE / distance
        normal = way * inverse
        x, inverse = wp.max(distance * thinness, LEAST_SHARE), wp.min(thickness * inverse, WHOLE / LEAST_SHARE)
        share = wp.vec2d(WHOLE, NOTHING)
        if wp.static(sort == 1):
            share = slant_share(x1 - x0, x3 - x2)
        push = share[0] * squeeze_force(x, inverse, thickness, modulus)
        # how far the first's nearest point moved in the last iteration against the second's
        change = weights[0] * move0 + weights[1] * move1 + weights[2] * move2 + weights[3] * move3
        lean += change
        lean -= normal * wp.dot(normal, lean)
        lean -= friction_slide(lean, normal, LEAN * thickness, cloth_there[2])
        grip = push * thinness * (WHOLE / LEAN)
        force = normal * push - lean * grip
        part = NOTHING
        if wp.static(fourth == "stiffness"):
            approach = -wp.dot(normal, change)
            closing = wp.max(wp.float64(step.reach) * approach * thinness, NOTHING)
            nearer = wp.max(x - closing, wp.float64(0.5) * x)
            stiffness = share[0] * squeeze_stiffness(WHOLE / nearer, modulus)
            force += normal * (wp.float64(step.viscosity) * stiffness * approach)
            part = wp.float64(2.0) * (stiffness + grip)  # the weights' sizes sum to two
        if wp.static(fourth == "size"):
            part = push + grip * wp.length(lean)
        if wp.static(fourth != "size"):
            contact.lean[pair] = wp.vec3f(lean)
        add_pair(contact, corners, weights, force, part)
        if wp.static(sort == 1):
            if share[1] > NOTHING:  # nearly parallel edges also turn
                energy = share[1] * squeeze_energy(x, inverse, thickness, modulus)
                turn_apart(contact, corners, x1 - x0, x3 - x2, energy)

    return press_pair


# Of a block's threads, those that press vertices on triangles; the others press edges: threads that go together would
# wait for each other where their pairs are of two kinds.
ON_TRIANGLES = 64

_OWN = f"""
    // pairs next to each other come due together: a warp takes some here and there
    const int lane = threadIdx.x & 31, ahead = {BLOCK_THREADS} * blocks;
    const int own = first + 32 * (int)(blockIdx.x + (threadIdx.x >> 5) * blocks) + lane;
"""

_LOOK = f"""
    wp::vec_t<{ROUNDS}, wp::int64> found;
#if defined(__CUDA_ARCH__)
    {_OWN}
#pragma unroll
    for (int round = 0; round < {ROUNDS}; ++round)
        found[round] = own + round * ahead < due.shape[0] ? due.data[own + round * ahead] : 0;
#endif
    return found;
"""

_QUEUE = f"""
#if defined(__CUDA_ARCH__)
    {_OWN}
    int* queue = (int*)__cvta_shared_to_generic(place);  // of both kinds how many, and those, from either end
    if (anew != 0) {{
        __syncthreads();  // till those queued before are done
        if (threadIdx.x < 2)
            queue[threadIdx.x] = 0;
        __syncthreads();
    }}
    const unsigned int lower = (1u << lane) - 1u;
#pragma unroll
    for (int round = 0; round < {ROUNDS}; ++round) {{
        const int pair = own + round * ahead;
        const bool near = pair < count && dues[round] <= gone, edges = dues[round] & 1;
#pragma unroll
        for (int kind = 0; kind < 2; ++kind) {{
            const unsigned int mask = __ballot_sync(0xffffffffu, near && edges == (kind == 1));
            if (mask == 0)
                continue;
            int base = 0;
            if (lane == 0)
                base = atomicAdd(queue + kind, __popc(mask));
            base = __shfl_sync(0xffffffffu, base, 0) + __popc(mask & lower);
            if (mask >> lane & 1)
                queue[kind == 0 ? 2 + base : {QUEUED + 1} - base] = pair;
        }}
    }}
    __syncthreads();
    return wp::vec_t<2, int>(queue[0], queue[1]);
#else
    const int most = {ROUNDS * BLOCK_THREADS} * blocks, left = count - first < most ? count - first : most;
    return wp::vec_t<2, int>(left, left);
#endif
"""

_QUEUED = f"""
#if defined(__CUDA_ARCH__)
    const int* queue = (const int*)__cvta_shared_to_generic(place);
    return queue[kind == 0 ? 2 + number : {QUEUED + 1} - number];
#else
    return due.data[first + number] <= gone && (due.data[first + number] & 1) == kind ? first + number : -1;
#endif
"""

_ROOM = f"""
#if defined(__CUDA_ARCH__)
    return {QUEUED - ROUNDS * BLOCK_THREADS};
#else
    return -1;
#endif
"""

_TURN = f"""
#if defined(__CUDA_ARCH__)
    const int warp = threadIdx.x >> 5, lane = threadIdx.x & 31;  // a few go to as many warps
    if (kind == 0)
        return warp < {ON_TRIANGLES // 32} ? lane * {ON_TRIANGLES // 32} + warp : {QUEUED};
    return warp < {ON_TRIANGLES // 32} ? {QUEUED}
        : lane * {(BLOCK_THREADS - ON_TRIANGLES) // 32} + warp - {ON_TRIANGLES // 32};
#else
    return 0;
#endif
"""

_STRIDE = f"""
#if defined(__CUDA_ARCH__)
    return kind == 0 ? {ON_TRIANGLES} : {BLOCK_THREADS - ON_TRIANGLES};
#else
    return 1;
#endif
"""


@wp.func_native(_LOOK)
def look_due(due: wp.array(dtype=wp.int64), first: int, blocks: int) -> wp.types.vector(length=ROUNDS, dtype=wp.int64):
    """When a thread's share of the pairs may be near, ROUNDS for each of so many blocks' threads; a GPU's only."""
    ...


@wp.func_native(_QUEUE)
def queue_due(
    place: int,
    dues: wp.types.vector(length=ROUNDS, dtype=wp.int64),
    first: int,
    count: int,
    gone: wp.int64,
    blocks: int,
    anew: int,
) -> wp.vec2i:
    """Has a block queue its share of the pairs that may be near; for how many of each kind to ask ``queued``.

    ``dues`` of ``look_due``, of pairs from a first one to before ``count``; ``anew``: and forget those queued before.
    """
    ...


@wp.func_native(_QUEUED)
def queued(place: int, due: wp.array(dtype=wp.int64), first: int, kind: int, number: int, gone: wp.int64) -> int:
    """One of those queued; on the CPU, where a block is one thread, -1 where the pair is another's."""
    ...


@wp.func_native(_ROOM)
def queue_room() -> int:
    """How many may be queued before it is time to press: on the CPU, which does not queue, none."""
    ...


@wp.func_native(_TURN)
def first_queued(kind: int) -> int:
    """The first number of those queued that is a thread's."""
    ...


@wp.func_native(_STRIDE)
def queue_stride(kind: int) -> int:
    """How many numbers on its next one is."""
    ...


@functools.cache
def queued_function(precision: str, fourth: str, sort: int) -> wp.Function:
    """The function that presses the queued pairs of a sort; arguments as of ``pair_function``."""
    types = cloth_types(precision)
    Cloth, Step = types.Cloth, types.Step
    press_pair = pair_function(precision, fourth, sort)

    @wp.func
    def press_queued(
        step: Step, cloth: Cloth, contact: ClothContact, place: int, begin: int, total: int, gone: wp.int64
    ):
        """Presses those of so many that are a thread's."""
        number = first_queued(wp.static(sort))
        while number < total:
            pair = queued(place, contact.due, begin, wp.static(sort), number, gone)
            if pair >= 0:
                press_pair(step, cloth, contact, pair, gone)
            number += queue_stride(wp.static(sort))

    return press_queued


@functools.cache
def press_function(precision: str, fourth: str) -> wp.Function:
    """The function that presses a block's share of the pairs; arguments as of ``press_kernel``."""
    types = cloth_types(precision)
    Cloth, Step = types.Cloth, types.Step
    press_on_triangles = queued_function(precision, fourth, 0)
    press_on_edges = queued_function(precision, fourth, 1)

    @wp.func
    def press_share(step: Step, cloth: Cloth, contact: ClothContact, thread: int, blocks: int):
        """Presses the pairs that may be near, one of so many blocks its share; the first of all turns to the next.

        A block first queues those: they are few, and lie anywhere, so that else most threads would wait for others.
        """
        first = int(0)
        dues = look_due(contact.due, first, blocks)  # asked for at once with what follows
        count = contact.count[0]
        gone = EVER
        if wp.static(fourth != "size"):
            gone = contact_way(contact, thread)
        if count > contact.corners.shape[0]:  # nothing moves: which pairs found room is chance
            count = 0
        place = own_memory()
        anew = int(1)
        while first < count:
            total = queue_due(place, dues, first, count, gone, blocks, anew)
            begin = int(first)
            first += ROUNDS * BLOCK_THREADS * blocks
            dues = look_due(contact.due, first, blocks)
            anew = int(0)
            if first >= count or total[0] + total[1] > queue_room():
                anew = int(1)
                press_on_triangles(step, cloth, contact, place, begin, total[0], gone)
                press_on_edges(step, cloth, contact, place, begin, total[1], gone)

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

"""How far vertices go that may meet cloth: when pairs come due, and when it is time to search for pairs anew."""

import warp as wp

from warp_cloth.kernels.contact.arrays import REGIONS, ROOM_UNIT, TURNED, ContactBefore, ContactData

LONGER = wp.constant(1.000001)  # more than rounding makes a way shorter
SHRUNK, GROWN = wp.constant(wp.float64(0.7)), wp.constant(wp.float64(1.5))  # of a skin, from search to search


_RAISE = f"""
#if defined(__CUDA_ARCH__)
    wp::int32* const to = numbers.data + {REGIONS} * row + which;
    asm volatile("red.relaxed.gpu.global.max.s32 [%0], %1;" :: "l"(to), "r"(value) : "memory");
#else
    if (value > numbers.data[{REGIONS} * row + which])
        numbers.data[{REGIONS} * row + which] = value;
#endif
"""


@wp.func_native(_RAISE)
def raise_to(numbers: wp.array2d(dtype=wp.int32), row: int, which: int, value: int):
    """Raises a number to a value, if that is higher."""
    ...


_COUNT_ALL = """
#if defined(__CUDA_ARCH__)
    const unsigned int all = __activemask();
    if ((threadIdx.x & 31) == __ffs(all) - 1)
        asm volatile("red.relaxed.gpu.global.add.s32 [%0], %1;" :: "l"(count.data), "r"(__popc(all)) : "memory");
#else
    count.data[0] += 1;
#endif
"""


@wp.func_native(_COUNT_ALL)
def count_all(count: wp.array(dtype=wp.int32)):
    """Counts the threads that call this."""
    ...


@wp.kernel(grid_stride=False)
def weigh_asked(contact: ContactData):
    """Whether it is time for another search: where many ask, or few for long enough. One thread."""
    asked = contact.asked[0]
    waits = asked > 0 or contact.asked[1] > 0
    contact.asked[0] = 0
    if asked > contact.many or (waits and contact.turn[0] - contact.turn_then[0] >= contact.patience):
        contact.moved[0] = 1
        waits = False
    contact.asked[1] = wp.where(waits, 1, 0)


@wp.func
def contact_turn(contact: ContactData, vertex: int):
    """After the last press, the contact's turn and how far the region has gone that has a vertex's number, if any.

    To be asked for before anything is written, after which a GPU would wait for it.
    """
    gone = wp.int64(0)
    if vertex < contact.region_count:
        gone = contact.way[1, vertex]
    return contact.turn[wp.static(TURNED)], gone


@wp.func
def contact_watch(contact: ContactData, vertex: int, before: ContactBefore, length: float, turn: int, gone: wp.int64):
    """Notes how far a vertex went [m], and asks for another search where what it touches may not be known any more.

    That is where it has used up its skin, or will have at the next look. The last two are of ``contact_turn``.
    """
    if before.gone + (float(1.0) + float(contact.ahead)) * length > before.skin:
        count_all(contact.asked)
    if before.region > 0:
        raise_to(contact.stride, turn & 1, before.region, wp.int32(length * LONGER / float(ROOM_UNIT)) + 1)
    if vertex < contact.region_count:  # of which there are fewer
        contact.way[0, vertex] = gone
    if vertex == 0:
        contact.turn[0] = turn


@wp.func
def skin_worn(contact: ContactData, vertex: int, position: wp.vec3d, move: wp.vec3d):
    """What share of its skin a vertex has used up since the last search, or will have at the next look."""
    gone = wp.length(position - contact.searched[vertex]) + contact.ahead * wp.length(move)
    return gone / wp.float64(contact.skin[vertex])


@wp.func
def next_skin(contact: ContactData, vertex: int, position: wp.vec3d, move: wp.vec3d):
    """How far a vertex is to have room to go till the next search [m]: by and by twice what it goes."""
    grown = wp.clamp(wp.float64(2.0) * skin_worn(contact, vertex, position, move), SHRUNK, GROWN)
    skin = wp.float64(contact.skin[vertex]) * grown
    return wp.float32(wp.clamp(skin, contact.least_skin, contact.most_skin))

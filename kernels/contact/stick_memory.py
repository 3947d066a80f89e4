"""What a pair leans survives the search that lists the pairs anew: a hash table of those that leaned before."""

import warp as wp

from warp_cloth.kernels.contact.arrays import ContactData

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

SEARCH = wp.constant(wp.int64(32))  # bits of a place that hold a pair; above them stands the search that put it there
PAIR = wp.constant(wp.int64(2**32 - 1))

# odd numbers that spread well, of xxHash
SPREAD_1 = wp.constant(wp.uint32(2654435761))
SPREAD_2 = wp.constant(wp.uint32(2246822519))
SPREAD_3 = wp.constant(wp.uint32(3266489917))
SPREAD_4 = wp.constant(wp.uint32(668265263))
SPREAD_5 = wp.constant(wp.uint32(374761393))


@wp.struct
class LeanMemory:
    """The pairs that leaned, P at most, in a table of H places, a power of two and more than P."""

    search: wp.array(dtype=wp.int64)  # number of the search to come; what others put into the table is gone, shape [1]
    place: wp.array(dtype=wp.int64)  # shape [H]
    corners: wp.array(dtype=wp.vec4i)  # shape [P]
    kind: wp.array(dtype=wp.int32)  # shape [P]
    lean: wp.array(dtype=wp.vec4f)  # as ContactData.lean [m], shape [P]


@wp.func
def pair_hash(corners: wp.vec4i, kind: int):
    """A number that spreads pairs over the table (multiplicative, each corner turned differently)."""
    hash = wp.uint32(corners[0]) * SPREAD_1
    hash = (hash ^ wp.uint32(corners[1])) * SPREAD_2
    hash = (hash ^ wp.uint32(corners[2])) * SPREAD_3
    hash = (hash ^ wp.uint32(corners[3])) * SPREAD_4
    hash = (hash ^ wp.uint32(kind)) * SPREAD_5
    return wp.int32((hash ^ (hash >> wp.uint32(15))) & wp.uint32(0x7FFFFFFF))


@wp.func
def remembered_lean(memory: LeanMemory, corners: wp.vec4i, kind: int):
    """The lean of a pair at the last search [m], once its memory is of the past; ``kind`` ON_TRIANGLE or ON_EDGE."""
    last = memory.place.shape[0] - 1
    search = memory.search[0] - wp.int64(1)
    place = pair_hash(corners, kind) & last
    held = memory.place[place]
    while held >> SEARCH == search:
        pair = wp.int32(held & PAIR)
        if memory.corners[pair] == corners and memory.kind[pair] == kind:
            return memory.lean[pair]
        place = (place + 1) & last
        held = memory.place[place]
    return wp.vec4f()


@wp.func
def forget_leans(memory: LeanMemory):
    """Makes what is in the table that of the last search."""
    memory.search[0] = memory.search[0] + wp.int64(1)


@wp.func
def remember_lean(contact: ContactData, memory: LeanMemory, pair: int):
    """Puts a pair, if it leans, into the table, wherever a place is free: what is found there is the same."""
    lean = contact.lean[pair]
    if lean == wp.vec4f():
        return
    corners = contact.corners[pair]
    kind = contact.kind[pair] & 1
    memory.corners[pair] = corners
    memory.kind[pair] = kind
    memory.lean[pair] = lean
    last = memory.place.shape[0] - 1
    search = memory.search[0]
    place = pair_hash(corners, kind) & last
    held = memory.place[place]
    kept = bool(False)
    while not kept:
        if held >> SEARCH == search:
            place = (place + 1) & last
            held = memory.place[place]
        else:
            found = wp.atomic_cas(memory.place, place, held, (search << SEARCH) | wp.int64(pair))
            kept = found == held
            held = found

"""Stick memory: a hash table by which a pair's stick displacement survives the search that lists all pairs again."""

import warp as wp

from warp_cloth.kernels.contact.arrays import ContactData

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

PAIR_BITS = wp.constant(wp.int64(32))  # an entry's low bits name a pair; above them stands the search that wrote it
PAIR = wp.constant(wp.int64(2**32 - 1))

# odd multipliers that spread well, from xxHash
SPREAD_1 = wp.constant(wp.uint32(2654435761))
SPREAD_2 = wp.constant(wp.uint32(2246822519))
SPREAD_3 = wp.constant(wp.uint32(3266489917))
SPREAD_4 = wp.constant(wp.uint32(668265263))
SPREAD_5 = wp.constant(wp.uint32(374761393))


@wp.struct
class StickMemory:
    """The pairs that stuck, P at most, in a table of H entries; H is a power of two and more than P."""

    search: wp.array(dtype=wp.int64)  # number of the next search; entries of earlier ones are void, shape [1]
    entry: wp.array(dtype=wp.int64)  # shape [H]
    corners: wp.array(dtype=wp.vec4i)  # shape [P]
    kind: wp.array(dtype=wp.int32)  # shape [P]
    stick: wp.array(dtype=wp.vec4f)  # as ContactPairs.stick [m], shape [P]


@wp.func
def pair_hash(corners: wp.vec4i, kind: int):
    """A number that spreads pairs over the table; multiplicative, with a different factor for each corner."""
    hash = wp.uint32(corners[0]) * SPREAD_1
    hash = (hash ^ wp.uint32(corners[1])) * SPREAD_2
    hash = (hash ^ wp.uint32(corners[2])) * SPREAD_3
    hash = (hash ^ wp.uint32(corners[3])) * SPREAD_4
    hash = (hash ^ wp.uint32(kind)) * SPREAD_5
    return wp.int32((hash ^ (hash >> wp.uint32(15))) & wp.uint32(0x7FFFFFFF))


@wp.func
def remembered_stick(memory: StickMemory, corners: wp.vec4i, kind: int):
    """Stick displacement of a pair before this search [m]; ``kind`` ON_TRIANGLE or ON_EDGE."""
    last = memory.entry.shape[0] - 1
    search = memory.search[0] - wp.int64(1)
    place = pair_hash(corners, kind) & last
    entry = memory.entry[place]
    while entry >> PAIR_BITS == search:
        pair = wp.int32(entry & PAIR)
        if memory.corners[pair] == corners and memory.kind[pair] == kind:
            return memory.stick[pair]
        place = (place + 1) & last
        entry = memory.entry[place]
    return wp.vec4f()


@wp.func
def begin_search(memory: StickMemory):
    """Starts a search: the table's entries become those before it."""
    memory.search[0] = memory.search[0] + wp.int64(1)


@wp.func
def remember_stick(contact: ContactData, memory: StickMemory, pair: int):
    """Stores a pair, if it sticks, in any free entry of its chain: a query finds the same whatever the order."""
    stick = contact.pairs.stick[pair]
    if stick == wp.vec4f():
        return
    corners = contact.pairs.corners[pair]
    kind = contact.pairs.kind[pair] & 1
    memory.corners[pair] = corners
    memory.kind[pair] = kind
    memory.stick[pair] = stick
    last = memory.entry.shape[0] - 1
    search = memory.search[0]
    place = pair_hash(corners, kind) & last
    entry = memory.entry[place]
    stored = bool(False)
    while not stored:
        if entry >> PAIR_BITS == search:
            place = (place + 1) & last
            entry = memory.entry[place]
        else:
            found = wp.atomic_cas(memory.entry, place, entry, (search << PAIR_BITS) | wp.int64(pair))
            stored = found == entry
            entry = found

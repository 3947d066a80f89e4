"""What a pair leans survives the search that lists the pairs anew: a hash table of those that leaned before."""

import warp as wp

from warp_cloth.kernels.cloth_contact import ClothContact

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

EMPTY = wp.constant(wp.int32(-1))


@wp.struct
class LeanMemory:
    """The pairs that leaned, P at most, in a table of H places, a power of two and more than P."""

    place: wp.array(dtype=wp.int32)  # a pair, or EMPTY, shape [H]
    corners: wp.array(dtype=wp.vec4i)  # shape [P]
    kind: wp.array(dtype=wp.int32)  # shape [P]
    lean: wp.array(dtype=wp.vec3f)  # [m], shape [P]


@wp.func
def pair_hash(corners: wp.vec4i, kind: int):
    """A number that spreads pairs over the table (multiplicative, each corner turned differently)."""
    hash = wp.uint32(corners[0]) * wp.uint32(2654435761)
    hash = (hash ^ wp.uint32(corners[1])) * wp.uint32(2246822519)
    hash = (hash ^ wp.uint32(corners[2])) * wp.uint32(3266489917)
    hash = (hash ^ wp.uint32(corners[3])) * wp.uint32(668265263)
    hash = (hash ^ wp.uint32(kind)) * wp.uint32(374761393)
    return wp.int32((hash ^ (hash >> wp.uint32(15))) & wp.uint32(0x7FFFFFFF))


@wp.func
def remembered_lean(memory: LeanMemory, corners: wp.vec4i, kind: int):
    """The lean of a pair at the last search [m]; ``kind`` ON_TRIANGLE or ON_EDGE."""
    last = memory.place.shape[0] - 1
    place = pair_hash(corners, kind) & last
    pair = memory.place[place]
    while pair != EMPTY:
        if memory.corners[pair] == corners and memory.kind[pair] == kind:
            return memory.lean[pair]
        place = (place + 1) & last
        pair = memory.place[place]
    return wp.vec3f()


@wp.kernel
def forget_leans(memory: LeanMemory):
    """Empties the table."""
    memory.place[wp.tid()] = EMPTY


@wp.kernel
def remember_leans(contact: ClothContact, memory: LeanMemory):
    """Puts each pair that leans into the table, wherever a place is free: what is found there is the same."""
    pair = wp.tid()
    if pair >= contact.count[0]:
        return
    lean = contact.lean[pair]
    if lean == wp.vec3f():
        return
    corners = contact.corners[pair]
    kind = contact.kind[pair] & 1
    memory.corners[pair] = corners
    memory.kind[pair] = kind
    memory.lean[pair] = lean
    last = memory.place.shape[0] - 1
    place = pair_hash(corners, kind) & last
    while wp.atomic_cas(memory.place, place, EMPTY, pair) != EMPTY:
        place = (place + 1) & last

"""Cloth on cloth: pairs nearer than the thickness push apart and hold each other by friction."""

import functools

import warp as wp

from warp_cloth.kernels.cloth import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.touch import NOTHING, WHOLE, nearest_on_edges, nearest_on_triangle

# Sums are kept as whole numbers of these units: whole numbers add up to the same in every order, so that pairs may be
# found and summed in any.
FORCE_UNIT = wp.constant(wp.float64(2.0**-36))  # [N]; a vertex weighs 1e7 of them
STIFFNESS_UNIT = wp.constant(wp.float64(2.0**-16))  # [N/m]
ROOM_UNIT = wp.constant(wp.float64(2.0**-33))  # [m]
NO_LIMIT = wp.constant(wp.int32(2**31 - 1))  # room of a vertex with nothing near

# Of the distance between two bits of cloth, what each may move in an iteration: less than half, so they never pass.
ROOM_SHARE = wp.constant(wp.float64(0.45))

SHRUNK, GROWN = wp.constant(wp.float64(0.7)), wp.constant(wp.float64(1.5))  # of a skin, from search to search

ON_TRIANGLE = wp.constant(wp.int32(0))  # a vertex and a triangle
ON_EDGE = wp.constant(wp.int32(1))  # two edges
NEIGHBOURS = wp.constant(wp.int32(2))  # added where the two are near in the rest shape: they do not push

EVER = wp.constant(wp.int64(2**62))  # farther than any vertex goes [ROOM_UNIT]; what is due beyond it never is


@wp.struct
class ClothContact:
    """Which cloth is near which, and what that does to the vertices; P pairs at most, V vertices."""

    # of the garments
    thickness: wp.array(dtype=wp.float32)  # [m], shape [V]
    modulus: wp.array(dtype=wp.float32)  # of squeeze_energy [N/m], shape [V]
    friction: wp.array(dtype=wp.float32)  # shape [V]
    thickest: wp.float64  # [m]
    least_skin: wp.float64  # of a vertex that stands still [m]
    most_skin: wp.float64  # [m]
    ahead: wp.float64  # iterations to the next look at whether another is due
    margin: wp.float64  # pairs this much farther apart than thick are left alone till they may be as near again [m]
    far: wp.float64  # the same with the thinnest garment: whatever is left alone is farther apart [m]
    # pairs
    count: wp.array(dtype=wp.int32)  # pairs found, more than P where they did not fit, shape [1]
    corners: wp.array(dtype=wp.vec4i)  # vertex and triangle, or the ends of two edges, shape [P]
    kind: wp.array(dtype=wp.int32)  # ON_TRIANGLE or ON_EDGE, and NEIGHBOURS or not, shape [P]
    lean: wp.array(dtype=wp.vec3f)  # how far the first has been dragged along the second [m], shape [P]
    due: wp.array(dtype=wp.int64)  # how far any vertex has gone when a pair may be near again, of due_of, shape [P]
    # how far vertices have gone, the farthest in each iteration [ROOM_UNIT]: what a move reads of the ways and writes
    # for the next one lie apart, so that no thread of a launch reads what another one writes
    way: wp.array(dtype=wp.int64)  # before the last press, and after it, shape [2]
    stride: wp.array(dtype=wp.int32)  # of the last iteration and of this one, in turn, shape [2]
    turn: wp.array(dtype=wp.int32)  # iterations before the last press, and after it, shape [2]
    # blocks that press while others work out patches, in one launch
    pressing: int  # how many; 0: pairs are pressed by a launch of their own
    waiting: int  # how many others
    told: wp.array(dtype=wp.int32)  # of the former those done, of the latter those that know it, shape [2]; zero
    # what a move reads, and leaves as it was at the start
    sum: wp.array2d(dtype=wp.int64)  # force [FORCE_UNIT] and fourth part [STIFFNESS_UNIT], shape [V, 4]; zero
    room: wp.array(dtype=wp.int32)  # largest displacement [ROOM_UNIT], shape [V]; NO_LIMIT
    # between two searches
    lift: wp.array(dtype=wp.float32)  # how much farther from the avatar than its offset a vertex stays [m], shape [V]
    shift: wp.array(dtype=wp.vec3f)  # displacement in each iteration that untangles [m], shape [V]
    searched: wp.array(dtype=wp.vec3d)  # where vertices were at the last search [m], shape [V]
    skin: wp.array(dtype=wp.float32)  # how far each may go from there till the next: what is known allows for it [m]
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
def contact_room(contact: ClothContact, vertex: int, position: wp.vec3d):
    """How far a vertex may move [m] before it could meet something, known or not; leaves the room open.

    Whatever was farther off at the last search than both skins and the thickness cannot be met as long as none goes
    beyond its skin and half the thickness. While there is no room for all pairs nothing moves.
    """
    count = contact.count[0]
    nearest = contact.room[vertex]
    searched = contact.searched[vertex]
    skin = wp.float64(contact.skin[vertex])
    known = ROOM_SHARE * contact.far
    if nearest != NO_LIMIT:
        known = wp.min(wp.float64(nearest) * ROOM_UNIT, known)
        contact.room[vertex] = NO_LIMIT
    if count > contact.corners.shape[0]:  # some pairs did not fit
        known = NOTHING
    unknown = skin + wp.float64(0.49) * contact.thickest - wp.length(position - searched)
    return wp.max(wp.min(known, unknown), NOTHING)


_RAISE = """
#if defined(__CUDA_ARCH__)
    const unsigned int here = __activemask();
    const int most = __reduce_max_sync(here, value);
    if ((threadIdx.x & 31) == __ffs(here) - 1)
        atomicMax(numbers.data + which, most);
#else
    if (value > numbers.data[which])
        numbers.data[which] = value;
#endif
"""


@wp.func_native(_RAISE)
def raise_to(numbers: wp.array(dtype=wp.int32), which: int, value: int):
    """Raises a number to a value, if that is higher; threads that go together ask memory once."""
    ...


@wp.func
def contact_watch(contact: ClothContact, vertex: int, position: wp.vec3d, move: wp.vec3d, turn: int):
    """Notes how far a vertex went, and asks for another search where what it touches may not be known any more.

    ``turn`` is the contact's after the last press.
    """
    length = wp.length(move)
    if skin_worn(contact, vertex, position, move) > WHOLE:
        contact.moved[0] = 1
    raise_to(contact.stride, turn & 1, wp.int32(length / ROOM_UNIT) + 1)
    if vertex == 0:
        contact.turn[0] = turn
        contact.way[0] = contact.way[1]


@wp.func
def skin_worn(contact: ClothContact, vertex: int, position: wp.vec3d, move: wp.vec3d):
    """What share of its skin a vertex has used up since the last search, or will have at the next look."""
    gone = wp.length(position - contact.searched[vertex]) + contact.ahead * wp.length(move)
    return gone / wp.float64(contact.skin[vertex])


@wp.func
def next_skin(contact: ClothContact, vertex: int, position: wp.vec3d, move: wp.vec3d):
    """How far a vertex is to have room to go till the next search [m]: by and by twice what it goes."""
    grown = wp.clamp(wp.float64(2.0) * skin_worn(contact, vertex, position, move), SHRUNK, GROWN)
    skin = wp.float64(contact.skin[vertex]) * grown
    return wp.float32(wp.clamp(skin, contact.least_skin, contact.most_skin))


@wp.func
def pair_reach(contact: ClothContact, corners: wp.vec4i, kind: int):
    """How near a pair must be to be kept [m]: the thickness and the larger skin of either side."""
    skin_0, skin_1 = contact.skin[corners[0]], contact.skin[corners[1]]
    skin_2, skin_3 = contact.skin[corners[2]], contact.skin[corners[3]]
    others = wp.max(skin_2, skin_3)
    skins = wp.where(kind == ON_TRIANGLE, skin_0 + wp.max(skin_1, others), wp.max(skin_0, skin_1) + others)
    return contact.thickest + wp.float64(skins)


@wp.func
def contact_gone(contact: ClothContact):
    """How far any vertex may have gone up to now [ROOM_UNIT]."""
    even, odd = contact.stride[0], contact.stride[1]  # neither waits for the turn
    return contact.way[0] + wp.int64(wp.where((contact.turn[0] & 1) == 0, even, odd))


@wp.func
def contact_way(contact: ClothContact, thread: int):
    """The same; the first thread turns to the next iteration."""
    turn = contact.turn[0]
    way = contact_gone(contact)
    if thread == 0:
        contact.way[1] = way
        contact.turn[1] = turn + 1
        contact.stride[(turn + 1) & 1] = 0
    return way


@wp.func
def due_of(way: wp.int64, kind: int):
    """A way [ROOM_UNIT] whose lowest bit says what it is the way of: ON_TRIANGLE or ON_EDGE."""
    return (way & ~wp.int64(1)) | wp.int64(kind)


@wp.func
def due_after(contact: ClothContact, kind: int, distance: wp.float64, thickness: wp.float64, way: wp.int64):
    """When a pair may be near that is so far apart [m] after a way; in the past if it is near.

    No move is longer than what lies beyond the margin leaves room for.
    """
    apart = wp.float64(0.5) * (distance - thickness - contact.margin) / ROOM_UNIT
    return due_of(wp.where(apart > NOTHING, way + wp.int64(apart), wp.int64(-2)), kind)


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
def pair_thickness(contact: ClothContact, corners: wp.vec4i):
    """Thickness where two bits of cloth meet [m]: the mean of both."""
    return wp.float64(0.5) * wp.float64(contact.thickness[corners[0]] + contact.thickness[corners[3]])


@wp.func
def pair_cloth(contact: ClothContact, corners: wp.vec4i):
    """Thickness [m], modulus [N/m] and friction where two bits of cloth meet: the means of both."""
    first, second = corners[0], corners[3]
    half = wp.float64(0.5)
    modulus = wp.float64(contact.modulus[first] + contact.modulus[second])
    friction = wp.float64(contact.friction[first] + contact.friction[second])
    return wp.vec3d(pair_thickness(contact, corners), half * modulus, half * friction)


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

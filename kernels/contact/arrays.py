"""Cloth on cloth: pairs nearer than the thickness push apart and hold each other by friction."""

import functools

import warp as wp

from warp_cloth.kernels.base.access import element
from warp_cloth.kernels.base.block import TOLD_APART
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.contact.squeeze import NOTHING, nearest_functions
from warp_cloth.kernels.math.real import inner, root, scaled_sum

# Sums are kept as whole numbers of these units: whole numbers add up to the same in every order, so that pairs may be
# found and summed in any.
FORCE_UNIT = wp.constant(wp.float64(2.0**-36))  # [N]; a vertex weighs 1e7 of them
STIFFNESS_UNIT = wp.constant(wp.float64(2.0**-16))  # [N/m]
ROOM_UNIT = wp.constant(wp.float64(2.0**-33))  # [m]
NO_LIMIT = wp.constant(wp.int32(2**31 - 1))  # room of a vertex with nothing near

# Of the distance between two bits of cloth, what each may move in an iteration: less than half, so they never pass.
ROOM_SHARE = wp.constant(wp.float64(0.45))

ON_TRIANGLE = wp.constant(wp.int32(0))  # a vertex and a triangle
ON_EDGE = wp.constant(wp.int32(1))  # two edges
NEIGHBOURS = wp.constant(wp.int32(2))  # added where the two are near in the rest shape: they do not push

EVER = wp.constant(wp.int64(2**62))  # farther than any vertex goes [ROOM_UNIT]; what is due beyond it never is

REGIONS = 1024  # of vertices, at most; nothing is in that of number 0
TURNED = TOLD_APART // 4  # so far apart that blocks which await a press do not read what it has read
_REGION_BITS = 16  # of a word of four


@wp.struct
class ContactData:
    """Which cloth is near which, and what that does to the vertices; P pairs at most, V vertices."""

    # of the garments
    thickness: wp.array(dtype=wp.float32)  # [m], shape [V]
    fabric: wp.array(dtype=wp.vec4f)  # thickness [m], modulus of squeeze_energy [N/m], friction, nothing, shape [V]
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
    lean: wp.array(dtype=wp.vec4f)  # how far the first has been dragged along the second [m], nothing, shape [P]
    regions: wp.array(dtype=wp.uint64)  # of the four vertices, of pair_regions, shape [P]
    due: wp.array(dtype=wp.int64)  # how far its regions have gone when a pair may be near again, of due_of, shape [P]
    # how far vertices have gone, the farthest of each region in each iteration [ROOM_UNIT]: what a move reads of the
    # ways and writes for the next one lie apart, so that no thread of a launch reads what another one writes
    region: wp.array(dtype=wp.int32)  # of each vertex, which has others near it, shape [V]
    region_count: int  # that of number 0 included
    way: wp.array2d(dtype=wp.int64)  # before the last press, and after it, shape [2, REGIONS]
    stride: wp.array2d(dtype=wp.int32)  # of the last iteration and of this one, in turn, shape [2, REGIONS]
    turn: wp.array(dtype=wp.int32)  # iterations before the last press, and from TURNED on after it, shape [2 TURNED]
    # blocks that press while others work out patches, in one launch
    pressing: int  # how many; 0: pairs are pressed by a launch of their own
    waiting: int  # how many others
    told: wp.array(dtype=wp.int32)  # of the former those done, of the latter those that know it, shape [2]; zero
    # what a move reads, and leaves as it was at the start
    sum: wp.array2d(dtype=wp.int64)  # force [FORCE_UNIT] and bound or magnitude [STIFFNESS_UNIT], shape [V, 4]; zero
    room: wp.array(dtype=wp.int32)  # largest displacement [ROOM_UNIT], shape [V]; NO_LIMIT
    # between two searches
    lift: wp.array(dtype=wp.float32)  # how much farther from the avatar than its offset a vertex stays [m], shape [V]
    shift: wp.array(dtype=wp.vec3f)  # displacement in each iteration that untangles [m], shape [V]
    searched: wp.array(dtype=wp.vec3d)  # where vertices were at the last search [m], shape [V]
    skin: wp.array(dtype=wp.float32)  # how far each may go from there till the next: what is known allows for it [m]
    moved: wp.array(dtype=wp.int32)  # whether it is time for another, shape [1]
    patience: int  # iterations from one to the next for a few vertices that ask for it
    many: int  # times that vertices ask till a look, above which they are not few
    asked: wp.array(dtype=wp.int32)  # how often they have since the last look, and whether some wait, shape [2]
    turn_then: wp.array(dtype=wp.int32)  # iterations before the last search, shape [1]


@functools.cache
def apart_function(precision: str, sort: int) -> wp.Function:
    """The function that tells where the two of a pair of a sort (ON_TRIANGLE, ON_EDGE) are nearest, and how far apart.

    Where is told in the precision of forces. The way from one to the other is summed from differences in float64: seen
    from the second vertex nothing large cancels.
    """
    types = cloth_types(precision)
    real, vec3, vec4, nearest = types.real, types.vec3, types.vec4, nearest_functions(types.real)
    on_triangle, on_edges = nearest.on_triangle, nearest.on_edges
    one = wp.constant(real(1.0))

    @wp.func
    def pair_apart(x0: wp.vec3d, x1: wp.vec3d, x2: wp.vec3d, x3: wp.vec3d):
        """Weights of the four vertices whose sum is the way from the second's nearest point to the first's.

        And this way [m], its square in float64 and its length.
        """
        d0, d2, d3 = x0 - x1, x2 - x1, x3 - x1
        weights = vec4()
        if wp.static(sort == 0):
            on = on_triangle(vec3(d0), vec3(d2), vec3(d3))
            weights = vec4(one, -on[0], -on[1], -on[2])
        else:
            at = on_edges(-vec3(d0), vec3(d3 - d2), vec3(d0 - d2))
            weights = vec4(one - at[0], at[0], at[1] - one, -at[1])
        w0, w2, w3 = wp.float64(weights[0]), wp.float64(weights[2]), wp.float64(weights[3])
        # the weights sum to zero
        way = scaled_sum(d3, w3, scaled_sum(d2, w2, d0 * w0))
        square = inner(way, way)
        return weights, vec3(way), square, root(real(square))

    return pair_apart


@wp.struct
class ContactBefore:
    """What is known of a vertex before pairs are pressed."""

    gone: float  # how far it is from where it was at the last search [m]
    skin: float  # ContactData's [m]
    room: float  # how far it may move [m], whatever is pressed
    shift: wp.vec3f  # ContactData's [m]
    lift: float  # [m]
    region: int


@wp.func
def contact_before(contact: ContactData, vertex: int, position: wp.vec3d):
    """What is known of a vertex before pairs are pressed.

    Whatever was farther off at the last search than both skins and the thickness cannot be met as long as none goes
    beyond its skin and half the thickness. While there is no room for all pairs nothing moves.
    """
    before = ContactBefore()
    way = wp.vec3f(position - element(contact.searched, vertex))
    before.skin = element(contact.skin, vertex)
    before.shift = element(contact.shift, vertex)
    before.lift = element(contact.lift, vertex)
    before.region = element(contact.region, vertex)
    before.gone = root(inner(way, way))
    unknown = before.skin + float(wp.float64(0.49) * contact.thickest) - before.gone
    before.room = wp.max(wp.min(float(ROOM_SHARE * contact.far), unknown), float(0.0))
    if element(contact.count, 0) > contact.corners.shape[0]:  # some pairs did not fit
        before.room = float(0.0)
    return before


@wp.func
def pair_reach(contact: ContactData, corners: wp.vec4i, kind: int):
    """How near a pair must be to be kept [m]: the thickness and the larger skin of either side."""
    skin_0, skin_1 = contact.skin[corners[0]], contact.skin[corners[1]]
    skin_2, skin_3 = contact.skin[corners[2]], contact.skin[corners[3]]
    others = wp.max(skin_2, skin_3)
    skins = wp.where(kind == ON_TRIANGLE, skin_0 + wp.max(skin_1, others), wp.max(skin_0, skin_1) + others)
    return contact.thickest + wp.float64(skins)


@wp.func
def region_gone(contact: ContactData, region: int):
    """How far any vertex of a region may have gone up to now [ROOM_UNIT]."""
    even, odd = contact.stride[0, region], contact.stride[1, region]  # neither waits for the turn
    return contact.way[0, region] + wp.int64(wp.where((contact.turn[0] & 1) == 0, even, odd))


@wp.func
def region_of(regions: wp.uint64, corner: int):
    """One of the regions in a word of ``pair_regions``."""
    return wp.int32((regions >> wp.uint64(wp.static(_REGION_BITS) * corner)) & wp.uint64(wp.static(REGIONS - 1)))


@wp.func
def pair_regions(contact: ContactData, corners: wp.vec4i, kind: int):
    """The regions whose ways together bound by how much a pair may have come nearer: each once of either side."""
    first, second = int(contact.region[corners[0]]), int(contact.region[corners[1]])
    third, fourth = int(contact.region[corners[2]]), int(contact.region[corners[3]])
    if kind == ON_TRIANGLE:
        third = wp.where(third == second, 0, third)
        fourth = wp.where(fourth == second, 0, fourth)
    else:
        second = wp.where(second == first, 0, second)
    fourth = wp.where(fourth == third, 0, fourth)
    low = wp.uint64(first | (second << wp.static(_REGION_BITS)))
    return low | (wp.uint64(third | (fourth << wp.static(_REGION_BITS))) << wp.uint64(wp.static(2 * _REGION_BITS)))


@wp.func
def pair_gone(contact: ContactData, regions: wp.uint64):
    """How far a pair's regions may have gone up to now, together [ROOM_UNIT]."""
    gone = wp.int64(0)
    for corner in range(4):
        gone += region_gone(contact, region_of(regions, corner))
    return gone


@wp.func
def due_of(way: wp.int64, kind: int):
    """A way [ROOM_UNIT] whose lowest bit says what it is the way of: ON_TRIANGLE or ON_EDGE."""
    return (way & ~wp.int64(1)) | wp.int64(kind)


@wp.func
def due_after(contact: ContactData, kind: int, distance: wp.float64, thickness: wp.float64, gone: wp.int64):
    """When a pair may be near that is so far apart [m] after its regions have gone so far; in the past if it is near.

    No move is longer than what lies beyond the margin leaves room for.
    """
    apart = (distance - thickness - contact.margin) / ROOM_UNIT
    return due_of(wp.where(apart > NOTHING, gone + wp.int64(apart), wp.int64(-2)), kind)


@wp.func
def pair_thickness(contact: ContactData, corners: wp.vec4i):
    """Thickness where two bits of cloth meet [m]: the mean of both."""
    return float(0.5) * (contact.thickness[corners[0]] + contact.thickness[corners[3]])


@wp.func
def pair_cloth(contact: ContactData, corners: wp.vec4i):
    """Thickness [m], modulus [N/m] and friction where two bits of cloth meet: the means of both."""
    one, other = element(contact.fabric, corners[0]), element(contact.fabric, corners[3])
    half = float(0.5)
    return wp.vec3f(half * (one[0] + other[0]), half * (one[1] + other[1]), half * (one[2] + other[2]))

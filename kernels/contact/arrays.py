"""Cloth contact: its arrays by role (model, pair list, displacement bounds, search trigger, sums), and what a pair is.

Two pieces of cloth nearer than their thickness push each other apart and hold each other by friction. A pair is a
vertex and a triangle, or two edges.
"""

import functools

import warp as wp

from warp_cloth.kernels.base.access import element
from warp_cloth.kernels.base.block import CACHE_LINE
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.math.closest_points import NOTHING, on_edges_function, on_triangle_function
from warp_cloth.kernels.math.real import inner, root, scaled_sum

# Sums are integers of these units: integers add up to the same in any order, so pairs may be found and summed in any.
FORCE_UNIT = wp.constant(wp.float64(2.0**-36))  # [N]; a vertex weighs 1e7 of them
STIFFNESS_UNIT = wp.constant(wp.float64(2.0**-16))  # [N/m]
LENGTH_UNIT = wp.constant(wp.float64(2.0**-33))  # [m]
NO_LIMIT = wp.constant(wp.int32(2**31 - 1))  # step limit of a vertex with nothing near

# Fraction of the distance between two pieces of cloth that each may move in an iteration: less than half, so they
# never pass each other.
STEP_FRACTION = wp.constant(wp.float64(0.45))

ON_TRIANGLE = wp.constant(wp.int32(0))  # a vertex and a triangle
ON_EDGE = wp.constant(wp.int32(1))  # two edges
NEIGHBOURS = wp.constant(wp.int32(2))  # added where the two are near in the rest shape: they do not push

NEVER = wp.constant(wp.int64(2**62))  # longer than the path of any vertex [LENGTH_UNIT]; a pair due later is never due

REGIONS = 1024  # of vertices, at most; number 0 is empty
# Distance between an iteration's number before and after forces: so far apart that blocks which wait for the forces
# do not read a cache line that the others have read.
NEXT_ITERATION = CACHE_LINE // 4
_REGION_BITS = 16  # a word packs four regions


@wp.struct
class ContactFabric:
    """Fabric of a vertex, or where two pieces of cloth meet."""

    thickness: float  # [m]
    squeeze_modulus: float  # of laws.squeeze [N/m]
    friction: float


@wp.struct
class ContactModel:
    """What the host alone writes: constants of the garments, and what a stage of the fit goes by; V vertices."""

    thickness: wp.array(dtype=wp.float32)  # [m], shape [V]
    fabric: wp.array(dtype=ContactFabric)  # shape [V]
    thickest: wp.float64  # greatest thickness [m]
    least_skin: wp.float64  # least search margin: of a vertex at rest [m]
    most_skin: wp.float64  # greatest search margin [m]
    lift: wp.array(dtype=wp.float32)  # how much farther from the avatar than its offset a vertex stays [m], shape [V]
    active_margin: wp.float64  # pairs apart by more than this beyond their thickness are skipped until due [m]
    active_distance: wp.float64  # the same plus the least thickness: skipped pairs are farther apart [m]
    check_interval: wp.float64  # iterations from one check whether a search is due to the next
    request_limit: int  # requests per check that make a search due at once
    longest_wait: int  # iterations since the last search after which any request makes one due


@wp.struct
class ContactPairs:
    """The pair list of the last search; P pairs at most."""

    count: wp.array(dtype=wp.int32)  # pairs found; more than P where they did not fit, shape [1]
    corners: wp.array(dtype=wp.vec4i)  # a vertex and a triangle's, or the ends of two edges, shape [P]
    kind: wp.array(dtype=wp.int32)  # ON_TRIANGLE or ON_EDGE, plus NEIGHBOURS, shape [P]
    stick: wp.array(dtype=wp.vec4f)  # stick displacement of the first against the second [m], 0, shape [P]
    regions: wp.array(dtype=wp.uint64)  # of the four vertices, packed by ``pair_regions``, shape [P]
    due: wp.array(dtype=wp.int64)  # path of its regions after which it may be near again, of ``due_path``, shape [P]


@wp.struct
class DisplacementBounds:
    """Upper bounds of how far vertices have moved, by region: they decide when a skipped pair is due.

    What an iteration reads is stored apart from what it writes for the next: no thread reads what another writes.
    """

    region: wp.array(dtype=wp.int32)  # of each vertex, shape [V]; vertices of a region are near each other
    region_count: int  # number 0 included
    path: wp.array2d(dtype=wp.int64)  # path length before the forces, and after them [LENGTH_UNIT], shape [2, REGIONS]
    step: wp.array2d(dtype=wp.int32)  # longest step of an even, and an odd iteration [LENGTH_UNIT], shape [2, REGIONS]
    # before the forces; from NEXT_ITERATION on after them, shape [2 NEXT_ITERATION]
    iteration: wp.array(dtype=wp.int32)


@wp.struct
class ContactBlocks:
    """Thread blocks of a launch in which some compute contact forces while others compute the patches' forces."""

    force_count: int  # blocks that compute contact forces; 0: a launch of their own does
    move_count: int  # blocks that move vertices, and wait for the former
    done: wp.array(dtype=wp.int32)  # counters of block.await_blocks, shape [2]; zero between launches


@wp.struct
class ContactSums:
    """Scratch: sums over pairs, which a move reads and resets."""

    load: wp.array2d(dtype=wp.int64)  # force [FORCE_UNIT] and fourth component [STIFFNESS_UNIT], shape [V, 4]; zero
    step_limit: wp.array(dtype=wp.int32)  # longest displacement allowed [LENGTH_UNIT], shape [V]; NO_LIMIT


@wp.struct
class SearchTrigger:
    """When the pair list is no longer valid: search margins (the skins of a Verlet list), and requests to search."""

    position: wp.array(dtype=wp.vec3d)  # at the last search [m], shape [V]
    skin: wp.array(dtype=wp.float32)  # margin: how far each may go from there until the next search [m], shape [V]
    due: wp.array(dtype=wp.int32)  # whether it is time for a search, shape [1]
    requests: wp.array(dtype=wp.int32)  # by vertices since the last check; whether any is pending, shape [2]
    last_search: wp.array(dtype=wp.int32)  # its iteration, shape [1]


@wp.struct
class ContactData:
    """All arrays of cloth contact: model, state, scratch. Made by warp_cloth.contact.arrays."""

    model: ContactModel
    # state: what searches and iterations leave to the next ones
    pairs: ContactPairs
    bounds: DisplacementBounds
    trigger: SearchTrigger
    shift: wp.array(dtype=wp.vec3f)  # untangling displacement in each iteration [m], shape [V]
    # scratch: as it was again after an iteration
    sums: ContactSums
    blocks: ContactBlocks


@wp.func
def pair_fabric(contact: ContactData, corners: wp.vec4i):
    """Fabric where two pieces of cloth meet: the mean of both."""
    one = contact.model.fabric[corners[0]]
    other = contact.model.fabric[corners[3]]
    half = float(0.5)
    fabric = ContactFabric()
    fabric.thickness = half * (one.thickness + other.thickness)
    fabric.squeeze_modulus = half * (one.squeeze_modulus + other.squeeze_modulus)
    fabric.friction = half * (one.friction + other.friction)
    return fabric


@wp.func
def pair_thickness(contact: ContactData, corners: wp.vec4i):
    """Thickness where two pieces of cloth meet [m]: the mean of both."""
    return float(0.5) * (contact.model.thickness[corners[0]] + contact.model.thickness[corners[3]])


@functools.cache
def separation_function(precision: str, sort: int) -> wp.Function:
    """Function ``pair_separation`` for pairs of a sort (ON_TRIANGLE, ON_EDGE).

    The nearest points are found in the precision of forces. The vector between them is summed from differences in
    float64: relative to the second vertex nothing large cancels.
    """
    types = cloth_types(precision)
    real, vec3, vec4 = types.real, types.vec3, types.vec4
    on_triangle, on_edges = on_triangle_function(real), on_edges_function(real)
    one = wp.constant(real(1.0))

    @wp.func
    def pair_separation(x0: wp.vec3d, x1: wp.vec3d, x2: wp.vec3d, x3: wp.vec3d):
        """Weights w of the four vertices, the vector sum_i w_i x_i, its square in float64 and its length [m].

        The vector leads from the second's nearest point to the first's.
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
        separation = scaled_sum(d3, w3, scaled_sum(d2, w2, d0 * w0))
        square = inner(separation, separation)
        return weights, vec3(separation), square, root(real(square))

    return pair_separation


@wp.struct
class VertexContact:
    """What is known of a vertex before contact forces are."""

    moved: float  # distance from where it was at the last search [m]
    skin: float  # as in SearchTrigger [m]
    step_limit: float  # longest displacement allowed, whatever the forces [m]
    shift: wp.vec3f  # as in ContactData [m]
    lift: float  # [m]
    region: int


@wp.func
def load_vertex_contact(contact: ContactData, vertex: int, position: wp.vec3d):
    """Loads what is known of a vertex before the contact forces are.

    Cloth that was farther off at the last search than both skins and the thickness cannot be reached as long as no
    vertex goes beyond its skin and half the thickness. While the pair list is full nothing moves.
    """
    known = VertexContact()
    moved = wp.vec3f(position - element(contact.trigger.position, vertex))
    known.skin = element(contact.trigger.skin, vertex)
    known.shift = element(contact.shift, vertex)
    known.lift = element(contact.model.lift, vertex)
    known.region = element(contact.bounds.region, vertex)
    known.moved = root(inner(moved, moved))
    to_unknown = known.skin + float(wp.float64(0.49) * contact.model.thickest) - known.moved
    known.step_limit = wp.max(wp.min(float(STEP_FRACTION * contact.model.active_distance), to_unknown), float(0.0))
    if element(contact.pairs.count, 0) > contact.pairs.corners.shape[0]:  # some pairs did not fit
        known.step_limit = float(0.0)
    return known


@wp.func
def listing_distance(contact: ContactData, corners: wp.vec4i, kind: int):
    """How near a pair must be to be listed [m]: the thickness and the larger skin of either side."""
    skin_0, skin_1 = contact.trigger.skin[corners[0]], contact.trigger.skin[corners[1]]
    skin_2, skin_3 = contact.trigger.skin[corners[2]], contact.trigger.skin[corners[3]]
    others = wp.max(skin_2, skin_3)
    skins = wp.where(kind == ON_TRIANGLE, skin_0 + wp.max(skin_1, others), wp.max(skin_0, skin_1) + others)
    return contact.model.thickest + wp.float64(skins)


@wp.func
def region_path(contact: ContactData, region: int):
    """Upper bound of the path of a region's vertices up to now [LENGTH_UNIT]."""
    even, odd = contact.bounds.step[0, region], contact.bounds.step[1, region]  # loads that need no iteration number
    return contact.bounds.path[0, region] + wp.int64(wp.where((contact.bounds.iteration[0] & 1) == 0, even, odd))


@wp.func
def pair_region(regions: wp.uint64, corner: int):
    """One of the regions packed by ``pair_regions``."""
    return wp.int32((regions >> wp.uint64(wp.static(_REGION_BITS) * corner)) & wp.uint64(wp.static(REGIONS - 1)))


@wp.func
def pair_regions(contact: ContactData, corners: wp.vec4i, kind: int):
    """The regions whose paths together bound by how much a pair may have come nearer: each once on either side."""
    region_0, region_1 = int(contact.bounds.region[corners[0]]), int(contact.bounds.region[corners[1]])
    region_2, region_3 = int(contact.bounds.region[corners[2]]), int(contact.bounds.region[corners[3]])
    if kind == ON_TRIANGLE:
        region_2 = wp.where(region_2 == region_1, 0, region_2)
        region_3 = wp.where(region_3 == region_1, 0, region_3)
    else:
        region_1 = wp.where(region_1 == region_0, 0, region_1)
    region_3 = wp.where(region_3 == region_2, 0, region_3)
    low = wp.uint64(region_0 | (region_1 << wp.static(_REGION_BITS)))
    high = wp.uint64(region_2 | (region_3 << wp.static(_REGION_BITS)))
    return low | (high << wp.uint64(wp.static(2 * _REGION_BITS)))


@wp.func
def pair_path(contact: ContactData, regions: wp.uint64):
    """Sum of the paths of a pair's regions up to now [LENGTH_UNIT]."""
    path = wp.int64(0)
    for corner in range(4):
        path += region_path(contact, pair_region(regions, corner))
    return path


@wp.func
def tagged_path(path: wp.int64, kind: int):
    """A path [LENGTH_UNIT] whose lowest bit is replaced by the pair's kind: ON_TRIANGLE or ON_EDGE."""
    return (path & ~wp.int64(1)) | wp.int64(kind)


@wp.func
def due_path(contact: ContactData, kind: int, distance: wp.float64, thickness: wp.float64, path: wp.int64):
    """The path at which a pair may be near that is this far apart [m] at ``path``; negative if it is near now.

    Before it is due a pair needs no step limit: steps within STEP_FRACTION of the active distance never reach it.
    """
    apart = (distance - thickness - contact.model.active_margin) / LENGTH_UNIT
    return tagged_path(wp.where(apart > NOTHING, path + wp.int64(apart), wp.int64(-2)), kind)

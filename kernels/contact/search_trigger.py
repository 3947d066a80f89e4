"""Search trigger: how far vertices have moved, which decides when pairs are due and when a search for pairs is."""

import warp as wp

from warp_cloth.kernels.contact.arrays import LENGTH_UNIT, NEXT_ITERATION, REGIONS, ContactData, VertexContact

LONGER = wp.constant(1.000001)  # outweighs the rounding of a length
SHRUNK, GROWN = wp.constant(wp.float64(0.7)), wp.constant(wp.float64(1.5))  # factors on a skin from search to search


_RAISE = f"""
#if defined(__CUDA_ARCH__)
    wp::int32* const to = step.data + {REGIONS} * row + region;
    asm volatile("red.relaxed.gpu.global.max.s32 [%0], %1;" :: "l"(to), "r"(value) : "memory");
#else
    int* const to = &step.data[{REGIONS} * row + region];
    int now = __atomic_load_n(to, __ATOMIC_RELAXED);  // several threads may move vertices of a region
    while (value > now && !__atomic_compare_exchange_n(to, &now, value, true, __ATOMIC_RELAXED, __ATOMIC_RELAXED)) {{
    }}
#endif
"""


@wp.func_native(_RAISE)
def raise_step(step: wp.array2d(dtype=wp.int32), row: int, region: int, value: int):
    """Raises a region's longest step to a value, where that is higher."""
    ...


_COUNT_THREADS = """
#if defined(__CUDA_ARCH__)
    const unsigned int all = __activemask();
    if ((threadIdx.x & 31) == __ffs(all) - 1)
        asm volatile("red.relaxed.gpu.global.add.s32 [%0], %1;" :: "l"(count.data), "r"(__popc(all)) : "memory");
#else
    __atomic_fetch_add(count.data, 1, __ATOMIC_RELAXED);
#endif
"""


@wp.func_native(_COUNT_THREADS)
def count_requests(count: wp.array(dtype=wp.int32)):
    """Counts the threads that call this, one atomic for each warp."""
    ...


@wp.kernel(grid_stride=False)
def decide_search(contact: ContactData):
    """Makes a search due where there are many requests, or few that have waited for long enough. One thread."""
    requests = contact.trigger.requests[0]
    pending = requests > 0 or contact.trigger.requests[1] > 0
    contact.trigger.requests[0] = 0
    waited = contact.bounds.iteration[0] - contact.trigger.last_search[0]
    if requests > contact.model.request_limit or (pending and waited >= contact.model.longest_wait):
        contact.trigger.due[0] = 1
        pending = False
    contact.trigger.requests[1] = wp.where(pending, 1, 0)


@wp.func
def load_bounds(contact: ContactData, vertex: int):
    """After contact forces: the iteration, and the path of the region whose number is a vertex's, if there is one.

    Load them before anything is written: after that a GPU would wait for it.
    """
    path = wp.int64(0)
    if vertex < contact.bounds.region_count:
        path = contact.bounds.path[1, vertex]
    return contact.bounds.iteration[wp.static(NEXT_ITERATION)], path


@wp.func
def note_displacement(
    contact: ContactData, vertex: int, known: VertexContact, length: float, iteration: int, path: wp.int64
):
    """Raises the bounds by a vertex's step [m], and requests a search where cloth near it may no longer be known.

    That is where it has used up its skin, or will have at the next check. The last two are of ``load_bounds``.
    """
    if known.moved + (float(1.0) + float(contact.model.check_interval)) * length > known.skin:
        count_requests(contact.trigger.requests)
    if known.region > 0:
        raise_step(contact.bounds.step, iteration & 1, known.region, wp.int32(length * LONGER / float(LENGTH_UNIT)) + 1)
    if vertex < contact.bounds.region_count:  # there are more vertices than regions
        contact.bounds.path[0, vertex] = path
    if vertex == 0:
        contact.bounds.iteration[0] = iteration


@wp.func
def skin_used(contact: ContactData, vertex: int, position: wp.vec3d, displacement: wp.vec3d):
    """Fraction of its skin that a vertex has used up since the last search, or will have at the next check."""
    moved = wp.length(position - contact.trigger.position[vertex])
    moved = moved + contact.model.check_interval * wp.length(displacement)
    return moved / wp.float64(contact.trigger.skin[vertex])


@wp.func
def next_skin(contact: ContactData, vertex: int, position: wp.vec3d, displacement: wp.vec3d):
    """A vertex's skin until the next search [m]: it tends to twice what the vertex uses."""
    grown = wp.clamp(wp.float64(2.0) * skin_used(contact, vertex, position, displacement), SHRUNK, GROWN)
    skin = wp.float64(contact.trigger.skin[vertex]) * grown
    return wp.float32(wp.clamp(skin, contact.model.least_skin, contact.model.most_skin))

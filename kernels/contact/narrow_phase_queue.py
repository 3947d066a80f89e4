"""How a block queues those of its pairs that may be near, so that its threads press them side by side."""

import warp as wp

from warp_cloth.kernels.base.block import BLOCK_THREADS
from warp_cloth.kernels.base.options import BLOCK_MEMORY
from warp_cloth.kernels.contact.arrays import EVER, REGIONS
from warp_cloth.kernels.contact.displacement_bounds import GONE, TABLE

ROUNDS = 3  # of a block's threads: for how many pairs each looks at once whether they may be near
# Pairs that a block has room for beside how far each region has gone; those that may be near are pressed at a time.
QUEUED = (BLOCK_MEMORY - 8 * REGIONS) // 4 - 2

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
        found[round] = own + round * ahead < end ? asked.data[own + round * ahead] : 0;
#endif
    return found;
"""

_QUEUE = f"""
#if defined(__CUDA_ARCH__)
    {_OWN}
    {TABLE}
    int* queue = (int*)(table + {REGIONS});  // of both kinds how many, and those, from either end
    if (anew != 0) {{
        __syncthreads();  // till those queued before are done, and it is known how far regions have gone
        if (threadIdx.x == 0)
            queue[0] = 0;
        __syncthreads();
    }}
    const unsigned int lower = (1u << lane) - 1u;
    unsigned int masks[2][{ROUNDS}];
    int counted = 0;  // of both kinds, which go to the counter together
#pragma unroll
    for (int round = 0; round < {ROUNDS}; ++round) {{
        const int pair = own + round * ahead;
        const bool edges = dues[round] & 1;
        wp::int64 limit = {int(EVER)}ll;
        if (all == 0) {{
            {GONE % {"table": "table", "regions": "regions[round]"}}
            limit = gone;
        }}
        const bool near = pair < count && dues[round] <= limit;
        masks[0][round] = __ballot_sync(0xffffffffu, near && !edges);
        masks[1][round] = __ballot_sync(0xffffffffu, near && edges);
        counted += __popc(masks[0][round]) | __popc(masks[1][round]) << 16;
    }}
    if (counted != 0) {{
        int base = 0;
        if (lane == 0)
            base = atomicAdd(queue, counted);
        base = __shfl_sync(0xffffffffu, base, 0);
        int places[2] = {{2 + (base & 65535), {QUEUED + 1} - (base >> 16)}};
#pragma unroll
        for (int round = 0; round < {ROUNDS}; ++round) {{
            const int pair = own + round * ahead;
            if (masks[0][round] >> lane & 1)
                queue[places[0] + __popc(masks[0][round] & lower)] = pair;
            if (masks[1][round] >> lane & 1)
                queue[places[1] - __popc(masks[1][round] & lower)] = pair;
            places[0] += __popc(masks[0][round]);
            places[1] -= __popc(masks[1][round]);
        }}
    }}
    __syncthreads();
    return wp::vec_t<2, int>(queue[0] & 65535, queue[0] >> 16);
#else
    const int most = {ROUNDS * BLOCK_THREADS} * blocks, left = count - first < most ? count - first : most;
    return wp::vec_t<2, int>(left, left);
#endif
"""

_QUEUED = f"""
    {TABLE}
#if defined(__CUDA_ARCH__)
    const int* queue = (const int*)(table + {REGIONS});
    return queue[kind == 0 ? 2 + number : {QUEUED + 1} - number];
#else
    const wp::int64 due = dues.data[first + number];
    if ((due & 1) != kind)
        return -1;
    wp::int64 limit = {int(EVER)}ll;
    if (all == 0) {{
        {GONE % {"table": "table", "regions": "regions.data[first + number]"}}
        limit = gone;
    }}
    return due <= limit ? first + number : -1;
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
    const int thread = threadIdx.x;  // a few go to one warp: the others leave the core to those that work out patches
    if (kind == 0)
        return thread < {ON_TRIANGLES} ? thread : {QUEUED};
    return thread < {ON_TRIANGLES} ? {QUEUED} : thread - {ON_TRIANGLES};
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


for _dtype in (wp.int64, wp.uint64):

    @wp.func_native(_LOOK.replace("wp::int64", f"wp::{_dtype.__name__}"))
    def look_due(asked: wp.array(dtype=_dtype), first: int, end: int, blocks: int) -> wp.types.vector(
        length=ROUNDS, dtype=_dtype
    ):
        """When a thread's share of the pairs may be near, or their regions, ROUNDS for each of so many blocks' threads.

        Of pairs from a first one to before ``end``. A GPU's only.
        """
        ...


@wp.func_native(_QUEUE)
def queue_due(
    place: int,
    dues: wp.types.vector(length=ROUNDS, dtype=wp.int64),
    regions: wp.types.vector(length=ROUNDS, dtype=wp.uint64),
    way: wp.array2d(dtype=wp.int64),
    first: int,
    count: int,
    all: int,
    blocks: int,
    anew: int,
) -> wp.vec2i:
    """Has a block queue its share of the pairs that may be near; for how many of each kind to ask ``queued``.

    ``dues`` and ``regions`` of ``look_due``, of pairs from a first one to before ``count``; ``all``: whatever regions
    have gone; ``anew``: and forget those queued before.
    """
    ...


@wp.func_native(_QUEUED)
def queued(
    place: int,
    dues: wp.array(dtype=wp.int64),
    regions: wp.array(dtype=wp.uint64),
    way: wp.array2d(dtype=wp.int64),
    first: int,
    kind: int,
    number: int,
    all: int,
) -> int:
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

"""Narrow-phase queue: a block queues those of its pairs that are due, so that its threads work on them side by side."""

import warp as wp

from warp_cloth.kernels.base.block import BLOCK_THREADS
from warp_cloth.kernels.base.options import BLOCK_MEMORY
from warp_cloth.kernels.contact.arrays import NEVER, REGIONS
from warp_cloth.kernels.contact.displacement_bounds import PAIR_PATH, PATH_TABLE

ROUNDS = 3  # pairs that each thread of a block checks at once
# Pairs for which a block has memory besides the regions' paths; when the queue is full, its pairs are processed.
QUEUED = (BLOCK_MEMORY - 8 * REGIONS) // 4 - 2

# Threads of a block that take vertices on triangles; the others take edges: threads of a warp would wait for each other
# where their pairs are of two kinds.
ON_TRIANGLES = 64

_OWN = f"""
    // pairs next to each other come due together: a warp takes some here and there
    const int lane = threadIdx.x & 31, ahead = {BLOCK_THREADS} * blocks;
    const int own = first + 32 * (int)(blockIdx.x + (threadIdx.x >> 5) * blocks) + lane;
"""

_LOAD = f"""
    wp::vec_t<{ROUNDS}, wp::int64> found;
#if defined(__CUDA_ARCH__)
    {_OWN}
#pragma unroll
    for (int round = 0; round < {ROUNDS}; ++round)
        found[round] = own + round * ahead < end ? values.data[own + round * ahead] : 0;
#endif
    return found;
"""

_QUEUE = f"""
#if defined(__CUDA_ARCH__)
    {_OWN}
    {PATH_TABLE}
    int* queue = (int*)(table + {REGIONS});  // the counts of both kinds, then their pairs, from either end
    if (restart != 0) {{
        __syncthreads();  // until those queued before are done, and the regions' paths are known
        if (threadIdx.x == 0)
            queue[0] = 0;
        __syncthreads();
    }}
    const unsigned int lower = (1u << lane) - 1u;
    unsigned int masks[2][{ROUNDS}];
    int counted = 0;  // both kinds in one word, for one atomic
#pragma unroll
    for (int round = 0; round < {ROUNDS}; ++round) {{
        const int pair = own + round * ahead;
        const bool edges = dues[round] & 1;
        wp::int64 limit = {int(NEVER)}ll;
        if (all == 0) {{
            {PAIR_PATH % {"table": "table", "regions": "regions[round]"}}
            limit = pair_path;
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
    {PATH_TABLE}
#if defined(__CUDA_ARCH__)
    const int* queue = (const int*)(table + {REGIONS});
    return queue[kind == 0 ? 2 + number : {QUEUED + 1} - number];
#else
    const wp::int64 due = dues.data[first + number];
    if ((due & 1) != kind)
        return -1;
    wp::int64 limit = {int(NEVER)}ll;
    if (all == 0) {{
        {PAIR_PATH % {"table": "table", "regions": "regions.data[first + number]"}}
        limit = pair_path;
    }}
    return due <= limit ? first + number : -1;
#endif
"""

_CAPACITY = f"""
#if defined(__CUDA_ARCH__)
    return {QUEUED - ROUNDS * BLOCK_THREADS};
#else
    return -1;
#endif
"""

_FIRST = f"""
#if defined(__CUDA_ARCH__)
    const int thread = threadIdx.x;  // few pairs go to one warp: that leaves the core to blocks that work on patches
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

    @wp.func_native(_LOAD.replace("wp::int64", f"wp::{_dtype.__name__}"))
    def load_due(values: wp.array(dtype=_dtype), first: int, end: int, blocks: int) -> wp.types.vector(
        length=ROUNDS, dtype=_dtype
    ):
        """Loads ``due`` or ``regions`` of a thread's pairs from ``first`` to before ``end``, ROUNDS for each thread.

        On the GPU only.
        """
        ...


@wp.func_native(_QUEUE)
def queue_due(
    place: int,
    dues: wp.types.vector(length=ROUNDS, dtype=wp.int64),
    regions: wp.types.vector(length=ROUNDS, dtype=wp.uint64),
    first: int,
    count: int,
    all: int,
    blocks: int,
    restart: int,
) -> wp.vec2i:
    """A block queues those of its pairs that are due; returns how many of each kind are queued.

    ``dues`` and ``regions`` of ``load_due``, of pairs from ``first`` to before ``count``; ``all``: whether they are due
    or not; ``restart``: empties the queue first.
    """
    ...


@wp.func_native(_QUEUED)
def queued_pair(
    place: int,
    dues: wp.array(dtype=wp.int64),
    regions: wp.array(dtype=wp.uint64),
    path: wp.array2d(dtype=wp.int64),
    first: int,
    kind: int,
    number: int,
    all: int,
) -> int:
    """A queued pair; on the CPU, which does not queue, -1 where that pair is not due or of the other kind."""
    ...


@wp.func_native(_CAPACITY)
def queue_capacity() -> int:
    """Queue length beyond which its pairs must be processed; on the CPU, which does not queue, none."""
    ...


@wp.func_native(_FIRST)
def first_queued(kind: int) -> int:
    """A thread's first number in the queue."""
    ...


@wp.func_native(_STRIDE)
def queue_stride(kind: int) -> int:
    """Distance from one of a thread's numbers to its next."""
    ...

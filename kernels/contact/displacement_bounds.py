"""Displacement bounds: how far each region's vertices may have moved, in a block's shared memory."""

import warp as wp

from warp_cloth.kernels.base.block import BLOCK_THREADS
from warp_cloth.kernels.contact.arrays import NEXT_ITERATION, REGIONS

REGIONS_PER_THREAD = -(-REGIONS // BLOCK_THREADS)

# Sum of the paths of four packed regions.
PAIR_PATH = """
    wp::int64 pair_path = 0;
#pragma unroll
    for (int corner = 0; corner < 4; ++corner)
        pair_path += %(table)s[(int)(%(regions)s >> 16 * corner & 65535u)];
"""
PATH_TABLE = f"""
#if defined(__CUDA_ARCH__)
    wp::int64* const table = (wp::int64*)__cvta_shared_to_generic(place);
#else
    const wp::int64* const table = path.data + {REGIONS};  // row 1, which this one thread has just written
#endif
"""

_ADVANCE = f"""
    const int at = iteration.data[0], odd = at & 1;
#if defined(__CUDA_ARCH__)
    {PATH_TABLE}
    wp::int64 paths[{REGIONS_PER_THREAD}];
    int steps[2][{REGIONS_PER_THREAD}];  // both are loaded, so that neither waits for the iteration
#pragma unroll
    for (int k = 0; k < {REGIONS_PER_THREAD}; ++k) {{  // all loads before any use
        const int region = threadIdx.x + {BLOCK_THREADS} * k;
        if (region < count) {{
            paths[k] = path.data[region];
            steps[0][k] = step.data[region];
            steps[1][k] = step.data[{REGIONS} + region];
        }}
    }}
#pragma unroll
    for (int k = 0; k < {REGIONS_PER_THREAD}; ++k) {{
        const int region = threadIdx.x + {BLOCK_THREADS} * k;
        if (region < count) {{
            paths[k] += odd ? steps[1][k] : steps[0][k];
            table[region] = paths[k];
            if (blockIdx.x == 0) {{
                path.data[{REGIONS} + region] = paths[k];
                step.data[{REGIONS} * (1 - odd) + region] = 0;
            }}
        }}
    }}
    if (blockIdx.x == 0 && threadIdx.x == 0)
        iteration.data[{NEXT_ITERATION}] = at + 1;
#else
    for (int region = 0; region < count; ++region) {{
        path.data[{REGIONS} + region] = path.data[region] + step.data[{REGIONS} * odd + region];
        step.data[{REGIONS} * (1 - odd) + region] = 0;
    }}
    iteration.data[{NEXT_ITERATION}] = at + 1;
#endif
"""

_BLOCK_PAIR_PATH = f"""
    {PATH_TABLE}
    {PAIR_PATH % {"table": "table", "regions": "regions"}}
    return pair_path;
"""


@wp.func_native(_ADVANCE)
def advance_bounds(
    place: int,
    path: wp.array2d(dtype=wp.int64),
    step: wp.array2d(dtype=wp.int32),
    iteration: wp.array(dtype=wp.int32),
    count: int,
):
    """Adds the last step of the first ``count`` regions to their paths.

    Every block keeps the paths in shared memory, at ``place``; the first also writes them for the next iteration.
    """
    path[1, place] = path[0, place] + wp.int64(step[iteration[0] & 1, place])
    step[1, place] = 0
    iteration[NEXT_ITERATION] = iteration[0] + 1


@wp.func_native(_BLOCK_PAIR_PATH)
def block_pair_path(place: int, path: wp.array2d(dtype=wp.int64), regions: wp.uint64) -> wp.int64:
    """Sum of the paths of a pair's regions, from where ``advance_bounds`` keeps them."""
    ...

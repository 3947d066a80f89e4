"""How far the regions of a cloth's vertices have gone, by which a block tells which pairs may be near."""

import warp as wp

from warp_cloth.kernels.base.block import BLOCK_THREADS
from warp_cloth.kernels.contact.arrays import REGIONS, TURNED

REGION_TURNS = -(-REGIONS // BLOCK_THREADS)  # of a block's threads, a region each

GONE = """
    wp::int64 gone = 0;
#pragma unroll
    for (int corner = 0; corner < 4; ++corner)
        gone += %(table)s[(int)(%(regions)s >> 16 * corner & 65535u)];
"""
TABLE = f"""
#if defined(__CUDA_ARCH__)
    wp::int64* const table = (wp::int64*)__cvta_shared_to_generic(place);
#else
    const wp::int64* const table = way.data + {REGIONS};  // what one thread has written for the next move
#endif
"""

_TURN_ON = f"""
    const int at = turn.data[0], odd = at & 1;
#if defined(__CUDA_ARCH__)
    {TABLE}
    wp::int64 gone[{REGION_TURNS}];
    int strides[2][{REGION_TURNS}];  // neither waits for the turn
#pragma unroll
    for (int k = 0; k < {REGION_TURNS}; ++k) {{  // all asked for at once
        const int region = threadIdx.x + {BLOCK_THREADS} * k;
        if (region < count) {{
            gone[k] = way.data[region];
            strides[0][k] = stride.data[region];
            strides[1][k] = stride.data[{REGIONS} + region];
        }}
    }}
#pragma unroll
    for (int k = 0; k < {REGION_TURNS}; ++k) {{
        const int region = threadIdx.x + {BLOCK_THREADS} * k;
        if (region < count) {{
            gone[k] += odd ? strides[1][k] : strides[0][k];
            table[region] = gone[k];
            if (blockIdx.x == 0) {{
                way.data[{REGIONS} + region] = gone[k];
                stride.data[{REGIONS} * (1 - odd) + region] = 0;
            }}
        }}
    }}
    if (blockIdx.x == 0 && threadIdx.x == 0)
        turn.data[{TURNED}] = at + 1;
#else
    for (int region = 0; region < count; ++region) {{
        way.data[{REGIONS} + region] = way.data[region] + stride.data[{REGIONS} * odd + region];
        stride.data[{REGIONS} * (1 - odd) + region] = 0;
    }}
    turn.data[{TURNED}] = at + 1;
#endif
"""

_GONE_TOGETHER = f"""
    {TABLE}
    {GONE % {"table": "table", "regions": "regions"}}
    return gone;
"""


@wp.func_native(_TURN_ON)
def turn_on(
    place: int,
    way: wp.array2d(dtype=wp.int64),
    stride: wp.array2d(dtype=wp.int32),
    turn: wp.array(dtype=wp.int32),
    count: int,
):
    """Has a block keep how far each of so many regions has gone; the first block notes it for the next iteration."""
    way[1, place] = way[0, place] + wp.int64(stride[turn[0] & 1, place])
    stride[1, place] = 0
    turn[TURNED] = turn[0] + 1


@wp.func_native(_GONE_TOGETHER)
def gone_together(place: int, way: wp.array2d(dtype=wp.int64), regions: wp.uint64) -> wp.int64:
    """How far a pair's regions have gone together, of ``turn_on``."""
    ...

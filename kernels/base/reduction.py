"""Ordered reduction: garments in chunks of one thread block each, sums over them, and a grid barrier for blocks.

Every sum is added in one fixed order, pairwise, whatever the number of blocks, so that a garment gets the same bits
alone, in a batch, on a GPU and on the CPU, where a block is one thread.
"""

import warp as wp

# Threads of a block on a GPU, and values that it sums pairwise; of more values, those REDUCTION_WIDTH apart come first.
REDUCTION_WIDTH = 256

# One sum for each of the %(many)d arrays ``values``.
_BLOCK_SUMS = """
    const wp::float64* values[%(many)d] = {%(values)s};
    wp::float64 sums[%(many)d] = {};
#if defined(__CUDA_ARCH__)
    __shared__ double of_warp[%(many)d][%(warps)d];
    __syncthreads();
    for (int i = first + (int)threadIdx.x; i < last; i += %(width)d)
        for (int k = 0; k < %(many)d; ++k) {
            double value;
            if (from_other_blocks)
                asm volatile("ld.relaxed.gpu.global.f64 %%0, [%%1];" : "=d"(value) : "l"(values[k] + i) : "memory");
            else
                value = values[k][i];
            sums[k] += value;
        }
    for (int apart = 1; apart < 32; apart *= 2)
        for (int k = 0; k < %(many)d; ++k)
            sums[k] += __shfl_xor_sync(0xffffffff, sums[k], apart);
    if ((threadIdx.x & 31) == 0)
        for (int k = 0; k < %(many)d; ++k)
            of_warp[k][threadIdx.x >> 5] = sums[k];
    __syncthreads();
    for (int k = 0; k < %(many)d; ++k) {
        double left[%(warps)d];
        for (int i = 0; i < %(warps)d; ++i)
            left[i] = of_warp[k][i];
#pragma unroll
        for (int apart = 1; apart < %(warps)d; apart *= 2)
#pragma unroll
            for (int i = 0; i < %(warps)d; i += 2 * apart)
                left[i] += left[i + apart];
        sums[k] = left[0];
    }
#else
    for (int k = 0; k < %(many)d; ++k) {
        double left[%(width)d] = {};
        for (int i = first; i < last; ++i)
            left[(i - first) %% %(width)d] += values[k][i];
        for (int apart = 1; apart < %(width)d && apart < last - first; apart *= 2)
            for (int i = 0; i < %(width)d; i += 2 * apart)
                left[i] += left[i + apart];
        sums[k] = left[0];
    }
#endif
    return %(answer)s;
"""
_ONE = {"many": 1, "values": "values_0.data", "answer": "sums[0]"}
_TWO = {"many": 2, "values": "values_0.data, values_1.data", "answer": "{sums[0], sums[1]}"}
_BLOCK = {"width": REDUCTION_WIDTH, "warps": REDUCTION_WIDTH // 32}

_GRID_BARRIER = """
#if defined(__CUDA_ARCH__)
    __syncthreads();
    if (blocks > 1 && threadIdx.x == 0) {
        asm volatile("red.release.gpu.global.add.s32 [%0], 1;" :: "l"(arrived.data) : "memory");
        int now;
        do  // past the core's own cache
            asm volatile("ld.relaxed.gpu.global.s32 %0, [%1];" : "=r"(now) : "l"(arrived.data) : "memory");
        while (now < barriers * blocks);
    }
    __syncthreads();
#endif
"""

_COHERENT_LOAD = """
    wp::vec_t<6, %(real)s> six;
    const %(real)s* source = &array.data[2 * vertex].c[0];
#if defined(__CUDA_ARCH__)
    if (from_other_blocks) {
#pragma unroll
        for (int i = 0; i < 6; i += 2)
            asm volatile("ld.relaxed.gpu.global.v2.%(kind)s {%%0, %%1}, [%%2];"
                : "=%(letter)s"(six.c[i]), "=%(letter)s"(six.c[i + 1]) : "l"(source + i) : "memory");
        return six;
    }
#endif
    for (int i = 0; i < 6; ++i)
        six.c[i] = source[i];
    return six;
"""
_ADD_IN_LANE_ORDER = """
    auto result = sum;
#if defined(__CUDA_ARCH__)
    const auto* own = reinterpret_cast<const %(real)s*>(&value);
    auto* total = reinterpret_cast<%(real)s*>(&result);
    for (int lane = 0; lane < count; ++lane)
#pragma unroll
        for (int i = 0; i < %(length)d; ++i)
            total[i] += __shfl_sync(0xffffffff, own[i], lane);
#else
    result = wp::add(sum, value);
#endif
    return result;
"""

_SINGLE = {"real": "wp::float32", "kind": "f32", "letter": "f"}
_DOUBLE = {"real": "wp::float64", "kind": "f64", "letter": "d"}


@wp.struct
class Chunks:
    """V vertices of G garments in C chunks, each of a single garment, and scratch memory for their sums."""

    first: wp.array(dtype=wp.int32)  # vertex of each chunk, shape [C + 1]
    garment: wp.array(dtype=wp.int32)  # of each chunk, shape [C]
    start: wp.array(dtype=wp.int32)  # first chunk of each garment, shape [G + 1]
    scratch: wp.array(dtype=wp.float64)  # what is summed, shape [V]; kernels that sum write it


@wp.func_native(_BLOCK_SUMS % (_ONE | _BLOCK))
def block_sum(values_0: wp.array(dtype=wp.float64), first: int, last: int, from_other_blocks: bool) -> wp.float64:
    """Sum of values first .. last - 1; all threads of the block must call it.

    ``from_other_blocks``: other blocks wrote the values in this launch, so the loads must bypass the core's own cache.
    """
    ...


@wp.func_native(_BLOCK_SUMS % (_TWO | _BLOCK))
def two_block_sums(
    values_0: wp.array(dtype=wp.float64),
    values_1: wp.array(dtype=wp.float64),
    first: int,
    last: int,
    from_other_blocks: bool,
) -> wp.vec2d:
    """As ``block_sum``, of two arrays at once."""
    ...


@wp.func_native(_GRID_BARRIER)
def grid_barrier(arrived: wp.array(dtype=wp.int32), blocks: int, barriers: int):
    """Waits until ``blocks`` blocks have arrived ``barriers`` times; all must be resident on the GPU at once.

    ``arrived`` [1] starts at zero. What other blocks wrote before the barrier must be read by ``coherent_load`` or with
    ``from_other_blocks``: the core's own cache may still hold older values.
    """
    ...


@wp.func
def garment_sums(
    chunks: Chunks,
    sums_0: wp.array(dtype=wp.float64),
    sums_1: wp.array(dtype=wp.float64),
    garment: int,
    from_other_blocks: bool,
):
    """Two sums over a garment, from the sums over its chunks; all threads of the block must call it."""
    return two_block_sums(sums_0, sums_1, chunks.start[garment], chunks.start[garment + 1], from_other_blocks)


@wp.func
def sum_chunk(chunks: Chunks, chunk: int, lane: int, sum_out: wp.array(dtype=wp.float64)):
    """Sums what the block has left in a chunk's ``scratch``; all its threads must call it."""
    sum = block_sum(chunks.scratch, chunks.first[chunk], chunks.first[chunk + 1], False)
    if lane == 0:
        sum_out[chunk] = sum


@wp.func
def garment_ratio(
    chunks: Chunks,
    numerator: wp.array(dtype=wp.float64),
    denominator: wp.array(dtype=wp.float64),
    garment: int,
    from_other_blocks: bool,
):
    """Ratio of two sums over a garment, or 0 where the second is not above zero."""
    both = garment_sums(chunks, numerator, denominator, garment, from_other_blocks)
    result = wp.float64(0.0)
    if both[1] > wp.float64(0.0):
        result = both[0] / both[1]
    return result


for _real, _words in ((wp.float32, _SINGLE), (wp.float64, _DOUBLE)):
    _three, _six = (wp.types.vector(length=_length, dtype=_real) for _length in (3, 6))

    @wp.func_native(_COHERENT_LOAD % _words)
    def coherent_load(array: wp.array(dtype=_three), vertex: int, from_other_blocks: bool) -> _six:
        """The vectors 2 vertex and 2 vertex + 1, past the core's own cache where one block of many may write them.

        ``from_other_blocks``: one may have written them in this launch.
        """
        ...

    for _kind in (_three, _six, wp.types.matrix(shape=(3, 3), dtype=_real)):

        @wp.func_native(_ADD_IN_LANE_ORDER % {**_words, "length": wp.types.type_size(_kind)})
        def add_in_lane_order(sum: _kind, value: _kind, count: int) -> _kind:
            """Adds to ``sum`` the values of the warp's first ``count`` threads, one after another."""
            ...

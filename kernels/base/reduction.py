"""Garments in parts that a thread block works on each, sums over them, and blocks that wait for each other.

Every sum is made in one fixed order, in pairs, these in pairs, and so on, whatever the blocks; on the CPU a block is
one thread.
"""

import functools

import warp as wp

from warp_cloth.kernels.base.options import real_size
from warp_cloth.kernels.base.types import cloth_types

SUMMED = 256  # values that a block sums in pairs, and its threads on a GPU; of more, first those that far apart

# One sum for each of ``values``, as often as they are %(many)d.
_BLOCK_SUMS = """
    const wp::float64* values[%(many)d] = {%(values)s};
    wp::float64 sums[%(many)d] = {};
#if defined(__CUDA_ARCH__)
    __shared__ double of_warp[%(many)d][%(warps)d];
    __syncthreads();
    for (int i = first + (int)threadIdx.x; i < last; i += %(summed)d)
        for (int k = 0; k < %(many)d; ++k) {
            double value;
            if (elsewhere)
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
        double left[%(summed)d] = {};
        for (int i = first; i < last; ++i)
            left[(i - first) %% %(summed)d] += values[k][i];
        for (int apart = 1; apart < %(summed)d && apart < last - first; apart *= 2)
            for (int i = 0; i < %(summed)d; i += 2 * apart)
                left[i] += left[i + apart];
        sums[k] = left[0];
    }
#endif
    return %(answer)s;
"""
_ONE = {"many": 1, "values": "values_0.data", "answer": "sums[0]"}
_TWO = {"many": 2, "values": "values_0.data, values_1.data", "answer": "{sums[0], sums[1]}"}
_BLOCK = {"summed": SUMMED, "warps": SUMMED // 32}

_MEET = """
#if defined(__CUDA_ARCH__)
    __syncthreads();
    if (blocks > 1 && threadIdx.x == 0) {
        asm volatile("red.release.gpu.global.add.s32 [%0], 1;" :: "l"(came.data) : "memory");
        int now;
        do  // which leaves the core's cache to others
            asm volatile("ld.relaxed.gpu.global.s32 %0, [%1];" : "=r"(now) : "l"(came.data) : "memory");
        while (now < meetings * blocks);
    }
    __syncthreads();
#endif
"""

_FRESH = """
    wp::vec_t<6, %(real)s> six;
    const %(real)s* source = &array.data[2 * vertex].c[0];
#if defined(__CUDA_ARCH__)
    if (elsewhere) {
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
_IN_ORDER = """
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

_TOGETHER = """
#if defined(__CUDA_ARCH__)
    return 32;
#else
    return 1;
#endif
"""

_SINGLE = {"real": "wp::float32", "kind": "f32", "letter": "f"}
_DOUBLE = {"real": "wp::float64", "kind": "f64", "letter": "d"}


@wp.struct
class Parts:
    """V vertices of G garments in P parts, each of one garment."""

    first: wp.array(dtype=wp.int32)  # vertex of each part, shape [P + 1]
    garment: wp.array(dtype=wp.int32)  # of each part, shape [P]
    start: wp.array(dtype=wp.int32)  # the first part of each garment, shape [G + 1]
    dot: wp.array(dtype=wp.float64)  # what is summed, shape [V]


@wp.func_native(_BLOCK_SUMS % (_ONE | _BLOCK))
def block_sum(values_0: wp.array(dtype=wp.float64), first: int, last: int, elsewhere: bool) -> wp.float64:
    """Sum of these values; all threads of the block ask. ``elsewhere``: other blocks wrote them in this launch."""
    ...


@wp.func_native(_BLOCK_SUMS % (_TWO | _BLOCK))
def two_block_sums(
    values_0: wp.array(dtype=wp.float64), values_1: wp.array(dtype=wp.float64), first: int, last: int, elsewhere: bool
) -> wp.vec2d:
    """As ``block_sum``, of both."""
    ...


@wp.func_native(_MEET)
def meet_blocks(came: wp.array(dtype=wp.int32), blocks: int, meetings: int):
    """Until so many blocks have met so many times; all must have room on the GPU at once.

    What others have written since is to be read as ``fresh`` or ``elsewhere``: a core's own cache may hold what was.
    """
    ...


@wp.func
def totals(
    parts: Parts,
    sums: wp.array(dtype=wp.float64),
    others: wp.array(dtype=wp.float64),
    garment: int,
    elsewhere: bool,
):
    """Both sums of a garment's parts' sums; all threads of the block ask."""
    return two_block_sums(sums, others, parts.start[garment], parts.start[garment + 1], elsewhere)


@wp.func
def sum_part(parts: Parts, part: int, lane: int, sum_out: wp.array(dtype=wp.float64)):
    """Sums what the block has left in ``dot`` of a part; all its threads ask."""
    sum = block_sum(parts.dot, parts.first[part], parts.first[part + 1], False)
    if lane == 0:
        sum_out[part] = sum


@wp.func
def ratio(
    parts: Parts,
    above: wp.array(dtype=wp.float64),
    below: wp.array(dtype=wp.float64),
    garment: int,
    elsewhere: bool,
):
    """Of a garment's two totals, or nothing where the second is not above zero."""
    both = totals(parts, above, below, garment, elsewhere)
    result = wp.float64(0.0)
    if both[1] > wp.float64(0.0):
        result = both[0] / both[1]
    return result


def _words(precision: str) -> dict[str, str]:
    """How a number is called in C++ and by a GPU."""
    return _DOUBLE if real_size(precision) == 8 else _SINGLE


@functools.cache
def fresh_function(precision: str) -> wp.Function:
    """The function ``fresh``: both vectors of a vertex, which another block may have written in this launch."""
    vec3, vec6 = cloth_types(precision).vec3, cloth_types(precision).vec6

    @wp.func_native(_FRESH % _words(precision))
    def fresh(array: wp.array(dtype=vec3), vertex: int, elsewhere: bool) -> vec6:
        """The vectors 2 vertex and 2 vertex + 1; ``elsewhere``: another block may have written them in this launch."""
        ...

    return fresh


@wp.func_native(_TOGETHER)
def lanes_together() -> int:
    """How many threads go together: so many work on a row, and add in its order."""
    ...


@functools.cache
def order_function(precision: str, kind: type) -> wp.Function:
    """The function ``add_in_order``, of vectors or matrices of this type."""
    how = {**_words(precision), "length": wp.types.type_size(kind)}

    @wp.func_native(_IN_ORDER % how)
    def add_in_order(sum: kind, value: kind, count: int) -> kind:
        """sum and the values of the first so many threads that go together, added one after another."""
        ...

    return add_in_order

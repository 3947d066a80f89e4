"""A thread block and its shared memory, in which a patch of cloth is computed; on the CPU a block is one thread.

A place in that memory is a number of bytes: from its start, or, where its sign bit is set, in the overflow array, which
serves patches that are too large. On the CPU all are in that array.
"""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_cloth.kernels.base.options import BLOCK_MEMORY, BLOCK_THREADS
from warp_cloth.kernels.base.types import cloth_types

WARPS = BLOCK_THREADS // 32  # of a block
FEW_PER_CORE = 3  # blocks, where a launch has no more: each thread then has registers for all its values
CACHE_LINE = 128  # [bytes]
OVERFLOW = wp.constant(-2147483648)  # the sign bit

_OWN_MEMORY = """
#if defined(__CUDA_ARCH__)
    __shared__ __align__(16) unsigned char memory[%d];
    return (int)__cvta_generic_to_shared(memory);
#else
    return 0;
#endif
"""

_WAIT = """
#if defined(__CUDA_ARCH__)
    __syncthreads();
#endif
"""

_NO_EARLIER = """
#if defined(__CUDA_ARCH__)
    asm volatile("" ::: "memory");
#endif
"""

_BLOCK = """
#if defined(__CUDA_ARCH__)
    return (int)blockIdx.x;
#else
    return thread;
#endif
"""

_LANE = """
#if defined(__CUDA_ARCH__)
    return (int)threadIdx.x;
#else
    return 0;
#endif
"""

_BLOCK_THREADS = """
#if defined(__CUDA_ARCH__)
    return %s;
#else
    return 1;
#endif
"""

_WARP_SIZE = """
#if defined(__CUDA_ARCH__)
    return 32;
#else
    return 1;
#endif
"""

_SIGNAL = """
#if defined(__CUDA_ARCH__)
    __syncthreads();
    if (threadIdx.x == 0)
        asm volatile("red.release.gpu.global.add.s32 [%0], 1;" :: "l"(counters.data) : "memory");
#endif
"""

_AWAIT = """
    int arrived = 0;
#if defined(__CUDA_ARCH__)
    if (signalling > 0) {
        if (threadIdx.x == 0) {
            int done;
            do  // past the core's own cache
                asm volatile("ld.relaxed.gpu.global.s32 %0, [%1];" : "=r"(done) : "l"(counters.data) : "memory");
            while (done < signalling);
        }
        __syncthreads();
        if (threadIdx.x == blockDim.x - 1)  // nobody waits here for its result
            asm volatile("atom.relaxed.gpu.global.add.s32 %0, [%1], 1;"
                : "=r"(arrived) : "l"(counters.data + 1) : "memory");
    }
#endif
    return arrived;
"""

_LEAVE = """
#if defined(__CUDA_ARCH__)
    if (signalling > 0 && threadIdx.x == blockDim.x - 1 && arrived == waiting - 1) {
        counters.data[0] = 0;
        counters.data[1] = 0;
    }
#endif
"""

_PLACE = """
#if defined(__CUDA_ARCH__)
    void* at_%(place)s = %(overflow)s__cvta_shared_to_generic(%(place)s);
#else
    void* at_%(place)s = overflow.data + (%(place)s & 2147483647);
#endif
    auto* value_at_%(place)s = reinterpret_cast<%(type)s*>(__builtin_assume_aligned(at_%(place)s, %(alignment)d));
"""
_MAY_OVERFLOW = "%(place)s < 0 ? (void*)(overflow.data + (%(place)s & 2147483647)) : "


def _locate(place: str, type: str, alignment: int, fits: bool) -> str:
    """C++ of a pointer to the value at a place: ``value_at_`` and the place's name."""
    overflow = "" if fits else _MAY_OVERFLOW % {"place": place}
    return _PLACE % {"place": place, "type": type, "alignment": alignment, "overflow": overflow}


@functools.cache
def own_memory_function(size: int) -> wp.Function:
    """Function ``own_memory``; ``size``: of that memory [bytes]."""

    @wp.func_native(_OWN_MEMORY % size)
    def own_memory() -> int:
        """Place where the block's shared memory starts."""
        ...

    return own_memory


own_memory = own_memory_function(BLOCK_MEMORY)


@wp.func_native(_WAIT)
def wait_for_block():
    """Barrier: waits until all threads of the block have arrived."""
    ...


@wp.func_native(_NO_EARLIER)
def load_no_earlier():
    """Compiler barrier: no later load moves before it, where its value would occupy registers."""
    ...


@wp.func_native(_BLOCK)
def block_of(thread: int) -> int:
    """Number of a thread's block."""
    ...


@wp.func_native(_LANE)
def lane_of(thread: int) -> int:
    """Number of a thread in its block."""
    ...


@functools.cache
def threads_function(threads: int) -> wp.Function:
    """Function ``block_threads``; ``threads``: their number, known at compile time, or 0: read on the device.

    With a known number threads load more of a large patch at a time. In small patches that only makes kernels longer.
    """

    @wp.func_native(_BLOCK_THREADS % (threads or "(int)blockDim.x"))
    def block_threads() -> int:
        """Threads of a block; on a GPU more than a patch owns vertices."""
        ...

    return block_threads


block_threads = threads_function(0)


@wp.func_native(_WARP_SIZE)
def warp_size() -> int:
    """Threads that run together: a GPU's warp, 1 on the CPU."""
    ...


@wp.func_native(_SIGNAL)
def signal_done(counters: wp.array(dtype=wp.int32)):
    """Signals that all that the block's threads have written may be read; ``counters`` as in ``await_blocks``."""
    ...


@wp.func_native(_AWAIT)
def await_blocks(counters: wp.array(dtype=wp.int32), signalling: int) -> int:
    """Waits until so many blocks have signalled; returns how many waiting blocks arrived before, for ``leave_blocks``.

    A GPU starts blocks in the order of their numbers: those that signal wait for none, and must be the first.
    ``counters`` starts as two zeros. What other blocks have written may be read only from cache lines that nobody has
    read before in the launch: of others a core's own cache may hold old values, and to invalidate it takes as long as
    to load from memory.
    """
    ...


@wp.func_native(_LEAVE)
def leave_blocks(counters: wp.array(dtype=wp.int32), signalling: int, waiting: int, arrived: int):
    """Of ``waiting`` blocks, each of which has called ``await_blocks``, the last resets ``counters`` to zero."""
    ...


_FETCH = """
#if defined(__CUDA_ARCH__)
    const char* start = (const char*)(array.data + first);
    const int size = count * (int)sizeof(*array.data);
#if __CUDA_ARCH__ >= 900
    if (size > 0) {
        const int skew = (int)((unsigned long long)start & 15);
        asm volatile("cp.async.bulk.prefetch.L2.global [%0], %1;" :: "l"(start - skew), "r"(size + skew + 15 & -16));
    }
#else
    if (threadIdx.x >> 5 == warp % (blockDim.x >> 5))
#pragma unroll 1
        for (int at = 128 * (threadIdx.x & 31); at < size; at += 128 * 32)
            asm volatile("prefetch.global.L2 [%0];" :: "l"(start + at));
#endif
#endif
"""

_FETCHES = """
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
    return threadIdx.x == blockDim.x - 32 * (warp + 1);
#else
    return true;
#endif
"""


@wp.func_native(_FETCHES)
def fetches(warp: int) -> bool:
    """Whether a thread must call ``fetch_ahead``: one of a warp, where one instruction prefetches all."""
    ...


for _dtype in (wp.int32, wp.uint64, wp.float32, wp.float64, wp.vec4f, wp.vec4d, wp.vec4i):

    @wp.func_native(_FETCH)
    def fetch_ahead(array: wp.array(dtype=_dtype), first: int, count: int, warp: int):
        """Prefetches elements into the L2 cache, by one of the block's WARPS."""
        ...


@functools.cache
def memory_functions(precision: str, fits: bool) -> SimpleNamespace:
    """Functions ``read_4``, ``read_3``, ``read_2``, ``read_point`` and ``write_4`` to ``write_point``.

    A point's first two coordinates are at one place, the third is at another.

    ``fits``: whether no patch is too large for a block's own memory.
    """
    types = cloth_types(precision)
    real = "wp::float64" if precision == "float64" else "wp::float32"
    four = _accessors(types.vec4, f"wp::vec_t<4, {real}>", 16, fits)
    three = _accessors(types.vec3, f"wp::vec_t<3, {real}>", 8 if precision == "float64" else 4, fits)
    two = _accessors(types.vec2, f"wp::vec_t<2, {real}>", 2 * types.real_size, fits)
    points = _point_accessors(types.point, "wp::float32" if precision == "float32" else "wp::float64", fits)
    return SimpleNamespace(
        read_4=four[0],
        write_4=four[1],
        read_3=three[0],
        write_3=three[1],
        read_2=two[0],
        write_2=two[1],
        read_point=points[0],
        write_point=points[1],
    )


def _accessors(dtype: Any, name: str, alignment: int, fits: bool) -> tuple[wp.Function, wp.Function]:
    find = _locate("place", name, alignment, fits)

    @wp.func_native(find + "    return *value_at_place;")
    def read(overflow: wp.array(dtype=wp.uint8), place: int) -> dtype:
        """The value at a place."""
        ...

    @wp.func_native(find + "    *value_at_place = value;")
    def write(overflow: wp.array(dtype=wp.uint8), place: int, value: dtype):
        """Writes the value at a place."""
        ...

    return read, write


def _point_accessors(dtype: Any, real: str, fits: bool) -> tuple[wp.Function, wp.Function]:
    size = 4 if real == "wp::float32" else 8
    find = _locate("place", f"wp::vec_t<2, {real}>", 2 * size, fits) + _locate("third", real, size, fits)

    @wp.func_native(find + "    const auto pair = *value_at_place;\n    return {pair[0], pair[1], *value_at_third};")
    def read(overflow: wp.array(dtype=wp.uint8), place: int, third: int) -> dtype:
        """The point at two places."""
        ...

    @wp.func_native(find + "    *value_at_place = {value[0], value[1]};\n    *value_at_third = value[2];")
    def write(overflow: wp.array(dtype=wp.uint8), place: int, third: int, value: dtype):
        """Writes the point at two places."""
        ...

    return read, write

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

WARPS = BLOCK_THREADS // 32  # of threads that go together
FEW_PER_CORE = 3  # where there are no more at all: threads then keep all in registers
TOLD_APART = 128  # [bytes] that a core's own cache keeps together
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

_TELL = """
#if defined(__CUDA_ARCH__)
    __syncthreads();
    if (threadIdx.x == 0)
        asm volatile("red.release.gpu.global.add.s32 [%0], 1;" :: "l"(told.data) : "memory");
#endif
"""

_AWAIT = """
    int came = 0;
#if defined(__CUDA_ARCH__)
    if (tellers > 0) {
        if (threadIdx.x == 0) {
            int done;
            do  // which leaves the core's cache to others
                asm volatile("ld.relaxed.gpu.global.s32 %0, [%1];" : "=r"(done) : "l"(told.data) : "memory");
            while (done < tellers);
        }
        __syncthreads();
        if (threadIdx.x == blockDim.x - 1)  // whose answer nobody waits for here
            asm volatile("atom.relaxed.gpu.global.add.s32 %0, [%1], 1;"
                : "=r"(came) : "l"(told.data + 1) : "memory");
    }
#endif
    return came;
"""

_LEAVE = """
#if defined(__CUDA_ARCH__)
    if (tellers > 0 && threadIdx.x == blockDim.x - 1 && came == waiting - 1) {
        told.data[0] = 0;
        told.data[1] = 0;
    }
#endif
"""

_PLACE = """
#if defined(__CUDA_ARCH__)
    void* at_%(place)s = %(overflow)s__cvta_shared_to_generic(%(place)s);
#else
    void* at_%(place)s = overflow.data + (%(place)s & 2147483647);
#endif
    auto* held_%(place)s = reinterpret_cast<%(type)s*>(__builtin_assume_aligned(at_%(place)s, %(alignment)d));
"""
_MAY_OVERFLOW = "%(place)s < 0 ? (void*)(overflow.data + (%(place)s & 2147483647)) : "


def _found(place: str, type: str, alignment: int, fits: bool) -> str:
    """C++ that finds what is held at a place."""
    overflow = "" if fits else _MAY_OVERFLOW % {"place": place}
    return _PLACE % {"place": place, "type": type, "alignment": alignment, "overflow": overflow}


@functools.cache
def own_memory_function(size: int) -> wp.Function:
    """The function that tells where the block's own memory of so many bytes starts."""

    @wp.func_native(_OWN_MEMORY % size)
    def own_memory() -> int:
        """Place where the block's own memory starts."""
        ...

    return own_memory


own_memory = own_memory_function(BLOCK_MEMORY)


@wp.func_native(_WAIT)
def wait_for_block():
    """Until all threads of the block have come here."""
    ...


@wp.func_native(_NO_EARLIER)
def load_no_earlier():
    """What is read after this a compiler does not ask for before: what comes before needs the registers."""
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
    """The function that tells how many threads a block has; ``threads``: 0, or as many, told when it is compiled.

    Threads that are told go through more of a large patch at a time. In small patches that only makes kernels longer.
    """

    @wp.func_native(_BLOCK_THREADS % (threads or "(int)blockDim.x"))
    def block_threads() -> int:
        """How many threads a block has: more than the patch that it works on owns vertices, on a GPU."""
        ...

    return block_threads


block_threads = threads_function(0)


@wp.func_native(_TELL)
def signal_done(told: wp.array(dtype=wp.int32)):
    """Tells that all that the block's threads have written may be read; ``told`` as of ``await_blocks``."""
    ...


@wp.func_native(_AWAIT)
def await_blocks(told: wp.array(dtype=wp.int32), tellers: int) -> int:
    """Until so many blocks have told; what ``leave_blocks`` is to know.

    A GPU begins blocks in the order of their numbers: tellers, who wait for none, must be the first. ``told`` holds two
    zeros before. What they have written may be read where nobody has read any of its TOLD_APART bytes before in the
    launch: of all else a core's own cache may still hold what was, and to empty that takes as long as to ask memory.
    """
    ...


@wp.func_native(_LEAVE)
def leave_blocks(told: wp.array(dtype=wp.int32), tellers: int, waiting: int, came: int):
    """Of as many blocks as are ``waiting``, each of which has awaited ``tellers``, the last leaves ``told`` at zero."""
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
    if (threadIdx.x >> 5 == turn % (blockDim.x >> 5))
#pragma unroll 1
        for (int at = 128 * (threadIdx.x & 31); at < size; at += 128 * 32)
            asm volatile("prefetch.global.L2 [%0];" :: "l"(start + at));
#endif
#endif
"""

_FETCHES = """
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
    return threadIdx.x == blockDim.x - 32 * (turn + 1);
#else
    return true;
#endif
"""


@wp.func_native(_FETCHES)
def fetches(turn: int) -> bool:
    """Whether a thread has to ``fetch_ahead``: of one of a block's warps, where memory brings all at once, only one."""
    ...


for _dtype in (wp.int32, wp.uint64, wp.float32, wp.float64, wp.vec4f, wp.vec4d, wp.vec4i):

    @wp.func_native(_FETCH)
    def fetch_ahead(array: wp.array(dtype=_dtype), first: int, count: int, turn: int):
        """Has one of the block's WARPS bring so many elements nearer: who reads them later waits less long."""
        ...


@functools.cache
def memory_functions(precision: str, fits: bool) -> SimpleNamespace:
    """Functions ``read_4``, ``read_3``, ``read_2``, ``read_point`` and as many that write.

    A point's first two coordinates are in one place, the third is in another.

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
    find = _found("place", name, alignment, fits)

    @wp.func_native(find + "    return *held_place;")
    def read(overflow: wp.array(dtype=wp.uint8), place: int) -> dtype:
        """What is kept at a place."""
        ...

    @wp.func_native(find + "    *held_place = value;")
    def write(overflow: wp.array(dtype=wp.uint8), place: int, value: dtype):
        """Keeps it at a place."""
        ...

    return read, write


def _point_accessors(dtype: Any, real: str, fits: bool) -> tuple[wp.Function, wp.Function]:
    size = 4 if real == "wp::float32" else 8
    find = _found("place", f"wp::vec_t<2, {real}>", 2 * size, fits) + _found("third", real, size, fits)

    @wp.func_native(find + "    const auto pair = *held_place;\n    return {pair[0], pair[1], *held_third};")
    def read(overflow: wp.array(dtype=wp.uint8), place: int, third: int) -> dtype:
        """The point that is kept at two places."""
        ...

    @wp.func_native(find + "    *held_place = {value[0], value[1]};\n    *held_third = value[2];")
    def write(overflow: wp.array(dtype=wp.uint8), place: int, third: int, value: dtype):
        """Keeps it there."""
        ...

    return read, write

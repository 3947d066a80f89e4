"""Elements of arrays, without the support of Warp's own indexing for negative indices and strides.

That takes more instructions than the arithmetic on what is read. On a GPU vectors of four are read by one load.
"""

from typing import Any

import warp as wp

_ELEMENT = "return array.data[index];"
_ALIGNED = "return *reinterpret_cast<decltype(array.data)>(__builtin_assume_aligned(array.data + index, 16));"
_PUT = "array.data[index] = value;"
_PUT_ALIGNED = "*reinterpret_cast<decltype(array.data)>(__builtin_assume_aligned(array.data + index, 16)) = value;"
_ADD = """
    auto& sum = array.data[index];
#if defined(__CUDA_ARCH__)
    wp::atomic_add(&sum, value);
#else
    for (int k = 0; k < 4; ++k)
        sum[k] += value[k];
#endif
"""


_SINGLE = (wp.int32, wp.uint64, wp.float32, wp.float64, wp.vec2f, wp.vec2d, wp.vec2i, wp.vec3f, wp.vec3d, wp.vec3i)
_FOURS = (wp.vec4i, wp.vec4f, wp.vec4d)

for _dtype in _SINGLE + _FOURS:

    @wp.func_native(_ALIGNED if _dtype in _FOURS else _ELEMENT)
    def element(array: wp.array(dtype=_dtype), index: int) -> _dtype:
        """An element."""
        return array[index]


for _dtype in (wp.float32, wp.float64, wp.vec3f, wp.vec3d, wp.vec4f, wp.vec4d):

    @wp.func_native(_PUT_ALIGNED if _dtype in _FOURS else _PUT)
    def put(array: wp.array(dtype=_dtype), index: int, value: _dtype):
        """Writes an element."""
        array[index] = value


for _dtype in (wp.vec4f, wp.vec4d):

    @wp.func_native(_ADD)
    def add_to(array: wp.array(dtype=_dtype), index: int, value: _dtype):
        """Adds to an element."""
        array[index] += value


@wp.func
def permuted(order: wp.array(dtype=wp.int32), index: int) -> int:
    """order[index]; the index itself where ``order`` is empty."""
    number = index
    if order.shape[0] > 0:
        number = element(order, index)
    return number


@wp.func
def position_of(state: Any, vertex: int):
    """Position of a vertex [m], in float64 whatever type positions are stored in; ``state`` of types.cloth_types."""
    return wp.vec3d(element(state.position, vertex))

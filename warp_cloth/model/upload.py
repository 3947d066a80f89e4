"""Upload of many garments' arrays, concatenated: an array that several garments share is sent to the device once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.base.threads import concatenate
from warp_cloth.base.warp_setup import keeping_kernels
from warp_cloth.kernels.base.concatenate import join_pieces

WORD = 4  # bytes
MOST_DISTINCT = 0.8  # fraction of the arrays that are distinct, up to which the device concatenates them
MOST_WORDS = (1 << 31) - 1  # of 32-bit indices


def upload_concatenated(
    arrays: Sequence[NDArray[Any]],
    dtype: Any,
    device: str,
    starts: Sequence[int] | None = None,
    *,
    signed: bool = False,
    more: int = 0,
) -> wp.array:
    """Concatenates arrays of rows on a device.

    Args:
        arrays: each of rows of the dtype; the same object may occur several times.
        dtype: Warp's, of a multiple of four bytes.
        device: Warp's name of it.
        starts: offsets, added to the numbers of each array.
        signed: whether offsets are subtracted from negative numbers.
        more: number of rows of zeros appended.
    """
    distinct = {id(array): array for array in arrays}
    lengths = np.array([len(array) for array in arrays])
    row = wp.types.type_size_in_bytes(dtype) // WORD
    rows = int(lengths.sum()) + more
    if rows * row > MOST_WORDS or not _device_is_faster(len(distinct), len(arrays), device):
        return _concatenate_on_host(arrays, dtype, device, starts, signed, more)
    return _concatenate_on_device(list(distinct.values()), arrays, lengths, dtype, device, starts, signed, more)


def _device_is_faster(distinct: int, count: int, device: str) -> bool:
    """Whether arrays with so many distinct ones are concatenated faster on the device: copies to it take longest."""
    return distinct <= MOST_DISTINCT * count and bool(wp.get_device(device).is_cuda)


def _concatenate_on_host(
    arrays: Sequence[NDArray[Any]],
    dtype: Any,
    device: str,
    starts: Sequence[int] | None,
    signed: bool,
    more: int,
) -> wp.array:
    """Concatenates on the host, then uploads."""
    if signed and starts is not None:
        shifted = zip(arrays, np.asarray(starts, dtype=arrays[0].dtype), strict=False)
        arrays, starts = [np.where(array < 0, array - start, array + start) for array, start in shifted], None
    rows = concatenate(arrays, starts)
    if more:
        rows = np.concatenate([rows, np.zeros_like(rows, shape=(more, *rows.shape[1:]))])
    return wp.array(np.ascontiguousarray(rows), dtype=dtype, device=device)


def _concatenate_on_device(
    distinct: Sequence[NDArray[Any]],
    arrays: Sequence[NDArray[Any]],
    lengths: NDArray[np.int64],
    dtype: Any,
    device: str,
    starts: Sequence[int] | None,
    signed: bool,
    more: int,
) -> wp.array:
    """Uploads each distinct array once, then concatenates on the device."""
    row = wp.types.type_size_in_bytes(dtype) // WORD
    sent = wp.array(np.ascontiguousarray(concatenate(distinct)), dtype=dtype, device=device)
    begin = dict(zip(map(id, distinct), np.cumsum([0, *(len(each) for each in distinct[:-1])]), strict=True))
    segments = np.zeros((len(arrays), 4), dtype=np.int32)
    segments[:, 0] = row * (np.cumsum(lengths) - lengths)
    segments[:, 1] = [row * begin[id(array)] for array in arrays]
    segments[:, 2] = row * lengths
    if starts is not None:
        segments[:, 3] = list(starts)[: len(arrays)]
    count = int(lengths.sum())
    result = wp.empty(count + more, dtype=dtype, device=device)
    if more:
        result[count:].zero_()
    uploaded = wp.array(segments, dtype=wp.vec4i, device=device)
    size = len(arrays), row * int(lengths.max())
    with keeping_kernels():
        wp.launch(join_pieces, dim=size, inputs=[_words(sent), uploaded, int(signed), _words(result)], device=device)
    return result


def _words(array: wp.array) -> wp.array:
    """The same memory as 32-bit integers."""
    count = wp.types.type_size_in_bytes(array.dtype) // WORD * len(array)
    return wp.array(ptr=array.ptr, dtype=wp.int32, shape=count, device=array.device, copy=False)

"""Arrays of many garments end to end on a device: what several garments have alike is sent there once."""

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
WORTH = 0.8  # share of the arrays that are different, below which they are put end to end on the device
MOST_WORDS = (1 << 31) - 1  # that a kernel tells apart


def joined(
    arrays: Sequence[NDArray[Any]],
    dtype: Any,
    device: str,
    starts: Sequence[int] | None = None,
    *,
    signed: bool = False,
    more: int = 0,
) -> wp.array:
    """Arrays of one kind one after another on a device, and so many rows of zeros ``more``.

    Args:
        arrays: each of rows of the dtype; the same object may come several times.
        dtype: Warp's, of four bytes or a multiple.
        device: Warp's name of it.
        starts: are added to each array's numbers.
        signed: whether they are taken away from negative ones.
        more: rows.
    """
    distinct = {id(array): array for array in arrays}
    lengths = np.array([len(array) for array in arrays])
    row = wp.types.type_size_in_bytes(dtype) // WORD
    rows = int(lengths.sum()) + more
    if rows * row > MOST_WORDS or not _worth_while(len(distinct), len(arrays), device):
        return _joined_here(arrays, dtype, device, starts, signed, more)
    return _joined_there(list(distinct.values()), arrays, lengths, dtype, device, starts, signed, more)


def _worth_while(distinct: int, count: int, device: str) -> bool:
    """Whether so many different ones of so many arrays are better put end to end on the device: memory is far there."""
    return distinct <= WORTH * count and bool(wp.get_device(device).is_cuda)


def _joined_here(
    arrays: Sequence[NDArray[Any]],
    dtype: Any,
    device: str,
    starts: Sequence[int] | None,
    signed: bool,
    more: int,
) -> wp.array:
    """Put end to end on the host."""
    if signed and starts is not None:
        shifted = zip(arrays, np.asarray(starts, dtype=arrays[0].dtype), strict=False)
        arrays, starts = [np.where(array < 0, array - start, array + start) for array, start in shifted], None
    rows = concatenate(arrays, starts)
    if more:
        rows = np.concatenate([rows, np.zeros_like(rows, shape=(more, *rows.shape[1:]))])
    return wp.array(np.ascontiguousarray(rows), dtype=dtype, device=device)


def _joined_there(
    distinct: Sequence[NDArray[Any]],
    arrays: Sequence[NDArray[Any]],
    lengths: NDArray[np.int64],
    dtype: Any,
    device: str,
    starts: Sequence[int] | None,
    signed: bool,
    more: int,
) -> wp.array:
    """Sent there once each, and put end to end there."""
    row = wp.types.type_size_in_bytes(dtype) // WORD
    sent = wp.array(np.ascontiguousarray(concatenate(distinct)), dtype=dtype, device=device)
    begin = dict(zip(map(id, distinct), np.cumsum([0, *(len(each) for each in distinct[:-1])]), strict=True))
    pieces = np.zeros((len(arrays), 4), dtype=np.int32)
    pieces[:, 0] = row * (np.cumsum(lengths) - lengths)
    pieces[:, 1] = [row * begin[id(array)] for array in arrays]
    pieces[:, 2] = row * lengths
    if starts is not None:
        pieces[:, 3] = list(starts)[: len(arrays)]
    count = int(lengths.sum())
    found = wp.empty(count + more, dtype=dtype, device=device)
    if more:
        found[count:].zero_()
    told = wp.array(pieces, dtype=wp.vec4i, device=device)
    size = len(arrays), row * int(lengths.max())
    with keeping_kernels():
        wp.launch(join_pieces, dim=size, inputs=[_words(sent), told, int(signed), _words(found)], device=device)
    return found


def _words(array: wp.array) -> wp.array:
    """The same memory as whole numbers of four bytes."""
    count = wp.types.type_size_in_bytes(array.dtype) // WORD * len(array)
    return wp.array(ptr=array.ptr, dtype=wp.int32, shape=count, device=array.device, copy=False)

"""Ordered reduction: garments in chunks, a thread block each (kernels.base.reduction); launches by block and warp."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.base.compiling import in_blocks
from warp_cloth.kernels.base.reduction import REDUCTION_WIDTH, Chunks

WARP = 32  # threads that run together, on a GPU
ROWS = 4  # that a block works on, a warp each
MOST_CHUNKS = 1_024  # of a garment: every block that needs a garment's sum adds them all


def split_into_chunks(starts: NDArray[np.integer[Any]], size: int, device: str) -> Any:
    """Chunks of at most ``size`` vertices, of more where a garment would have over MOST_CHUNKS.

    ``starts`` [G + 1] is the first vertex of each garment: a garment's chunks depend on its own size alone.
    """
    counts = np.diff(starts)
    sizes = size * np.maximum(1, -(-counts // (size * MOST_CHUNKS)))
    first = [np.arange(starts[i], starts[i + 1], sizes[i]) for i in range(len(counts))]
    numbers = [len(one) for one in first]
    chunks = Chunks()
    chunks.first = wp.array(np.concatenate([*first, starts[-1:]]), dtype=wp.int32, device=device)
    chunks.garment = wp.array(np.repeat(np.arange(len(counts)), numbers), dtype=wp.int32, device=device)
    chunks.start = wp.array(np.cumsum([0, *numbers]), dtype=wp.int32, device=device)
    chunks.scratch = wp.zeros(int(starts[-1]), dtype=wp.float64, device=device)
    return chunks


def launch_blocks(
    kernel: wp.Kernel, blocks: int, inputs: list[Any], device: str, threads: int = REDUCTION_WIDTH
) -> None:
    """Launches a kernel by thread blocks of so many threads each on a GPU, of one on the CPU."""
    size = threads if wp.get_device(device).is_cuda else 1
    wp.launch(kernel, dim=blocks * size, inputs=inputs, device=device, block_dim=size)


def launch_rows(kernel: wp.Kernel, rows: int, inputs: list[Any], device: str) -> None:
    """Launches a kernel with a warp for every row on a GPU, with a thread on the CPU."""
    lanes = WARP if wp.get_device(device).is_cuda else 1
    wp.launch(kernel, dim=rows * lanes, inputs=inputs, device=device, block_dim=ROWS * lanes)


def in_rows(kernel: wp.Kernel) -> wp.Kernel:
    """A kernel that ``launch_rows`` launches, compiled for its blocks."""
    return in_blocks(kernel, ROWS * WARP)

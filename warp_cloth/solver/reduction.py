"""Garments in parts that a thread block works on each (kernels.base.reduction)."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.kernels.base.reduction import SUMMED, Parts

TOGETHER = 32  # threads, on a GPU
MOST = 1_024  # parts of a garment: every block that asks for a garment's sum adds them up


def split(starts: NDArray[np.integer[Any]], most: int, device: str) -> Any:
    """Parts of at most so many vertices, more in a garment of very many.

    ``starts`` [G + 1] is the first vertex of each garment: what its parts are hangs on its own size alone.
    """
    sizes = np.diff(starts)
    longest = most * np.maximum(1, -(-sizes // (most * MOST)))
    first = [np.arange(starts[i], starts[i + 1], longest[i]) for i in range(len(sizes))]
    counts = [len(one) for one in first]
    parts = Parts()
    parts.first = wp.array(np.concatenate([*first, starts[-1:]]), dtype=wp.int32, device=device)
    parts.garment = wp.array(np.repeat(np.arange(len(sizes)), counts), dtype=wp.int32, device=device)
    parts.start = wp.array(np.cumsum([0, *counts]), dtype=wp.int32, device=device)
    parts.dot = wp.zeros(int(starts[-1]), dtype=wp.float64, device=device)
    return parts


def launch_blocks(kernel: wp.Kernel, blocks: int, inputs: list[Any], device: str, of: int = SUMMED) -> None:
    """Launches a kernel of so many blocks, each of so many threads on a GPU."""
    threads = of if wp.get_device(device).is_cuda else 1
    wp.launch(kernel, dim=blocks * threads, inputs=inputs, device=device, block_dim=threads)


def launch_rows(kernel: wp.Kernel, rows: int, inputs: list[Any], device: str) -> None:
    """Launches a kernel whose threads go together, on a GPU, to work on so many rows."""
    together = TOGETHER if wp.get_device(device).is_cuda else 1
    wp.launch(kernel, dim=rows * together, inputs=inputs, device=device, block_dim=4 * together)

"""Ordered reduction: garments in chunks, and sums over them in one fixed order."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from warp_cloth.kernels.base.reduction import REDUCTION_WIDTH, Chunks, garment_sums, sum_chunk
from warp_cloth.solver.reduction import MOST_CHUNKS, launch_blocks, split_into_chunks


@wp.kernel
def sum_all(chunks: Chunks, sums: wp.array(dtype=wp.float64), found: wp.array(dtype=wp.float64)):
    for chunk in range(chunks.garment.shape[0]):
        sum_chunk(chunks, chunk, 0, sums)
    for garment in range(found.shape[0]):
        found[garment] = garment_sums(chunks, sums, sums, garment, False)[1]


def in_pairs(values: np.ndarray) -> float:
    """Sum of REDUCTION_WIDTH values in pairs, these in pairs, and so on; of more, first those that far apart."""
    sums = np.zeros(REDUCTION_WIDTH)
    for first in range(0, len(values), REDUCTION_WIDTH):
        row = values[first : first + REDUCTION_WIDTH]
        sums[: len(row)] += row
    while len(sums) > 1:
        sums = sums[0::2] + sums[1::2]
    return float(sums[0])


@pytest.mark.parametrize("sizes", [[1, 700], [REDUCTION_WIDTH, 31, 5 * REDUCTION_WIDTH + 1]])
def test_garments_are_summed_chunk_by_chunk_in_pairs(sizes: list[int]) -> None:
    starts = np.cumsum([0, *sizes])
    chunks = split_into_chunks(starts, REDUCTION_WIDTH, "cpu")
    values = np.random.default_rng(0).standard_normal(starts[-1])
    chunks.scratch.assign(values)
    sums = wp.zeros(len(chunks.garment), dtype=wp.float64, device="cpu")
    found = wp.zeros(len(sizes), dtype=wp.float64, device="cpu")
    launch_blocks(sum_all, 1, [chunks, sums, found], "cpu")
    for garment, first in enumerate(starts[:-1]):
        own = values[first : starts[garment + 1]]
        wanted = np.array([in_pairs(own[i : i + REDUCTION_WIDTH]) for i in range(0, len(own), REDUCTION_WIDTH)])
        assert found.numpy()[garment] == in_pairs(wanted)


def test_a_garment_has_the_same_chunks_both_others_and_no_more_than_a_block_can_sum() -> None:
    few, many = 100, 3 * 64 * MOST_CHUNKS
    alone = split_into_chunks(np.array([0, few]), 64, "cpu")
    both = split_into_chunks(np.array([0, many, many + few]), 64, "cpu")
    start = both.start.numpy()
    assert start[1] <= MOST_CHUNKS
    assert (both.first.numpy()[start[1] :] - many).tolist() == alone.first.numpy().tolist()
    assert both.garment.numpy().tolist() == [0] * start[1] + [1] * 2

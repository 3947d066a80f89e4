"""Parts of garments, and sums over them in one fixed order."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from warp_cloth.kernels.base.reduction import SUMMED, Parts, sum_part, totals
from warp_cloth.solver.reduction import MOST, launch_blocks, split


@wp.kernel
def sum_all(parts: Parts, sums: wp.array(dtype=wp.float64), found: wp.array(dtype=wp.float64)):
    for part in range(parts.garment.shape[0]):
        sum_part(parts, part, 0, sums)
    for garment in range(found.shape[0]):
        found[garment] = totals(parts, sums, sums, garment, False)[1]


def in_pairs(values: np.ndarray) -> float:
    """Sum of SUMMED values in pairs, these in pairs, and so on; of more, first those that far apart."""
    sums = np.zeros(SUMMED)
    for first in range(0, len(values), SUMMED):
        row = values[first : first + SUMMED]
        sums[: len(row)] += row
    while len(sums) > 1:
        sums = sums[0::2] + sums[1::2]
    return float(sums[0])


@pytest.mark.parametrize("sizes", [[1, 700], [SUMMED, 31, 5 * SUMMED + 1]])
def test_garments_are_summed_part_by_part_in_pairs(sizes: list[int]) -> None:
    starts = np.cumsum([0, *sizes])
    parts = split(starts, SUMMED, "cpu")
    values = np.random.default_rng(0).standard_normal(starts[-1])
    parts.dot.assign(values)
    sums = wp.zeros(len(parts.garment), dtype=wp.float64, device="cpu")
    found = wp.zeros(len(sizes), dtype=wp.float64, device="cpu")
    launch_blocks(sum_all, 1, [parts, sums, found], "cpu")
    for garment, first in enumerate(starts[:-1]):
        own = values[first : starts[garment + 1]]
        wanted = np.array([in_pairs(own[i : i + SUMMED]) for i in range(0, len(own), SUMMED)])
        assert found.numpy()[garment] == in_pairs(wanted)


def test_a_garment_has_the_same_parts_beside_others_and_no_more_than_a_block_can_sum() -> None:
    few, many = 100, 3 * 64 * MOST
    alone, beside = split(np.array([0, few]), 64, "cpu"), split(np.array([0, many, many + few]), 64, "cpu")
    start = beside.start.numpy()
    assert start[1] <= MOST
    assert (beside.first.numpy()[start[1] :] - many).tolist() == alone.first.numpy().tolist()
    assert beside.garment.numpy().tolist() == [0] * start[1] + [1] * 2

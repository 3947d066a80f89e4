"""Sorting by counting gives the order that sorting by comparing gives."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from warp_cloth.base import topology
from warp_cloth.base.topology import build_topology, ragged_rows, sorted_unique, stable_argsort


@pytest.mark.parametrize("group", [4, 1 << 15])
@pytest.mark.parametrize("largest", [0, 1, 17, 65_535, 65_536, 2**31 - 1, 2**45])
@pytest.mark.parametrize("count", [0, 1, 5, 3000])
def test_the_order_is_that_of_a_stable_sort(
    count: int, largest: int, group: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(topology, "GROUP", group)
    rng = np.random.default_rng(count)
    for kind in (np.int32, np.int64) if largest < 2**31 else (np.int64,):
        keys = rng.integers(0, largest, count, endpoint=True).astype(kind)
        keys[count // 2 :] = keys[: count - count // 2]
        assert np.array_equal(stable_argsort(keys), np.argsort(keys, kind="stable"))


def test_sorted_keys_are_the_different_ones() -> None:
    keys = np.random.default_rng(0).integers(0, 50, 200)
    assert np.array_equal(sorted_unique(keys), np.unique(keys))
    assert not len(sorted_unique(keys[:0]))


def test_rows_of_owners_hold_their_entries_as_they_stood() -> None:
    start, order = ragged_rows(np.array([2, 0, 2, 2, 0]), 4)
    assert [order[a:b].tolist() for a, b in pairwise(start)] == [[1, 4], [], [0, 2, 3], []]


def test_a_layer_sewn_to_a_tube_leaves_its_openings() -> None:
    """A tube of two rings of twelve, and a flap on one of its lines from rim to rim."""
    count, rows = 12, 3
    at = np.arange(count * rows).reshape(rows, count)
    a, b, c, d = at[:-1], np.roll(at, -1, axis=1)[:-1], np.roll(at, -1, axis=1)[1:], at[1:]
    tube = np.concatenate([np.stack([a, b, c], axis=-1).reshape(-1, 3), np.stack([a, c, d], axis=-1).reshape(-1, 3)])
    seam, free = at[:, 0], at.size + np.arange(rows)
    flap = [(seam[k], free[k], free[k + 1]) for k in range(rows - 1)]
    flap += [(seam[k], free[k + 1], seam[k + 1]) for k in range(rows - 1)]
    for layer in (np.array(flap), np.array(flap)[:, ::-1]):
        made = build_topology(np.concatenate([layer, tube]).astype(np.int32), at.size + rows)
        assert sorted(sorted(loop.tolist()) for loop in made.boundary_loops) == [at[0].tolist(), at[-1].tolist()]
        rim, joined = 2 * count + rows + 1, rows - 1  # edges of one triangle, and of three
        assert len(made.hinges) == len(made.edges) - rim - joined

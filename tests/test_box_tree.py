"""The tree of boxes: walks find what meets a box, all of it and nothing else, whatever the tree's height."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import warp as wp
from devices import DEVICES

from warp_cloth.contact import box_tree as trees
from warp_cloth.contact.leaf_order import LeafOrder, sheet_order
from warp_cloth.kernels.base.block import block_of, block_threads, lane_of
from warp_cloth.kernels.contact.box_tree import (
    LEAVES,
    WIDTH,
    BoxTree,
    advance_walk,
    boxes_in_range,
    leaf_overlaps,
    lowest_bit,
    may_overlap,
    refit_above,
    refit_groups,
    start_walk,
    store_box,
)

COUNT = 5000  # boxes: five blocks of leaves, the last not full
THREADS = 256
SIZE = 0.02  # of a box, in a cube of side 1


@wp.kernel(grid_stride=False)
def box_all(tree: BoxTree, lower: wp.array(dtype=wp.vec3f), upper: wp.array(dtype=wp.vec3f)):
    """Boxes the leaves, and two levels above."""
    thread = wp.tid()
    block = block_of(thread)
    local = lane_of(thread)
    while local < LEAVES:
        place = block * LEAVES + local
        box = tree.leaf[place]
        if box >= 0:
            store_box(tree, 0, place, lower[box], upper[box])
        local += block_threads()
    refit_above(tree, block, lane_of(thread))


@wp.kernel(grid_stride=False)
def box_highest(tree: BoxTree):
    """Boxes the fourth level."""
    refit_groups(tree, 2, 0, tree.first[3] - tree.first[2], lane_of(wp.tid()))


@wp.kernel(grid_stride=False)
def find_all(
    tree: BoxTree,
    lower: wp.array(dtype=wp.vec3f),
    upper: wp.array(dtype=wp.vec3f),
    begin: int,
    end: int,
    vertices: wp.array(dtype=wp.vec2i),
    found_out: wp.array2d(dtype=wp.int32),
):
    """How many boxes of other vertices meet each one, of some leaves, and the sum of their numbers."""
    own = wp.tid()
    walk = advance_walk(tree, start_walk(tree, lower[own], upper[own], begin, end))
    while walk.group >= 0:
        groups = walk.mask_1
        while groups != wp.uint32(0):
            group = WIDTH * walk.group + lowest_bit(groups)
            groups = groups & (groups - wp.uint32(1))
            may = may_overlap(tree, group, lower[own], upper[own])
            mask = leaf_overlaps(tree.bound, vertices, group, lower[own], upper[own], own, -1, may)
            mask = mask & boxes_in_range(begin, end, 0, group)
            while mask != wp.uint32(0):
                found_out[own, 0] = found_out[own, 0] + 1
                found_out[own, 1] = found_out[own, 1] + tree.leaf[WIDTH * group + lowest_bit(mask)]
                mask = mask & (mask - wp.uint32(1))
        walk = advance_walk(tree, walk)


def planted(places: np.ndarray, sheet: np.ndarray, device: str) -> tuple[np.ndarray, np.ndarray]:
    """An order of places by sheet that keeps near what is near, and where in it each sheet begins."""
    order, starts = sheet_order(sheet)
    with wp.ScopedDevice(device):
        there = wp.array(places.astype(np.float32), dtype=wp.vec3f)
        return LeafOrder("mixed", order, starts).ordered(there).numpy(), starts


def boxed(lower: np.ndarray, upper: np.ndarray, order: np.ndarray, device: str) -> tuple[Any, list[wp.array]]:
    """A tree of boxes on a device, and the boxes there."""
    with wp.ScopedDevice(device):
        tree = trees.box_tree(order)
        given = [wp.array(corner.astype(np.float32), dtype=wp.vec3f) for corner in (lower, upper)]
        threads = THREADS if wp.get_device(device).is_cuda else 1
        wp.launch(box_all, dim=trees.block_count(tree) * threads, inputs=[tree, *given], block_dim=threads)
        if tree.levels > 3:
            wp.launch(box_highest, dim=threads, inputs=[tree], block_dim=threads)
    return tree, given


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("most_top", [0, 8])
@pytest.mark.parametrize("some", [(0, COUNT), (1234, 3000)])
def test_walks_find_what_every_pair_finds(
    monkeypatch: pytest.MonkeyPatch, device: str, most_top: int, some: tuple[int, int]
) -> None:
    monkeypatch.setattr(trees, "MOST_TOP", most_top)  # none: even a small tree has a fourth level
    random = np.random.default_rng(7)
    lower = random.uniform(size=(COUNT, 3)).astype(np.float32)
    upper = lower + random.uniform(high=2.0 * SIZE, size=(COUNT, 3)).astype(np.float32)
    order, _ = planted(lower, np.zeros(COUNT, dtype=np.int32), device)
    tree, given = boxed(lower, upper, order, device)
    assert tree.levels == (4 if most_top == 0 else 3)
    count = COUNT // int(WIDTH) * int(WIDTH)  # whole teams
    found = wp.zeros((count, 2), dtype=wp.int32, device=device)
    vertices = random.integers(0, COUNT, size=(len(order), 2)).astype(np.int32)
    theirs = wp.array(vertices, dtype=wp.vec2i, device=device)
    wp.launch(find_all, dim=count, inputs=[tree, *given, *some, theirs, found], device=device, block_dim=64)
    others = vertices[slice(*some)][order[slice(*some)] >= 0]
    asked = order[slice(*some)]
    asked = asked[asked >= 0]
    expected = np.zeros((count, 2), dtype=np.int32)
    for own in range(count):
        meets = ((lower[asked] <= upper[own]) & (upper[asked] >= lower[own])).all(axis=1) & (others != own).all(axis=1)
        expected[own] = meets.sum(), asked[meets].sum()
    assert expected[:, 0].max() > 1
    assert np.array_equal(found.numpy(), expected)


@pytest.mark.parametrize("device", DEVICES)
def test_an_order_keeps_sheets_apart_and_near_what_is_near(device: str) -> None:
    random = np.random.default_rng(3)
    places = random.uniform(size=(9000, 3))
    places[:, 2] = 0.0
    sheet = random.integers(0, 3, size=len(places)).astype(np.int32)
    order, starts = planted(places, sheet, device)
    assert np.array_equal(np.sort(order[order >= 0]), np.arange(len(places)))
    for number in range(3):
        own = order[starts[number] : starts[number + 1]]
        assert (sheet[own[own >= 0]] == number).all()
        groups = own[: (own >= 0).sum() // int(WIDTH) * int(WIDTH)].reshape(-1, int(WIDTH))
        sides = np.ptp(places[groups], axis=1)[:, :2]
        # a group has 32 of some 3,000 places in a square of side 1: halved, it is at most twice as long as wide
        assert sides.max() < 2.5 * np.sqrt(int(WIDTH) / (sheet == number).sum()) * np.sqrt(2.0)

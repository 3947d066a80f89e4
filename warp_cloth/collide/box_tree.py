"""Trees of boxes for what lies near each other: their order, and their memory on the device."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.kernels.box_tree import LEAVES, WIDTH, BoxTree
from warp_cloth.mesh import Indices, Points

MOST_TOP = 8  # groups of the third level that a walk goes through one after another; of more there is a fourth level
CELLS = 16  # bits of a place along each axis


def near_order(places: Points, item: Indices) -> Indices:
    """An order by item, then along a Z curve (Morton 1966), which keeps near what is near; ``places`` [m], [N, 3]."""
    low = places.min(axis=0)
    size = max(float((places - low).max()), np.finfo(np.float64).tiny)
    with np.errstate(invalid="ignore"):  # what is lost may come anywhere
        cells = np.nan_to_num((places - low) * ((2**CELLS - 1) / size)).astype(np.uint64)
    code = np.asarray(item).astype(np.uint64) << np.uint64(3 * CELLS)
    for axis in range(3):
        code |= _spread(cells[:, axis]) << np.uint64(axis)
    return np.argsort(code, kind="stable").astype(np.int32)


def _spread(cells: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Two empty bits between every two of the lowest sixteen."""
    for shift, mask in ((16, 0xFF0000FF), (8, 0xF00F00F00F), (4, 0xC30C30C30C3), (2, 0x249249249249)):
        cells = (cells | (cells << np.uint64(shift))) & np.uint64(mask)
    return cells


def box_tree(order: Indices) -> Any:
    """A tree (kernels.box_tree BoxTree) whose leaves hold what is numbered thus; its boxes are of nothing yet."""
    block, width = int(LEAVES), int(WIDTH)
    count = -(-max(len(order), 1) // block) * block
    groups = [count // width, count // block, -(-count // (block * width))]
    if groups[-1] > MOST_TOP:
        groups.append(-(-groups[-1] // width))
    tree = BoxTree()
    leaf = np.full(count, -1, dtype=np.int32)
    leaf[: len(order)] = order
    tree.leaf = wp.array(leaf, dtype=wp.int32)
    tree.first = wp.array(np.concatenate([[0], np.cumsum(groups)]), dtype=wp.int32)
    tree.levels = len(groups)
    nothing = np.repeat(np.array([np.finfo(np.float32).max, -np.finfo(np.float32).max], dtype=np.float32), 3 * width)
    tree.bound = wp.array(np.tile(nothing, sum(groups)), dtype=wp.float32)
    return tree


def in_teams(order: Indices) -> Indices:
    """The same with -1 behind it, so that every team has all its threads."""
    return np.pad(order, (0, -len(order) % int(WIDTH)), constant_values=-1)


def block_count(tree: Any) -> int:
    """Thread blocks that box a tree's leaves."""
    return int(tree.leaf.size) // int(LEAVES)

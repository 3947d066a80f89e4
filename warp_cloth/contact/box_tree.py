"""Box trees (BVHs) and candidate lists: their memory on the device."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from warp_cloth.base.mesh import Indices
from warp_cloth.kernels.contact.box_tree import LEAVES, WIDTH, BoxTree
from warp_cloth.kernels.contact.broad_phase import COUNTER_STRIDE, LEAF_LISTS, Candidates

MOST_TOP = 8  # groups of the highest level, which a traversal visits one after another; more get a fourth level


def box_tree(order: Indices) -> Any:
    """A tree (kernels.contact.box_tree BoxTree) of leaves in an order of ``leaf_order``; its boxes are empty."""
    block, width, count = int(LEAVES), int(WIDTH), len(order)
    groups = [count // width, count // block, -(-count // (block * width))]
    if groups[-1] > MOST_TOP:
        groups.append(-(-groups[-1] // width))
    tree = BoxTree()
    tree.leaf = wp.array(order, dtype=wp.int32)
    tree.first = wp.array(np.concatenate([[0], np.cumsum(groups)]), dtype=wp.int32)
    tree.levels = len(groups)
    nothing = np.repeat(np.array([np.finfo(np.float32).max, -np.finfo(np.float32).max], dtype=np.float32), 3 * width)
    tree.bound = wp.array(np.tile(nothing, sum(groups)), dtype=wp.float32)
    return tree


def block_count(tree: Any) -> int:
    """Thread blocks that refit a tree's leaves."""
    return int(tree.leaf.size) // int(LEAVES)


def candidate_lists(groups: int, leaves: int) -> Any:
    """Empty lists (kernels.contact.broad_phase Candidates) of these capacities."""
    candidates = Candidates()
    candidates.count = wp.zeros((1 + int(LEAF_LISTS)) * int(COUNTER_STRIDE), dtype=wp.int32)
    candidates.group = wp.empty(groups, dtype=wp.vec3i)
    candidates.leaf = wp.empty(leaves, dtype=wp.vec2i)
    return candidates

"""Trees of boxes for what lies near each other: their memory on the device, and that of what meets."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from warp_cloth.base.mesh import Indices
from warp_cloth.kernels.contact.box_tree import LEAVES, WIDTH, BoxTree
from warp_cloth.kernels.contact.broad_phase import APART, PARTS, Meetings

MOST_TOP = 8  # groups of the third level that a walk goes through one after another; of more there is a fourth level


def box_tree(order: Indices) -> Any:
    """A tree (kernels.contact.box_tree BoxTree) of leaves in an order of planting's; its boxes are of nothing yet."""
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
    """Thread blocks that box a tree's leaves."""
    return int(tree.leaf.size) // int(LEAVES)


def lists_of(groups: int, leaves: int) -> Any:
    """Lists (kernels.contact.broad_phase Meetings) of so much room."""
    meetings = Meetings()
    meetings.count = wp.zeros((1 + int(PARTS)) * int(APART), dtype=wp.int32)
    meetings.group = wp.empty(groups, dtype=wp.vec3i)
    meetings.leaf = wp.empty(leaves, dtype=wp.vec2i)
    return meetings

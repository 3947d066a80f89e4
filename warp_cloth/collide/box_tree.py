"""Trees of boxes for what lies near each other: their order, their memory on the device, and that of what meets."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.kernels.box_tree import LEAVES, WIDTH, BoxTree
from warp_cloth.kernels.meeting import APART, PARTS, Meetings
from warp_cloth.mesh import Indices, Points

MOST_TOP = 8  # groups of the third level that a walk goes through one after another; of more there is a fourth level


def near_order(places: Points, sheet: Indices) -> tuple[Indices, Indices]:
    """An order by sheet in which what is near stays together, and where in it each sheet begins; then its length.

    ``places`` [m], shape [N, 3]. Every sheet fills whole blocks of leaves: where it has no more, -1 stands.
    """
    block = int(LEAVES)
    counts = np.bincount(sheet)
    starts = np.concatenate([[0], np.cumsum(-(-counts // block) * block)])
    order = np.full(starts[-1], -1, dtype=np.int32)
    by_sheet = np.split(np.argsort(sheet, kind="stable"), np.cumsum(counts)[:-1])
    for start, part in zip(starts, by_sheet, strict=False):
        order[start : start + len(part)] = part[_halved(np.ascontiguousarray(places[part].T, dtype=np.float32))]
    return order, starts.astype(np.int32)


def _halved(places: NDArray[np.float32]) -> NDArray[np.int64]:
    """An order of places: halved across their longest side, each half so again (Bentley 1975), down to groups.

    Larger halves are of whole blocks of leaves. ``places`` [m], shape [3, N]: numpy goes along rows far faster.
    """
    block, count = int(LEAVES), places.shape[1]
    order = np.arange(count)
    halves = [(0, count)]
    while halves:
        first, last = halves.pop()
        blocks = -(-(last - first) // block)
        if blocks > 1:
            here = places.take(order[first:last], axis=1)
            along = here[np.ptp(here, axis=1).argmax()]
            half = (blocks + 1) // 2 * block
            order[first:last] = order[first:last][np.argpartition(along, half)]
            halves += [(first, first + half), (first + half, last)]
    # what fills the last block comes last in every half
    number = np.arange(-(-count // block) * block)
    here = places.take(order[np.minimum(number, count - 1)], axis=1)
    size = block
    while size > int(WIDTH):
        apart = here.reshape(3, -1, size)
        longest = np.ptp(apart, axis=2).argmax(axis=0)
        along = apart[longest, np.arange(len(longest))]
        along[number.reshape(-1, size) >= count] = np.inf
        halved = (np.argpartition(along, size // 2, axis=1) + size * np.arange(len(along))[:, None]).ravel()
        here, number = here.take(halved, axis=1), number[halved]
        size //= 2
    return np.asarray(order[number[number < count]])


def box_tree(order: Indices) -> Any:
    """A tree (kernels.box_tree BoxTree) of ``near_order``'s leaves; its boxes are of nothing yet."""
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
    """Lists (kernels.meeting Meetings) of so much room."""
    meetings = Meetings()
    meetings.count = wp.zeros((1 + int(PARTS)) * int(APART), dtype=wp.int32)
    meetings.group = wp.empty(groups, dtype=wp.vec3i)
    meetings.leaf = wp.empty(leaves, dtype=wp.vec2i)
    return meetings

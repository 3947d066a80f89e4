"""Leaf order of the box trees: a spatial order, computed on the device."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from warp_cloth.base.mesh import Indices
from warp_cloth.kernels.contact.arrays import REGIONS
from warp_cloth.kernels.contact.box_tree import EMPTY_BOUND, LEAVES, WIDTH
from warp_cloth.kernels.contact.leaf_order import locate_kernel, rank_leaves, span_segments, store_leaves


def sheet_order(sheet: Indices) -> tuple[Indices, Indices]:
    """An order by sheet, and where in it each sheet begins; the last start is the order's length.

    Every sheet fills whole blocks of leaves, padded with -1.
    """
    block = int(LEAVES)
    counts = np.bincount(sheet)
    starts = np.concatenate([[0], np.cumsum(-(-counts // block) * block)])
    order = np.full(starts[-1], -1, dtype=np.int32)
    by_sheet = np.split(np.argsort(sheet, kind="stable"), np.cumsum(counts)[:-1])
    for start, part in zip(starts, by_sheet, strict=False):
        order[start : start + len(part)] = part
    return order, starts.astype(np.int32)


def halvings(starts: Indices) -> list[Indices]:
    """For each round of halving, the segment of each group of leaves.

    Halves of more than a block of leaves consist of whole blocks. ``starts`` of ``sheet_order``.
    """
    block, width = int(LEAVES), int(WIDTH)
    rounds: list[Indices] = []
    ends = np.unique(np.asarray(starts) // block)
    while len(ends) - 1 < ends[-1]:
        rounds.append(np.repeat(np.arange(len(ends) - 1, dtype=np.int32), np.diff(ends) * (block // width)))
        ends = np.unique([*ends, *(ends[:-1] + (np.diff(ends) + 1) // 2)])
    groups = np.arange(ends[-1] * (block // width), dtype=np.int32)
    while block > width:
        rounds.append(groups // (block // width))
        block //= 2
    return rounds


class LeafOrder:
    """Orders the leaves by where they are.

    The order affects the search's speed, and which of two equally distant triangles a vertex is moved away from.
    """

    def __init__(self, precision: str, order: Indices, starts: Indices) -> None:
        """``order`` and ``starts`` of ``sheet_order``, of all trees one after another; on Warp's default device."""
        self._first = wp.array(order, dtype=wp.int32)
        self._rounds = [wp.array(segment, dtype=wp.int32) for segment in halvings(starts)]
        self._locate = locate_kernel(precision)

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that this launches."""
        return [self._locate, span_segments, rank_leaves, store_leaves]

    def ordered(self, place: wp.array) -> wp.array:
        """The order for leaves at these places [m], shape [leaves]: halved repeatedly across the longest side."""
        device, count = place.device, len(self._first)
        groups = count // int(WIDTH)
        order = wp.empty(2 * count, dtype=wp.int32, device=device)  # the sort uses the second half as scratch
        key = wp.empty(2 * count, dtype=wp.int64, device=device)
        wp.copy(order, self._first)
        spans = wp.full((len(self._rounds), groups, 6), float(EMPTY_BOUND), dtype=wp.float32, device=device)
        for number, segment in enumerate(self._rounds):
            read = [order, place, segment, spans[number]]
            wp.launch(span_segments, dim=count, inputs=read, device=device)
            wp.launch(rank_leaves, dim=count, inputs=[*read, key], device=device)
            wp.utils.radix_sort_pairs(key, order, count, 0, 32 + groups.bit_length())
        return order[:count]

    def apply(self, state: Any, search: Any, contact: Any) -> None:
        """Orders the trees' leaves, and assigns vertices to regions. Does not wait for the device."""
        device, vertices = self._first.device, len(search.vertex)
        leaves = len(search.triangles) + len(search.edges) + len(contact.bounds.region)
        place = wp.empty(leaves, dtype=wp.vec3f, device=device)
        wp.launch(self._locate, dim=leaves, inputs=[state, search, place], device=device)
        size = int(WIDTH)
        while vertices // size >= REGIONS:
            size *= 2
        read = [self.ordered(place), search, contact, size]
        wp.launch(store_leaves, dim=len(self._first), inputs=read, device=device)
        contact.bounds.region_count = 1 + -(-vertices // size)

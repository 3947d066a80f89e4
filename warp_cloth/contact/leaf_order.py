"""Plants the trees of cloth on cloth on the device: puts their leaves in an order that keeps near what is near."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from warp_cloth.base.mesh import Indices
from warp_cloth.kernels.contact.arrays import REGIONS
from warp_cloth.kernels.contact.box_tree import FAR_OFF, LEAVES, WIDTH
from warp_cloth.kernels.contact.leaf_order import locate_kernel, plant_leaves, rank_leaves, span_segments


def first_order(sheet: Indices) -> tuple[Indices, Indices]:
    """An order by sheet, and where in it each sheet begins; then its length.

    Every sheet fills whole blocks of leaves: where it has no more, -1 stands.
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
    """Round by round the segment that each group of leaves belongs to: one that is halved next, or small already.

    Halves of more than a block of leaves are of whole blocks. ``starts`` of ``first_order``.
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


class Planting:
    """Orders the leaves of what is searched by where they are.

    That changes the search's speed, and which of two crossings that are equally far is undone.
    """

    def __init__(self, precision: str, order: Indices, starts: Indices) -> None:
        """``order`` and ``starts`` of ``first_order``, of all trees end to end; on Warp's default device."""
        self._first = wp.array(order, dtype=wp.int32)
        self._rounds = [wp.array(segment, dtype=wp.int32) for segment in halvings(starts)]
        self._locate = locate_kernel(precision)

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that planting launches."""
        return [self._locate, span_segments, rank_leaves, plant_leaves]

    def ordered(self, place: wp.array) -> wp.array:
        """The order where leaves are at these places [m], shape [leaves]: halved across the longest side, and again."""
        device, count = place.device, len(self._first)
        groups = count // int(WIDTH)
        order = wp.empty(2 * count, dtype=wp.int32, device=device)  # sorting needs as much room beside what it sorts
        rank = wp.empty(2 * count, dtype=wp.int64, device=device)
        wp.copy(order, self._first)
        spans = wp.full((len(self._rounds), groups, 6), float(FAR_OFF), dtype=wp.float32, device=device)
        for number, segment in enumerate(self._rounds):
            read = [order, place, segment, spans[number]]
            wp.launch(span_segments, dim=count, inputs=read, device=device)
            wp.launch(rank_leaves, dim=count, inputs=[*read, rank], device=device)
            wp.utils.radix_sort_pairs(rank, order, count, 0, 32 + groups.bit_length())
        return order[:count]

    def plant(self, state: Any, search: Any, contact: Any) -> None:
        """Plants the trees where the cloth is, and puts vertices in regions. Does not wait for the device."""
        device, vertices = self._first.device, len(search.vertex)
        leaves = len(search.triangles) + len(search.edges) + len(contact.region)
        place = wp.empty(leaves, dtype=wp.vec3f, device=device)
        wp.launch(self._locate, dim=leaves, inputs=[state, search, place], device=device)
        size = int(WIDTH)
        while vertices // size >= REGIONS:
            size *= 2
        read = [self.ordered(place), search, contact, size]
        wp.launch(plant_leaves, dim=len(self._first), inputs=read, device=device)
        contact.region_count = 1 + -(-vertices // size)

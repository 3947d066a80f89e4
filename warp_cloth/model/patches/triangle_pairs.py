"""Which triangles of a patch a thread works out together, and which of their edges, on the host.

Two triangles that share an edge have four vertices and five edges: whoever works out both reads less of each, and keeps
what it has read. A thread's *item* is such a pair, or a triangle that is left over. The shared edge is the item's, and
of the others up to two, so that every item has about as much to do; edges that no item takes are *loose*.

Threads are told of them in words: three of each item, the first ones of all a patch's items, then the second, then the
third, then one of each loose edge. Where in a word what stands says kernels.base.options. How an edge pulls and bends
a word tells by a number of its patch's different laws, of which regular cloth has few.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices
from warp_cloth.garment.elements import Elements
from warp_cloth.garment.rest import Floats
from warp_cloth.kernels.base.options import (
    BEGIN_BITS,
    CODE_AFTER,
    CODE_BACK,
    CODE_BITS,
    NUMBER_BITS,
    REVERSED_BITS,
    SIDE_AB,
    SLOTS,
    WORD_ACROSS,
    WORD_BEGIN,
    WORD_CODE,
    WORD_LAW,
    WORD_REVERSED,
)
from warp_cloth.model.patches.members import Keys, Members, Numbers, edge_numbers, words

ALONE = 2  # side that stands for the shared one where there is none: the corners are a, b, c then
ROUNDS = 16  # of proposals, after which what is left stays alone
LOW = 0.6  # of a vertex' places each counts so much of the one before, where it is asked which vertex is lower
SHARE = SLOTS - 1  # edges that an item takes besides the one that its triangles share


def find_pairs(partner: Keys, edge: Indices, size: Floats, is_first: NDArray[np.bool_]) -> tuple[Keys, Keys]:
    """Pairs triangles across long sides, as long as there are two that have none yet.

    Returns the first triangle of each triangle's item, and which of its sides a triangle shares, opposite to this
    corner; -1 where it is alone.

    Args:
        partner: triangle across each side, -1 where there is none to pair with, shape [T, 3].
        edge: that each side is, which tells sides of equal size apart.
        size: of each side, the same seen from both triangles.
        is_first: whether a triangle is the first one of each side's hinge.
    """
    rows = np.arange(len(partner))
    alone = np.ones(len(partner) + 1, dtype=bool)
    alone[-1] = False
    side, first = np.full(len(partner), -1), rows.copy()
    for _ in range(ROUNDS):
        asks = np.flatnonzero(alone[:-1])
        free = alone[partner[asks]]
        best = np.where(free, size[asks], -1.0)
        tied = free & (best >= best.max(axis=1, keepdims=True))
        choice = np.argmax(np.where(tied, edge[asks], -1), axis=1)
        asks, choice = asks[free.any(axis=1)], choice[free.any(axis=1)]
        if not len(asks):
            break
        asked = np.full(len(partner), -1)
        asked[asks] = partner[asks, choice]
        agreed = asked[asked[asks]] == asks
        asks, choice = asks[agreed], choice[agreed]
        side[asks], alone[asks] = choice, False
        first[asks] = np.where(is_first[asks, choice], asks, partner[asks, choice])
    return first, side


def share_edges(edge: Keys, item: Keys, edge_count: int, item_count: int) -> Keys:
    """Which item takes an edge as one of its SHARE, -1 where none does; shape [``edge_count``].

    Args:
        edge: of each side of a triangle that is not shared within its item.
        item: that the triangle is of.
    """
    taken = np.full(edge_count, -1)
    room = np.full(item_count, SHARE)
    seen = np.bincount(edge, minlength=edge_count)
    order = np.lexsort((-item, edge))
    choices = np.full((edge_count, 2), -1)
    ranked = edge[order]
    rank = np.arange(len(ranked)) - np.searchsorted(ranked, ranked)
    usual = rank < 2
    choices[ranked[usual], rank[usual]] = item[order][usual]
    for choice in (0, 1):
        wants = np.flatnonzero((taken < 0) & (choices[:, choice] >= 0))
        of = choices[wants, choice]
        by_item = np.lexsort((wants, seen[wants], of))  # who has no other choice comes first
        wants, of = wants[by_item], of[by_item]
        gets = np.arange(len(of)) - np.searchsorted(of, of) < room[of]
        taken[wants[gets]] = of[gets]
        room -= np.bincount(of[gets], minlength=item_count)
    return taken


class Items:
    """Items of the triangles that patches own, and what their threads are told.

    Args:
        elements: of the garment.
        places: where its vertices are, which tells what sides are long, shape [V, 2..3].
        own: the patches' own triangles.
        lane: as which patches count vertices that they own, -1 for others.
    """

    def __init__(self, elements: Elements, places: Floats, own: Members, lane: Callable[[Keys, Numbers], Keys]) -> None:
        self._elements, self._own, self._lane = elements, own, lane
        self._height = places @ LOW ** np.arange(places.shape[1])
        self._edges = edge_numbers(elements.edges[own.element])
        beside = elements.adjacent_triangles[self._edges]
        is_first = beside[..., 0] == own.element[:, None]
        across = np.where(is_first, beside[..., 1], beside[..., 0])
        fold = elements.hinge_stiffness[self._edges]
        # where more than two triangles meet at an edge its hinge is of two of them only
        self._may_take = (beside == own.element[:, None, None]).any(axis=-1) | (fold == 0.0)
        # triangles that are wound likewise, or that no hinge joins, stay alone
        joined = self._may_take & (fold > 0.0)
        partner = np.where(joined, own.member(own.patch[:, None], across), -1)
        ends = places[elements.ends[self._edges]]
        length = np.linalg.norm(ends[..., 0, :] - ends[..., 1, :], axis=-1)
        self._first, side = find_pairs(partner, self._edges, length, is_first)
        self._side = np.where(side < 0, ALONE, side)
        self._paired, self._is_second = side >= 0, self._first != np.arange(len(side))
        self._bent, self._across, self._is_first = fold != 0.0, across, is_first

    def arrange(self, normal: Members, mine: Members) -> Keys:
        """Counts triangles and edges as threads work on them; returns how many items each patch has."""
        self._arrange_triangles(normal)
        self._share_edges(mine)
        return self._count

    def _arrange_triangles(self, normal: Members) -> None:
        """Items' first triangles, those of pairs before others; second ones in the same order; those of no item."""
        own = self._own
        self._count = np.bincount(own.patch[~self._is_second], minlength=len(own.count))
        self._item = self._numbers()[self._first]
        among = own.member(normal.patch, normal.element)
        number = (self._item + self._is_second * self._count[own.patch])[among]
        normal.arrange(np.where(among < 0, self._elements.corners[normal.element].min(axis=1), number), among < 0)

    def _numbers(self) -> Keys:
        """As which each item counts, by its first triangle: as its lowest vertex does, where it may.

        So neighbours lie as their vertices do, and what threads side by side ask for lies in different banks of the
        block's memory. Where several items have the same lowest vertex, or one that the patch does not own, they take
        what is left.
        """
        own, corners = self._own, self._elements.corners
        leads = np.flatnonzero(~self._is_second)
        second = leads.copy()
        second[np.searchsorted(leads, self._first[self._is_second])] = np.flatnonzero(self._is_second)
        around = np.concatenate([corners[own.element[leads]], corners[own.element[second]]], axis=1)
        low = np.take_along_axis(around, np.argmin(self._height[around], axis=1)[:, None], axis=1)[:, 0]
        patch, pair = own.patch[leads], self._paired[leads]
        pairs = np.bincount(patch[pair], minlength=len(own.count))
        wanted = self._lane(patch, low)
        wanted[~pair | (wanted >= pairs[patch])] = -1
        base = np.cumsum(self._count) - self._count
        place = np.where(wanted < 0, -1, base[patch] + wanted)
        order = np.lexsort((low, patch))
        got = order[np.unique(place[order], return_index=True)[1]]
        got = got[place[got] >= 0]
        kept = np.zeros(len(leads), dtype=bool)
        kept[got] = True
        free = np.ones(len(leads), dtype=bool)
        free[place[got]] = False
        left = order[~kept[order]]
        left = left[np.lexsort((~pair[left], patch[left]))]
        place[left] = np.flatnonzero(free)
        number = np.zeros(len(own.patch), dtype=np.int64)
        number[leads] = place - base[patch]
        return number

    def _share_edges(self, mine: Members) -> None:
        """What pairs share, item by item; what else items take, one of each, then the other; then loose edges.

        Where an item takes less, nothing is there.
        """
        own, side = self._own, np.arange(3)
        edge = mine.member(own.patch[:, None], self._edges)
        owner = np.broadcast_to((own.start[own.patch] + self._item)[:, None], edge.shape)
        outer = ((side != self._side[:, None]) | ~self._paired[:, None]) & self._may_take
        taken = share_edges(edge[outer], owner[outer], len(mine.element), len(own.element))
        of, place = np.nonzero(outer & (taken[edge] == owner))
        one_each = np.unique(edge[of, place], return_index=True)[1]
        turn = (place - self._side[of]) % 3
        which = np.where(self._is_second[of], turn + 2, np.where(turn == 0, SIDE_AB, turn))
        order = one_each[np.lexsort((which[one_each], owner[of, place][one_each]))]
        of, place, self._which = of[order], place[order], which[order]
        inner = np.flatnonzero(self._paired & ~self._is_second)

        number = np.full(len(mine.element), -1)
        number[edge[inner, self._side[inner]]] = self._item[inner]
        by_item = owner[of, place]
        slot = 1 + np.arange(len(of)) - np.searchsorted(by_item, by_item)
        number[edge[of, place]] = slot * self._count[own.patch[of]] + self._item[of]
        loose = np.flatnonzero(number < 0)
        loose = loose[np.lexsort((self._elements.ends[mine.element[loose]].min(axis=1), mine.patch[loose]))]
        patch = mine.patch[loose]
        number[loose] = SLOTS * self._count[patch] + np.arange(len(loose)) - np.searchsorted(patch, patch)
        mine.place(number, SLOTS * self._count + np.bincount(patch, minlength=len(own.count)))
        self._taken = of, place

    def words(self, ends: Keys, vertex: Members, normal: Members, mine: Members) -> NDArray[np.uint64]:
        """What threads are told of their items and of loose edges, of which ``ends`` has ends and triangles, shape [E].

        Where the edges are that pairs share, an item's vertices and how they and the taken edges lie; where the first
        of the taken ones are, the other sides of its triangles; where the second ones are, nothing yet (``with_laws``).
        """
        own, elements = self._own, self._elements
        patch, count = own.patch, self._count[own.patch]
        corners, rows = elements.corners[own.element], np.arange(len(patch))
        word = words(ends, NUMBER_BITS)
        at = mine.start[patch] + self._item
        for slot in range(SLOTS):
            word[at + slot * count] = 0
        one, two, alone = ~self._is_second, self._is_second, ~self._paired
        a, b, c = (vertex.find(patch, corners[rows, (self._side + turn) % 3]) for turn in (1, 2, 0))
        for corner, number in enumerate((a, b, c)):
            _put(word, at[one], corner * NUMBER_BITS, number[one])
        _put(word, at[two], 3 * NUMBER_BITS, c[two])

        sides = mine.find(patch[:, None], self._edges)
        others = np.sort((self._side[:, None] + [1, 2]) % 3, axis=1)
        second, place = at + count, 2 * NUMBER_BITS * two
        _put(word, second, place, sides[rows, others[:, 0]])
        _put(word, second, place + NUMBER_BITS, sides[rows, others[:, 1]])
        _put(word, second[alone], 2 * NUMBER_BITS, sides[alone, ALONE])
        _put(word, second, WORD_BEGIN + BEGIN_BITS * two, ALONE - self._side)
        turned = ((elements.edges[own.element] < 0) * np.array([1, 2, 4])).sum(axis=1)
        _put(word, second, WORD_REVERSED + REVERSED_BITS * two, turned)

        of, place = self._taken
        patch, edge = patch[of], self._edges[of, place]
        bent, back = self._bent[of, place], elements.ends[edge, 0] != corners[of, (place + 1) % 3]
        after = bent & ~self._is_first[of, place]
        slot = (mine.find(patch, edge) - self._item[of]) // count[of] - 1
        code = self._which + CODE_BACK * back + CODE_AFTER * after
        _put(word, at[of], WORD_CODE + CODE_BITS * slot, code)
        across = np.where(bent, normal.find(patch, self._across[of, place]), 0)
        _put(word, at[of] + slot * count[of], WORD_ACROSS, across)
        return word


def _put(word: NDArray[np.uint64], at: Keys, bit: Keys | int, number: Keys) -> None:
    """Writes numbers into some words, from a bit on where there is nothing yet; of the same word one after another."""
    np.bitwise_or.at(word, at, number.astype(np.uint64) << np.asarray(bit, dtype=np.uint64))


def with_laws(
    ends: NDArray[np.uint64], patch: dict[str, Keys], law: NDArray[Any]
) -> tuple[NDArray[np.uint64], NDArray[Any], Keys, Keys]:
    """Words that tell by which of its patch's laws each edge pulls and bends, and each patch's different laws.

    A third word of an item has the laws of its edges, that of a loose edge its own.

    Args:
        ends: of all patches, as ``Items.words`` has made them, shape [E].
        patch: of PatchTables.
        law: of each edge, shape [E, 1..4].

    Returns:
        The words, the laws, and each patch's first one and how many it has.
    """
    count = patch["edge_count"]
    of = np.repeat(np.arange(len(count)), count)
    _, alike = np.unique(law.view(f"V{law.dtype.itemsize * law.shape[1]}").ravel(), return_inverse=True)
    keys, first, number = np.unique(of * len(law) + alike, return_index=True, return_inverse=True)
    law_count = np.bincount(keys // max(len(law), 1), minlength=len(count))
    law_start = np.cumsum(law_count) - law_count
    first, rank = np.sort(first), np.argsort(np.argsort(first))  # as edges come: where all differ threads go in step
    number = rank[number] - law_start[of]
    local, items = np.arange(len(of)) - patch["edge_start"][of], patch["item_count"][of]
    slot = np.minimum(local // np.maximum(items, 1), SLOTS)
    slot[items == 0] = SLOTS
    loose = slot == SLOTS
    told = ends.copy()
    third = np.arange(len(of)) + (SLOTS - 1 - slot) * items
    _put(told, np.where(loose, np.arange(len(of)), third), np.where(loose, WORD_LAW, NUMBER_BITS * slot), number)
    return told, law[first], law_start, law_count

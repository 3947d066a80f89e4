"""Which triangles of a patch a thread works out together, and which of their edges (kernels.pairs), on the host.

Two triangles that share an edge have four vertices and five edges: whoever works out both reads less of each, and keeps
what it has read. A thread's *item* is such a pair, or a triangle that is left over. The shared edge is the item's, and
of the others up to two, so that every item has about as much to do; edges that no item takes are *loose*.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.garment.elements import Elements
from warp_cloth.garment.rest import Floats
from warp_cloth.kernels.limits import CODE_AFTER, CODE_BACK, CODE_TURN_0, CODE_TURN_1, SIDE_AB, SLOTS
from warp_cloth.mesh import Indices
from warp_cloth.patches.members import Keys, Members, edge_numbers

ALONE = 2  # side that stands for the shared one where there is none: the corners are a, b, c then
ROUNDS = 16  # of proposals, after which what is left stays alone
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
    """

    def __init__(self, elements: Elements, places: Floats, own: Members) -> None:
        self._elements, self._own = elements, own
        self._edges = edge_numbers(elements.edges[own.element])
        beside = elements.beside[self._edges]
        is_first = beside[..., 0] == own.element[:, None]
        across = np.where(is_first, beside[..., 1], beside[..., 0])
        fold = elements.fold[self._edges]
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
        own, corners = self._own, self._elements.corners
        among = own.member(normal.patch, normal.element)
        kind = np.where(self._is_second, 2, np.where(self._paired, 0, 1))[among]
        leader = np.where(among < 0, normal.element, own.element[self._first][among])
        key = corners[leader].min(axis=1).astype(np.int64) * len(corners) + leader
        normal.arrange(key, np.where(among < 0, 3, kind))
        self._count = np.bincount(own.patch[~self._is_second], minlength=len(own.count))
        self._item = normal.find(own.patch, own.element[self._first])

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

    def put_words(self, word: Keys, vertex: Members, normal: Members, mine: Members) -> None:
        """Writes what threads are told of their items in place of their edges' ends and triangles, shape [E, 4].

        Where the edges are that pairs share, an item's vertices; where taken ones are, their ends, the triangle across
        and what kernels.pairs tells by CODE; with the first of these how the triangles are turned.
        """
        own, elements = self._own, self._elements
        patch, count = own.patch, self._count[own.patch]
        corners, rows = elements.corners[own.element], np.arange(len(patch))
        at = mine.start[patch] + self._item
        for slot in range(SLOTS):
            word[at + slot * count] = 0
        a, b, c = (vertex.find(patch, corners[rows, (self._side + turn) % 3]) for turn in (1, 2, 0))
        turned = (ALONE - self._side) << np.where(self._is_second, CODE_TURN_1, CODE_TURN_0)
        one, two = ~self._is_second, self._is_second
        word[at[one], :3] = np.stack([a, b, c], axis=1)[one]
        word[at[two], 3] = c[two]
        word[(at + count)[one], 3] += turned[one]
        word[(at + count)[two], 3] += turned[two]

        of, place = self._taken
        patch, edge = patch[of], self._edges[of, place]
        at = mine.start[patch] + mine.find(patch, edge)
        ends, bent = elements.ends[edge], self._bent[of, place]
        word[at, :2] = vertex.find(patch[:, None], ends)
        word[at, 2] = np.where(bent, normal.find(patch, self._across[of, place]), 0)
        word[at, 3] += self._which
        word[at, 3] += CODE_BACK * (ends[:, 0] != corners[of, (place + 1) % 3])
        word[at, 3] += CODE_AFTER * (bent & ~self._is_first[of, place])

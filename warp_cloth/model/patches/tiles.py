"""Matching of a patch's triangles into pairs, one thread for each pair and some of its edges, on the host.

Two triangles that share an edge have four vertices and five edges: a thread that computes both loads less for each. A
thread's *tile* is such a pair, or a triangle that is left over. A tile has the shared edge and up to two of the
others, so that all tiles cost about the same; edges that no tile has are *loose*.

Tiles are packed into 64-bit words: three of each tile (the first words of all tiles of a patch, then the second, then
the third), then one word of each loose edge; kernels.base.options has the bits. An edge's constants
(SpringField) are packed as an index into the different ones of its patch, of which regular cloth has few.
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
    WORD_CONSTANTS,
    WORD_REVERSED,
)
from warp_cloth.model.patches.members import Keys, Members, Numbers, edge_numbers, packed_bits

ALONE = 2  # the side used in place of the shared one where there is none: the corners are a, b, c then
ROUNDS = 16  # of proposals; triangles left then stay alone
LOW = 0.6  # weight of a coordinate relative to the one before, where the lower one of two vertices is determined
OUTER_EDGES = SLOTS - 1  # edges of a tile at most, besides the one that its triangles share


def find_pairs(partner: Keys, edge: Indices, size: Floats, is_first: NDArray[np.bool_]) -> tuple[Keys, Keys]:
    """Greedy matching of triangles across their longest sides: each proposes to its best free neighbour.

    Returns the first triangle of each triangle's tile, and the side that a triangle shares, by its opposite corner; -1
    where it is alone.

    Args:
        partner: triangle across each side, -1 where there is none to pair with, shape [T, 3].
        edge: edge of each side, the tie-breaker between sides of equal size.
        size: of each side, the same from both triangles.
        is_first: whether the triangle is the first of the hinge at each side.
    """
    rows = np.arange(len(partner))
    alone = np.ones(len(partner) + 1, dtype=bool)
    alone[-1] = False
    side, first = np.full(len(partner), -1), rows.copy()
    for _ in range(ROUNDS):
        single = np.flatnonzero(alone[:-1])
        free = alone[partner[single]]
        best = np.where(free, size[single], -1.0)
        tied = free & (best >= best.max(axis=1, keepdims=True))
        choice = np.argmax(np.where(tied, edge[single], -1), axis=1)
        single, choice = single[free.any(axis=1)], choice[free.any(axis=1)]
        if not len(single):
            break
        proposal = np.full(len(partner), -1)
        proposal[single] = partner[single, choice]
        agreed = proposal[proposal[single]] == single
        single, choice = single[agreed], choice[agreed]
        side[single], alone[single] = choice, False
        first[single] = np.where(is_first[single, choice], single, partner[single, choice])
    return first, side


def assign_edges(edge: Keys, tile: Keys, edge_count: int, tile_count: int) -> Keys:
    """The tile that takes each edge as one of its OUTER_EDGES, -1 where none does; shape [``edge_count``].

    Args:
        edge: edge of each triangle side that is not shared within its tile.
        tile: tile of that triangle.
    """
    taken = np.full(edge_count, -1)
    slots_left = np.full(tile_count, OUTER_EDGES)
    seen = np.bincount(edge, minlength=edge_count)
    order = np.lexsort((-tile, edge))
    choices = np.full((edge_count, 2), -1)
    ranked = edge[order]
    rank = np.arange(len(ranked)) - np.searchsorted(ranked, ranked)
    usual = rank < 2
    choices[ranked[usual], rank[usual]] = tile[order][usual]
    for choice in (0, 1):
        wants = np.flatnonzero((taken < 0) & (choices[:, choice] >= 0))
        of = choices[wants, choice]
        by_tile = np.lexsort((wants, seen[wants], of))  # edges without another choice come first
        wants, of = wants[by_tile], of[by_tile]
        gets = np.arange(len(of)) - np.searchsorted(of, of) < slots_left[of]
        taken[wants[gets]] = of[gets]
        slots_left -= np.bincount(of[gets], minlength=tile_count)
    return taken


class Tiles:
    """Tiles of the triangles that patches own, and their packed words.

    Args:
        elements: of the garment.
        places: coordinates of its vertices, by which sides are long or short, shape [V, 2..3].
        own: the patches' own triangles.
        lane: local numbers of vertices that patches own, -1 for others.
    """

    def __init__(self, elements: Elements, places: Floats, own: Members, lane: Callable[[Keys, Numbers], Keys]) -> None:
        self._elements, self._own, self._lane = elements, own, lane
        self._height = places @ LOW ** np.arange(places.shape[1])
        self._edges = edge_numbers(elements.edges[own.element])
        adjacent = elements.adjacent_triangles[self._edges]
        is_first = adjacent[..., 0] == own.element[:, None]
        across = np.where(is_first, adjacent[..., 1], adjacent[..., 0])
        fold = elements.hinge_stiffness[self._edges]
        # where more than two triangles meet at an edge, only two of them belong to its hinge
        self._may_take = (adjacent == own.element[:, None, None]).any(axis=-1) | (fold == 0.0)
        # triangles with the same winding along the edge, or without a hinge, stay alone
        joined = self._may_take & (fold > 0.0)
        partner = np.where(joined, own.member(own.patch[:, None], across), -1)
        ends = places[elements.ends[self._edges]]
        length = np.linalg.norm(ends[..., 0, :] - ends[..., 1, :], axis=-1)
        self._first, side = find_pairs(partner, self._edges, length, is_first)
        self._side = np.where(side < 0, ALONE, side)
        self._paired, self._is_second = side >= 0, self._first != np.arange(len(side))
        self._bent, self._across, self._is_first = fold != 0.0, across, is_first

    def arrange(self, normal: Members, local_edges: Members) -> Keys:
        """Numbers triangles and edges as threads work on them; returns the number of tiles of each patch."""
        self._arrange_triangles(normal)
        self._number_edges(local_edges)
        return self._count

    def _arrange_triangles(self, normal: Members) -> None:
        """Numbers the tiles' first triangles, pairs first, then second ones in the same order, then the rest."""
        own = self._own
        self._count = np.bincount(own.patch[~self._is_second], minlength=len(own.count))
        self._tile = self._numbers()[self._first]
        among = own.member(normal.patch, normal.element)
        number = (self._tile + self._is_second * self._count[own.patch])[among]
        normal.arrange(np.where(among < 0, self._elements.corners[normal.element].min(axis=1), number), among < 0)

    def _numbers(self) -> Keys:
        """Local number of each tile, at its first triangle: that of its lowest vertex, where possible.

        So tiles are ordered like their vertices, and neighbouring threads load from different banks of shared memory.
        Where several tiles have the same lowest vertex, or one that the patch does not own, they take the remaining
        numbers.
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
        placed = np.zeros(len(leads), dtype=bool)
        placed[got] = True
        free = np.ones(len(leads), dtype=bool)
        free[place[got]] = False
        left = order[~placed[order]]
        left = left[np.lexsort((~pair[left], patch[left]))]
        place[left] = np.flatnonzero(free)
        number = np.zeros(len(own.patch), dtype=np.int64)
        number[leads] = place - base[patch]
        return number

    def _number_edges(self, local_edges: Members) -> None:
        """Numbers edges: those shared within pairs, by tile; then the tiles' first outer edges, the second; loose ones.

        Where a tile has fewer, its number is unused.
        """
        own, side = self._own, np.arange(3)
        edge = local_edges.member(own.patch[:, None], self._edges)
        owner = np.broadcast_to((own.start[own.patch] + self._tile)[:, None], edge.shape)
        outer = ((side != self._side[:, None]) | ~self._paired[:, None]) & self._may_take
        taken = assign_edges(edge[outer], owner[outer], len(local_edges.element), len(own.element))
        of, place = np.nonzero(outer & (taken[edge] == owner))
        one_each = np.unique(edge[of, place], return_index=True)[1]
        step = (place - self._side[of]) % 3
        which = np.where(self._is_second[of], step + 2, np.where(step == 0, SIDE_AB, step))
        order = one_each[np.lexsort((which[one_each], owner[of, place][one_each]))]
        of, place, self._which = of[order], place[order], which[order]
        inner = np.flatnonzero(self._paired & ~self._is_second)

        number = np.full(len(local_edges.element), -1)
        number[edge[inner, self._side[inner]]] = self._tile[inner]
        by_tile = owner[of, place]
        slot = 1 + np.arange(len(of)) - np.searchsorted(by_tile, by_tile)
        number[edge[of, place]] = slot * self._count[own.patch[of]] + self._tile[of]
        loose = np.flatnonzero(number < 0)
        loose = loose[
            np.lexsort((self._elements.ends[local_edges.element[loose]].min(axis=1), local_edges.patch[loose]))
        ]
        patch = local_edges.patch[loose]
        number[loose] = SLOTS * self._count[patch] + np.arange(len(loose)) - np.searchsorted(patch, patch)
        local_edges.place(number, SLOTS * self._count + np.bincount(patch, minlength=len(own.count)))
        self._taken = of, place

    def packed(self, ends: Keys, vertex: Members, normal: Members, local_edges: Members) -> NDArray[np.uint64]:
        """Words of tiles and loose edges, shape [E]; ``ends``: end vertices and triangles of each edge.

        At the number of a shared edge: the tile's vertices, and the codes of its outer edges. At that of the first
        outer edge: the other sides of its triangles. At that of the second: nothing yet (``with_constants``).
        """
        own, elements = self._own, self._elements
        patch, count = own.patch, self._count[own.patch]
        corners, rows = elements.corners[own.element], np.arange(len(patch))
        word = packed_bits(ends, NUMBER_BITS)
        at = local_edges.start[patch] + self._tile
        for slot in range(SLOTS):
            word[at + slot * count] = 0
        one, two, alone = ~self._is_second, self._is_second, ~self._paired
        a, b, c = (vertex.find(patch, corners[rows, (self._side + step) % 3]) for step in (1, 2, 0))
        for corner, number in enumerate((a, b, c)):
            _put(word, at[one], corner * NUMBER_BITS, number[one])
        _put(word, at[two], 3 * NUMBER_BITS, c[two])

        sides = local_edges.find(patch[:, None], self._edges)
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
        slot = (local_edges.find(patch, edge) - self._tile[of]) // count[of] - 1
        code = self._which + CODE_BACK * back + CODE_AFTER * after
        _put(word, at[of], WORD_CODE + CODE_BITS * slot, code)
        across = np.where(bent, normal.find(patch, self._across[of, place]), 0)
        _put(word, at[of] + slot * count[of], WORD_ACROSS, across)
        return word


def _put(word: NDArray[np.uint64], at: Keys, bit: Keys | int, number: Keys) -> None:
    """Writes numbers into unused bits of words, from ``bit`` on; a word may occur several times in ``at``."""
    np.bitwise_or.at(word, at, number.astype(np.uint64) << np.asarray(bit, dtype=np.uint64))


def with_constants(
    ends: NDArray[np.uint64], patch: dict[str, Keys], constants: NDArray[Any]
) -> tuple[NDArray[np.uint64], NDArray[Any], Keys, Keys]:
    """Adds to the words the index of each edge's constants among its patch's different ones, and returns these.

    A tile's third word has the indices of its edges; the word of a loose edge has its own.

    Args:
        ends: words of all patches from ``Tiles.packed``, shape [E].
        patch: of PatchTables.
        constants: of each edge, shape [E, 1..4].

    Returns:
        The words, the constants, and the first and number of each patch.
    """
    count = patch["edge_count"]
    of = np.repeat(np.arange(len(count)), count)
    _, alike = np.unique(
        constants.view(f"V{constants.dtype.itemsize * constants.shape[1]}").ravel(), return_inverse=True
    )
    keys, first, number = np.unique(of * len(constants) + alike, return_index=True, return_inverse=True)
    constants_count = np.bincount(keys // max(len(constants), 1), minlength=len(count))
    constants_start = np.cumsum(constants_count) - constants_count
    first, rank = (
        np.sort(first),
        np.argsort(np.argsort(first)),
    )  # in the order of the edges: where all differ, neighbouring threads load neighbouring constants
    number = rank[number] - constants_start[of]
    local, tiles = np.arange(len(of)) - patch["edge_start"][of], patch["tile_count"][of]
    slot = np.minimum(local // np.maximum(tiles, 1), SLOTS)
    slot[tiles == 0] = SLOTS
    loose = slot == SLOTS
    words = ends.copy()
    third = np.arange(len(of)) + (SLOTS - 1 - slot) * tiles
    _put(words, np.where(loose, np.arange(len(of)), third), np.where(loose, WORD_CONSTANTS, NUMBER_BITS * slot), number)
    return words, constants[first], constants_start, constants_count

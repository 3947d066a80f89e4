"""Sheets of a mesh whose seams join three triangles or more at an edge, and their rims."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.connected import connected_components

Ints = NDArray[np.int64]


def sheet_rims(triangles: Ints, edge_of_side: Ints, edge_count: int) -> tuple[Ints, ...]:
    """Edges with one triangle, sheet by sheet; not those of rims that run along a seam of several layers.

    A hem folded double and sewn to its cloth has none; where its end is sewn is its rim, as limbs pass through there.

    At such a seam two triangles, wound alike, continue each other: those of the largest sheets. The rest are layers
    that end there, such as a placket or a pocket.

    Args:
        triangles: shape [F, 3].
        edge_of_side: the edge of the sides (0,1), (1,2), (2,0) of each triangle, shape [3 F].
        edge_count: number of edges.
    """
    count = np.bincount(edge_of_side, minlength=edge_count)
    order = np.argsort(edge_of_side, kind="stable")
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    inner = first[count == 2]
    one, other = order[inner] // 3, order[inner + 1] // 3
    sheet = connected_components(len(triangles), one, other)
    size = np.bincount(sheet, minlength=len(triangles))
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    ends_there = count[edge_of_side] > 2
    joined: list[tuple[int, int]] = []
    folded: list[int] = []
    for edge in np.flatnonzero(count > 2).tolist():
        sides = order[first[edge] : first[edge] + count[edge]].tolist()
        pairs = [(a, b) for a, b in combinations(sides, 2) if start[a] == end[b]]
        if pairs:
            a, b = max(pairs, key=lambda pair: sorted(size[sheet[side // 3]] for side in pair))
            joined.append((a // 3, b // 3))
            ends_there[[a, b]] = False
            meeting = [sheet[side // 3] for side in (a, b)]
            others = [sheet[side // 3] for side in sides if side not in (a, b)]
            if meeting[0] != meeting[1] and set(others) & set(meeting):
                folded.append(edge)
    more = np.array(joined, dtype=np.int64).reshape(-1, 2)
    sheet = connected_components(len(triangles), np.concatenate([one, more[:, 0]]), np.concatenate([other, more[:, 1]]))
    rims = _closed_lines(np.array(folded, dtype=np.int64), start, end, order[first])
    border = np.flatnonzero((count[edge_of_side] == 1) | ends_there)
    for number in np.unique(sheet[border // 3]).tolist():
        own = border[sheet[border // 3] == number]
        vertices, place = np.unique(np.concatenate([start[own], end[own]]), return_inverse=True)
        a, b = place.reshape(2, -1)
        part = connected_components(len(vertices), a, b)[a]
        free = own[~np.isin(part, part[ends_there[own]])]
        if len(free):
            rims.append(np.unique(edge_of_side[free]))
    return tuple(rims)


def _closed_lines(edges: Ints, start: Ints, end: Ints, side: Ints) -> list[Ints]:
    """Those of some edges that run in closed lines, line by line.

    ``start``, ``end``: the vertices of each side of the triangles; ``side``: one side at each edge of the mesh.
    """
    vertices, place = np.unique(np.stack([start[side[edges]], end[side[edges]]]), return_inverse=True)
    a, b = place.reshape(2, -1)
    part = connected_components(len(vertices), a, b)
    is_open = np.isin(part, part[np.bincount(place.ravel(), minlength=len(vertices)) != 2])
    return [edges[part[a] == number] for number in np.unique(part[~is_open]).tolist()]

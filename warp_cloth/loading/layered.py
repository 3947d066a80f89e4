"""Layers of a garment that meet at one line of edges, as the ruffles of a skirt at its waist."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.connected import connected_components
from warp_cloth.loading.raw import Ints


def layers_meet(edge_of_side: Ints, edges: Ints) -> NDArray[np.bool_]:
    """At which of the edges that have three faces or more only whole layers meet, shape [N].

    Cut along all such edges, the mesh falls into sheets there: each face belongs to another, which goes on behind it. A
    fin stands on one sheet, that goes round its ends, or has nothing behind it: a slip of the modeller's.

    Args:
        edge_of_side: the edge of the sides (0,1), (1,2), (2,0) of each face, shape [3 F].
        edges: those with three faces or more, shape [N].
    """
    count = np.bincount(edge_of_side)
    order = np.argsort(edge_of_side, kind="stable")
    first = np.cumsum(count) - count
    inner = first[count == 2]
    faces = len(edge_of_side) // 3
    sheet = connected_components(faces, order[inner] // 3, order[inner + 1] // 3)
    at_seam = (count[edge_of_side] > 2).reshape(-1, 3).any(axis=1)
    goes_on = np.bincount(sheet, weights=~at_seam, minlength=faces) > 0

    def is_layered(edge: int) -> bool:
        own = sheet[order[first[edge] : first[edge] + count[edge]] // 3]
        return len(np.unique(own)) == len(own) and bool(goes_on[own].all())

    return np.array([is_layered(edge) for edge in edges.tolist()], dtype=bool)

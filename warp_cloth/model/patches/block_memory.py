"""Shared memory of the thread blocks that compute patches: what each needs, and which do not fit, on the host."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.kernels.base.options import NUMBER_BITS, Terms, block_for, fold_numbers, point_size, real_size
from warp_cloth.model.patches.members import Keys


def too_large(patch: dict[str, Keys], terms: Terms, precision: str) -> NDArray[np.bool_]:
    """Which patches need more shared memory or threads than a block has, or more than the bits of tiles can number."""
    block = block_for(bool(patch["tile_count"].any()))
    over = (block_memory(patch, terms, precision) > block.memory) | (patch["tile_count"] > block.threads)
    return np.asarray(over | beyond_bits(patch))


def beyond_bits(patch: dict[str, Keys]) -> NDArray[np.bool_]:
    """Which patches have more vertices, normals or edges than the bits of tiles can number."""
    most = np.maximum.reduce([patch[name] for name in ("vertex_count", "normal_count", "edge_count")])
    return np.asarray((patch["tile_count"] > 0) & (most > 1 << NUMBER_BITS))


def block_memory(patch: dict[str, Keys], terms: Terms, precision: str) -> Keys:
    """Bytes that each patch's block needs, as laid out by kernels.patches.memory, shape [P]."""
    real, wide = real_size(precision), point_size(precision) // 3
    triangles, edges, vertices = patch["triangle_count"], patch["edge_count"], patch["vertex_count"]
    first = patch["normal_count"] if terms.folds else terms.yarns * triangles
    needed = 4 * real * (first + terms.edges * (edges + 1))
    points = -(-2 * wide * vertices // 16) * 16 + -(-wide * (vertices + 1) // 16) * 16
    corners, around = 4 * real * (2 * triangles + 1), 4 * real * vertices + points
    if terms.yarns:
        needed = needed + corners + around
    else:
        needed = needed + (np.maximum(corners, around) if terms.folds else around)
    return np.asarray(-(-(needed + fold_numbers(terms) * real * terms.folds * edges) // 16) * 16)

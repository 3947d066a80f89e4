"""Untangling: its device arrays for garments that may pass through themselves and each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from warp_cloth.base.topology import ragged_rows
from warp_cloth.contact.crossing import Sheets
from warp_cloth.garment.garment import Garment
from warp_cloth.kernels.contact.untangle import Untangling
from warp_cloth.model.permutation import Permutation

LAYER_DEPTH = 0.01  # [m]; greatest depth of one garment inside another once both are sewn


def sheet_untangling(sheets: Sheets, garments: Sequence[Garment], permutation: Permutation) -> Any:
    """Untangling (kernels.contact.untangle) of these garments; initially they all face outwards."""
    count = sheets.vertex_count
    untangling = Untangling()
    rim = np.zeros(count, dtype=np.int32)
    wings = []
    for garment, first in zip(garments, sheets.vertex_start, strict=False):
        topology = garment.rest.topology
        of_edge = np.full((len(topology.edges), 2), -1, dtype=np.int32)
        sides = topology.triangle_edges.ravel()
        third = np.roll(garment.triangles, -2, axis=1).ravel() + first
        order = np.argsort(sides, kind="stable")
        rank = np.arange(len(sides)) - np.searchsorted(sides[order], sides[order])
        two = rank < 2  # a seam of three panels has three triangles at an edge: it is drawn out of a crossing by two
        of_edge[sides[order][two], rank[two]] = third[order][two]
        wings.append(of_edge)
        rim[topology.edges[of_edge[:, 1] < 0].ravel() + first] = 1
    untangling.wings = wp.array(permutation.of(np.concatenate(wings)), dtype=wp.vec2i)
    untangling.rim = wp.array(permutation.rows(rim), dtype=wp.int32)
    start, order = ragged_rows(sheets.edges.ravel(), count)
    start, adjacent = permutation.lists(start, permutation.of(sheets.edges[:, ::-1].ravel()[order]))
    untangling.adjacent_start = wp.array(start, dtype=wp.int32)
    untangling.adjacent = wp.array(adjacent, dtype=wp.int32)
    untangling.crosses, untangling.level = wp.zeros(count, dtype=wp.int32), wp.zeros(count, dtype=wp.int32)
    untangling.age, untangling.next_age = wp.zeros(count, dtype=wp.int32), wp.zeros(count, dtype=wp.int32)
    untangling.outward = wp.full(count, 1.0, dtype=wp.float32)
    untangling.layer_depth = LAYER_DEPTH
    untangling.sum = wp.zeros((count, 4), dtype=wp.int64)
    untangling.count = wp.zeros(4, dtype=wp.int32)
    untangling.nearest = wp.zeros(count, dtype=wp.int64)
    return untangling

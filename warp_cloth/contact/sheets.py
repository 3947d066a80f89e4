"""Sheets: the triangles and edges of several garments over one array of vertices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warp_cloth.contact.crossing import Sheets
from warp_cloth.garment.garment import Garment

LAYER_LIFT = 8e-3  # [m]; while it is sewn, each layer keeps clear of the folds of the one inside it


@dataclass(frozen=True)
class SheetKind:
    """A garment's parameters in contact."""

    thickness: float  # [m]
    friction: float
    layer: int = 0  # among the garments, from the inside out


def sheets_of(garments: Sequence[Garment]) -> Sheets:
    """Triangles and edges of all garments, over one array of vertices."""
    first = np.concatenate([[0], np.cumsum([len(garment.points) for garment in garments])])
    first_edge = np.concatenate([[0], np.cumsum([len(garment.rest.topology.edges) for garment in garments])])
    topologies = [garment.rest.topology for garment in garments]
    return Sheets(
        np.concatenate([garment.triangles + at for garment, at in zip(garments, first, strict=False)]).astype(np.int32),
        np.concatenate([each.edges + at for each, at in zip(topologies, first, strict=False)]).astype(np.int32),
        np.concatenate([each.triangle_edges + at for each, at in zip(topologies, first_edge, strict=False)]),
        np.repeat(np.arange(len(garments), dtype=np.int32), [len(garment.triangles) for garment in garments]),
        tuple(int(at) for at in first),
    )

"""Where the worn garments of scenes lie in their avatars: vertices, edges and faces."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.avatar.exact import ExactCollider, depth_summary, depths_under
from warp_cloth.avatar.openings import Opening, measured_openings, opening_samples
from warp_cloth.avatar.penetration import Overlap, Samples, edge_places, face_places, may_show, pierced, shown
from warp_cloth.base.mesh import Points
from warp_cloth.base.threads import concatenate, map_in_threads
from warp_cloth.garment.outfit import Outfit


def avatar_overlaps(
    outfits: Sequence[Outfit],
    worn: Sequence[Points],
    strains: Sequence[NDArray[Any]],
    exact_of: Sequence[ExactCollider | None],
    position: wp.array | Points | None = None,
) -> list[Overlap | None]:
    """Overlap of every scene's garments with its avatar.

    One query serves all scenes, as a GPU answers a million points as fast as a few.

    Args:
        outfits: the scenes' garments.
        worn: their points [m], shape [V, 3] each.
        strains: of their edges, shape [E] each.
        exact_of: their avatars; None: there is none, nor an overlap.
        position: all points one after another [m], where they are on the avatars' device already.
    """
    everywhere = np.concatenate(worn) if position is None else position
    vertex_depths = depths_under(everywhere, [len(points) for points in worn], exact_of)

    def samples_of(item: int) -> _ItemSamples:
        garments, points, strain = outfits[item].garments, worn[item], strains[item].astype(np.float64)
        starts = np.cumsum([0, *(len(garment.points) for garment in garments)]).tolist()
        parts = list(zip(garments, starts, strict=False))
        along = edge_places(points, np.concatenate([each.rest.topology.edges + at for each, at in parts]), strain)
        longest = float(((1.0 + strain) * np.concatenate([garment.rest.edge_length for garment in garments])).max())
        triangles = np.zeros((0, 3), dtype=np.int32)
        if may_show(longest):
            triangles = concatenate([garment.triangles for garment in garments], starts)
        ends = [*starts[1:], None]
        openings = [
            opening_samples(number, points[first:last], each.rest.topology, each.triangles)
            for number, (each, first, last) in enumerate(zip(garments, starts, ends, strict=False))
        ]
        found, across = [each for each, _ in openings], np.concatenate([places for _, places in openings])
        return _ItemSamples(along, face_places(points, triangles), list(itertools.chain(*found)), across)

    samples = map_in_threads(samples_of, range(len(worn)))
    queries = np.concatenate([points for each in samples for points in each.points])
    sample_depths = depths_under(queries, [sum(map(len, each.points)) for each in samples], exact_of)
    measured = zip(exact_of, vertex_depths, samples, sample_depths, strict=True)
    return [None if exact is None else _overlap(depths, each, own) for exact, depths, each, own in measured]


@dataclass(frozen=True, eq=False)
class _ItemSamples:
    """Where the depth of a scene's cloth in its avatar is measured, beside its vertices."""

    edges: Samples  # that may pass through the avatar
    faces: Samples  # that it may show through
    openings: list[Opening]
    across: Points  # samples in these [m], shape [N, 3]

    @property
    def points(self) -> tuple[Points, ...]:
        return self.edges.points, self.faces.points, self.across


def _overlap(depths: NDArray[np.float32], samples: _ItemSamples, sample_depths: NDArray[np.float32]) -> Overlap:
    """The overlap, from depths of vertices and of samples [m]."""
    ends = np.cumsum([len(points) for points in samples.points])[:-1]
    along, within, across = np.split(sample_depths, ends)
    edges, edge_depths = pierced(samples.edges, along)
    faces, face_depths = shown(samples.faces, within)
    summary = replace(
        depth_summary(depths),
        edges=len(edges),
        edge_max=1e3 * float(edge_depths.max(initial=0.0)),
        faces=len(faces),
        face_max=1e3 * float(face_depths.max(initial=0.0)),
    )
    openings = measured_openings(samples.openings, across)
    return Overlap(summary, depths, edges, edge_depths, faces, face_depths, openings)

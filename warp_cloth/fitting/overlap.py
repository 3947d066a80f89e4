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
from warp_cloth.avatar.penetration import (
    CLOSER,
    Overlap,
    Samples,
    edge_places,
    face_places,
    may_show,
    pierced,
    places_in,
    shown,
)
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
        return _ItemSamples(along, face_places(points, triangles), triangles, list(itertools.chain(*found)), across)

    samples = map_in_threads(samples_of, range(len(worn)))
    queries = np.concatenate([points for each in samples for points in each.points])
    sample_depths = depths_under(queries, [sum(map(len, each.points)) for each in samples], exact_of)
    faces = _shown_faces(samples, sample_depths, worn, exact_of)
    measured = zip(exact_of, vertex_depths, samples, sample_depths, faces, strict=True)
    return [
        None if exact is None else _overlap(depths, each, own, found) for exact, depths, each, own, found in measured
    ]


@dataclass(frozen=True, eq=False)
class _ItemSamples:
    """Where the depth of a scene's cloth in its avatar is measured, besides its vertices."""

    edges: Samples  # that may pass through the avatar
    faces: Samples  # that it may show through
    triangles: NDArray[np.int32]  # of all garments, shape [F, 3]; none where all are too small for it
    openings: list[Opening]
    across: Points  # samples in these [m], shape [N, 3]

    @property
    def points(self) -> tuple[Points, ...]:
        return self.edges.points, self.faces.points, self.across

    def parts(self, depths: NDArray[np.float32]) -> list[NDArray[np.float32]]:
        """Depths at the points, those of edges, faces and openings."""
        return np.split(depths, np.cumsum([len(points) for points in self.points])[:-1])


_Shown = tuple[NDArray[np.int64], NDArray[np.float32]]  # faces that the avatar shows through, and how deep [m]


def _shown_faces(
    samples: Sequence[_ItemSamples],
    depths: Sequence[NDArray[np.float32]],
    worn: Sequence[Points],
    exact_of: Sequence[ExactCollider | None],
) -> list[_Shown]:
    """The faces of each scene that its avatar shows through, measured at closer samples, with their neighbours."""

    def closer_samples(points: Points, each: _ItemSamples, own: NDArray[np.float32]) -> Samples:
        corners = each.triangles[shown(each.faces, each.parts(own)[1])[0]]
        near = np.flatnonzero(np.isin(each.triangles, corners).any(axis=1)) if len(corners) else np.zeros(0, np.int64)
        return places_in(points, each.triangles, near, CLOSER)

    closer = [closer_samples(*each) for each in zip(worn, samples, depths, strict=True)]
    counts = [len(each.points) for each in closer]
    if not sum(counts):
        return [shown(each, np.zeros(0, np.float32)) for each in closer]
    again = depths_under(np.concatenate([each.points for each in closer]), counts, exact_of)
    return [shown(each, own) for each, own in zip(closer, again, strict=True)]


def _overlap(
    depths: NDArray[np.float32], samples: _ItemSamples, sample_depths: NDArray[np.float32], shown_faces: _Shown
) -> Overlap:
    """The overlap, from depths of vertices and of samples [m]."""
    along, _, across = samples.parts(sample_depths)
    edges, edge_depths = pierced(samples.edges, along)
    faces, face_depths = shown_faces
    summary = replace(
        depth_summary(depths),
        edges=len(edges),
        edge_max=1e3 * float(edge_depths.max(initial=0.0)),
        faces=len(faces),
        face_max=1e3 * float(face_depths.max(initial=0.0)),
    )
    openings = measured_openings(samples.openings, across)
    return Overlap(summary, depths, edges, edge_depths, faces, face_depths, openings)

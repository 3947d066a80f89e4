"""Is a garment with legs long enough for the trunk? Its loop over a shoulder and through the crotch, and the body's.

Stays up nowhere if it is not: legs hold it at the crotch, and it pulls itself off the shoulders.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_cloth.anatomy.figure import Figure
from warp_cloth.anatomy.geodesics import EdgeGraph, Floats
from warp_cloth.anatomy.linking import Wearing
from warp_cloth.anatomy.openings import ARMS, LEGS, Opening
from warp_cloth.anatomy.skeleton import HEAD
from warp_cloth.anatomy.stance import ASTRIDE
from warp_cloth.anatomy.tape import Plane
from warp_cloth.base.connected import connected_components
from warp_cloth.base.mesh import Indices, Mesh, Points

# What a garment with shoulders and legs must stretch by to go round the trunk lengthwise. Of eight such designs seven
# are worn on their own bodies, and have 0.02 at most; one slides off the shoulders, with 0.22.
SHORT = 0.1
ON_SHOULDER = 0.65  # from the spine to the root of the arm: the middle of the shoulder, beside the neck


@dataclass(frozen=True)
class TrunkLoop:
    """From a shoulder down the front, between the legs, and up the back."""

    garment: float  # as cut [m]
    body: float  # a tape there [m]

    @property
    def strain(self) -> float:
        """What the garment has to stretch by, if that is more than 0."""
        return self.body / self.garment - 1.0

    @property
    def is_short(self) -> bool:
        """Whether the garment is too short to be worn, wherever it starts."""
        return self.strain > SHORT


def trunk_loop(wearing: Wearing, edges: Indices, lengths: Floats, body: Mesh) -> TrunkLoop | None:
    """The shorter of a garment's loops over either shoulder; None: it has no shoulders or legs, or the body sits.

    Args:
        wearing: its openings on the body.
        edges: shape [E, 2].
        lengths: of the edges at rest [m], shape [E].
        body: what wears it.
    """
    own = min(_garment_loops(wearing, edges, lengths), default=np.inf)
    around = _body_loop(body, wearing) if np.isfinite(own) else None
    return None if around is None else TrunkLoop(own, around)


def _garment_loops(wearing: Wearing, edges: Indices, lengths: Floats) -> Iterator[float]:
    """Shortest closed lines over each shoulder and through the crotch, along edges [m].

    Front and back are before and behind the spine where the garment starts; shoulder and crotch are lines between them
    that lead from one opening to another.
    """
    openings = dict(zip(wearing.limbs, wearing.openings, strict=True))
    legs, arms = ([openings[limb,] for limb in limbs if (limb,) in openings] for limbs in (LEGS, ARMS))
    neckline = next((opening for limbs, opening in openings.items() if HEAD in limbs), None)
    if neckline is None or len(legs) < 2:
        return
    skeleton = wearing.skeleton
    ahead = (wearing.onto - skeleton.spine_at(wearing.onto)) @ skeleton.forward > 0.0
    crossing = np.flatnonzero(ahead[edges[:, 0]] != ahead[edges[:, 1]])
    lines = _lines(wearing.triangles, edges, crossing)
    crotch = _between(lines, edges, legs[0], legs[1])
    for arm in arms:
        shoulder = _between(lines, edges, neckline, arm)
        if not len(shoulder) or not len(crotch):
            continue
        ends = edges[crotch]
        over = np.concatenate([shoulder, crotch])
        front, back = (
            _distances(edges, lengths, over, ahead == side, np.unique(edges[shoulder])) for side in (True, False)
        )
        yield float((front + back)[ends].min())


def _lines(triangles: Indices, edges: Indices, crossing: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """The edges that cross from front to back, in lines: those of one triangle belong together."""
    count = int(triangles.max()) + 1
    keys = edges[crossing, 0].astype(np.int64) * count + edges[crossing, 1]  # ascending, as edges are sorted
    sides = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).astype(np.int64)
    sought = sides.min(axis=2) * count + sides.max(axis=2)
    place = np.minimum(np.searchsorted(keys, sought), max(len(keys) - 1, 0))
    own = (keys[place] == sought) if len(keys) else np.zeros(sought.shape, dtype=bool)
    two = np.flatnonzero(own.sum(axis=1) == 2)
    pairs = place[two][own[two]].reshape(-1, 2)
    label = connected_components(len(crossing), pairs[:, 0], pairs[:, 1])
    return [crossing[label == number] for number in np.unique(label)]


def _between(lines: list[NDArray[np.int64]], edges: Indices, first: Opening, last: Opening) -> NDArray[np.int64]:
    """The edges of the lines that lead from one opening to another."""
    found = [line for line in lines if all((each.distances[edges[line]] == 0.0).any() for each in (first, last))]
    return np.concatenate(found) if found else np.zeros(0, dtype=np.int64)


def _distances(
    edges: Indices, lengths: Floats, over: NDArray[np.int64], side: NDArray[np.bool_], sources: Indices
) -> Floats:
    """Distances from ``sources`` over one side of a garment and some edges to the other [m], shape [V]."""
    used = np.union1d(np.flatnonzero(side[edges].all(axis=1)), over)
    return EdgeGraph(edges[used], lengths[used], len(side)).distances(sources)


def _body_loop(body: Mesh, wearing: Wearing) -> float | None:
    """The shorter of the tapes over a body's shoulders and through its crotch [m]; None: there is no crotch."""
    figure = Figure.of(body, wearing.skeleton)
    crotch = figure.crotch
    if crotch is None or not figure.legs_along(ASTRIDE):
        return None
    left, up, forward = figure.frame
    shoulders = figure.skeleton.shoulders
    low: Points = shoulders + left * (figure.middle - shoulders @ left) + up * (crotch - shoulders @ up)
    tapes = []
    for arm in ARMS:
        root = figure.skeleton.curves[arm][figure.skeleton.joints[arm]]
        along = shoulders + ON_SHOULDER * (root - shoulders) - low
        plane = Plane.through(low, np.cross(along, forward))
        ends = plane.section(figure.body.points, figure.trunk.triangles).ends.reshape(-1, 2)
        above = (plane.in_space(ends) - low) @ up > 0.0
        if above.sum() > 2:
            tapes.append(plane.tape(ends[above]).length)
    return min(tapes, default=None)

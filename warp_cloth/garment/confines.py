"""The box that a pinned garment cannot leave, by its energy: with an avatar outside it contact need not be computed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_cloth.garment.garment import Garment
from warp_cloth.garment.rest import Floats, RestShape
from warp_cloth.material.constants import YarnConstants

ROUNDS = 40  # of raising the energy bound until it is consistent
MOST_STEPS = 400  # edges on a path from a pin; a bound is not worth more work


def confining_box(garment: Garment) -> tuple[Floats, Floats] | None:
    """Lowest and highest corner [m], each shape [3], of a box that the garment cannot leave; None without a proof.

    An edge or yarn of energy k/3 |e|^3 has a strain of (3 E / k)^(1/3) at most, E the total elastic energy: that of
    the start, and what gravity adds as the cloth sinks as far as it can. The shortest path of edges stretched that far
    bounds every vertex's distance from the pins; an energy that these distances cannot supply is never exceeded.
    """
    rest = garment.rest
    paths = _edge_paths(rest, garment.points) if rest.yarns is None else _woven_paths(rest.yarns, garment.points)
    if not len(garment.pins) or not len(paths.ends) or not (paths.stiffness > 0.0).all():
        return None
    start = paths.start + 7.0 * float(rest.hinge_stiffness.sum())  # C (t - sin t) is at most 2 pi C
    pinned = garment.points[garment.pins]
    low, high = pinned.min(axis=0), pinned.max(axis=0)
    energy = start + 1e-9
    for _ in range(ROUNDS):
        far = _distances(len(garment.points), garment.pins, paths.ends, paths.lengths(energy))
        if far is None:
            return None
        sunk = np.maximum(garment.points[:, 1] - (low[1] - far), 0.0)
        needed = start + float(rest.vertex_weight @ sunk)
        if needed < energy:
            return low - far.max(), high + far.max()
        energy = 1.1 * needed
    return None


@dataclass(frozen=True, eq=False)
class _Paths:
    """N connections of two vertices, each the sum of two lengths at rest that two springs stretch."""

    ends: NDArray[np.int32]  # shape [N, 2]
    rest: Floats  # [m], shape [N, 2]
    stiffness: Floats  # k of E = k/3 |e|^3 [J], shape [N, 2]
    start: float  # elastic energy at the start [J]

    def lengths(self, energy: float) -> Floats:
        """The greatest possible length of each [m], shape [N]."""
        longest: Floats = (self.rest * (1.0 + np.cbrt(3.0 * energy / self.stiffness))).sum(axis=1)
        return longest


def _edge_paths(rest: RestShape, points: Floats) -> _Paths:
    ends, length = rest.topology.edges, rest.edge_length
    change = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1) - length
    energy = np.where(change > 0.0, rest.edge_pull, rest.edge_push) @ np.abs(change) ** 3 / 3.0
    none = np.zeros_like(length)
    return _Paths(
        ends, np.stack([length, none], axis=1), np.stack([rest.edge_pull * length**3, none + 1.0], axis=1), energy
    )


def _woven_paths(yarns: YarnConstants, points: Floats) -> _Paths:
    """The sides of woven triangles: each has a part along weft and a part along warp."""
    inverse = yarns.slope[:, [0, 2, 1, 3]].reshape(-1, 2, 2)  # [T, corner, direction]
    sides = np.swapaxes(np.linalg.inv(inverse), 1, 2)  # [T, corner, direction], from the first corner
    parts = np.abs(np.stack([sides[:, 0], sides[:, 1], sides[:, 1] - sides[:, 0]], axis=1))
    stiffness = np.broadcast_to(np.stack([yarns.weft, yarns.warp], axis=1)[:, None], parts.shape)
    ends = yarns.corners[:, [[0, 1], [0, 2], [1, 2]]].reshape(-1, 2)
    corners = points[yarns.corners]
    straight = np.einsum("tcx,tcd->tdx", corners[:, 1:] - corners[:, :1], inverse)  # now, of unit length at rest
    bias = np.stack([straight[:, 0] + straight[:, 1], straight[:, 0] - straight[:, 1]], axis=1) / np.sqrt(2.0)
    strain = np.linalg.norm(np.concatenate([straight, bias], axis=1), axis=2) - 1.0
    each = np.stack([yarns.weft, yarns.warp, yarns.shear, yarns.shear]).T
    weaker = np.where(strain > 0.0, 1.0, yarns.compression)
    energy = float((each * weaker * np.abs(strain) ** 3).sum() / 3.0)
    return _Paths(ends, parts.reshape(-1, 2), stiffness.reshape(-1, 2), energy)


def _distances(count: int, pins: NDArray[np.int32], ends: NDArray[np.int32], lengths: Floats) -> Floats | None:
    """Length of the shortest path from any pin to each vertex [m]; None if there is none, or it has too many edges."""
    far = np.full(count, np.inf)
    far[pins] = 0.0
    for _ in range(MOST_STEPS):
        shorter = far.copy()
        np.minimum.at(shorter, ends[:, 0], far[ends[:, 1]] + lengths)
        np.minimum.at(shorter, ends[:, 1], far[ends[:, 0]] + lengths)
        if np.array_equal(shorter, far):
            return far if np.isfinite(far).all() else None
        far = shorter
    return None

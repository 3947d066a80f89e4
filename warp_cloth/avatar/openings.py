"""What passes through the openings of a garment: samples of a surface across each boundary loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices, Points
from warp_cloth.base.topology import Topology

AROUND = 24  # samples around a loop, so that a wrist in a wide sleeve is met
ACROSS = np.array([0.0, 0.15, 0.3, 0.5, 0.7, 0.9])  # from its middle to itself


@dataclass(frozen=True, eq=False)
class Opening:
    """A boundary loop of a garment, as worn."""

    garment: int  # of the scene
    vertices: Indices  # of the garment, in order along the loop
    girth: float  # length of the loop [m]
    filled: bool = True  # whether the avatar reaches into it, or into the tube of cloth behind it


def opening_samples(
    garment: int, points: Points, topology: Topology, triangles: Indices
) -> tuple[list[Opening], Points]:
    """The openings of a garment and, for each, samples in it and in the tube of cloth behind it [m], shape [N, 3].

    ``points`` [m], shape [V, 3]. A sleeve may end beyond the fingers, and a hem below the feet: then the limb ends in
    the tube, so the same surface is sampled once more, moved into the cloth by the loop's radius.
    """
    loops = topology.boundary_loops
    if len(loops) < 2 or not np.isfinite(points).all():  # a flat sheet has one, and needs nothing in it
        return [], np.zeros((0, 3))
    near = triangles[np.isin(triangles, np.concatenate(loops)).any(axis=1)]
    corners, count = near.ravel(), np.bincount(near.ravel(), minlength=len(points))
    middles = np.repeat(points[near].mean(axis=1), 3, axis=0)
    openings, samples = [], []
    inner = np.stack([np.bincount(corners, middles[:, axis], len(points)) for axis in range(3)], axis=1)
    for loop in loops:
        line = points[loop]
        girth = float(np.linalg.norm(np.roll(line, -1, axis=0) - line, axis=1).sum())
        inward = (inner[loop] / count[loop, None] - line).mean(axis=0)
        inward /= max(float(np.linalg.norm(inward)), np.finfo(float).tiny)
        some = line[np.linspace(0, len(line), AROUND, endpoint=False).astype(int)]
        centre = some.mean(axis=0)
        across = (centre + (some - centre)[:, None] * ACROSS[:, None]).reshape(-1, 3)
        openings.append(Opening(garment, loop, girth))
        samples += [across, across + inward * girth / (2.0 * np.pi)]
    return openings, np.concatenate(samples)


def measured_openings(openings: Sequence[Opening], depths: NDArray[np.float32]) -> tuple[Opening, ...]:
    """The openings, by the depths of their samples in the avatar [m]."""
    deepest = depths.reshape(len(openings), 2 * AROUND * len(ACROSS)).max(axis=1, initial=0.0).tolist()
    return tuple(replace(opening, filled=depth > 0.0) for opening, depth in zip(openings, deepest, strict=True))

"""Audit of a collider: its distance error against the avatar's exact mesh, and what three views do not see."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.avatar.exact import ExactCollider
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.kernels.avatar import visibility as kernels

PAPER_VIEWS = ((0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0))  # towards the viewers: front, back, top
NEARBY = 0.05  # [m] round the surface nearest to a garment's vertices: what it may come to lie on
SAMPLES = 10_000  # points of that surface; ten of them beyond the 99.9th percentile
OFF_SURFACE = 2e-4  # [m]; visibility is tested from here: clear of float32's rounding and of the point's own face
LEAST_GAP = 0.9  # of the offset that must be free of the exact mesh: cloth at the offset fits no narrower gap
PERCENTILES = (50.0, 99.0, 99.9, 100.0)
GOLDEN = (0.7548776662466927, 0.5698402909980532)  # steps of Roberts' R2 sequence: even, and the same every time


class Sampled(Protocol):
    """A collider that is sampled on the host: unit normal and signed distance [m] at points [m], shape [N, 4]."""

    @property
    def reach(self) -> float: ...

    def sample(self, points: Points) -> NDArray[np.float32]: ...


@dataclass(frozen=True)
class ContactError:
    """Percentiles of a collider's distance error against the exact mesh [mm]."""

    p50: float
    p99: float
    p999: float
    max: float


@dataclass(frozen=True, eq=False)
class NearSurface:
    """Points of the avatar's outer surface that a garment can reach, evenly distributed by area."""

    points: Points  # [m], shape [N, 3]
    normals: Points  # of their faces, outward, shape [N, 3]
    area: float  # of the surface that they represent [m2]

    def above(self, offset: float) -> Points:
        """The points at this distance along the normals [m]."""
        return self.points + offset * self.normals

    def worn(self, exact: ExactCollider, offset: float) -> Points:
        """Points at this offset [m] where cloth can lie: no other surface is nearer."""
        return self.worn_and_true(exact, offset)[0]

    def worn_and_true(self, exact: ExactCollider, offset: float) -> tuple[Points, NDArray[np.float32]]:
        """The same and their exact distances [m]."""
        points = self.above(offset)
        distances = exact.sample(points)[:, 3]
        there = distances >= LEAST_GAP * offset
        return points[there], distances[there]


def near_surface(avatar: Mesh, exact: ExactCollider, garment: Points, lower: Points, upper: Points) -> NearSurface:
    """Samples what garments at these positions [m] can come to lie on, within a box [m].

    Surface inside other parts, and between crossing ones, is left out.
    """
    a, b, c = (avatar.points[corner] for corner in avatar.triangles.T)
    normals = np.cross(b - a, c - a)
    area = 0.5 * np.linalg.norm(normals, axis=1)
    centre = (a + b + c) / 3.0
    lowest, highest = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    marks = exact.closest(garment[np.isfinite(garment).all(axis=1)]).points
    near = ((centre > lower) & (centre < upper)).all(axis=1)
    near &= _within(centre, marks, NEARBY)
    large = (highest - lowest).max(axis=1) > NEARBY  # these may reach into the region wherever their middle is
    near |= large & ((lowest < upper) & (highest > lower)).all(axis=1)
    total = np.cumsum(np.where(near, area, 0.0))
    if total[-1] == 0.0:
        return NearSurface(np.zeros((0, 3)), np.zeros((0, 3)), 0.0)
    step = np.arange(SAMPLES)
    face = np.searchsorted(total, (step + 0.5) / SAMPLES * total[-1])
    u, v = (step * GOLDEN[0] % 1.0, step * GOLDEN[1] % 1.0)
    u, v = np.where(u + v > 1.0, 1.0 - u, u)[:, None], np.where(u + v > 1.0, 1.0 - v, v)[:, None]
    points = a[face] + u * (b - a)[face] + v * (c - a)[face]
    outward = exact.orientation * normals[face] / (2.0 * area[face, None])
    shift = OFF_SURFACE * outward
    # both together take a GPU the time of one: its threads wait for memory
    off, below = np.split(exact.sample(np.concatenate([points + shift, points - shift]))[:, 3], 2)
    outer = (off > 0.0) & (below < 0.0)
    if large.any():
        there = ((points > lower) & (points < upper)).all(axis=1) & _within(points, marks, NEARBY)
        outer &= there | ~large[face]
    return NearSurface(points[outer], outward[outer], float(total[-1] * outer.mean()))


def unseen_share(surface: NearSurface, exact: ExactCollider) -> float:
    """Fraction of a surface that the front, back and top view do not see; 0 where there is none."""
    if not len(surface.points):
        return 0.0
    points = exact.local(surface.above(OFF_SURFACE))
    normals = wp.array(surface.normals.astype(np.float32), dtype=wp.vec3f, device=exact.device)
    seen = wp.zeros(len(points), dtype=wp.int32, device=exact.device)
    for toward in PAPER_VIEWS:
        inputs = [exact.mesh.id, points, normals, wp.vec3f(*toward)]
        wp.launch(kernels.mark_visible, dim=len(points), inputs=inputs, outputs=[seen], device=exact.device)
    return float(1.0 - seen.numpy().mean())


def contact_error(
    collider: Sampled, exact: ExactCollider, points: Points, true: NDArray[np.float32] | None = None
) -> ContactError:
    """Error of a collider's distance at points [m], shape [N, 3], against the exact mesh, as far as both reach.

    ``true`` are the exact distances there [m], where already known.
    """
    if not len(points):
        return ContactError(0.0, 0.0, 0.0, 0.0)
    reach = min(collider.reach, exact.reach)
    distances = exact.sample(points)[:, 3] if true is None else true
    truth = np.minimum(distances.astype(np.float64), reach)
    found = np.minimum(collider.sample(points)[:, 3].astype(np.float64), reach)
    return ContactError(*(float(value) for value in np.percentile(1e3 * np.abs(found - truth), PERCENTILES)))


def _within(points: Points, marks: Points, distance: float) -> NDArray[np.bool_]:
    """Whether points [m] lie in or next to a cell of size ``distance`` [m] that holds a mark."""
    if not len(marks):
        return np.zeros(len(points), dtype=bool)
    low = np.minimum(points.min(axis=0), marks.min(axis=0)) - distance
    high = np.maximum(points.max(axis=0), marks.max(axis=0)) + distance
    count = np.ceil((high - low) / distance).astype(np.int64) + 1
    taken = np.zeros(count, dtype=bool)
    taken[tuple(np.floor((marks - low) / distance).astype(np.int64).T)] = True
    for axis in range(3):
        before, after = np.roll(taken, 1, axis), np.roll(taken, -1, axis)  # no mark lies in the outermost cells
        taken |= before | after
    return taken[tuple(np.floor((points - low) / distance).astype(np.int64).T)]

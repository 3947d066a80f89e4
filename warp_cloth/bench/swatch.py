"""Meshes of flat specimens, strips and discs, in the xz plane with the warp along -z."""

from __future__ import annotations

import math

import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import Delaunay

from warp_cloth.base.mesh import Indices, Mesh, Points
from warp_cloth.shapes import square

SMOOTHING_ROUNDS = 12  # triangles are then at most twice as long as wide, and still run in all directions


def strip(width: float, length: float, edge: float) -> Mesh:
    """A rectangle in a regular grid of about this edge length [m]; y of its panel is along its length."""
    columns, rows = max(round(width / edge), 1), max(round(length / edge), 1)
    count = max(columns, rows) + 1
    whole = square(side=1.0, vertices_per_side=count)
    texcoords = whole.texcoords if whole.texcoords is not None else np.zeros((0, 3, 2))
    cell = 1.0 / (count - 1)
    inside = (texcoords.mean(axis=1) < np.array([columns, rows]) * cell).all(axis=1)
    flat = texcoords[inside] / cell * np.array([width / columns, length / rows])
    used, triangles = np.unique(whole.triangles[inside], return_inverse=True)
    points = np.zeros((len(used), 3))
    triangles = triangles.reshape(-1, 3)
    points[triangles.ravel(), 0] = flat[..., 0].ravel() - 0.5 * width
    points[triangles.ravel(), 2] = 0.5 * length - flat[..., 1].ravel()
    return Mesh("strip", points, triangles.astype(np.int32), texcoords=flat)


def disc(radius: float, hole: float, edge: float, seed: int = 0) -> Mesh:
    """A disc without its middle, in irregular triangles of about this edge length [m], other ones for each seed.

    Its two innermost rings of vertices lie half a triangle's height inside and outside ``hole`` [m]. Regular meshes
    will not do: on rings in six sides cloth falls into six folds and stands out along its weft.
    """
    rng = np.random.default_rng(seed)
    height = edge * math.sqrt(0.75)
    rings = [_circle(r, edge, rng.uniform()) for r in (hole - 0.5 * height, hole + 0.5 * height, radius)]
    fixed, innermost = np.concatenate(rings), len(rings[0])
    area = math.pi * (radius**2 - (hole + 0.5 * height) ** 2)
    count = max(round(area / (edge * height) - 0.5 * (len(fixed) - innermost)), 0)
    low, high = hole + 0.5 * height + 0.5 * edge, radius - 0.5 * edge
    turn, away = rng.uniform(0.0, 2.0 * np.pi, count), np.sqrt(rng.uniform(low**2, high**2, count))
    flat = np.concatenate([fixed, away[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])])
    for _ in range(SMOOTHING_ROUNDS):
        inner = _centred(flat, Delaunay(flat).simplices)[len(fixed) :]
        away = np.hypot(inner[:, 0], inner[:, 1])
        flat[len(fixed) :] = inner * (np.clip(away, low, high) / away)[:, None]
    triangles = Delaunay(flat).simplices
    triangles = triangles[(triangles >= innermost).any(axis=1)]
    points = np.column_stack([flat[:, 0], np.zeros(len(flat)), -flat[:, 1]])
    return Mesh("disc", points, triangles.astype(np.int32), texcoords=flat[triangles])


def _circle(radius: float, edge: float, phase: float) -> Points:
    """Vertices evenly on a circle, shape [N, 2]."""
    count = max(round(2.0 * math.pi * radius / edge), 6)
    turn = (np.arange(count) + phase) * 2.0 * np.pi / count
    return radius * np.column_stack([np.cos(turn), np.sin(turn)])


def _centred(flat: Points, triangles: Indices) -> Points:
    """Every vertex in the centroid of the triangles round it, which spaces vertices evenly, shape [N, 2]."""
    corners = flat[triangles]
    along, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = np.abs(along[:, 0] * other[:, 1] - along[:, 1] * other[:, 0])
    weighted = area[:, None] * corners.mean(axis=1)
    sums = [np.bincount(triangles.ravel(), np.repeat(each, 3), len(flat)) for each in (area, *weighted.T)]
    return np.column_stack([sums[1] / sums[0], sums[2] / sums[0]])


def on_finer_disc(coarse: Mesh, points: Points, fine: Mesh) -> Points:
    """Interpolated points of a disc [m] from those of a ``coarse`` one; both meshes are as they were cut."""
    flat, wanted = coarse.points[:, [0, 2]], fine.points[:, [0, 2]]
    moved = LinearNDInterpolator(flat, points - coarse.points)
    shape, away = moved(wanted), np.hypot(wanted[:, 0], wanted[:, 1])
    # the coarse rim is a polygon: what lies beyond it moves as its nearest side does
    rim = np.hypot(flat[:, 0], flat[:, 1])
    sides = int((rim > rim.max() * (1.0 - 1e-9)).sum())
    within = rim.max() * math.cos(math.pi / sides) * (1.0 - 1e-6)
    beyond = np.isnan(shape).any(axis=1)
    shape[beyond] = moved(wanted[beyond] * (within / away[beyond])[:, None])
    return np.asarray(fine.points + shape)


def along(mesh: Mesh) -> tuple[Points, Points]:
    """Coordinates of every vertex across and along its strip as it was cut [m], shape [V] each."""
    length = float(mesh.points[:, 2].max() - mesh.points[:, 2].min())
    return mesh.points[:, 0], 0.5 * length - mesh.points[:, 2]

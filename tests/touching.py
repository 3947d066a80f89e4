"""Contact of cloth by another road: every pair, in NumPy."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from warp_cloth.base.mesh import Points
from warp_cloth.contact.cloth import ClothContact
from warp_cloth.kernels.contact.arrays import REGIONS

PARALLEL = 0.01  # squared sine below which two edges count less
# The sums are kept in units of 2^-36 N; a vertex here adds up at most 200 pairs, each worked out in float32.
FORCE_ROUNDING = 200 * 2.0**-36  # [N]
RELATIVE_ROUNDING = 5e-6


class Pair(NamedTuple):
    """Two bits of cloth nearer than their thickness."""

    corners: np.ndarray  # four vertices
    weights: np.ndarray  # whose sum is the way from the second's nearest point to the first's
    on_edge: bool


def four_regions(packed: np.ndarray) -> np.ndarray:
    """Regions of four vertices, packed in a word each as kernels.contact.arrays's pair_regions does, shape [N, 4]."""
    shift = np.array([0, 16, 32, 48], dtype=np.uint64)
    return ((packed[:, None] >> shift) & np.uint64(REGIONS - 1)).astype(np.int64)


def on_segment(p: np.ndarray, a: np.ndarray, b: np.ndarray) -> float:
    """Share of the way from a to b nearest to p."""
    return float(np.clip((p - a) @ (b - a) / max((b - a) @ (b - a), 1e-60), 0.0, 1.0))


def triangle_weights(p: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Barycentric coordinates of the nearest point: the foot if it is inside, or the nearest on a side."""
    a, b, c = corners
    foot = np.linalg.lstsq(np.stack([b - a, c - a], axis=1), p - a, rcond=None)[0]
    if (foot >= 0.0).all() and foot.sum() <= 1.0:
        return np.array([1.0 - foot.sum(), *foot])
    found = []
    for k in range(3):
        share = on_segment(p, corners[k], corners[(k + 1) % 3])
        weights = np.zeros(3)
        weights[k], weights[(k + 1) % 3] = 1.0 - share, share
        found.append(weights)
    return min(found, key=lambda weights: float(np.linalg.norm(p - weights @ corners)))


def edge_weights(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> tuple[float, float]:
    """Shares along a b and c d where they are nearest: where the lines are, if within both, or at an end."""
    lines = np.stack([b - a, c - d], axis=1)
    if np.linalg.matrix_rank(lines) == 2:
        s, t = np.linalg.lstsq(lines, c - a, rcond=None)[0]
        if 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0:
            return float(s), float(t)
    ends = [
        (on_segment(c, a, b), 0.0),
        (on_segment(d, a, b), 1.0),
        (0.0, on_segment(a, c, d)),
        (1.0, on_segment(b, c, d)),
    ]
    return min(ends, key=lambda st: float(np.linalg.norm(a + st[0] * (b - a) - c - st[1] * (d - c))))


def rest_neighbours(cloth_contact: ClothContact) -> list[set[int]]:
    start, near = cloth_contact.pair_search.geometry.near_start.numpy(), cloth_contact.pair_search.geometry.near.numpy()
    order = cloth_contact.order.numpy() if cloth_contact.order else np.arange(len(start) - 1)
    rows = [set(order[near[a:b]].tolist()) for a, b in pairwise(start)]
    return [rows[place] for place in np.argsort(order)]


def touching_pairs(points: Points, cloth_contact: ClothContact, only: int | None = None) -> list[Pair]:
    """Every vertex with every triangle, every edge with every later one, nearer than the thickness.

    ``only``: those of one vertex.
    """
    near = rest_neighbours(cloth_contact)
    triangles, edges = cloth_contact.sheets.triangles, cloth_contact.sheets.edges
    thickness = float(cloth_contact.data.model.thickness.numpy()[0])
    pairs = []

    def boxes(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return points[rows].min(axis=1) - thickness, points[rows].max(axis=1) + thickness

    low, high = boxes(triangles)
    for vertex, p in enumerate(points):
        for t in np.flatnonzero(((p >= low) & (p <= high)).all(axis=1)):
            corners = triangles[t]
            wanted = only is None or only in (vertex, *corners)
            if wanted and near[vertex].isdisjoint(corners.tolist()):
                weights = triangle_weights(p, points[corners])
                if np.linalg.norm(p - weights @ points[corners]) < thickness:
                    pairs.append(Pair(np.array([vertex, *corners]), np.array([1.0, *-weights]), False))
    low, high = boxes(edges)
    for e, (i, j) in enumerate(edges):
        lower, upper = points[[i, j]].min(axis=0), points[[i, j]].max(axis=0)
        for o in np.flatnonzero(((upper >= low) & (lower <= high)).all(axis=1)):
            k, m = edges[o]
            wanted = o > e and (only is None or only in (i, j, k, m))
            if wanted and near[i].isdisjoint((k, m)) and near[j].isdisjoint((k, m)):
                s, t = edge_weights(*points[[i, j, k, m]])
                weights = np.array([1.0 - s, s, t - 1.0, -t])
                if np.linalg.norm(weights @ points[[i, j, k, m]]) < thickness:
                    pairs.append(Pair(np.array([i, j, k, m]), weights, True))
    return pairs


def squared_sine(d0: np.ndarray, d1: np.ndarray) -> float:
    cross = np.cross(d0, d1)
    return float(cross @ cross / ((d0 @ d0) * (d1 @ d1)))


def squeeze(distance: float, thickness: float, modulus: float) -> tuple[float, float]:
    """Energy and force: m h^2 (1/x + 3 x - x^2 - 3), m h (1/x^2 - 3 + 2 x)."""
    x = distance / thickness
    return modulus * thickness**2 * (1 / x + 3 * x - x * x - 3), modulus * thickness * (1 / x**2 - 3 + 2 * x)


def pair_energy(points: Points, pair: Pair, thickness: float, modulus: float) -> float:
    """Energy of a pair [J]."""
    x = points[pair.corners]
    energy = squeeze(float(np.linalg.norm(pair.weights @ x)), thickness, modulus)[0]
    share = squared_sine(x[1] - x[0], x[3] - x[2]) / PARALLEL if pair.on_edge else 1.0
    return energy * (share * (2.0 - share) if share < 1.0 else 1.0)


def constants(cloth_contact: ClothContact) -> tuple[float, float]:
    """Thickness [m] and modulus [N/m] of garments of one fabric."""
    fabric = cloth_contact.data.model.fabric.numpy()[0]
    return float(fabric["thickness"]), float(fabric["squeeze_modulus"])


def brute_energy(points: Points, pairs: list[Pair], cloth_contact: ClothContact) -> float:
    """Energy of all pairs [J]."""
    return sum(pair_energy(points, pair, *constants(cloth_contact)) for pair in pairs)


def brute_forces(points: Points, pairs: list[Pair], cloth_contact: ClothContact) -> np.ndarray:
    """Force on each vertex [N], shape [V, 3]."""
    thickness, modulus = constants(cloth_contact)
    force = np.zeros_like(points)
    for pair in pairs:
        x = points[pair.corners]
        way = pair.weights @ x
        distance = float(np.linalg.norm(way))
        energy, push = squeeze(distance, thickness, modulus)
        if pair.on_edge:
            d0, d1 = x[1] - x[0], x[3] - x[2]
            share = squared_sine(d0, d1) / PARALLEL
            if share < 1.0:
                push *= share * (2.0 - share)
                steep = 2.0 * (1.0 - share) / PARALLEL * energy
                dot, a, b = d0 @ d1, d0 @ d0, d1 @ d1
                by_d0 = steep * 2.0 * dot / (a * b) * (d0 * dot / a - d1)
                by_d1 = steep * 2.0 * dot / (a * b) * (d1 * dot / b - d0)
                for corner, turn in zip(pair.corners, (by_d0, -by_d0, by_d1, -by_d1), strict=True):
                    force[corner] += turn
        for corner, weight in zip(pair.corners, pair.weights, strict=True):
            force[corner] += weight * push * way / distance
    return force

"""Strips of cloth as the bench cuts them, in the meshings that a material may not depend on."""

from __future__ import annotations

import numpy as np
from scipy.spatial import Delaunay

from warp_cloth.base.mesh import Mesh

MESHINGS = ("alternating", "parallel", "turned", "random")


def swatch(width: float, length: float, edge: float, meshing: str) -> Mesh:
    """A rectangle of about this edge length [m], laid as ``warp_cloth.bench.swatch.strip`` lays it.

    Regular grids with alternating or parallel diagonals, a grid turned by 30 degrees, or random points at least two
    thirds of an edge apart; the last two in a Delaunay triangulation.
    """
    columns, rows = round(width / edge), round(length / edge)
    if meshing in ("alternating", "parallel"):
        x, y = np.meshgrid(np.linspace(0.0, width, columns + 1), np.linspace(0.0, length, rows + 1))
        flat = np.column_stack([x.ravel(), y.ravel()])
        row, column = (part.ravel() for part in np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"))
        a = row * (columns + 1) + column
        b, c, d = a + 1, a + columns + 2, a + columns + 1
        rising = ((row + column) % 2 == 0) | (meshing == "parallel")
        first = np.where(rising[:, None], np.column_stack([a, b, c]), np.column_stack([a, b, d]))
        second = np.where(rising[:, None], np.column_stack([a, c, d]), np.column_stack([b, c, d]))
        return _laid(meshing, flat, np.concatenate([first, second]), length)
    inside = _turned(width, length, edge) if meshing == "turned" else _random(width, length, edge)
    flat = np.concatenate([_border(width, length, columns, rows), inside])
    triangles = Delaunay(flat).simplices
    sides = flat[triangles[:, 1:]] - flat[triangles[:, :1]]
    doubled = sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]
    triangles[doubled < 0.0] = triangles[doubled < 0.0][:, ::-1]
    return _laid(meshing, flat, triangles[np.abs(doubled) > 1e-3 * edge**2], length)  # without those of the border


def _laid(name: str, flat: np.ndarray, triangles: np.ndarray, length: float) -> Mesh:
    across = flat[:, 0] - 0.5 * flat[:, 0].max()
    points = np.column_stack([across, np.zeros(len(flat)), 0.5 * length - flat[:, 1]])
    return Mesh(name, points, triangles.astype(np.int32), texcoords=flat[triangles])


def _border(width: float, length: float, columns: int, rows: int) -> np.ndarray:
    x, y = np.linspace(0.0, width, columns + 1), np.linspace(0.0, length, rows + 1)[1:-1]
    ends = [np.column_stack([x, np.full_like(x, at)]) for at in (0.0, length)]
    sides = [np.column_stack([np.full_like(y, at), y]) for at in (0.0, width)]
    return np.concatenate([*ends, *sides])


def _clear(points: np.ndarray, width: float, length: float, edge: float) -> np.ndarray:
    low, high = 0.45 * edge, np.array([width, length]) - 0.45 * edge
    return points[((points > low) & (points < high)).all(axis=1)]


def _turned(width: float, length: float, edge: float) -> np.ndarray:
    reach = np.arange(-round((width + length) / edge), round((width + length) / edge) + 1) * edge
    x, y = (part.ravel() for part in np.meshgrid(reach, reach))
    turn = np.radians(30.0)
    points = np.column_stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)])
    # four corners of a square lie on a circle: a hair's breadth decides which diagonal is drawn
    points += np.random.default_rng(1).normal(scale=1e-4 * edge, size=points.shape)
    return _clear(points + 0.5 * np.array([width, length]), width, length, edge)


def _random(width: float, length: float, edge: float) -> np.ndarray:
    random = np.random.default_rng(1)
    candidates = random.uniform(0.0, [width, length], (round(25 * width * length / edge**2), 2))
    kept = np.zeros((0, 2))
    for candidate in _clear(candidates, width, length, edge):
        if not len(kept) or ((kept - candidate) ** 2).sum(axis=1).min() > (0.65 * edge) ** 2:
            kept = np.vstack([kept, candidate])
    return kept

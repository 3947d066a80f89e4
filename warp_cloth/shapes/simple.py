"""Square cloth and sphere: shapes whose every measure is known exactly."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh

MOST_DIVISIONS = 512  # of an icosahedron's edge: 2.6 million vertices; beyond it a stated edge is a slip of the unit
ICOSAHEDRON_ARC = math.atan(2)  # angle of an edge seen from the centre
ICOSAHEDRON_FACES = (
    "0 11 5, 0 5 1, 0 1 7, 0 7 10, 0 10 11, 1 5 9, 5 11 4, 11 10 2, 10 7 6, 7 1 8, "
    "3 9 4, 3 4 2, 3 2 6, 3 6 8, 3 8 9, 4 9 5, 2 4 11, 6 2 10, 8 6 7, 9 8 1"
)


def square(
    *,
    side: float = 1.0,
    vertices_per_side: int = 33,
    height: float = 1.0,
    plane: Literal["horizontal", "vertical"] = "horizontal",
    centre: Sequence[float] = (0.0, 0.0),
) -> Mesh:
    """Square cloth in a regular grid whose diagonals alternate, so that the bias has no preferred side.

    Horizontal it lies at y = ``height``, facing up; vertical it hangs facing +z, its top edge at y = ``height``.
    ``centre`` is the (x, z) of its middle. Texture coordinates are metres from its lower left corner.
    """
    if not (side > 0 and math.isfinite(side)):
        raise InputError("square side", f"{side!r} m is not a length", "give a positive length in metres")
    if vertices_per_side < 2:
        raise InputError("square vertices_per_side", f"{vertices_per_side!r} vertices make no square", "give 2 or more")
    if plane not in ("horizontal", "vertical"):
        raise InputError("square plane", f"{plane!r} is unknown", 'use "horizontal" or "vertical"')
    n = int(vertices_per_side)
    steps = np.linspace(0, side, n)
    u, v = (grid.ravel() for grid in np.meshgrid(steps, steps, indexing="xy"))
    x = u - side / 2 + centre[0]
    if plane == "horizontal":
        points = np.column_stack([x, np.full(n * n, float(height)), side / 2 - v + centre[1]])
    else:
        points = np.column_stack([x, v - side + height, np.full(n * n, float(centre[1]))])
    row, column = (grid.ravel() for grid in np.meshgrid(np.arange(n - 1), np.arange(n - 1), indexing="ij"))
    corner = row * n + column
    a, b, c, d = corner, corner + 1, corner + n + 1, corner + n  # counter-clockwise in u, v
    even = ((row + column) % 2 == 0)[:, None]
    first = np.where(even, np.column_stack([a, b, c]), np.column_stack([a, b, d]))
    second = np.where(even, np.column_stack([a, c, d]), np.column_stack([b, c, d]))
    triangles = np.stack([first, second], axis=1).reshape(-1, 3).astype(np.int32)
    texcoords = np.column_stack([u, v])[triangles]
    panels = np.zeros(len(triangles), dtype=np.int32)
    return Mesh("square", points, triangles, texcoords=texcoords, panels=panels, panel_names=("square",))


def sphere(*, radius: float = 0.3, centre: Sequence[float] = (0.0, 0.6, 0.0), edge: float = 0.02) -> Mesh:
    """Closed sphere with outward winding: an icosahedron, its faces divided until edges are about ``edge`` [m]."""
    if not (radius > 0 and math.isfinite(radius)):
        raise InputError("sphere radius", f"{radius!r} m is not a length", "give a positive length in metres")
    if not (edge > 0 and math.isfinite(edge)):
        raise InputError("sphere edge", f"{edge!r} m is not a length", "give a positive length in metres")
    divisions = max(1, round(radius * ICOSAHEDRON_ARC / edge))
    if divisions > MOST_DIVISIONS:
        raise InputError("sphere edge", f"{edge} m is too fine for a radius of {radius} m", "give a longer edge")
    corners, faces = _icosahedron()
    i, j = np.meshgrid(np.arange(divisions + 1), np.arange(divisions + 1), indexing="ij")
    inside = i + j <= divisions
    weights = np.column_stack([(divisions - i - j)[inside], i[inside], j[inside]])  # of a face's three corners
    directions = np.einsum("sk,fkd->fsd", weights / divisions, corners[faces]).reshape(-1, 3)
    # a point is known by the corners and weights that make it, whichever face it is seen from
    parts = np.where(weights > 0, faces[:, None, :] * (divisions + 1) + weights, 0)
    parts = np.sort(parts.reshape(-1, 3), axis=1)
    base = 12 * (divisions + 1) + 1
    keys = (parts[:, 0] * base + parts[:, 1]) * base + parts[:, 2]
    _, first, index = np.unique(keys, return_index=True, return_inverse=True)
    directions = directions[first] / np.linalg.norm(directions[first], axis=1, keepdims=True)
    number = np.full(inside.shape, -1)
    number[inside] = np.arange(len(weights))
    start, right, above, across = number[:-1, :-1], number[1:, :-1], number[:-1, 1:], number[1:, 1:]
    whole, twin = right >= 0, across >= 0
    cells = np.vstack(
        [
            np.column_stack([start[whole], right[whole], above[whole]]),
            np.column_stack([right[twin], across[twin], above[twin]]),
        ]
    )
    offsets = len(weights) * np.arange(len(faces))
    triangles = index.ravel()[(cells + offsets[:, None, None]).reshape(-1, 3)]
    return Mesh("sphere", radius * directions + np.asarray(centre, dtype=float), triangles.astype(np.int32))


def _icosahedron() -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Unit corners, shape [12, 3], and outward faces, shape [20, 3]."""
    golden = (1 + math.sqrt(5)) / 2
    plane = np.array([(-1, golden), (1, golden), (-1, -golden), (1, -golden)])
    corners = np.zeros((12, 3))
    corners[0:4, 0:2] = plane
    corners[4:8, 1:3] = plane
    corners[8:12, 2], corners[8:12, 0] = plane[:, 0], plane[:, 1]
    faces = np.array([[int(corner) for corner in face.split()] for face in ICOSAHEDRON_FACES.split(",")])
    return corners / math.hypot(1, golden), faces

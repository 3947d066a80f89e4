"""Garments that lie on themselves: a sheet folded over, a sleeve turned up inside itself, a pleated skirt."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from warp_cloth.base.mesh import Indices, Points

SHEET_GAP = 0.012  # [m] between the halves of the sheet
SLEEVE_GAP = 0.006  # [m]
PLEAT_GAP = 0.004  # [m] from layer to layer
BALL = {"shape": {"kind": "sphere", "radius": 0.15, "centre": [0.0, 0.15, 0.0]}}
HANGING = {"pin": {"loop": "top"}}


class Folded(NamedTuple):
    """A mesh as it starts, and where its vertices are on the flat cloth, for each corner of each triangle."""

    points: Points  # [m], shape [V, 3]
    triangles: Indices  # shape [F, 3]
    texcoords: Points  # [m], shape [F, 3, 2]


def _cloth(columns: int, rows: int, u: np.ndarray, v: np.ndarray, girth: float | None = None) -> tuple[Indices, Points]:
    """Triangles of a grid, row by row, and their texture coordinates; ``girth`` [m]: closed to a tube of that."""
    quads = columns if girth else columns - 1
    a = (np.arange(rows - 1)[:, None] * columns + np.arange(quads)).ravel()
    b = (np.arange(rows - 1)[:, None] * columns + (np.arange(quads) + 1) % columns).ravel()
    one = np.stack([a, b, b + columns, a, b + columns, a + columns], axis=1).reshape(-1, 2, 3)
    two = np.stack([a, b, a + columns, b, b + columns, a + columns], axis=1).reshape(-1, 2, 3)
    even = (np.arange(len(a)) // quads + np.arange(len(a)) % quads) % 2 == 0
    triangles = np.where(even[:, None, None], one, two).reshape(-1, 3)
    flat = np.stack([u, v], axis=1)[triangles]
    if girth:  # the last column's quads go on to where the first lies a girth farther
        over = np.ptp(flat[:, :, 0], axis=1) > 0.5 * girth
        flat[over, :, 0] += np.where(flat[over, :, 0] < 0.5 * girth, girth, 0.0)
    return triangles.astype(np.int32), flat


def folded_sheet(count: int, side: float, height: float) -> Folded:
    """A square sheet at a height, one half folded over the other by a half turn."""
    u, v = (each.ravel() for each in np.meshgrid(*[np.linspace(0.0, side, count)] * 2))
    radius = 0.5 * SHEET_GAP
    straight = 0.5 * (side - np.pi * radius)
    turn = np.clip((u - straight) / radius, 0.0, np.pi)
    beyond = np.maximum(u - straight - np.pi * radius, 0.0)
    x = np.minimum(u, straight) + radius * np.sin(turn) - beyond
    points = np.stack([x - 0.25 * side, height + radius * (1.0 - np.cos(turn)), v - 0.5 * side], axis=1)
    return Folded(points, *_cloth(count, count, u, v))


def turned_sleeve(columns: int, rows: int, radius: float, length: float, turned: float) -> Folded:
    """A hanging tube whose lowest ``turned`` metres are pushed up inside it."""
    angle, y = (
        each.ravel() for each in np.meshgrid(np.arange(columns) * 2.0 * np.pi / columns, np.linspace(0.0, length, rows))
    )
    half = 0.5 * SLEEVE_GAP
    turn = np.clip((turned - y) / half, 0.0, np.pi)
    up = np.maximum(turned - y - np.pi * half, 0.0)
    r = radius - half * (1.0 - np.cos(turn))
    height = np.maximum(y, turned) - half * np.sin(turn) + up
    points = np.stack([r * np.cos(angle), height, r * np.sin(angle)], axis=1)
    return Folded(points, *_cloth(columns, rows, radius * angle, y, 2.0 * np.pi * radius))


def pleated_skirt(pleats: int, along: int, rows: int, waist: float, length: float, flare: float) -> Folded:
    """Knife pleats all round: three layers everywhere, cloth three times the waist; ``waist`` and ``flare`` are radii.

    A pleat runs forward on the outside, back in the middle and forward on the inside, ``along`` edges each time.
    """
    width, gap = 2.0 * np.pi * waist / pleats, PLEAT_GAP
    end = 0.12 * width
    way = [(0.0, 2.0), (width - end, 2.0), (width - end, 1.0), (end, 1.0), (end, 0.0), (width, 0.0), (width, 2.0)]
    runs = [
        np.linspace(way[k], way[k + 1], count, endpoint=False) for k, count in enumerate((along, 1, along, 1, along, 2))
    ]
    one = np.concatenate(runs) * [1.0, gap]
    ring = np.concatenate([one + np.array([k * width, 0.0]) for k in range(pleats)])
    steps = np.linalg.norm(np.diff(np.concatenate([ring, ring[:1] + np.array([pleats * width, 0.0])]), axis=0), axis=1)
    u, y = (each.ravel() for each in np.meshgrid(np.cumsum(steps) - steps, np.linspace(0.0, length, rows)))
    angle, out = (np.tile(ring[:, axis], rows) for axis in (0, 1))
    r = waist + out + flare * (1.0 - y / length)
    points = np.stack([r * np.cos(angle / waist), y, r * np.sin(angle / waist)], axis=1)
    return Folded(points, *_cloth(len(ring), rows, u, y, float(steps.sum())))

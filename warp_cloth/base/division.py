"""Triangles divided at the middles of their sides: each in four, or only where sides are long."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices, Points
from warp_cloth.base.topology import mesh_edges

Ints = NDArray[np.int64]

# The corners of a triangle, then the middles of its sides 0 1, 1 2 and 2 0, in parts of its corners
NODES = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]])
TURNED = np.array([1, 2, 0, 4, 5, 3])  # what its nodes are, seen from the next corner
WHOLE = np.array([[0, 1, 2]])
IN_TWO = np.array([[0, 3, 2], [3, 1, 2]])  # where side 0 is divided
IN_THREE = np.array([[3, 1, 4], [0, 3, 4], [0, 4, 2]])  # sides 0 and 1, and the rest from corner 0 to the middle of 1
IN_THREE_ELSE = np.array([[3, 1, 4], [0, 3, 2], [3, 4, 2]])
IN_FOUR = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])
MOST_ROUNDS = 20  # of halving
NARROW = 0.5  # times a triangle's longest side, up to which another one waits: else its parts would be as narrow


@dataclass(frozen=True, eq=False)
class Division:
    """Triangles of which some are parts of earlier ones."""

    triangles: Indices  # shape [F, 3]
    source: Ints  # the earlier triangle of each, shape [F]
    weights: Points  # of that one's corners at each of its corners, shape [F, 3, 3]

    def held(self, corners: Points) -> Points:
        """What they have at their corners, where earlier ones had ``corners``; shape [F, 3, k]."""
        found: Points = np.einsum("fnc,fck->fnk", self.weights, corners[self.source])
        return found


def divided(points: Points, triangles: Indices) -> tuple[Points, Indices]:
    """A mesh with each triangle in four: its points, the middles of its edges after them [m], and its triangles."""
    points, parts = _at_sides(points, triangles, points[triangles], np.ones(triangles.shape, dtype=bool))
    return points, parts.triangles


def refined(points: Points, triangles: Indices, corners: Points, longest: float) -> tuple[Points, Division]:
    """A mesh without long sides: its points, further ones after them [m], and the parts of its triangles.

    Args:
        points: [m], shape [V, 3].
        triangles: shape [F, 3].
        corners: of the triangles, between which sides are measured [m], shape [F, 3, 2 or 3].
        longest: side [m].
    """
    count = len(triangles)
    whole = Division(triangles, np.arange(count), np.broadcast_to(np.eye(3), (count, 3, 3)))
    for _ in range(MOST_ROUNDS):
        now = whole.held(corners)
        sides = np.linalg.norm(np.roll(now, -1, axis=1) - now, axis=2)
        is_long = (sides > longest) & (sides > NARROW * sides.max(axis=1, keepdims=True))
        if not is_long.any():
            break
        points, parts = _at_sides(points, whole.triangles, now, is_long)
        weights = np.einsum("fnc,fck->fnk", parts.weights, whole.weights[parts.source])
        whole = Division(parts.triangles, whole.source[parts.source], weights)
    return points, whole


def _at_sides(points: Points, triangles: Indices, corners: Points, at: NDArray[np.bool_]) -> tuple[Points, Division]:
    """A mesh divided in the middle of every edge that is one of the sides ``at``, shape [F, 3], of a triangle."""
    edges = mesh_edges(triangles, len(points)).astype(np.int64)
    keys = edges[:, 0] * len(points) + edges[:, 1]
    sides = np.stack([triangles, np.roll(triangles, -1, axis=1)]).astype(np.int64)
    edge = np.searchsorted(keys, sides.min(axis=0) * len(points) + sides.max(axis=0))
    halved = np.bincount(edge[at], minlength=len(edges)) > 0
    nodes = np.hstack([triangles, len(points) + np.cumsum(halved)[edge] - 1])
    is_cut = halved[edge]
    parts: list[Ints] = []
    sources: list[Ints] = []
    weights: list[Points] = []

    def cut(which: NDArray[np.bool_], into: Ints, turn: Ints) -> None:
        source = np.flatnonzero(which)
        for part in turn[into]:
            parts.append(nodes[source][:, part])
            sources.append(source)
            weights.append(np.broadcast_to(NODES[part], (len(source), 3, 3)))

    count, turn = is_cut.sum(axis=1), np.arange(6)
    cut(count == 3, IN_FOUR, turn)
    middles = 0.5 * (corners + np.roll(corners, -1, axis=1))
    for first in range(3):
        second, third = (first + 1) % 3, (first + 2) % 3
        cut((count == 1) & is_cut[:, first], IN_TWO, turn)
        across = np.linalg.norm(corners[:, first] - middles[:, second], axis=1)
        shorter = across <= np.linalg.norm(corners[:, third] - middles[:, first], axis=1)
        both = (count == 2) & ~is_cut[:, third]
        cut(both & shorter, IN_THREE, turn)
        cut(both & ~shorter, IN_THREE_ELSE, turn)
        turn = TURNED[turn]
    cut(count == 0, WHOLE, np.arange(6))
    division = Division(np.concatenate(parts).astype(np.int32), np.concatenate(sources), np.concatenate(weights))
    return np.vstack([points, points[edges[halved]].mean(axis=1)]), division

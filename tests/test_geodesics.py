"""Distances, parts, nearest points and crossings of curves, against SciPy and brute force."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from warp_cloth.anatomy.crossings import cone_crossings, surface_crossings
from warp_cloth.anatomy.geodesics import EdgeGraph, level_lines, nearest_points
from warp_cloth.base.connected import connected_components
from warp_cloth.base.topology import build_topology, mesh_edges

SEEDS = range(8)


def random_graph(seed: int) -> tuple[NDArray[np.int32], NDArray[np.float64], int]:
    """Edges of a random graph of several parts, their lengths, some of them equal or 0, and the number of vertices."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 400))
    edges = rng.integers(0, count, (int(rng.integers(1, 2 * count)), 2))
    edges = np.unique(np.sort(edges[edges[:, 0] != edges[:, 1]], axis=1), axis=0).astype(np.int32)
    lengths = np.where(rng.random(len(edges)) < 0.3, rng.integers(0, 3, len(edges)), rng.random(len(edges)))
    return edges, lengths.astype(np.float64), count


@pytest.mark.parametrize("seed", SEEDS)
def test_distances_have_the_bits_of_scipy(seed: int) -> None:
    sparse, csgraph = pytest.importorskip("scipy.sparse"), pytest.importorskip("scipy.sparse.csgraph")
    edges, lengths, count = random_graph(seed)
    matrix = sparse.coo_matrix((np.maximum(lengths, 1e-9), (edges[:, 0], edges[:, 1])), shape=(count, count)).tocsr()
    graph = EdgeGraph(edges, lengths, count)
    for sources in ([0], [count - 1, 0, count // 2, 0]):
        expected = csgraph.dijkstra(matrix, directed=False, indices=sources, min_only=True)
        assert np.array_equal(graph.distances(np.array(sources, dtype=np.int32)), expected)


@pytest.mark.parametrize("seed", SEEDS)
def test_parts_are_connected_components(seed: int) -> None:
    edges, lengths, count = random_graph(seed)
    assert np.array_equal(
        EdgeGraph(edges, lengths, count).parts(), connected_components(count, edges[:, 0], edges[:, 1])
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_nearest_points_are_those_of_brute_force(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points, queries = rng.normal(size=(200, 3)), rng.normal(size=(50, 3)) * 1.5
    if seed == 0:
        points = points.round(0)  # many at one place
    squares = ((queries[:, None] - points[None]) ** 2).sum(axis=2)
    found = nearest_points(points, queries)
    assert squares[np.arange(50), found] == pytest.approx(squares.min(axis=1), abs=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_edges_are_those_of_the_topology(seed: int) -> None:
    triangles = np.random.default_rng(seed).integers(0, 60, (200, 3)).astype(np.int32)
    assert np.array_equal(mesh_edges(triangles, 60), build_topology(triangles, 60).edges)


def straight_crossings(a: NDArray[np.float64], b: NDArray[np.float64], corners: NDArray[np.float64]) -> int:
    """Triangles, shape [F, 3, 3], through which a segment passes, by solving for the point in each plane."""
    count = 0
    for p, q, r in corners:
        matrix = np.stack([q - p, r - p, a - b], axis=1)
        if abs(np.linalg.det(matrix)) > 1e-14:
            u, v, t = np.linalg.solve(matrix, a - p)
            count += u > 0.0 and v > 0.0 and u + v < 1.0 and 0.0 < t < 1.0
    return int(count)


@pytest.mark.parametrize("seed", SEEDS)
def test_crossings_are_those_of_brute_force(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points, triangles = rng.normal(size=(30, 3)), rng.integers(0, 30, (40, 3)).astype(np.int32)
    curves = [rng.normal(size=(size, 3)) for size in (2, 9, 20)]

    def expected(corners: NDArray[np.float64]) -> list[int]:
        pairs = [list(pairwise(curve)) for curve in curves]
        return [sum(straight_crossings(a, b, corners) for a, b in each) for each in pairs]

    assert surface_crossings(points, triangles, curves).tolist() == expected(points[triangles])
    start, end = points[:12], np.roll(points[:12], -1, axis=0)
    cone = np.stack([np.broadcast_to(start.mean(axis=0), start.shape), start, end], axis=1)
    assert cone_crossings(start, end, curves).tolist() == expected(cone)


def test_no_lines_where_there_are_no_levels_or_triangles() -> None:
    points, triangles = np.eye(3), np.array([[0, 1, 2]], dtype=np.int32)
    values = np.array([0.0, 1.0, np.inf])
    for faces, levels in ((triangles, []), (triangles, [0.5]), (triangles[:0], [0.5])):
        lines = level_lines(points, faces, values, np.array(levels, dtype=np.float64))
        assert lines.girths().tolist() == [0.0] * len(levels)

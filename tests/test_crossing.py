"""Counting where cloth passes through cloth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import warp as wp
from cloths import grid
from designs.geometry import segments_hit

from warp_cloth.base.mesh import Indices, Mesh, Points
from warp_cloth.base.topology import build_topology
from warp_cloth.contact.crossing import Sheets, find_crossings, find_pierced
from warp_cloth.loading import load_mesh

SOUP_SIZE = 60  # triangles, in a box not much wider than each: they cross in many places
TSHIRT_FACES = 217  # of the shared T-shirt that cross as it is loaded, counted by others, too


def sheets(triangles: Indices, *counts: int) -> Sheets:
    """One or more garments of so many vertices each."""
    start = np.concatenate([[0], np.cumsum(counts)])
    topology = build_topology(triangles, int(start[-1]))
    garment = np.searchsorted(start, triangles[:, 0], side="right") - 1
    return Sheets(triangles, topology.edges, topology.triangle_edges, garment.astype(np.int32), tuple(start.tolist()))


def two_grids(offset: list[float], turned: bool) -> tuple[Points, Sheets]:
    """Two squares, the second moved, and turned about the x axis through its middle so that it stands on the first."""
    first, second = grid(5, 0.2), grid(5, 0.2)
    other = second.points - [0.1, 0.1, 0.0]
    if turned:
        other = other[:, [0, 2, 1]]
    triangles = np.concatenate([first.triangles, second.triangles + first.vertex_count]).astype(np.int32)
    points = np.concatenate([first.points, other + np.add(offset, [0.1, 0.1, 0.0])])
    return points, sheets(triangles, first.vertex_count, second.vertex_count)


def test_the_tree_finds_what_every_pair_finds() -> None:
    random = np.random.default_rng(1)
    points = (random.random((SOUP_SIZE, 1, 3)) * 1.5 + random.random((SOUP_SIZE, 3, 3))).reshape(-1, 3)
    triangles = np.arange(3 * SOUP_SIZE, dtype=np.int32).reshape(-1, 3)
    soup = sheets(triangles, len(points))
    found = find_crossings(points, soup, "cpu")
    edge, triangle = np.nonzero(np.ones((len(soup.edges), SOUP_SIZE), dtype=bool))
    apart = (soup.edges[edge][:, :, None] != triangles[triangle][:, None]).all(axis=(1, 2))
    start, end = np.moveaxis(points[soup.edges[edge]], 1, 0)
    pierced = np.flatnonzero(apart & segments_hit(start, end, points[triangles[triangle]]))
    assert len(pierced) > SOUP_SIZE // 2
    assert np.array_equal(found.pierced, np.stack([edge[pierced], triangle[pierced]], axis=1))


def test_what_lies_in_one_plane_crosses_nothing_however_it_is_turned() -> None:
    random = np.random.default_rng(2)
    flat = random.random((SOUP_SIZE, 1, 3)) * 0.15 + random.random((SOUP_SIZE, 3, 3)) * 0.1
    flat[:, :, 2] = 0.0
    soup = sheets(np.arange(3 * SOUP_SIZE, dtype=np.int32).reshape(-1, 3), 3 * SOUP_SIZE)
    for _ in range(10):
        turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
        points = flat.reshape(-1, 3) @ turn + random.normal(size=3)  # rounding is not in the plane
        assert not len(find_crossings(points, soup, "cpu").pairs)


def test_a_sheet_through_another_crosses_along_its_whole_width() -> None:
    points, both = two_grids([0.003, 0.007, 0.002], turned=True)
    found = find_crossings(points, both, "cpu")
    # along a line of the standing sheet: its upright edges, diagonals, and the lying sheet's lines it passes
    assert len(found.pairs) >= 8
    assert {both.garment[a] for a, _ in found.pairs} == {0}
    assert {both.garment[b] for _, b in found.pairs} == {1}


def test_garments_of_different_items_do_not_meet() -> None:
    points, both = two_grids([0.003, 0.007, 0.002], turned=True)
    with wp.ScopedDevice("cpu"):
        triangles, edges = wp.array(both.triangles, dtype=wp.vec3i), wp.array(both.edges, dtype=wp.vec2i)
        item = wp.array(np.repeat([0, 1], np.diff(both.vertex_start)), dtype=wp.int32)
        assert not len(find_pierced(wp.array(points, dtype=wp.vec3d), triangles, edges, item))


@pytest.mark.parametrize("offset", [[0.003, 0.007, 0.001], [0.0, 0.0, 1e-9], [0.003, 0.007, 0.0]])
def test_sheets_that_lie_on_each_other_do_not_cross(offset: list[float]) -> None:
    points, both = two_grids(offset, turned=False)
    assert not len(find_crossings(points, both, "cpu").pairs)


def test_triangles_with_a_common_vertex_cross_where_one_passes_through_the_other() -> None:
    points = np.array([[0.0, 0, 0], [1, -1, 0], [1, 1, 0], [1, 0, -1], [1, 0, 1.0]]) + 0.0
    fan = sheets(np.array([[0, 1, 2], [0, 3, 4]], dtype=np.int32), 5)
    points[3:, 0] = 0.5  # the far side of the second now stands in the first
    found = find_crossings(points, fan, "cpu")
    assert found.pairs.tolist() == [[0, 1]]
    assert found.faces.tolist() == [0, 1]


def test_a_flat_or_folded_garment_does_not_cross_itself() -> None:
    mesh = grid(9, 0.4)
    one = sheets(mesh.triangles, mesh.vertex_count)
    assert not len(find_crossings(mesh.points, one, "cpu").pairs)
    folded = mesh.points.copy()
    over = folded[:, 0] > 0.2
    folded[over, 0] = 0.4 - folded[over, 0]
    folded[over, 2] = 1e-3 + 0.1 * (0.2 - folded[over, 0])
    assert not len(find_crossings(folded, one, "cpu").pairs)


def test_a_shape_that_is_not_finite_is_not_searched() -> None:
    points, both = two_grids([0.003, 0.007, 0.002], turned=True)
    points[3, 1] = np.nan
    assert not len(find_crossings(points, both, "cpu").pairs)


def shared_tshirt(shared_data: Path) -> Mesh:
    return load_mesh(shared_data / "garmentcode" / "tshirt.obj", role="garment", key="garment", rest="uv")


def test_the_shared_tshirt_starts_with_the_crossings_that_are_known(shared_data: Path) -> None:
    mesh = shared_tshirt(shared_data)
    found = find_crossings(mesh.points, sheets(mesh.triangles, mesh.vertex_count), "cpu")
    assert len(found.faces) == TSHIRT_FACES

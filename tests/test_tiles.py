"""Threads work on pairs of triangles: which these are, and that every edge is worked on once."""

from __future__ import annotations

import numpy as np
import pytest
from cloths import cloth_forces, grid, model_of
from scipy.spatial import Delaunay

from warp_cloth.base.cache import Cache
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.topology import build_topology
from warp_cloth.garment.elements import garment_elements
from warp_cloth.garment.rest import RestShape, build_rest_shape
from warp_cloth.kernels.base.options import CODE_BITS, NUMBER_BITS, SLOTS, WORD_CODE, WORD_CONSTANTS, Accumulate, Terms
from warp_cloth.material.fabric import resolve_fabric
from warp_cloth.model.patches import cutting, on_device
from warp_cloth.model.patches.cutting import cut_patches, garment_patches
from warp_cloth.model.patches.tables import PatchTables
from warp_cloth.model.patches.tiles import OUTER_EDGES, assign_edges, find_pairs, with_constants

FABRIC = resolve_fabric({"stretch": 20e3, "compression": 0.1, "bending": 1e-5})
BENT = Terms(edges=True, folds=True, yarns=False)


def cut(mesh: Mesh, monkeypatch: pytest.MonkeyPatch) -> PatchTables:
    monkeypatch.setattr(cutting, "SMALLEST", 100)
    elements = garment_elements(mesh.triangles, build_rest_shape(mesh, FABRIC, rest="mesh"))
    return cut_patches([elements], [mesh.points], BENT, precision="mixed", own_memory=True, paired=True)


def test_pairs_are_mutual_and_across_the_longest_sides() -> None:
    # a strip of four: 0 and 1 share the longest side, so 2, which 1 would rather have had, goes with 3
    partner = np.array([[1, -1, -1], [0, 2, -1], [1, 3, -1], [2, -1, -1]])
    size = np.array([[3.0, 1.0, 1.0], [3.0, 2.0, 1.0], [2.0, 1.0, 1.0], [1.0, 1.0, 1.0]])
    edge = np.array([[0, 1, 2], [0, 3, 4], [3, 5, 6], [5, 7, 8]])
    is_first = partner > np.arange(4)[:, None]
    first, side = find_pairs(partner, edge, size, is_first)
    assert first.tolist() == [0, 0, 2, 2]
    assert side.tolist() == [0, 0, 1, 0]


def test_a_triangle_without_a_free_neighbour_stays_alone() -> None:
    partner = np.array([[1, -1, -1], [0, 2, -1], [1, -1, -1]])
    edge = np.array([[0, 1, 2], [0, 3, 4], [3, 5, 6]])
    first, side = find_pairs(partner, edge, np.ones((3, 3)), partner > np.arange(3)[:, None])
    assert sorted(np.unique(first, return_counts=True)[1].tolist()) == [1, 2]
    assert (side < 0).sum() == 1


def test_no_item_takes_more_than_its_share() -> None:
    rng = np.random.default_rng(3)
    edge = np.repeat(np.arange(200), 2)
    tile = rng.integers(90, size=400)
    taken = assign_edges(edge, tile, 200, 90)
    assert np.bincount(taken[taken >= 0], minlength=90).max() <= OUTER_EDGES
    assert all(taken[each] in (-1, *tile[edge == each]) for each in range(200))
    full = np.bincount(taken[taken >= 0], minlength=90) == OUTER_EDGES
    assert full[tile[taken[edge] < 0]].all()  # none is left that a tile has room for


@pytest.mark.parametrize(
    "triangles",
    [
        [[0, 1, 2], [0, 2, 1]],  # share all their edges
        [[0, 1, 2], [0, 2, 1], [1, 0, 3]],
        [[0, 1, 2], [1, 0, 3], [0, 1, 4], [2, 1, 5]],  # three at an edge
        [[0, 1, 2], [0, 1, 3], [1, 3, 4]],  # wound likewise
    ],
)
def test_triangles_that_meet_as_no_cloth_does_have_the_bits_of_scattered_forces(
    triangles: list[list[int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(on_device, "takes_pairs", lambda terms, vertices: True)
    count = np.max(triangles) + 1
    points = np.random.default_rng(2).normal(size=(count, 3))
    points[:3] = np.eye(3)  # of equal sides
    mesh = Mesh("odd", points, np.array(triangles, dtype=np.int32))
    topology = build_topology(mesh.triangles, count)
    even = np.ones(len(topology.edges))
    rest = RestShape(topology, 0.9 * even, even, 0.1 * even, np.ones(len(topology.hinges)), np.ones(count), 1.0)
    loads = [
        cloth_forces(model_of(mesh, rest, precision="mixed", gathers=how), Accumulate.STIFFNESS)
        for how in (False, True)
    ]
    assert (loads[0] == loads[1]).all()


def test_every_edge_of_a_patch_is_worked_on_once(monkeypatch: pytest.MonkeyPatch) -> None:
    tables = cut(grid(30), monkeypatch)
    rows = tables.patch
    for patch in range(len(rows["vertex_start"])):
        tiles, pairs = rows["tile_count"][patch], (rows["triangle_count"] - rows["tile_count"])[patch]
        assert 0 < pairs <= tiles
        first, count = rows["edge_start"][patch], rows["edge_count"][patch]
        bits = WORD_CODE + CODE_BITS * np.arange(OUTER_EDGES, dtype=np.uint64)
        takes = tables.ends[first : first + tiles] >> bits[:, None] & np.uint64(7) != 0
        there = np.ones(count, dtype=bool)
        there[: SLOTS * tiles] = np.concatenate([np.arange(tiles) < pairs, *takes])
        edges = tables.edge[first : first + count][there]
        assert len(np.unique(edges)) == len(edges)
        start, owned = rows["slot_start"][patch], rows["owned_count"][patch]
        asked = np.unique(tables.edge_slot[start : start + owned].view(np.uint16) >> 1)
        assert there[asked[asked < count]].all()


def test_words_tell_every_edge_its_constants_and_patches_have_each_once(monkeypatch: pytest.MonkeyPatch) -> None:
    tables = cut(grid(30), monkeypatch)
    rows, constants = tables.patch, np.random.default_rng(5).integers(4, size=(len(tables.edge), 2)).astype(np.float32)
    ends, distinct, start, count = with_constants(tables.ends, rows, constants)
    for patch in range(len(count)):
        first, end = rows["edge_start"][patch], rows["edge_start"][patch] + rows["edge_count"][patch]
        tiles, own = rows["tile_count"][patch], distinct[start[patch] : start[patch] + count[patch]]
        assert len(np.unique(own, axis=0)) == len(own)
        third = ends[first + (SLOTS - 1) * tiles : first + SLOTS * tiles]
        words = [*(third >> np.uint64(NUMBER_BITS * slot) for slot in range(SLOTS)), ends[first + SLOTS * tiles : end]]
        words[-1] = words[-1] >> np.uint64(WORD_CONSTANTS)
        told = np.concatenate(words) & np.uint64((1 << NUMBER_BITS) - 1)
        assert (own[told] == constants[first:end]).all()


def test_pairs_count_as_one_of_their_vertices_does(monkeypatch: pytest.MonkeyPatch) -> None:
    tables = cut(grid(30), monkeypatch)
    rows = tables.patch
    for patch in range(len(rows["vertex_start"])):
        pairs, owned = rows["triangle_count"][patch] - rows["tile_count"][patch], rows["owned_count"][patch]
        tile = np.arange(pairs)
        words = tables.ends[rows["edge_start"][patch] + tile]
        corners = words[:, None] >> np.arange(0, 4 * NUMBER_BITS, NUMBER_BITS, dtype=np.uint64)
        found = (corners & np.uint64((1 << NUMBER_BITS) - 1) == tile[:, None]).any(axis=1)
        assert found[:owned].mean() > 0.7


def test_irregular_cloth_is_cut_a_little_smaller_rather_than_in_halves() -> None:
    flat = np.random.default_rng(1).uniform(size=(4000, 2))
    mesh = Mesh("irregular", np.column_stack([flat, np.zeros(len(flat))]), Delaunay(flat).simplices.astype(np.int32))
    elements = garment_elements(mesh.triangles, build_rest_shape(mesh, FABRIC, rest="mesh"))
    (tables,) = garment_patches(
        [elements], [mesh.points], BENT, precision="mixed", cache=Cache(), size=152, paired=True
    )
    owned = tables.patch["owned_count"]
    assert owned.sum() == len(flat)
    assert (owned < 100).mean() < 0.2

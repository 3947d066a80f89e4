"""The coarse level with rigid modes: its blocks are Galerkin's, and it takes what soft cloth would do."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from cloths import grid

from warp_cloth.garment.garment import Garment
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.kernels.implicit.system import system_types
from warp_cloth.material.fabric import Fabric
from warp_cloth.model.model import ClothModel, build_model
from warp_cloth.solver.implicit.coarse_garments import build_hierarchy
from warp_cloth.solver.implicit.coarse_levels import Level, build_levels
from warp_cloth.solver.implicit.rigid_level import FOLLOWED, FRACTION, RigidCorrection, prolongation_over, rigid_depth
from warp_cloth.solver.implicit.sparse import couples
from warp_cloth.solver.implicit.vertex_pairs import build_pairs
from warp_cloth.solver.reduction import split_into_chunks

COUNT = 25  # vertices along a side


@pytest.fixture(scope="module")
def cloth() -> tuple[ClothModel, np.ndarray, list[Level]]:
    """A wrinkled square in float64, its pairs, and its levels down to the one with rigid modes."""
    mesh = grid(COUNT, 0.5)
    points = mesh.points.copy()
    points[:, 2] += 5e-3 * np.sin(50.0 * points[:, 0])
    garment = Garment(points, mesh.triangles, build_rest_shape(mesh, Fabric(), rest="mesh"), np.zeros(0, np.int32))
    model = build_model([garment], device="cpu", precision="float64")
    pairs = build_pairs(model).ends
    levels = build_levels(model, [build_hierarchy(garment)], pairs)
    depth = rigid_depth(levels, model.vertex_count)
    assert depth is not None
    return model, pairs, levels[:depth]


def dense(rigid: RigidCorrection, model: ClothModel) -> np.ndarray:
    """What translations and rotations of the coarse vertices do to the fine ones, shape [3 V, 6 n]."""
    prolongation = rigid.level.prolongation
    start, index, weight = (getattr(prolongation, name).numpy() for name in ("start", "column", "value"))
    centre, points = rigid.level.centre.numpy(), model.points()
    out = np.zeros((len(points), 3, len(centre), 6))
    for vertex in range(len(points)):
        for entry in range(start[vertex], start[vertex + 1]):
            coarse = index[entry]
            x, y, z = points[vertex] - centre[coarse]
            cross = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
            out[vertex, :, coarse] = weight[entry] * np.hstack([np.eye(3), cross])
    return out.reshape(3 * len(points), -1)


def stiffness(model: ClothModel, pairs: np.ndarray, coupling: np.ndarray, anchor: np.ndarray) -> np.ndarray:
    """The matrix of springs and anchors, shape [3 V, 3 V]."""
    count = model.vertex_count
    out = np.zeros((count, 3, count, 3))
    for (i, j), s in zip(pairs, coupling, strict=True):
        out[i, :, i] += s
        out[j, :, j] += s
        out[i, :, j] -= s
        out[j, :, i] -= s
    for i, s in enumerate(anchor):
        out[i, :, i] += s
    return out.reshape(3 * count, -1)


def along(sides: np.ndarray, size: np.ndarray) -> np.ndarray:
    """size u u^T of the sides' directions u, shape [N, 3, 3]."""
    unit = sides / np.linalg.norm(sides, axis=1, keepdims=True)
    return size[:, None, None] * unit[:, :, None] * unit[:, None, :]


def six(m: np.ndarray) -> wp.array:
    """Symmetric matrices as the kernels take them."""
    rows = np.stack([m[:, a, b] for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))], axis=1)
    return wp.array(rows, dtype=wp.types.vector(6, wp.float64), device="cpu")


def test_vertices_follow_few_and_their_weights_add_up(cloth) -> None:
    model, _, levels = cloth
    follow = prolongation_over(levels, model.vertex_count)
    assert follow.shape[1] == levels[-1].count <= FRACTION * model.vertex_count
    assert np.bincount(follow.row).max() == FOLLOWED
    assert np.bincount(follow.row, follow.value) == pytest.approx(1.0, abs=1e-6)


def test_every_two_entries_of_an_owner_are_coupled() -> None:
    owner, item = np.array([0, 0, 0, 2]), np.array([3, 5, 7, 1])
    left, right = couples(owner, equal=True)
    found = {tuple(row) for row in np.stack([owner[left], item[left], item[right]], axis=1).tolist()}
    assert found == {(0, 3, 3), (0, 3, 5), (0, 3, 7), (0, 5, 5), (0, 5, 7), (0, 7, 7), (2, 1, 1)}


def test_springs_that_resist_no_rotation_leave_most_of_a_wrinkled_cloths_force_to_it(cloth) -> None:
    model, pairs, levels = cloth
    random = np.random.default_rng(1)
    points = model.points()
    coupling = along(points[pairs[:, 1]] - points[pairs[:, 0]], random.uniform(1e4, 2e4, len(pairs)))
    anchor = along(random.standard_normal(points.shape), np.full(len(points), 1e-2)) + 1e-3 * np.eye(3)
    rigid = RigidCorrection(model, pairs, levels)
    wp.force_load("cpu", modules=[kernel.module for kernel in rigid.kernels()])
    rigid.renew(six(coupling), six(anchor))

    # the solution on that level, by the dense matrices of what follows it
    follows = dense(rigid, model)
    whole = stiffness(model, pairs, coupling, anchor)
    force = random.standard_normal(len(points) * 3)
    wanted = follows @ np.linalg.solve(follows.T @ whole @ follows, follows.T @ force)

    system, solution = system_types("float64").LinearSystem(), system_types("float64").SolutionState()
    system.normal, solution.residual, solution.correction = (
        wp.zeros(len(points), dtype=wp.vec3d, device="cpu") for _ in range(3)
    )
    system.constraint = wp.zeros(len(points), dtype=wp.int32, device="cpu")
    solution.residual.assign(force.reshape(-1, 3))
    chunks = split_into_chunks(np.array([0, len(points)]), 100, "cpu")
    rho = wp.zeros(len(chunks.garment), dtype=wp.float64, device="cpu")
    rigid.correct(system, solution, chunks, rho, weight=1.0, iterations=400)
    found = solution.correction.numpy().ravel()
    assert found == pytest.approx(wanted, abs=1e-3 * np.abs(wanted).max())
    assert rho.numpy().sum() == pytest.approx(force @ found)

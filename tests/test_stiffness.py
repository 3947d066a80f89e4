"""The linearised forces against finite differences of the forces, and their coarse levels against a dense product."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from cloths import cloth_forces, deformed_model, grid, model_of, slopes, without
from reference import couplings

from warp_cloth.garment.garment import Garment
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.kernels.elements.stiffness import stiffness_types
from warp_cloth.kernels.implicit.coarse_levels import coarsen_anchors_kernel
from warp_cloth.kernels.implicit.sparse import sparse_types
from warp_cloth.kernels.passes.step import NoCollider
from warp_cloth.material.fabric import Fabric
from warp_cloth.model.model import ClothModel
from warp_cloth.solver.implicit.coarse_garments import build_hierarchy
from warp_cloth.solver.implicit.coarse_levels import build_levels
from warp_cloth.solver.implicit.options import ImplicitOptions
from warp_cloth.solver.implicit.step import ImplicitStep
from warp_cloth.solver.implicit.vertex_pairs import build_pairs

DIFFERENCE = 1e-6
ROUNDING = 1e-12
MESH = grid(6, 0.2)
FABRIC = Fabric(stretch_warp=2e4, stretch_weft=1e4, bending_warp=1e-5, bending_weft=1e-5)
WOVEN = Fabric(stretch_warp=2e4, stretch_weft=1e4, shear=50.0, bending_warp=0.0, bending_weft=0.0)
RUBBING = replace(WOVEN, shear_friction=50.0)


def stretched(share: float = 1.1) -> np.ndarray:
    """The grid pulled in its plane, every edge and yarn longer than at rest, and shaken a little."""
    shaken = np.random.default_rng(3).normal(scale=3e-4, size=MESH.points.shape)
    return MESH.points * share + shaken


def matrix_of(model: ClothModel) -> np.ndarray:
    """The couplings as one matrix, shape [3 V, 3 V]: what moving the vertices takes off the forces [N/m]."""
    table, blocks = couplings(model)
    matrix = np.zeros((model.vertex_count, 3, model.vertex_count, 3))
    start, other = table.start.numpy(), table.neighbour.numpy()
    for vertex in range(model.vertex_count):
        for row in range(start[vertex], start[vertex + 1]):
            matrix[vertex, :, other[row]] -= blocks[row]
            matrix[vertex, :, vertex] += blocks[row]
    return matrix.reshape(3 * model.vertex_count, -1)


@pytest.mark.parametrize("fabric", [FABRIC, WOVEN], ids=["edges", "woven"])
def test_stretched_cloth_changes_its_forces_as_linearised(fabric: Fabric) -> None:
    rest = without(build_rest_shape(MESH, fabric, rest="mesh"), bending=True)
    model = model_of(MESH, rest)
    model.set_points(stretched())
    expected = slopes(model)
    assert matrix_of(model) == pytest.approx(expected, abs=DIFFERENCE * np.abs(expected).max())


def test_a_hinge_resists_along_its_angles_gradient() -> None:
    rest = without(build_rest_shape(MESH, FABRIC, rest="mesh"), tension=True)
    points = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.04, 0.08, 0.0], [0.05, -0.06, 0.05]])
    mesh = type(MESH)("hinge", points, np.array([[0, 1, 2], [1, 0, 3]], dtype=np.int32))
    rest = without(build_rest_shape(mesh, FABRIC, rest="mesh"), tension=True)
    model = model_of(mesh, rest)
    force = cloth_forces(model)[:, :3].ravel()
    normals = np.cross(points[1], points[2]), np.cross(points[3], points[1])
    unit = [normal / np.linalg.norm(normal) for normal in normals]
    cosine = float(unit[0] @ unit[1])
    stiffness = rest.hinge_stiffness[rest.hinge_stiffness > 0.0][0]
    gradient = force / (stiffness * (1.0 - cosine))  # of the angle, up to its sign
    expected = stiffness * np.sqrt(1.0 - cosine**2) * np.outer(gradient, gradient)
    assert matrix_of(model) == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("fabric", [FABRIC, WOVEN, RUBBING], ids=["edges", "woven", "rubbing"])
def test_crumpled_cloth_is_never_linearised_to_run_away(fabric: Fabric) -> None:
    crumpled = MESH.points + np.random.default_rng(5).normal(scale=0.02, size=MESH.points.shape)
    matrix = matrix_of(deformed_model(MESH, crumpled, fabric))
    assert np.abs(matrix - matrix.T).max() < ROUNDING * np.abs(matrix).max()
    values = np.linalg.eigvalsh(matrix)
    assert values[0] > -ROUNDING * values[-1]


def test_coarse_blocks_are_those_of_the_dense_product() -> None:
    mesh = grid(17, 0.2)
    rest = build_rest_shape(mesh, FABRIC, rest="mesh")
    pins = np.array([0, 16], dtype=np.int32)
    garment = Garment(mesh.points, mesh.triangles, rest, pins)
    model = model_of(mesh, rest, pins=pins)
    model.set_points(mesh.points * 1.05 + np.random.default_rng(1).normal(scale=1e-3, size=mesh.points.shape))
    table = build_pairs(model)
    levels = build_levels(model, [build_hierarchy(garment)], table.ends)
    assert len(levels) == 1
    step = ImplicitStep(model, None, NoCollider, table, levels, ImplicitOptions())
    step.linearisation.launch()
    step.preconditioner.coarsen_stiffness()
    follow = np.zeros((model.vertex_count, levels[0].count))
    start, index, weight = (getattr(levels[0].prolongation, name).numpy() for name in ("start", "column", "value"))
    for vertex in range(model.vertex_count):
        follow[vertex, index[start[vertex] : start[vertex + 1]]] = weight[start[vertex] : start[vertex + 1]]
    fine = matrix_of(model).reshape(model.vertex_count, 3, model.vertex_count, 3)
    dense = np.einsum("ia,iujv,ja->auv", follow, fine, follow, optimize=True)
    found = step.preconditioner.block[0].numpy()
    expected = np.stack([dense[:, a, b] for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))], axis=1)
    # weights below coarse_levels.SMALLEST are left out
    assert found == pytest.approx(expected, abs=1e-3 * np.abs(expected).max())


@pytest.mark.parametrize(("lumped", "wanted"), [(False, 1.5), (True, 2.0)])
def test_cloth_that_is_anchored_all_around_is_anchored_in_full_on_coarse_levels(lumped: bool, wanted: float) -> None:
    rows = sparse_types("float64").CsrMatrix()
    rows.start = wp.array([0, 3], dtype=wp.int32, device="cpu")
    rows.column = wp.array([0, 1, 2], dtype=wp.int32, device="cpu")
    rows.value = wp.array([0.5, 1.0, 0.5], dtype=wp.float64, device="cpu")
    vec6 = stiffness_types("float64").vec6
    anchor, stiffness, found, inverse = (wp.zeros(count, dtype=vec6, device="cpu") for count in (3, 1, 1, 1))
    anchor.fill_(vec6(1.0, 1.0, 1.0, 0.0, 0.0, 0.0))  # [N/m]
    kernel = coarsen_anchors_kernel("float64")
    wp.launch(kernel, dim=1, inputs=[rows, lumped, anchor, stiffness, found, inverse], device="cpu")
    assert found.numpy()[0] == pytest.approx([wanted] * 3 + [0.0] * 3)
    assert inverse.numpy()[0][:3] == pytest.approx([1.0 / wanted] * 3, rel=1e-5)

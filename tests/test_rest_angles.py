"""Rest angles: cloth that was pressed or shaped goes back to its folds, and flat cloth pays nothing for them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from cloths import cloth_forces, grid, model_of

from warp_cloth.avatar.collider import Collider
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.base.topology import build_topology
from warp_cloth.garment.folds import fold_angles
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.kernels.base.options import Accumulate
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.material.fabric import Fabric, fabric_named
from warp_cloth.model.model import ClothModel
from warp_cloth.model.result import Status
from warp_cloth.scene import load_scene
from warp_cloth.solver.certificate.certifier import Certifier, Tolerance
from warp_cloth.solver.certificate.strains import element_energies
from warp_cloth.solver.forces import ForcePass
from warp_cloth.solver.goal import Goal
from warp_cloth.solver.loop import relax_items
from warp_cloth.solver.relax import Relaxation
from warp_cloth.solver.step_options import StepOptions

FLAT = grid(5, 0.2)
BOARD = Fabric(stretch_warp=2e3, stretch_weft=2e3, bending_warp=1e-5, bending_weft=1e-5)  # it turns soon
CREASE = 0.1  # [m], x of the middle column
ROUNDING = 1e-12  # of a hinge's largest force, in float64


def folded(degrees: float) -> Points:
    """The grid, its right half turned by this about its middle column, without a stretch."""
    points = FLAT.points.copy()
    right = np.maximum(points[:, 0] - CREASE, 0.0)
    points[:, 0] += right * (np.cos(np.radians(degrees)) - 1.0)
    points[:, 2] += right * np.sin(np.radians(degrees))
    return points


def crumpled() -> Mesh:
    """A grid that is nowhere flat, a third of its triangles wound the other way."""
    points = FLAT.points + np.random.default_rng(5).normal(scale=4e-3, size=FLAT.points.shape)
    triangles = FLAT.triangles.copy()
    triangles[::3] = triangles[::3, ::-1]
    return replace(FLAT, points=points, triangles=triangles)


def model_with(mesh: Mesh, rest_angles: str, **options: str) -> ClothModel:
    return model_of(mesh, build_rest_shape(mesh, fabric_named("wool"), rest="mesh", rest_angles=rest_angles), **options)


def test_cloth_in_its_rest_angles_has_no_forces_and_no_energy() -> None:
    mesh = crumpled()
    shaped, flat = model_with(mesh, "mesh"), model_with(mesh, "flat")
    largest = np.abs(cloth_forces(flat)[:, :3]).max()
    assert largest > 0.0
    assert np.abs(cloth_forces(shaped)[:, :3]).max() <= ROUNDING * largest
    assert element_energies(shaped)[1].sum() <= ROUNDING * element_energies(flat)[1].sum()


@pytest.mark.parametrize("degrees", [90.0, -120.0])
def test_a_crease_that_is_pressed_flat_folds_back(degrees: float) -> None:
    mesh = replace(FLAT, points=folded(degrees))
    rest = build_rest_shape(mesh, BOARD, rest="mesh", rest_angles="mesh")
    pins = np.flatnonzero(FLAT.points[:, 0] < 0.06).astype(np.int32)
    model = model_of(mesh, rest, pins=pins, precision="mixed")
    model.set_points(FLAT.points)
    relaxation = Relaxation(model, Collider(), StepOptions())
    relaxation.step.gravity = cloth_types("mixed").vec3(0.0, 0.0, 0.0)
    certifier = Certifier(relaxation)
    wp.force_load("cpu", modules=[kernel.module for kernel in relaxation.kernels() + certifier.kernels()])
    (outcome,) = relax_items(certifier, [Goal(Tolerance(rest_error=1e-4), 20_000)])
    topology = build_topology(mesh.triangles, mesh.vertex_count)
    away = fold_angles(outcome.points, topology) - rest.hinge_angle
    assert outcome.status is Status.AT_REST
    assert np.degrees(np.abs(away)).max() < 1.0  # its torque goes to zero as a square
    assert np.abs(outcome.points - mesh.points).max() < 1e-3


def test_flat_cloth_has_no_arrays_and_no_kernels_for_rest_angles() -> None:
    flat, shaped = model_with(FLAT, "flat"), model_with(crumpled(), "mesh")
    assert not flat.terms.angles
    assert flat.edges.rest is flat.hinges.rest is None
    assert shaped.terms.angles
    assert shaped.edges.rest.size == shaped.edge_count
    kernels, others = (
        ForcePass(model, Accumulate.NONE, wp.zeros(1, dtype=wp.vec4d)).kernels() for model in (flat, shaped)
    )
    assert len(kernels) == len(others)
    assert kernels[1] is not others[1]  # the one that folds edges is made for either
    assert not model_with(FLAT, "mesh").terms.angles  # a flat mesh is flat, whatever is asked for


def test_mixed_precision_agrees_with_double() -> None:
    mesh = crumpled()
    moved = mesh.points + np.random.default_rng(6).normal(scale=1e-3, size=mesh.points.shape)
    exact, single = model_with(mesh, "mesh"), model_with(mesh, "mesh", precision="mixed")
    exact.set_points(moved)
    single.set_points(moved)
    forces = cloth_forces(exact)
    assert np.abs(cloth_forces(single) - forces).max() <= 1e-4 * np.abs(forces).max()


def test_a_scene_says_whether_folds_are_pressed(tmp_path: Path) -> None:
    corners = "".join(f"v {x} {y} {z}\n" for x, z in ((0, 0), (0.1, 0), (0.1, 0.1)) for y in (0, 0.2))
    (tmp_path / "pleat.obj").write_text(corners + "f 1 3 4\nf 1 4 2\nf 3 5 6\nf 3 6 4\n")
    for said, expected in (("", 0.0), ('rest_angles = "flat"\n', 0.0), ('rest_angles = "mesh"\n', 90.0)):
        (tmp_path / "scene.toml").write_text(f'[garment]\nmesh = "pleat.obj"\n{said}')
        rest = load_outfit(load_scene(tmp_path / "scene.toml")).garments[0].rest
        assert np.degrees(np.abs(rest.fold_angle)).max() == pytest.approx(expected)

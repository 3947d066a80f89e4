"""Friction in shear: cloth sheared and let back goes round a loop as wide as 2HG, and a step's bound covers it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cloths import cloth_forces, grid, model_of, without

import warp_cloth
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.bench.specimen import piece
from warp_cloth.bench.swatch import disc
from warp_cloth.garment.laid import laid_by
from warp_cloth.garment.rest import RestKey, RestShape, build_rest_shape
from warp_cloth.kernels.base.options import Accumulate
from warp_cloth.material.constants import CLINGING_SHEAR
from warp_cloth.material.fabric import Fabric, resolve_fabric
from warp_cloth.solver.certificate.strains import element_energies

WIDTH = 0.6  # 2HG [gf/cm]
FRICTION = 0.5 * WIDTH * 0.980665  # [N/m]
PLAIN = resolve_fabric({"stretch": 2e4, "shear": 50.0})
RUBBING = resolve_fabric({"stretch": 2e4, "shear": 50.0, "shear_hysteresis_2HG": WIDTH})
NONE = np.zeros(0, dtype=np.int32)
MESH = disc(0.05, 0.01, 0.01, 0)  # irregular
CURVED = MESH.points + 5.0 * MESH.points[:, :1] ** 2 * [0.0, 1.0, 0.0]


def sheared(angle: float) -> np.ndarray:
    """The disc as a picture frame shears it [rad]: yarns keep their length."""
    flat = MESH.points
    across, along = flat[:, 0] - np.sin(angle) * flat[:, 2], np.cos(angle) * flat[:, 2]
    return np.column_stack([across, flat[:, 1], along])


def moment(rest: RestShape, angle: float) -> float:
    """Moment of the frame over the cloth's area [N/m]."""
    model = model_of(MESH, without(rest, bending=True))
    model.set_points(sheared(angle))
    forces, flat = cloth_forces(model)[:, :3], MESH.points
    change = np.column_stack([-np.cos(angle) * flat[:, 2], 0.0 * flat[:, 1], -np.sin(angle) * flat[:, 2]])
    return float(-(forces * change).sum() / rest.area)


def test_cloth_sheared_and_let_back_goes_round_a_loop_as_wide_as_its_friction() -> None:
    own, plain = piece(MESH, RUBBING, NONE).rest, piece(MESH, PLAIN, NONE).rest
    assert own.yarns is not None
    angles = np.radians([2.0, 4.0, 6.0])
    up = [moment(own, angle) - moment(plain, angle) for angle in angles]
    assert up == pytest.approx(FRICTION * np.cos(angles), rel=1e-6)
    laid = laid_by(own, sheared(np.radians(8.0)))
    back = replace(own, yarns=replace(own.yarns, laid=laid.shear))
    down = [moment(back, angle) - moment(plain, angle) for angle in angles]
    assert down == pytest.approx(-FRICTION * np.cos(angles), rel=1e-6)


def test_yarns_cling_up_to_half_a_degree() -> None:
    own, plain = piece(MESH, RUBBING, NONE).rest, piece(MESH, PLAIN, NONE).rest
    angle = np.radians(0.1)
    found = moment(own, angle) - moment(plain, angle)
    assert found == pytest.approx(FRICTION * np.sin(angle) * np.cos(angle) / CLINGING_SHEAR, rel=1e-6)
    assert laid_by(own, sheared(angle)).shear == pytest.approx(0.0)


@pytest.mark.parametrize("size", [1e-5, 3e-4, 2e-3])
def test_a_step_within_the_bound_leads_downhill(size: float) -> None:
    random, mesh = np.random.default_rng(4), grid(5)
    points = mesh.points + random.normal(scale=2e-3, size=mesh.points.shape)
    step = random.normal(scale=size, size=points.shape)
    energies, loads = [], []
    for fabric in (RUBBING, PLAIN):
        model = model_of(mesh, without(build_rest_shape(mesh, fabric, rest="mesh"), bending=True))
        model.set_points(points)
        loads.append(cloth_forces(model, Accumulate.STIFFNESS))
        here = np.sum(np.concatenate(element_energies(model)))
        model.set_points(points + step)
        energies.append(float(np.sum(np.concatenate(element_energies(model))) - here))
    gained, load = energies[0] - energies[1], loads[0] - loads[1]
    assert (load[:, 3] > 0.0).all()
    quadratic = 0.5 * float(load[:, 3] @ (step**2).sum(axis=1))
    assert gained <= -float((load[:, :3] * step).sum()) + quadratic


def test_a_fabric_states_2hg_and_without_it_there_is_no_part_of_it() -> None:
    assert RUBBING.shear_friction == pytest.approx(FRICTION)
    assert PLAIN.shear_friction == 0.0
    assert not piece(MESH, PLAIN, NONE).terms.shear_hysteresis
    model = model_of(MESH, piece(MESH, PLAIN, NONE).rest)
    assert not model.triangles.shear_hysteresis
    assert not model.weave.shear_hysteresis
    edges = build_rest_shape(MESH, Fabric(shear_friction=1.0), rest="uv")
    assert edges.yarns is None  # whose cloth has no yarns to rub


@pytest.mark.parametrize(
    ("shear", "mesh", "why"),
    [
        (50.0, replace(MESH, texcoords=None, points=CURVED), "the mesh has no texture coordinates"),
        ("edges", MESH, 'its shear is "edges"'),
    ],
)
def test_friction_in_shear_without_yarns_is_told(shear: float | str, mesh: Mesh, why: str) -> None:
    fabric = resolve_fabric({"stretch": 2e4, "shear": shear, "shear_hysteresis_2HG": WIDTH})
    rest: RestKey = "mesh" if mesh.texcoords is None else "uv"
    told = [note for note in build_rest_shape(mesh, fabric, rest=rest).notes if "shear_hysteresis_2HG" in note]
    assert len(told) == 1
    assert why in told[0]
    assert not any("2HG" in note for note in build_rest_shape(MESH, RUBBING, rest="uv").notes)


def test_a_fit_tells_both_ends_of_its_band_on_request() -> None:
    fabric = {"bending_hysteresis_2HB": 0.1, "shear_hysteresis_2HG": 1.0}
    shape = {"kind": "square", "vertices_per_side": 7, "side": 0.2}
    scene = {"garment": {"shape": shape, "fabric": fabric, "pin": {"loop": "top"}}}
    fit = warp_cloth.fit(scene, device="cpu", band=True)
    (worn,) = fit.garments
    band = fit.report["friction_band"]
    assert fit.worn
    assert (band["status"], band["pulled_down"]) == ("at_rest", "at_rest")
    apart = np.linalg.norm(worn.let_down - worn.points, axis=1)
    assert band["apart_mm"]["max"] == pytest.approx(1e3 * apart.max())
    assert apart.max() > 0.0
    scene["garment"]["fabric"] = {}
    with pytest.raises(InputError, match="no fabric has friction"):
        warp_cloth.fit(scene, device="cpu", band=True)
    assert "friction_band" not in warp_cloth.fit(scene, device="cpu").report

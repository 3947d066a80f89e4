"""Friction in bending: a hinge goes round a loop as wide as 2HB, and rest is a band between two certified shapes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cloths import cloth_forces, grid, model_of, without

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.bench.specimen import Specimens, piece
from warp_cloth.bench.swatch import disc, strip
from warp_cloth.garment.folds import fold_angles
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.laid import laid_by
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.material.fabric import Fabric, resolve_fabric
from warp_cloth.material.hysteresis import Laid, slid
from warp_cloth.solver.certificate.certifier import Tolerance

C = 0.02  # bending length of the cloth [m]
FABRIC = resolve_fabric({"weight_gsm": 160, "bending_length_mm": 1e3 * C, "stretch": 4e5})
RUBBING = resolve_fabric(
    {"weight_gsm": 160, "bending_length_mm": 1e3 * C, "stretch": 4e5, "bending_hysteresis_2HB": 0.06}
)
MOMENT = 0.5 * 0.06 * 9.80665e-3  # [N]
HEIGHT, AXIS = 0.05, 0.1  # of a single hinge [m]
STEEP = 20.0
FITTED = 0.1  # hinges are fitted to folds that have balanced, and at the border to what would lie beyond


def folded(angle: float) -> np.ndarray:
    """A hinge of two triangles, one of them turned up by an angle [rad]."""
    side = np.array([0.5 * AXIS, -HEIGHT * np.cos(angle), HEIGHT * np.sin(angle)])
    return np.array([[0.0, 0.0, 0.0], [AXIS, 0.0, 0.0], [0.5 * AXIS, HEIGHT, 0.0], side])


def torque(angle: float, moment: float, laid: float) -> float:
    """Torque that flattens a hinge [N m], of friction and of the cosine law."""
    mesh = Mesh("hinge", folded(0.0), np.array([[0, 1, 2], [1, 0, 3]], dtype=np.int32))
    rest = without(build_rest_shape(mesh, FABRIC, rest="mesh"), tension=True)
    rest = replace(rest, hinge_slider=np.array([[moment, STEEP]]), hinge_laid=np.array([laid]))
    model = model_of(mesh, rest)
    model.set_points(folded(angle))
    pull = cloth_forces(model)[3, :3]
    return float(-pull @ np.array([0.0, np.sin(angle), np.cos(angle)])) * HEIGHT


def test_a_hinge_bent_and_let_back_goes_round_a_loop_as_wide_as_its_friction() -> None:
    moment, laid, up = 1e-5, np.zeros(1), []
    slider, sign = np.array([[moment, STEEP]]), np.sign(fold_angles(folded(0.1), _topology())[0])
    angles = np.linspace(0.0, 1.0, 6)
    for angle in angles:
        up.append(torque(angle, moment, float(laid[0])))
        laid = slid(laid, np.array([sign * angle]), slider)
    down = [torque(angle, moment, float(laid[0])) for angle in angles[1:5]]
    assert np.array(up[1:5]) - np.array(down) == pytest.approx(2.0 * moment, rel=1e-6)
    elastic = [torque(angle, 0.0, 0.0) for angle in angles[1:5]]
    assert 0.5 * (np.array(up[1:5]) + np.array(down)) == pytest.approx(np.array(elastic), rel=1e-6)
    assert torque(0.01, moment, 0.0) == pytest.approx(moment * STEEP * 0.01, rel=0.01)  # it clings


def _topology() -> object:
    mesh = Mesh("hinge", folded(0.0), np.array([[0, 1, 2], [1, 0, 3]], dtype=np.int32))
    return build_rest_shape(mesh, FABRIC, rest="mesh").topology


def test_what_slid_rubs_as_before() -> None:
    slider = np.array([[1.0, STEEP], [1.0, STEEP]])
    laid = slid(np.zeros(2), np.array([0.7, 0.02]), slider)
    assert laid[1] == 0.0  # it has not slipped
    assert 2.0 * np.sin(0.5 * (0.7 - laid[0])) == pytest.approx(1.0 / STEEP)


@pytest.mark.parametrize("direction", [0, 2], ids=["weft", "warp"])
def test_irregular_cloth_bent_a_little_more_takes_the_fabrics_friction(direction: int) -> None:
    mesh = disc(0.15, 0.05, 0.01, 0)
    rest = build_rest_shape(mesh, RUBBING, rest="uv")
    curvature, bent = 2.0, mesh.points.copy()
    bent[:, 1] = (1.0 - np.cos(curvature * mesh.points[:, direction])) / curvature
    bent[:, direction] = np.sin(curvature * mesh.points[:, direction]) / curvature
    work = float(rest.hinge_slider[:, 0] @ np.abs(fold_angles(bent, rest.topology)))
    assert work / (curvature * rest.area) == pytest.approx(MOMENT, rel=FITTED)


def test_a_strip_rests_higher_laid_from_the_flat_than_let_down_from_the_hang() -> None:
    mesh = strip(C, 2.2 * C, C / 4.0)
    clamped = np.flatnonzero(mesh.points[:, 2] > mesh.points[:, 2].max() - 0.3 * C).astype(np.int32)
    tolerance = Tolerance(relative_rms=1e-3, relative_p99=1e-2, rest_error=5e-5)

    def tip(fabric: Fabric, start: np.ndarray, laid: Laid | None) -> tuple[float, Garment, np.ndarray]:
        strip = piece(mesh, fabric, clamped, laid=laid)
        settled = Specimens([strip], weightless=False).settle(start, tolerance, 20_000)
        assert settled.check.within(tolerance)
        return float(settled.points[:, 1].min()), strip, settled.points

    flat, _, _ = tip(RUBBING, mesh.points, None)
    _, hung, shape = tip(replace(RUBBING, weight=3.0 * RUBBING.weight), mesh.points, None)
    down, _, _ = tip(RUBBING, shape, laid_by(hung.rest, shape))
    elastic, _, _ = tip(FABRIC, mesh.points, None)
    assert flat > max(down, elastic) + 0.1 * C


def test_a_fabric_states_2hb_of_warp_and_weft() -> None:
    fabric = resolve_fabric({"bending_hysteresis_2HB_warp": 0.1, "bending_hysteresis_2HB_weft": 0.04})
    assert fabric.bending_friction_warp == pytest.approx(0.05 * 9.80665e-3)
    assert fabric.bending_friction_weft == pytest.approx(0.02 * 9.80665e-3)
    with pytest.raises(InputError, match="states the same value"):
        resolve_fabric({"bending_hysteresis_2HB": 0.1, "bending_hysteresis_2HB_weft": 0.04})


def test_cloth_without_friction_has_no_part_of_it() -> None:
    mesh = grid(4)
    rest = build_rest_shape(mesh, FABRIC, rest="mesh")
    garment = Garment(mesh.points, mesh.triangles, rest, np.zeros(0, dtype=np.int32))
    assert rest.hinge_slider is None
    assert not garment.terms.hysteresis
    assert not model_of(mesh, rest).edges.hysteresis

"""Simplified garments are the same cloth, and a fit that starts from them comes to rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cloths import NO_PINS, grid

from warp_cloth.base.mesh import Mesh
from warp_cloth.fitting.fit import fit
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.grain import Grain
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.material.fabric import Fabric, shipped_fabrics
from warp_cloth.model.result import Status
from warp_cloth.scene.shapes import TshirtShape
from warp_cloth.shapes import build_garment
from warp_cloth.solver.implicit import coarse_garments
from warp_cloth.solver.implicit.coarse_garments import (
    LIMP_STRAIN,
    Hierarchy,
    build_hierarchy,
    limp_fabric,
    prolong_shape,
)

ROUNDING = 1e-12
AREA = 0.01  # what a coarse outline may lose of a T-shirt's curved seams, as a share of its area
DEGREE = np.radians(1.0)
MESH = grid(21, 1.0)
PANEL = MESH.points[MESH.triangles][:, :, :2]
RADIUS = 0.4  # [m] to which it is rolled up
ROUNDER = 0.5  # times the distance from the roll that straight faces leave; vertices along hems see one side only
AWAY = np.array([0.1, 0.0, 0.0])  # [m]
DENIM = shipped_fabrics()["denim"]


def hierarchy_of(mesh: Mesh, fabric: Fabric, pins: np.ndarray = NO_PINS, turned: float = 0.0) -> Hierarchy:
    rest = build_rest_shape(mesh, fabric, rest="uv", grain=Grain(turned))
    return build_hierarchy(Garment(mesh.points, mesh.triangles, rest, pins))


def coarser(hierarchy: Hierarchy) -> Hierarchy:
    found = hierarchy.coarser()
    assert found is not None
    return found


def test_a_coarse_garment_weighs_and_measures_the_same() -> None:
    mesh = build_garment(TshirtShape(kind="tshirt"), body=None)
    fine = hierarchy_of(mesh, DENIM)
    coarse = coarser(fine)
    assert len(coarse.garment.points) < 0.3 * len(fine.garment.points)
    assert coarse.garment.rest.vertex_weight.sum() == pytest.approx(fine.garment.rest.vertex_weight.sum(), rel=AREA)
    assert coarse.garment.rest.area == pytest.approx(fine.garment.rest.area, rel=AREA)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 90.0, 135.0])
def test_its_warp_lies_as_the_finer_ones(degrees: float) -> None:
    coarse = coarser(hierarchy_of(replace(MESH, texcoords=PANEL), DENIM, turned=degrees)).garment.rest
    first = coarse.corners[:, 1] - coarse.corners[:, 0]
    drawn = coarse.sheet.flat[:, 1] - coarse.sheet.flat[:, 0]
    # the flat side's angle to the warp is the side's in the panel less the grain, up to a mirror and half a turn
    angle = np.arctan2(first[:, 0], first[:, 1]) + np.radians(degrees)
    own = np.arctan2(drawn[:, 0], drawn[:, 1])
    off = np.minimum(np.abs(np.sin(own - angle)), np.abs(np.sin(own + angle)))
    assert off.max() < DEGREE


def test_pinned_vertices_stay_and_flat_cloth_is_prolonged_exactly() -> None:
    pins = np.array([0, 20, 200], dtype=np.int32)
    fine = hierarchy_of(replace(MESH, texcoords=PANEL), DENIM, pins)
    coarse = coarser(fine)
    assert (coarse.garment.points[coarse.garment.pins] == MESH.points[pins]).all()
    moved = prolong_shape(fine.coarsenings[0], coarse.garment.points + AWAY, fine.garment)
    wanted = MESH.points + AWAY
    wanted[pins] = MESH.points[pins]
    assert moved == pytest.approx(wanted, abs=ROUNDING)


def test_what_is_prolonged_from_a_bent_cloth_is_round(monkeypatch: pytest.MonkeyPatch) -> None:
    fine = hierarchy_of(replace(MESH, texcoords=PANEL), DENIM)
    coarse = coarser(fine)

    def off() -> float:
        way = prolong_shape(fine.coarsenings[0], _rolled(coarse.garment.points), fine.garment) - _rolled(MESH.points)
        return float(np.sqrt(np.mean(np.sum(way**2, axis=1))))

    rounded = off()
    monkeypatch.setattr(coarse_garments, "ROUNDING", 0.0)
    assert rounded < ROUNDER * off()


def _rolled(points: np.ndarray) -> np.ndarray:
    angle = (points[:, 0] - 0.5) / RADIUS
    return np.stack([RADIUS * np.sin(angle), points[:, 1], RADIUS * np.cos(angle)], axis=1)


def test_a_limp_garment_is_drawn_out_by_its_weight_no_more_than_a_little() -> None:
    stiff = Fabric(stretch_warp=4e5, stretch_weft=2e5)
    hierarchy = hierarchy_of(replace(MESH, texcoords=PANEL), stiff)
    limp = hierarchy.coarser(limp=True)
    softer = limp.garment.rest.fabric
    load = limp.garment.rest.vertex_weight.sum() / np.sqrt(limp.garment.rest.area)
    assert np.sqrt(load / softer.stretch_weft) == pytest.approx(LIMP_STRAIN)
    assert softer.stretch_warp == pytest.approx(2.0 * softer.stretch_weft)
    assert coarser(hierarchy).garment.rest.fabric == stiff
    assert limp_fabric(Fabric(), load) == Fabric()  # soft enough as it is


def test_a_garment_of_unknown_rest_shape_stays_as_it_is() -> None:
    rest = replace(build_rest_shape(MESH, DENIM, rest="mesh"), corners=None)
    hierarchy = build_hierarchy(Garment(MESH.points, MESH.triangles, rest, NO_PINS))
    assert hierarchy.coarsenings == ()
    assert hierarchy.coarser() is None


def test_a_fit_tells_of_the_coarse_garments_that_it_started_from() -> None:
    overrides = ["garment.shape.vertices_per_side=33", "solver.method=multilevel"]
    worn = fit("hanging", device="cpu", overrides=overrides)
    assert worn.status is Status.AT_REST
    (level,) = worn.report["levels"]
    assert level["status"] == "at_rest"
    assert level["vertices"] < 33 * 33 / 3
    assert level["iterations"] > 0


def test_what_will_not_rest_when_coarse_still_fits() -> None:
    overrides = ["garment.shape.vertices_per_side=33", "solver.method=multilevel", "solver.iterations=100"]
    worn = fit("hanging", device="cpu", overrides=overrides)
    assert worn.status is Status.ITERATION_LIMIT
    assert worn.report["levels"][0]["status"] == "iteration_limit"
    assert np.isfinite(worn.garments[0].points).all()

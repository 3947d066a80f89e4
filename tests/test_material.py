"""One material on every mesh: the bench's tests return the fabric's own values, however the cloth is meshed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import warp as wp
from cloths import model_of
from swatches import MESHINGS, swatch

from warp_cloth.bench.specimen import Specimens, piece
from warp_cloth.bench.trials import bend, drape, pull, released, shear
from warp_cloth.garment.grain import Grain
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.kernels.base.options import Accumulate
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.material.fabric import Fabric, fabric_named, resolve_fabric
from warp_cloth.material.laboratory import MATCHED_FOLD, MATCHED_SHEAR_ANGLE, bending_length, rigidity_of_bending
from warp_cloth.solver.certificate.certifier import Tolerance
from warp_cloth.solver.certificate.strains import element_energies, measured_strains, yarn_summaries
from warp_cloth.solver.forces import ForcePass
from warp_cloth.solver.step_options import StepOptions

# 5 % is asked for on regular grids and 10 % on others. Yarns are exact on all of them; the clamps, between
# which the cloth cannot narrow, leave 1 % of the softest cloth's force.
YARN_TOLERANCE = 0.02
SHEAR_TOLERANCE = 0.05  # what the free sides still take from the middle, and yarns that lengthen a little
BENDING_TOLERANCE = 0.10
# What rounds that hardly change the energy would still change, in single hinges and in their mean.
SETTLED_APART, SETTLED_MEAN_APART = 5e-2, 2e-3
COARSE_EDGES = (0.25, 0.3, 0.35)  # of a bending length: the matched curvature turns up to 17 degrees from edge to edge
EDGE_TOLERANCE = 0.05  # of a fabric without yarns, on regular grids; others are a stated limit
WOVEN = ("cotton", "jersey")  # nearly inextensible, and softest: shear is 0.2 % and 6 % of the stretch
STRAINS = (0.01, 0.03, 0.06)
FOLDED_TO = 100.0 / 3.0  # [1/m], a radius of 3 cm


def directions(fabric: Fabric) -> list[tuple[float, float, float]]:
    """Grain, stretch and bending of a strip that is cut along the warp, and along the weft."""
    return [(0.0, fabric.stretch_warp, fabric.bending_warp), (90.0, fabric.stretch_weft, fabric.bending_weft)]


@pytest.mark.parametrize("edge", [0.01, 0.005])
@pytest.mark.parametrize("meshing", MESHINGS)
@pytest.mark.parametrize("value", [*WOVEN, {"stretch_warp": 40e3, "stretch_weft": 10e3}])
def test_tension_is_the_fabrics_own(value: Any, meshing: str, edge: float) -> None:
    fabric = resolve_fabric(value)
    mesh = swatch(0.05, 0.2, edge, meshing)
    for grain, stretch, _ in directions(fabric):
        for reading in pull(mesh, fabric, STRAINS, grain_degrees=grain):
            assert reading.measured == pytest.approx(stretch * reading.applied**2, rel=YARN_TOLERANCE)


@pytest.mark.parametrize("edge", [0.01, 0.005])
@pytest.mark.parametrize("meshing", MESHINGS)
@pytest.mark.parametrize("name", WOVEN)
def test_shear_is_the_fabrics_own(name: str, meshing: str, edge: float) -> None:
    fabric = fabric_named(name)
    mesh = swatch(0.2, 0.05, edge, meshing)
    for grain, _, _ in directions(fabric):
        (reading,) = shear(mesh, fabric, [MATCHED_SHEAR_ANGLE], grain_degrees=grain)
        assert reading.measured == pytest.approx(fabric.shear * reading.applied**2, rel=SHEAR_TOLERANCE)


@pytest.mark.parametrize("edge", [0.005, 0.0025])
@pytest.mark.parametrize("meshing", MESHINGS)
def test_bending_is_the_fabrics_own(meshing: str, edge: float) -> None:
    fabric = fabric_named("cotton")
    mesh = swatch(0.1, 0.1, edge, meshing)
    for grain, _, bending in directions(fabric):
        (reading,) = bend(mesh, fabric, [FOLDED_TO], clamp=0.01, grain_degrees=grain)
        assert reading.measured == pytest.approx(0.5 * bending * reading.applied**2, rel=BENDING_TOLERANCE)


def bent_to_its_fold(fabric: Fabric, bending: float, meshing: str, share: float, grain: float) -> float:
    """What a square of six bending lengths, in edges of this share of one, reads over what ``bending`` should."""
    length = bending_length(rigidity_of_bending(bending, fabric.weight), fabric.weight)
    mesh = swatch(6.0 * length, 6.0 * length, share * length, meshing)
    (reading,) = bend(mesh, fabric, [MATCHED_FOLD / length], clamp=0.6 * length, grain_degrees=grain)
    return reading.measured / (0.5 * reading.applied**2)


@pytest.mark.parametrize("share", COARSE_EDGES)
@pytest.mark.parametrize("meshing", MESHINGS)
def test_coarse_edges_bend_the_fabric_likewise(meshing: str, share: float) -> None:
    fabric = fabric_named("denim")
    for grain, _, bending in directions(fabric):
        assert bent_to_its_fold(fabric, bending, meshing, share, grain) == pytest.approx(bending, rel=BENDING_TOLERANCE)


@pytest.mark.parametrize("meshing", MESHINGS)
def test_cloth_twice_as_stiff_along_its_warp_is_so_on_every_mesh(meshing: str) -> None:
    wool = fabric_named("wool")
    fabric = replace(wool, bending_warp=2.0**0.5 * wool.bending, bending_weft=0.5**0.5 * wool.bending)
    for grain, _, bending in directions(fabric):
        read = bent_to_its_fold(fabric, wool.bending, meshing, 0.25, grain)
        assert read == pytest.approx(bending, rel=BENDING_TOLERANCE)


@pytest.mark.parametrize("meshing", ["alternating", "parallel"])
def test_a_fabric_without_threads_meets_its_stretch_on_regular_grids(meshing: str) -> None:
    fabric = Fabric()
    for grain, stretch, _ in directions(fabric):
        for reading in pull(swatch(0.05, 0.2, 0.01, meshing), fabric, STRAINS, grain_degrees=grain):
            assert reading.measured == pytest.approx(stretch * reading.applied**2, rel=EDGE_TOLERANCE)


def test_edges_take_their_stretch_by_their_direction() -> None:
    fabric = replace(Fabric(), stretch_warp=40e3, stretch_weft=10e3)
    for grain, stretch, _ in directions(fabric):
        (reading,) = pull(swatch(0.05, 0.2, 0.01, "alternating"), fabric, [0.03], grain_degrees=grain)
        assert reading.measured == pytest.approx(stretch * reading.applied**2, rel=EDGE_TOLERANCE)


def test_linearity_is_two_thirds() -> None:
    fabric = fabric_named("wool")
    readings = pull(swatch(0.05, 0.2, 0.01, "random"), fabric, [0.01, 0.02, 0.03, 0.04])
    strain = np.array([0.0, *(reading.applied for reading in readings)])
    force = np.array([0.0, *(reading.measured for reading in readings)])
    work = np.polynomial.Polynomial.fit(strain, force, 3).integ()
    linearity = (work(strain[-1]) - work(0.0)) / (0.5 * strain[-1] * force[-1])
    assert linearity == pytest.approx(2 / 3, rel=0.01)


def even_energy(fabric: Fabric, stretch: tuple[float, float], meshing: str = "random") -> float:
    """Energy per area of cloth whose weft and warp are evenly stretched."""
    mesh = swatch(0.05, 0.05, 0.01, meshing)
    model = model_of(mesh, build_rest_shape(mesh, fabric, rest="uv"))
    model.set_points(mesh.points * (stretch[0], 1.0, stretch[1]))
    return sum(float(energies.sum()) for energies in element_energies(model)) / 0.05**2


@pytest.mark.parametrize("name", ["cotton", "default"])
def test_compression_is_weaker_by_exactly_c(name: str) -> None:
    fabric = replace(fabric_named(name), compression=0.25)
    pulled = even_energy(fabric, (1.02, 1.02))
    assert even_energy(fabric, (0.98, 0.98)) == pytest.approx(0.25 * pulled, rel=1e-9)  # float64, products only


def test_no_meshing_changes_the_energy_of_even_strain() -> None:
    for stretch in ((1.03, 0.98), (1.0, 1.05), (0.97, 1.01)):
        energies = [even_energy(fabric_named("denim"), stretch, meshing) for meshing in MESHINGS]
        assert energies == pytest.approx([energies[0]] * len(energies), rel=1e-9)


def test_threads_tell_strain_along_weft_and_warp() -> None:
    mesh = swatch(0.05, 0.05, 0.01, "random")
    for grain, expected in ((0.0, (0.02, -0.01)), (90.0, (-0.01, 0.02))):
        rest = build_rest_shape(mesh, fabric_named("cotton"), rest="uv", grain=Grain(grain))
        model = model_of(mesh, rest)
        model.set_points(mesh.points * (1.02, 1.0, 0.99))
        strains = measured_strains(model).of_yarns()[:2].T
        assert strains == pytest.approx(np.broadcast_to(expected, strains.shape), abs=1e-9)
        found = yarn_summaries(measured_strains(model).of_yarns())
        assert (found["weft"].max, found["warp"].max) == pytest.approx(expected, abs=1e-9)
        bias = np.hypot(1.02, 0.99) / 2**0.5 - 1.0  # nothing is sheared
        assert (found["bias"].min, found["bias"].max) == pytest.approx((bias, bias), abs=1e-9)


def test_a_released_strip_keeps_a_slight_stretch_whatever_it_was_pulled_to() -> None:
    left = [
        reading.measured for reading in released(swatch(0.05, 0.2, 0.01, "alternating"), Fabric(), (0.01, 0.05, 0.2))
    ]
    assert all(1e-5 < strain < 1e-3 for strain in left)  # 0.03 %: what the certificate takes for rest


def test_stiffer_fabrics_drape_less() -> None:
    order = ("silk", "cotton", "denim", "felt")
    coefficients = [drape(10, fabric_named(name), discs=1)[0].coefficient for name in order]
    assert coefficients == sorted(coefficients)
    assert coefficients[1] - coefficients[0] > 10.0


def corner_drop(fabric: Fabric) -> tuple[float, float]:
    """How far the sides of a square, pinned at its middle, hang below it along the weft and along the warp [m]."""
    mesh = swatch(0.3, 0.3, 0.02, "alternating")
    far = np.abs(mesh.points[:, [0, 2]])
    held = np.flatnonzero((far < 0.031).all(axis=1)).astype(np.int32)
    folding = StepOptions(method="multilevel")  # vertex by vertex it would take far longer to fold
    specimen = Specimens([piece(mesh, fabric, held)], weightless=False, options=folding)
    noise = np.random.default_rng(0).normal(scale=1e-4, size=mesh.points.shape) * (0.0, 1.0, 0.0)
    points = specimen.settle(mesh.points + noise, Tolerance(), 6000).points
    ends = [(far[:, axis] > 0.149) & (far[:, 1 - axis] < 0.05) for axis in (0, 1)]
    return tuple(-float(points[end, 1].mean()) for end in ends)


def test_stiffly_warped_cloth_hangs_from_its_middle_over_the_weft_and_the_other_way_round() -> None:
    fabric = fabric_named("wool")
    stiff, limp = 30.0 * fabric.bending, 0.2 * fabric.bending
    weft_drop, warp_drop = corner_drop(replace(fabric, bending_warp=stiff, bending_weft=limp))
    assert weft_drop > 2.5 * warp_drop
    weft_drop, warp_drop = corner_drop(replace(fabric, bending_warp=limp, bending_weft=stiff))
    assert warp_drop > 2.5 * weft_drop


def test_fabrics_without_yarns_have_none_and_woven_edges_do_not_pull() -> None:
    mesh = swatch(0.05, 0.05, 0.01, "alternating")
    even = model_of(mesh, build_rest_shape(mesh, Fabric(), rest="uv"))
    woven = model_of(mesh, build_rest_shape(mesh, fabric_named("cotton"), rest="uv"))
    assert even.weave is None
    assert yarn_summaries(measured_strains(even).of_yarns()) == {}
    assert (even.terms.edges, even.terms.yarns) == (True, False)
    assert (woven.terms.edges, woven.terms.yarns) == (False, True)
    assert even.triangles.slope is even.triangles.yarns is None
    counts = [len(ForcePass(model, Accumulate.NONE, wp.zeros(1, dtype=wp.vec4d)).kernels()) for model in (even, woven)]
    assert counts == [3, 3]  # normals, edges, triangles: yarns take no launch of their own
    assert woven.weave_count == len(mesh.triangles)
    assert len(cloth_types("mixed").Weave.vars) == 4
    assert not woven.weave.shear_hysteresis  # of fabrics that state friction only


def test_a_curved_mesh_without_panels_is_told_to_be_even() -> None:
    flat = swatch(0.05, 0.05, 0.01, "alternating")
    bent = replace(flat, points=flat.points + np.array([0.0, 1.0, 0.0]) * flat.points[:, :1] ** 2, texcoords=None)
    rest = build_rest_shape(bent, fabric_named("cotton"), rest="mesh")
    assert rest.yarns is None
    assert "no texture coordinates for warp and weft" in rest.notes[0]
    plain = build_rest_shape(bent, resolve_fabric({"stretch": 5e3}), rest="mesh")
    assert plain.yarns is None  # nothing is lost: it is even
    assert not plain.notes
    known = build_rest_shape(replace(flat, texcoords=None), fabric_named("cotton"), rest="mesh")
    assert known.yarns is not None
    assert not known.notes


@pytest.mark.parametrize("name", ["denim", "default"])
@pytest.mark.parametrize("meshing", MESHINGS)
def test_large_sheets_stop_when_they_have_settled_and_bend_like_others(
    meshing: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh, fabric = swatch(0.1, 0.1, 0.0025, meshing), fabric_named(name)
    whole = build_rest_shape(mesh, fabric, rest="mesh").hinge_stiffness
    monkeypatch.setattr("warp_cloth.material.bending.MANY", 0)
    settled = build_rest_shape(mesh, fabric, rest="mesh").hinge_stiffness
    assert settled == pytest.approx(whole, rel=SETTLED_APART)
    assert settled.mean() == pytest.approx(whole.mean(), rel=SETTLED_MEAN_APART)

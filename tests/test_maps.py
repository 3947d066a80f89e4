"""Fit maps against closed forms: strain of a stretched strip, pressure of a net on a sphere, gap as exact distance."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from cloths import NO_PINS, grid, model_of, tube
from worn import box_avatar

from warp_cloth.anatomy.levels import body_levels
from warp_cloth.avatar.collider import Collider
from warp_cloth.avatar.exact import build_exact_collider
from warp_cloth.avatar.solid import closing_of
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh, vertex_normals
from warp_cloth.base.section import cut
from warp_cloth.fitting.fit import fit
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.kernels.avatar.closest import MeshCollider, mesh_contact
from warp_cloth.maps import MAPS, chosen_maps, measure_maps
from warp_cloth.maps.girths import TrunkLevels, garment_girths
from warp_cloth.maps.kinds import rounded_up, shown_range
from warp_cloth.maps.measure import MeasuredBody, girth_report, measured_girths
from warp_cloth.material.constants import even_network
from warp_cloth.material.fabric import Fabric
from warp_cloth.material.laboratory import GRAVITY
from warp_cloth.material.strain import face_strains, vertex_areas, vertex_means
from warp_cloth.model.result import WornGarment
from warp_cloth.shapes import MannequinMeasures, sphere, tshirt
from warp_cloth.solver.certificate.certifier import Certifier
from warp_cloth.solver.relax import Relaxation
from warp_cloth.solver.step_options import StepOptions

ROUNDING = 1e-9  # of float64 strains
CLOSED_FORM = 0.05  # of a map against its closed form
GIRTH = 3e-3  # [m]; 1 % of the stature between two levels looked at, where girths change least


def test_a_garment_has_the_strains_of_its_edges_and_faces_without_request() -> None:
    result = fit("hanging", device="cpu", maps="strain", overrides=["garment.shape.vertices_per_side=9"])
    (worn,) = result.garments
    assert worn.edge_strain.shape == (len(worn.edges),)
    strain = result.report["strain"]
    assert [worn.edge_strain.max(), worn.edge_strain.min()] == pytest.approx([strain["max"], strain["min"]], abs=1e-6)
    assert set(worn.face_strains) == {"strain", "strain_warp", "strain_weft", "strain_bias", "shear"}
    mesh, sheet = worn.mesh, worn.rest.sheet
    of_faces = worn.face_strains["strain"]
    assert of_faces.shape == (mesh.triangle_count,)
    mean = vertex_means(of_faces, sheet.areas, mesh.triangles, mesh.vertex_count)
    assert mean == pytest.approx(worn.fields["strain"], abs=1e-6)
    read = replace(worn, rest=None)
    with pytest.raises(InputError, match="was read from a file without its rest shape; fit it again"):
        _ = read.edge_strain


def panels(mesh: Mesh) -> Mesh:
    """The mesh with its own shape as its panels."""
    return replace(mesh, texcoords=mesh.points[mesh.triangles][:, :, :2])


def strains_of(mesh: Mesh, points: np.ndarray) -> dict[str, np.ndarray]:
    sheet = build_rest_shape(mesh, Fabric(), rest="mesh").sheet
    return face_strains(points, sheet)


def test_even_stretch_along_the_threads_is_read_exactly() -> None:
    mesh = panels(grid(5, 0.4))
    found = strains_of(mesh, mesh.points * (1.03, 1.10, 1.0))
    assert np.allclose(found["strain_weft"], 0.03, atol=ROUNDING)
    assert np.allclose(found["strain_warp"], 0.10, atol=ROUNDING)
    assert np.allclose(found["strain"], 0.10, atol=ROUNDING)
    assert np.allclose(found["strain_bias"], math.sqrt((1.03**2 + 1.10**2) / 2) - 1, atol=ROUNDING)
    assert np.allclose(found["shear"], 0.0, atol=1e-6)


def test_shear_is_the_change_of_the_threads_angle_however_the_cloth_lies() -> None:
    mesh = panels(grid(5, 0.4))
    angle = math.radians(7.0)
    sheared = mesh.points.copy()
    sheared[:, 0] += math.sin(angle) * mesh.points[:, 1]
    sheared[:, 1] = math.cos(angle) * mesh.points[:, 1]
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    found = strains_of(mesh, sheared @ turn.T + 5.0)
    assert np.allclose(found["shear"], 7.0, atol=1e-6)
    assert np.allclose(found["strain_warp"], 0.0, atol=ROUNDING)
    # unit yarns at 83 degrees: the long bias is |u + v| / sqrt 2 = sqrt(1 + sin 7 degrees)
    assert np.allclose(found["strain_bias"], math.sqrt(1 + math.sin(angle)) - 1, atol=ROUNDING)


def test_a_mesh_without_a_warp_has_its_largest_strain_only() -> None:
    bulging = grid(5, 0.4)
    bulging.points[:, 2] = bulging.points[:, 0] ** 2
    assert set(strains_of(bulging, bulging.points)) == {"strain"}


def test_strip_that_hangs_under_its_weight_strains_as_the_square_root_of_what_hangs_below() -> None:
    """Force per width at height y over the hem is w g y = K e^2, so e(y) = sqrt(w g y / K)."""
    fabric = {"weight": 2.0, "stretch": 4000.0, "shear": 100.0, "bending": 0.0}
    scene = {
        "garment": {
            "shape": {"kind": "square", "side": 0.6, "vertices_per_side": 25, "plane": "vertical", "height": 1.0},
            "fabric": fabric,
            "pin": {"box": [[-1.0, 0.999, -1.0], [1.0, 1.001, 1.0]]},
        },
        "solver": {"iterations": 4000, "tolerance_mm": 0.1},
    }
    worn = fit(scene, device="cpu", maps="strain")
    assert worn.status.value == "at_rest"
    garment = worn.garments[0]
    height = garment.mesh.points[:, 1] - garment.mesh.points[:, 1].min()
    expected = np.sqrt(2.0 * GRAVITY * height / 4000.0)
    # away from the hem, where a row of triangles averages a square root, and from the pins, which hold the width
    inner = (height > 0.1) & (height < 0.4) & (np.abs(garment.mesh.points[:, 0]) < 0.2)
    assert np.abs(garment.fields["strain_warp"][inner] / expected[inner] - 1.0).max() < CLOSED_FORM


def test_net_on_a_sphere_presses_by_its_tension_and_curvature() -> None:
    """A net strained by e all ways has E / A = K e^3 / 3 / N, N the network's share: p = (dE/de) e' / (4 pi r^2).

    With r = R (1 + e): p = K e^2 / (N R) / (1 + e)^2, K / N the sum of k L^3 per area (see material.constants).
    """
    radius, strain, offset = 0.3, 0.04, 0.003
    net = sphere(radius=(radius + offset) / (1 + strain), centre=(0.0, 0.0, 0.0), edge=0.03)
    fabric = Fabric(weight=1e-3, bending_warp=0.0, bending_weft=0.0)
    rest = build_rest_shape(net, fabric, rest="mesh")
    # the net's flat triangles leave its vertices at the offset, up to the avatar's own facets
    model = model_of(net, rest, offset=offset + 1e-4)
    worn = net.points * (1 + strain)
    model.set_points(worn)
    avatar = sphere(radius=radius, centre=(0.0, 0.0, 0.0), edge=0.01)
    exact = build_exact_collider(avatar, "cpu")
    collider = Collider(mesh_contact, exact.collider, MeshCollider)
    relaxation = Relaxation(model, collider, StepOptions())
    push = Certifier(relaxation).normal_forces()
    garment = Garment(net.points, net.triangles, rest, NO_PINS)
    made = measure_maps(
        ("pressure",),
        garments=[garment],
        worn=[worn],
        normal_forces=[push],
        avatar=avatar,
        garment_names=["net"],
        device="cpu",
    )
    tension = fabric.stretch / even_network(fabric.compression)
    rest_radius = float(np.linalg.norm(net.points, axis=1).mean())
    expected = 1e-3 * tension * strain**2 / (rest_radius * (1 + strain) ** 2)
    pressure = made.fields[0]["pressure"]
    weight = vertex_areas(worn, net.triangles)
    assert (pressure > 0.0).all()
    assert abs(np.average(pressure, weights=weight) / expected - 1.0) < CLOSED_FORM
    assert abs(np.median(pressure) / expected - 1.0) < CLOSED_FORM


def test_ease_is_the_exact_distance_to_the_skin() -> None:
    body = box_avatar()
    sheet = grid(9, 1.0)
    points = sheet.points @ np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]]) + (-0.5, 0.3, 0.23)
    garment = Garment(points, sheet.triangles, build_rest_shape(sheet, Fabric(), rest="mesh"), NO_PINS)
    made = measure_maps(
        ("gap",),
        garments=[garment],
        worn=[points],
        normal_forces=None,
        avatar=body,
        garment_names=["sheet"],
        device="cpu",
    )
    away = np.maximum(np.abs(points - (0.0, 0.8, 0.0)) - (0.2, 0.8, 0.2), 0.0)
    expected = 1e3 * np.linalg.norm(away, axis=1)
    assert np.abs(made.fields[0]["gap"] - expected).max() < 1e-3  # float32 over a metre


def test_means_at_vertices_keep_a_constant() -> None:
    mesh = grid(4, 1.0)
    areas = np.full(mesh.triangle_count, 2.0)
    assert np.allclose(vertex_means(np.full(mesh.triangle_count, 3.0), areas, mesh.triangles, 16), 3.0)


def test_levels_of_the_mannequin_are_its_measures(body: Mesh) -> None:
    girths = {level.name: level.girth for level in body_levels(body)}
    assert list(girths) == ["chest", "waist", "hip"]
    assert girths["chest"] == pytest.approx(0.98, abs=GIRTH)
    assert girths["waist"] == pytest.approx(0.86, abs=GIRTH)
    assert girths["hip"] == pytest.approx(1.00, abs=0.02)  # the fullest of the seat is a little below that level


def test_levels_do_not_mind_where_a_body_stands(body: Mesh) -> None:
    moved = replace(body, points=body.points + np.array((3.0, -2.0, 1.0)))
    for here, there in zip(body_levels(body), body_levels(moved), strict=True):
        assert there.girth == pytest.approx(here.girth, abs=1e-6)
        assert there.height == pytest.approx(here.height - 2.0, abs=1e-6)


def test_real_bodies_have_levels(shared_data: Path) -> None:
    from warp_cloth.loading import load_mesh

    for name in ("garmentcode/mean_all.obj", "anny/female_avg_A_pose.obj", "anny/female_avg_T_pose.obj"):
        levels = {
            level.name: level for level in body_levels(load_mesh(shared_data / name, role="avatar", key="avatar"))
        }
        assert levels["waist"].girth < levels["chest"].girth
        assert levels["waist"].girth < levels["hip"].girth
        assert levels["hip"].height < levels["waist"].height < levels["chest"].height


def test_a_bust_is_not_taken_for_arms(shared_data: Path) -> None:
    """Her girth grows by 8 % within 2 cm below it; the fullest lies 1 cm above the levels looked at."""
    from warp_cloth.loading import load_mesh

    woman = load_mesh(shared_data / "anny/female_avg_A_pose.obj", role="avatar", key="avatar")
    assert body_levels(woman)[0].girth == pytest.approx(0.914, rel=0.015)


def test_what_is_no_body_has_no_levels() -> None:
    assert body_levels(sphere(radius=0.5)) is None
    assert body_levels(box_avatar()) is None


def test_girths_of_a_scan_with_holes_and_hair_are_those_of_the_body(body: Mesh) -> None:
    kept = np.random.default_rng(0).random(body.triangle_count) > 0.01
    low, high = body.bounds()
    lock = low + np.array([[0.0, 0, 0], [0.01, 0, 0], [-0.2, 2 * (high[1] - low[1]), 0]])  # beside and above it
    points = np.concatenate([body.points, lock])
    triangles = np.concatenate([body.triangles[kept], [np.arange(3) + body.vertex_count]]).astype(np.int32)
    scan = Mesh("scan", points, triangles)
    assert body_levels(scan) is None
    found = body_levels(closing_of(scan).surface(scan))
    for here, there in zip(body_levels(body), found, strict=True):
        assert there.height == pytest.approx(here.height, abs=1e-6)
        assert there.girth == pytest.approx(here.girth, abs=GIRTH)


@pytest.mark.parametrize("share", [(0.0, 0.8), (0.0, 0.85), (0.0, 0.9), (0.045, 1.0), (0.06, 1.0), (0.1, 1.0)])
def test_a_body_without_its_head_or_feet_has_no_levels(body: Mesh, share: tuple[float, float]) -> None:
    (_, low, _), (_, high, _) = body.bounds()
    at = (body.points[body.triangles, 1].mean(axis=1) - low) / (high - low)
    cropped = replace(body, triangles=body.triangles[(at > share[0]) & (at < share[1])])
    assert body_levels(closing_of(cropped).surface(cropped)) is None


def test_feet_are_feet_wherever_their_toes_point(body: Mesh) -> None:
    """Feet turned out by 80 degrees about their ankles."""
    low, high = body.bounds()
    turned = body.points.copy()
    for side in (-1.0, 1.0):
        foot = (side * body.points[:, 0] > 0.0) & (body.points[:, 1] < low[1] + 0.05 * (high[1] - low[1]))
        ankle, turn = body.points[foot][body.points[foot, 1].argmax()], side * np.radians(80.0)
        spin = np.array([[np.cos(turn), 0.0, -np.sin(turn)], [0.0, 1.0, 0.0], [np.sin(turn), 0.0, np.cos(turn)]])
        turned[foot] = (body.points[foot] - ankle) @ spin + ankle
    assert body_levels(replace(body, points=turned)) is not None


def test_ease_at_the_waist_is_the_rest_girth_less_the_body(body: Mesh) -> None:
    rest = tube(0.2, 0.95, 1.25)
    worn = rest.points * (0.95, 1.0, 0.95)  # pushed together: what counts is the cloth there is
    sheet = build_rest_shape(rest, Fabric(), rest="mesh").sheet
    rows = {row["level"]: row for row in garment_girths("tube", worn, sheet, TrunkLevels(body, body_levels(body)))}
    assert set(rows) == {"waist"}
    assert rows["waist"]["natural_girth"] == pytest.approx(2e3 * np.pi * 0.2, rel=1e-3)  # 96 chords
    assert rows["waist"]["garment_girth"] == pytest.approx(0.95 * rows["waist"]["natural_girth"], rel=1e-6)
    assert rows["waist"]["ease"] == pytest.approx(2e3 * np.pi * 0.2 - 860.0, abs=1e3 * GIRTH)
    assert rows["waist"]["closed"] is True


@pytest.mark.parametrize("inset", [0.0, 0.01])
def test_what_lies_within_the_trunk_is_no_arm(body: Mesh, inset: float) -> None:
    """A body exported for both sides, or hollow: its inner skin is not what a sleeve would go round."""
    inner = body.points - inset * vertex_normals(body.points, body.triangles)
    twice = np.concatenate([body.triangles, body.triangles[:, ::-1] + body.vertex_count]).astype(np.int32)
    hollow = Mesh("hollow", np.concatenate([body.points, inner]), twice)
    rest = tube(0.2, 0.95, 1.25)
    sheet = build_rest_shape(rest, Fabric(), rest="mesh").sheet
    plain, double = (
        garment_girths("tube", rest.points, sheet, TrunkLevels(each, body_levels(each))) for each in (body, hollow)
    )
    assert plain[0]["closed"] is True
    assert double == plain


def test_a_fold_across_a_level_is_no_ease(body: Mesh) -> None:
    """A tube that is turned up and down again at the waist, so that a plane goes through three layers of it."""
    rest = tube(0.2, 0.85, 1.35, rows=51)
    waist = body_levels(body)[1].height
    lift = np.interp(
        rest.points[:, 1], [waist - 0.04, waist - 0.01, waist + 0.01, waist + 0.04], [0.0, 0.03, -0.03, 0.0]
    )
    tilt = 0.02 * np.sin(12.0 * np.arctan2(rest.points[:, 2], rest.points[:, 0]))  # so that it goes along them, too
    worn = rest.points + np.stack([np.zeros_like(lift), lift + tilt * (lift != 0.0), np.zeros_like(lift)], axis=1)
    sheet = build_rest_shape(rest, Fabric(), rest="mesh").sheet
    rows = {row["level"]: row for row in garment_girths("tube", worn, sheet, TrunkLevels(body, body_levels(body)))}
    assert rows["waist"]["natural_girth"] == pytest.approx(2e3 * np.pi * 0.2, rel=0.02)


def test_half_a_garment_goes_not_round(body: Mesh) -> None:
    whole = tube(0.2, 0.95, 1.25)
    front = whole.points[whole.triangles].mean(axis=1)[:, 2] > 0.0
    half = replace(whole, triangles=whole.triangles[front])
    sheet = build_rest_shape(half, Fabric(), rest="mesh").sheet
    (row,) = garment_girths("half", half.points, sheet, TrunkLevels(body, body_levels(body)))
    assert (row["closed"], row["ease"]) == (False, None)


def test_cloth_modelled_with_its_thickness_has_no_girth_of_its_own(body: Mesh) -> None:
    """A T-shirt 4 mm thick was told to have 158 cm of ease at the chest, and has 20 cm."""
    outer, inner = tube(0.204, 0.95, 1.25), tube(0.2, 0.95, 1.25)
    low, high = np.arange(96), outer.vertex_count - 96 + np.arange(96)
    rims = []
    for a in (low, high):
        b, below = np.roll(a, -1), outer.vertex_count
        rims += [np.stack([a, b, a + below], axis=1), np.stack([b, b + below, a + below], axis=1)]
    faces = np.concatenate([outer.triangles, inner.triangles[:, ::-1] + outer.vertex_count, *rims]).astype(np.int32)
    shell = Mesh("shell", np.concatenate([outer.points, inner.points]), faces)
    found = []
    for mesh in (shell, outer):
        worn = WornGarment(mesh.name, mesh, mesh.points, 1e-3, rest=build_rest_shape(mesh, Fabric(), rest="mesh"))
        found.append(measured_girths([worn], MeasuredBody.of(body)))
    (none, why), (rows, _) = found
    assert none == []
    assert '"shell" is modelled with its thickness' in why
    assert [row["level"] for row in rows] == ["waist"]


def test_sleeves_that_join_at_the_chest_are_left_out(body: Mesh) -> None:
    shirt = tshirt(size="L", edge=0.03, body=MannequinMeasures())
    sheet = build_rest_shape(shirt, Fabric(), rest="uv").sheet
    girths = garment_girths("shirt", shirt.points, sheet, TrunkLevels(body, body_levels(body)))
    rows = {row["level"]: row for row in girths}
    # its sleeves begin below the chest of a size M body
    assert rows["chest"]["natural_girth"] == pytest.approx(rows["waist"]["natural_girth"], rel=0.03)


def test_the_chest_is_measured_off_the_sleeves_whatever_the_mesh() -> None:
    """A section just below the armholes still cut the sleeves: 111.9 and 108.2 cm of these two."""
    chests = []
    for edge in (16, 20):
        girths = girth_report(fit("tshirt", device="cpu", overrides=[f"garment.shape.edge_mm={edge}"]))["girths_mm"]
        chests.append(next(row["natural_girth"] for row in girths if row["level"] == "chest"))
    assert chests[0] == pytest.approx(chests[1], abs=1.0)


def test_a_section_of_a_tube_is_one_ring() -> None:
    mesh = tube(0.3, 0.0, 1.0)
    section = cut(mesh.points, mesh.triangles, 0.4)
    assert section.part_count == 1
    assert section.girth(0) == pytest.approx(2 * np.pi * 0.3, rel=1e-3)
    assert np.allclose(section.weights.sum(axis=2), 1.0)


def test_names_of_maps_stand_for_groups_and_unknown_ones_are_refused() -> None:
    assert chosen_maps("gap, pressure") == ("gap", "pressure")
    assert chosen_maps("strain")[:2] == ("strain", "strain_warp")
    assert chosen_maps("all") == tuple(MAPS)
    with pytest.raises(InputError, match='did you mean "pressure"'):
        chosen_maps("presure")


def test_colour_ranges_end_on_round_numbers() -> None:
    assert [rounded_up(value) for value in (0.011, 0.02, 47.0, 1.0)] == [0.015, 0.02, 50.0, 1.0]
    values = np.linspace(-0.01, 0.047, 50).astype(np.float32)
    assert shown_range(MAPS["strain_warp"], [values]) == (-0.05, 0.05)
    assert shown_range(MAPS["pressure"], [values]) == (0.0, 0.05)


def test_maps_that_need_an_avatar_are_refused_without_one() -> None:
    with pytest.raises(InputError, match="the scene has no avatar"):
        fit("hanging", maps="pressure,gap")


@pytest.mark.parametrize("precision", [pytest.param("float32", marks=pytest.mark.long), "mixed"])  # compiles long
def test_pressing_is_the_same_bits_every_time(precision: str) -> None:
    scene = {
        "garment": {"shape": {"kind": "square", "vertices_per_side": 15, "height": 0.91}, "fabric": "jersey"},
        "avatar": {"shape": {"kind": "sphere"}},
        "solver": {"iterations": 100, "precision": precision},
    }
    wp.init()
    one, other = (fit(scene, device="cpu", maps="pressure,gap").garments[0].fields for _ in range(2))
    assert one["pressure"].max() > 0.0
    assert all(np.array_equal(one[name], other[name]) for name in ("pressure", "gap"))

"""A body posed within a garment: ways through free space, a surface along other curves, and a fit that starts so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import warp_cloth
from warp_cloth.anatomy.skeleton import LEFT_ARM, RIGHT_ARM, Skeleton
from warp_cloth.dressing.free_space import FreeSpace
from warp_cloth.dressing.posing import STATIONS, PosedBody
from warp_cloth.dressing.routes import curves_of, limb_routes
from warp_cloth.garment.outfit import Outfit, load_outfit
from warp_cloth.loading import load_mesh
from warp_cloth.scene import load_scene

COARSE = ("garment.shape.edge_mm=25",)


@pytest.fixture(scope="module")
def tshirt() -> Outfit:
    return load_outfit(load_scene("tshirt", COARSE))


@pytest.fixture(scope="module")
def skeleton(tshirt: Outfit) -> Skeleton:
    (wearing,) = tshirt.wearing
    assert wearing is not None
    return wearing.skeleton


def wall(hole: float) -> tuple[np.ndarray, np.ndarray]:
    """A wall in the plane z = 0, 1 m by 1 m, without the part x > hole [m]."""
    corners = np.array([[-0.5, -0.5, 0.0], [hole, -0.5, 0.0], [hole, 0.5, 0.0], [-0.5, 0.5, 0.0]])
    return corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)


def test_a_way_leads_round_cloth_at_a_distance() -> None:
    space = FreeSpace.around(*wall(0.3))
    (way,) = space.paths(np.array([0.0, 0.0, -0.15]), [np.array([0.0, 0.0, 0.15])])
    assert way is not None
    through = way[np.abs(way[:, 2]) < 0.04]
    assert ((through[:, 0] > 0.3) | (np.abs(through[:, 1]) > 0.5)).all()
    assert space.clearances(way).min() > 0.05


def test_no_way_leads_out_of_a_closed_box() -> None:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * 0.5
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([(q[a], q[b], q[c]) for q in quads for a, b, c in ((0, 1, 2), (0, 2, 3))], dtype=np.int32)
    space = FreeSpace.around(corners, triangles)
    assert space.paths(np.full(3, 0.25), [np.array([0.25, 0.25, 0.65])]) == [None]


def test_a_body_along_its_own_curves_is_itself_and_a_thin_one_close_to_them(tshirt: Outfit, skeleton: Skeleton) -> None:
    assert tshirt.avatar is not None
    body = PosedBody(tshirt.avatar, skeleton)
    assert body.points(body.home, np.inf) == pytest.approx(tshirt.avatar.points, abs=1e-9)
    assert body.points(body.between(body.home, 0.5), np.inf) == pytest.approx(tshirt.avatar.points, abs=1e-6)
    thin = body.points(body.home, 0.03)
    assert np.linalg.norm(thin - body.points(body.home, 0.0), axis=1).max() == pytest.approx(0.03)


def test_arms_leave_by_the_sleeves(tshirt: Outfit, skeleton: Skeleton) -> None:
    (wearing,), (garment,) = tshirt.wearing, tshirt.garments
    assert wearing is not None
    routes = limb_routes(wearing, garment.points)
    assert [limb for limb, route in enumerate(routes) if route is not None] == [RIGHT_ARM, LEFT_ARM]
    curves = curves_of(routes, skeleton, STATIONS)
    posed = replace(wearing, skeleton=replace(skeleton, curves=tuple(curves)))
    assert not posed.misplaced(garment.points)
    assert not posed.pierced(garment.points)


def test_a_tshirt_that_starts_behind_its_body_is_worn_all_the_same(tmp_path) -> None:  # type: ignore[no-untyped-def]
    """Its file places the panels 25 cm behind the body, so that both arms are outside."""
    outfit = load_outfit(load_scene("tshirt", COARSE))
    mesh = outfit.meshes[0]
    assert mesh.texcoords is not None
    lines = ["v " + " ".join(f"{x:.6f}" for x in point) for point in mesh.points - [0.0, 0.0, 0.25]]
    lines += ["vt " + " ".join(f"{x:.6f}" for x in corner) for corner in mesh.texcoords.reshape(-1, 2)]
    for number, triangle in enumerate(mesh.triangles):
        lines.append("f " + " ".join(f"{v + 1}/{3 * number + k + 1}" for k, v in enumerate(triangle)))
    path = tmp_path / "behind.obj"
    path.write_text("\n".join(lines) + "\n")
    assert load_mesh(path, role="garment", key="garment", prim=None, units="m").vertex_count == mesh.vertex_count
    scene = {"garment": {"mesh": str(path), "units": "m"}, "avatar": {"shape": {"kind": "mannequin"}}}
    fit = warp_cloth.fit(scene, device="cpu")
    assert fit.report["attempts"][0]["start"] == "posed"
    assert fit.worn, fit.message
    assert {"key": "solver.start", "value": "posed"}.items() <= next(
        choice for choice in fit.report["choices"] if choice["key"] == "solver.start"
    ).items()
    placed = warp_cloth.fit(scene, device="cpu", overrides=["solver.start=placed"])
    assert all(attempt["start"] != "posed" for attempt in placed.report["attempts"])

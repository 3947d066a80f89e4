"""Feet that are drawn in while a long skirt is put on: within the shins first, and blunt as they come out."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from meshfiles import write_circle_skirt

from warp_cloth.anatomy.openings import LEGS
from warp_cloth.anatomy.skeleton import Skeleton
from warp_cloth.base.clock import StageClock
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.dressing.feet import BLUNT, NEAR, STEP, Feet, _onto_hull
from warp_cloth.dressing.posing import PosedBody
from warp_cloth.fitting.dresser import Dresser
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.scene import load_scene


@pytest.fixture(scope="module")
def body() -> Mesh:
    outfit = load_outfit(load_scene("tshirt", ("garment.shape.edge_mm=40",)))
    assert outfit.avatar is not None
    return outfit.avatar


@pytest.fixture(scope="module")
def home(body: Mesh, skeleton: Skeleton) -> list[Points]:
    return PosedBody(body, skeleton).home


def cloth_above(floor: float, skeleton: Skeleton) -> Points:
    """Cloth that hangs down to this height over the lowest skin [m]."""
    lowest = float((skeleton.skin @ skeleton.up).min())
    return np.array([[0.0, 0.0, 0.3], [0.1, 0.0, 0.3], [0.0, 0.2, 0.3]]) + (lowest + floor) * skeleton.up


def test_feet_that_no_cloth_may_come_upon_stay_as_they_are(body: Mesh, skeleton: Skeleton, home: list[Points]) -> None:
    """Short skirts, and trousers, whose legs go through openings of their own, keep their bits."""
    for floor, may_be_met in ((0.15 + 2.0 * NEAR, True), (0.0, False)):
        feet = Feet(body.points, skeleton, may_be_met=may_be_met)
        feet.draw_in(cloth_above(floor, skeleton), home)
        assert feet.on(body.points, home) is body.points
        assert list(feet.grow(cloth_above(0.0, skeleton), home)) == []


def test_feet_come_out_at_once_where_cloth_has_been_drawn_up(
    body: Mesh, skeleton: Skeleton, home: list[Points]
) -> None:
    feet = Feet(body.points, skeleton, may_be_met=True)
    feet.draw_in(cloth_above(0.0, skeleton), home)
    assert len(list(feet.grow(cloth_above(0.5, skeleton), home))) == 1
    assert feet.on(body.points, home) is body.points


def test_feet_are_balls_at_the_ankles_and_come_out_blunt(body: Mesh, skeleton: Skeleton, home: list[Points]) -> None:
    feet = Feet(body.points, skeleton, may_be_met=True)
    low = cloth_above(0.0, skeleton)
    feet.draw_in(low, home)
    of_feet = [(skeleton.limb == leg) & ((skeleton.skin - home[leg][-1]) @ skeleton.up < 0.03) for leg in LEGS]
    shapes = [feet.on(body.points, home), *(feet.on(body.points, home) for _ in feet.grow(low, home))]
    moved = np.linalg.norm(shapes[0] - body.points, axis=1) > 0.0
    assert np.isin(skeleton.limb[moved], LEGS).all()
    for leg, own in zip(LEGS, of_feet, strict=True):
        assert moved[own].all()
        assert np.ptp(shapes[0][moved & (skeleton.limb == leg)], axis=0).max() <= 2.0 * BLUNT + 1e-9
    farthest = [float(np.linalg.norm(b - a, axis=1).max()) for a, b in itertools.pairwise(shapes)]
    assert max(farthest) <= STEP + 1e-9
    outwards = shapes[-1] - body.points  # each foot is within what it has come out as
    middles = {leg: body.points[moved & (skeleton.limb == leg)].mean(axis=0) for leg in LEGS}
    for leg, own in zip(LEGS, of_feet, strict=True):
        away = body.points[own] - middles[leg]
        assert ((outwards[own] * away).sum(axis=1) > 0.0).all()
        ends = body.points[own] @ skeleton.forward
        assert float((shapes[-1][own] @ skeleton.forward).max()) == pytest.approx(float(ends.max()) + BLUNT, abs=0.004)


@pytest.mark.parametrize(("waist", "drawn_in"), [(1.05, False), (0.6, True)], ids=("short", "long"))
def test_feet_are_drawn_in_within_a_skirt_that_reaches_them_until_all_else_is_home(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, waist: float, drawn_in: bool
) -> None:
    write_circle_skirt(tmp_path / "skirt.obj", girth=0.8, waist=waist, half=np.radians(30.0), rows=4, columns=5)
    avatar = {"shape": {"kind": "mannequin"}}
    scene = load_scene({"garment": {"mesh": str(tmp_path / "skirt.obj"), "units": "m"}, "avatar": avatar})
    dresser = Dresser(scene, load_outfit(scene), "cpu", 0.003, StageClock(), lifted=False, watching=False)
    skeleton = dresser.wearing.skeleton
    toes = [int(np.argmin(np.linalg.norm(skeleton.skin - skeleton.curves[leg][-1], axis=1))) for leg in LEGS]
    for name in ("_meet_body", "_relax"):
        monkeypatch.setattr(Dresser, name, lambda *_given: None)
    came_out = []

    def step(dresser: Dresser, curves: list[Points], thickness: float) -> None:
        came_out.append(dresser._feet.on(dresser._body.points(curves, thickness), curves)[toes] - skeleton.skin[toes])

    monkeypatch.setattr(Dresser, "_step", step)
    off = np.linalg.norm(dresser._surface[toes] - skeleton.skin[toes], axis=1)
    assert (off > 0.1).all() if drawn_in else (off < 0.05).all()
    dresser.come_home()
    ways = np.linalg.norm(came_out, axis=2).max(axis=1)
    assert (ways[0] > 0.1) == drawn_in
    assert (len(ways) > 0.1 / STEP) == drawn_in
    assert ways[-1] < 1.5 * BLUNT


def test_points_go_out_to_their_hull() -> None:
    corners = np.array(list(itertools.product((0.0, 1.0), repeat=3)))
    within = np.array([[0.5, 0.5, 0.75], [0.7, 0.5, 0.5]])
    out, hull = _onto_hull(np.vstack([corners, within]))
    np.testing.assert_allclose(hull[:8], corners, atol=1e-9)
    np.testing.assert_allclose(hull[8:], [[0.5, 0.5, 1.0], [1.0, 0.5, 0.5]], atol=1e-9)
    np.testing.assert_allclose(out[8:], [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], atol=1e-9)


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.zeros((2, 3)), np.eye(3)], ids=("none", "one", "flat"))
def test_points_without_a_volume_are_their_own_hull(points: Points) -> None:
    out, hull = _onto_hull(points)
    assert hull is points
    assert np.isfinite(out).all()

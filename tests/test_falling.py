"""Cloth that falls free: past a ball, over it, pulled by a seam, held by a pin, caught by other cloth."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import warp_cloth
from warp_cloth.base.mesh import Mesh
from warp_cloth.garment.falling import Catcher
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.scene import load_scene

BALL = {"shape": {"kind": "sphere", "edge_mm": 100}}
SQUARE = {"kind": "square", "vertices_per_side": 5, "side": 0.3, "height": 1.5}


def square(**keys: Any) -> Garment:
    return load_outfit(load_scene({"garment": {"shape": SQUARE, **keys}})).garments[0]


def body() -> Mesh:
    avatar = load_outfit(load_scene({"garment": {"shape": SQUARE}, "avatar": BALL})).avatar
    assert avatar is not None
    return avatar


def test_cloth_falls_where_nothing_is_below_it() -> None:
    cloth, ball = square(), body()
    reach = float(np.ptp(ball.points[:, 0])) / 2 + 0.15
    for aside, down, falls in ((0.0, 0.0, False), (reach - 0.05, 0.0, False), (reach + 0.2, 0.0, True), (0, 5, True)):
        assert Catcher([cloth], ball).falling(cloth.points + np.array([aside, -down, 0.0])).tolist() == [falls] * 25
    assert Catcher([cloth], None).falling(cloth.points).all()
    assert not Catcher([square(pin={"vertices": [0]})], None).falling(cloth.points).any()


def test_a_table_of_two_triangles_catches_cloth() -> None:
    corners = np.array([[-2.0, 0.7, -2.0], [2.0, 0.7, -2.0], [2.0, 0.7, 2.0], [-2.0, 0.7, 2.0]])
    table = Mesh("table", corners, np.array([[0, 2, 1], [0, 3, 2]], dtype=np.int32))
    cloth = square()
    for aside, falls in ((0.0, False), (1.2, False), (3.0, True)):
        assert Catcher([cloth], table).falling(cloth.points + np.array([aside, 0.0, 0.0])).all() == falls


def test_an_open_seam_may_pull_cloth_onto_the_body() -> None:
    """Two halves before and behind the ball, whose seam across it is still 1 m long."""
    cloth = square()
    points = cloth.points + np.where(cloth.points[:, [0]] > cloth.points[:, 0].mean(), 1.0, -1.0) * [1.0, 0.0, 0.0]
    assert not Catcher([cloth], body()).falling(points).any()


def test_cloth_over_other_cloth_is_caught_by_it() -> None:
    lower, upper = square(), square()
    points = np.concatenate([lower.points, upper.points + np.array([0.0, 0.3, 0.0])])
    assert Catcher([lower, upper], None).falling(points).tolist() == [True] * 25 + [False] * 25
    apart = np.concatenate([lower.points, upper.points + np.array([1e6, 0.3, 0.0])])
    assert Catcher([lower, upper], None).falling(apart).all()


@pytest.mark.parametrize("iterations", [None, 1500])
def test_a_fit_ends_as_its_cloth_falls_past_the_body(iterations: int | None) -> None:
    """But not where its iterations are stated."""
    garment = {"shape": {**SQUARE, "height": 0.6}, "translate": [0.6, 0.0, 0.0]}
    solver = {} if iterations is None else {"iterations": iterations}
    fit = warp_cloth.fit({"garment": garment, "avatar": BALL, "solver": solver})
    assert not fit.worn
    assert "fell_off" in [problem.code.value for problem in fit.problems]
    assert fit.report["iterations"] == (iterations or 1000)

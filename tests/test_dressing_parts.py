"""Parts of dressing by themselves: armholes on a body's curves, and wide skirts closed before they are sewn."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from warp_cloth.anatomy.openings import ARMS, LEGS
from warp_cloth.anatomy.skeleton import LEFT_ARM
from warp_cloth.base.curves import arc_lengths
from warp_cloth.dressing.routes import Route, _is_armhole, curves_of
from warp_cloth.dressing.skirts import CLOSED, skirt_closed

SHOULDER = np.array([0.2, 1.4, 0.0])


def skeleton() -> Any:
    """An arm from the middle over the shoulder and down, straight on."""
    arm = np.array([[0.0, 1.4, 0.0], SHOULDER, [0.2, 0.8, 0.0]])
    return SimpleNamespace(
        left=np.array([1.0, 0.0, 0.0]), up=np.array([0.0, 1.0, 0.0]), curves=[arm] * 5, joints=[1] * 5
    )


def ring(centre: tuple[float, float, float], radius: float = 0.08) -> Any:
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    return np.array(centre) + radius * np.stack([0.0 * angles, np.cos(angles), np.sin(angles)], axis=1)


@pytest.mark.parametrize(
    ("centre", "is_one"),
    [((0.18, 1.32, 0.0), True), ((0.3, 1.32, 0.0), False), ((0.2, 0.9, 0.0), False)],
    ids=["armhole", "short sleeve", "long sleeve, hanging"],
)
def test_an_armhole_is_told_from_a_sleeve(centre: tuple[float, float, float], is_one: bool) -> None:
    assert _is_armhole(ring(centre), LEFT_ARM, skeleton()) is is_one


def test_an_armhole_is_where_the_shoulder_is_at_home() -> None:
    """However long the way to it is: else the cloth on the shoulder goes out with the arm."""
    way = np.array([[0.0, 1.4, 0.0], [0.1, 1.2, 0.0], [0.2, 1.3, 0.0], [0.9, 1.3, 0.0]])
    to_armhole = float(arc_lengths(way)[2])
    routes: list[Route | None] = [None] * 5
    routes[LEFT_ARM] = Route(way, 0.0, to_armhole)
    count = 81
    curve = curves_of(routes, skeleton(), count)[LEFT_ARM]
    at_shoulder = 0.2 / 0.8 * (count - 1)  # of the curve at home
    np.testing.assert_allclose(curve[round(at_shoulder)], way[2], atol=1e-9)
    np.testing.assert_allclose(curve[[0, -1]], way[[0, -1]])


def dress(half_angle: float) -> tuple[Any, Any]:
    """A fan of cloth round a waist at the origin, to ``half_angle`` from down on both sides, and one arm's cuff."""
    angles, radii = np.meshgrid(np.linspace(-half_angle, half_angle, 41), np.linspace(0.1, 0.6, 6))
    fan = np.stack([radii * np.sin(angles), -radii * np.cos(angles), 0.0 * radii], axis=2).reshape(-1, 3)
    points = np.vstack([fan, ring((0.5, 0.4, 0.0))])
    hem, cuff = np.arange(5 * 41, 6 * 41), np.arange(len(fan), len(points))
    to_hem = np.concatenate([0.6 - radii.ravel(), np.full(len(cuff), 1.5)])
    to_cuff = np.concatenate([np.full(len(fan), 1.0), np.zeros(len(cuff))])
    openings = [SimpleNamespace(loop=hem), SimpleNamespace(loop=cuff)]
    limbs = [LEGS, (ARMS[1],)]
    distances = {LEGS: to_hem, (ARMS[1],): to_cuff}
    wearing = SimpleNamespace(openings=openings, limbs=limbs, skeleton=skeleton(), distances=lambda: distances)
    return wearing, points


def test_a_wide_skirt_is_closed_below_its_waist() -> None:
    wearing, points = dress(np.radians(170.0))
    closed = skirt_closed(wearing, points)
    fan, cuff = slice(0, 6 * 41), slice(6 * 41, None)
    assert points[fan, 1].max() > 0.5
    assert closed[fan, 1].max() < 0.0
    np.testing.assert_allclose(np.linalg.norm(closed[fan], axis=1), np.linalg.norm(points[fan], axis=1), atol=1e-9)
    aside = np.abs(np.arctan2(closed[fan, 0], -closed[fan, 1]))
    assert aside.max() == pytest.approx(CLOSED)
    np.testing.assert_array_equal(closed[cuff], points[cuff])


def test_a_narrow_skirt_is_left_as_it_is() -> None:
    wearing, points = dress(np.radians(60.0))
    assert skirt_closed(wearing, points) is points

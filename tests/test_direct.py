"""The paper's own rule against values worked out by hand: one edge, one hinge, one hanging pair, the cap."""

from __future__ import annotations

import numpy as np
import pytest
from cloths import bare_rest, model_of

from warp_cloth.avatar.collider import Collider
from warp_cloth.base.mesh import Indices, Mesh, Points
from warp_cloth.base.topology import build_topology
from warp_cloth.garment.rest import RestShape
from warp_cloth.model.model import ClothModel
from warp_cloth.solver.relax import Relaxation
from warp_cloth.solver.step_options import StepOptions

ROUNDING = 1e-12  # a few operations in float64, relative
CAP = 1e-3  # [m]
WEIGHT = 0.01  # [N]
DOWN = np.array([0.0, -1.0, 0.0])


NO_TRIANGLES = np.zeros((0, 3), dtype=np.int32)


def moved(
    points: Points,
    rest: RestShape,
    iterations: int = 1,
    pins: tuple[int, ...] = (),
    triangles: Indices = NO_TRIANGLES,
) -> Points:
    """Positions after iterations of the direct rule."""
    model = model_for(points, rest, np.array(pins, dtype=np.int32), triangles)
    relaxation = Relaxation(model, Collider(), StepOptions(method="direct", cap=CAP))
    for _ in range(iterations):
        relaxation.iterate()
    return model.points()


def model_for(points: Points, rest: RestShape, pins: Indices, triangles: Indices = NO_TRIANGLES) -> ClothModel:
    return model_of(Mesh("bare", points, triangles), rest, pins=pins)


def expected_move(force: Points) -> Points:
    """Force, cap, displacement: 1.1 weights, slightly larger than gravity, replace what is larger and move by CAP."""
    limit = 1.1 * WEIGHT
    size = np.linalg.norm(force, axis=1, keepdims=True)
    return np.where(size > limit, force * (limit / size), force) * CAP / limit


@pytest.mark.parametrize(("length", "pull"), [(0.102, 1000.0), (0.098, 1000.0), (0.12, 1000.0)])
def test_one_edge(length: float, pull: float) -> None:
    points = np.array([[0.0, 0.0, 0.0], [length, 0.0, 0.0]])
    after = moved(points, bare_rest(points, edges=[[0, 1]], length=[0.1], pull=pull, weight=WEIGHT))
    stretch = length - 0.1
    tension = pull * stretch**2 if stretch > 0.0 else -0.1 * pull * stretch**2  # c = 0.1
    force = np.array([[tension, -WEIGHT, 0.0], [-tension, -WEIGHT, 0.0]])
    assert after == pytest.approx(points + expected_move(force), rel=ROUNDING, abs=ROUNDING)


@pytest.mark.parametrize("angle", [30.0, 90.0, 150.0])
def test_one_hinge(angle: float) -> None:
    # axis of 0.2 m along x, both wings 0.1 m off its middle, the second folded up about the axis
    theta = np.radians(angle)
    points = np.array(
        [[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, -0.1], [0.0, 0.1 * np.sin(theta), 0.1 * np.cos(theta)]]
    )
    triangles = np.array([[0, 1, 2], [1, 0, 3]], dtype=np.int32)
    stiffness = 4e-4  # C [N m]
    topology = build_topology(triangles, 4)
    none = np.zeros(len(topology.edges))
    rest = RestShape(topology, none + 1.0, none, none, np.array([stiffness]), np.full(4, WEIGHT), 0.0)
    after = moved(points, rest, triangles=triangles)

    size = stiffness * (1.0 - np.cos(theta)) / 0.1  # N / d
    # the fold is a valley: the standing wing turns down to flat, the other one away below the axis
    wings = np.array([[0.0, -1.0, 0.0], [0.0, -np.cos(theta), np.sin(theta)]]) * size
    axis = -np.repeat(wings.sum(axis=0, keepdims=True), 2, axis=0) / 2.0
    force = np.concatenate([axis, wings]) + WEIGHT * DOWN
    assert after == pytest.approx(points + expected_move(force), rel=ROUNDING, abs=ROUNDING)


def test_hanging_pair_step_by_step_and_at_rest() -> None:
    pull, rest_length = 250.0, 0.1
    points = np.array([[0.0, 0.0, 0.0], [0.0, -rest_length, 0.0]])
    rest = bare_rest(points, edges=[[0, 1]], length=[rest_length], pull=pull, weight=WEIGHT)
    stretch = 0.0
    for iteration in range(1, 20):
        force = WEIGHT - pull * stretch**2
        stretch += np.clip(force, -1.1 * WEIGHT, 1.1 * WEIGHT) * CAP / (1.1 * WEIGHT)
        after = moved(points, rest, iteration, pins=(0,))
        assert after[0].tolist() == [0.0, 0.0, 0.0]
        assert after[1, 1] == pytest.approx(-rest_length - stretch, rel=ROUNDING)
    # at rest the edge bears the weight: k (r - L)^2 = w
    after = moved(points, rest, 200, pins=(0,))
    assert after[1, 1] == pytest.approx(-rest_length - np.sqrt(WEIGHT / pull), rel=1e-9)


def test_the_cap_keeps_the_direction_and_replaces_the_size() -> None:
    points = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0]])
    after = moved(points, bare_rest(points, edges=[[0, 1]], length=[1.0], pull=1e6, weight=WEIGHT))
    tension = 1e6 * 4.0**2 * np.array([0.6, 0.8, 0.0])
    for vertex, force in ((0, tension + WEIGHT * DOWN), (1, -tension + WEIGHT * DOWN)):
        assert after[vertex] - points[vertex] == pytest.approx(CAP * force / np.linalg.norm(force), rel=1e-9)

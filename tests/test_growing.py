"""What moves faster and faster is not at rest: a fold on its displacement to snap."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from warp_cloth.fitting.problem import Problem, load_problem, tolerance_of
from warp_cloth.kernels.certificate.summary import GREW_ONCE
from warp_cloth.model.result import Residual
from warp_cloth.scene import load_scene
from warp_cloth.solver.certificate.certifier import Check, Tolerance

STEP = 1e-5  # [m]
ROUNDING = 1e-12  # [m], of float64 positions near 1 m


@pytest.fixture(scope="module")
def hung() -> Problem:
    """A hanging square, which only is measured here."""
    return load_problem(
        load_scene({"garment": {"shape": {"kind": "square", "vertices_per_side": 5, "plane": "vertical"}}}), "cpu"
    )


def seen(made: Problem, vertex: int, displacements: list[list[float]]) -> float:
    """The growing displacement [m] at the last of the measurements between which a vertex moves by these [m]."""
    points = made.model.points().copy()
    start = points.copy()
    for iteration, displacement in enumerate([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], *displacements]):
        points[vertex] += displacement
        made.model.set_points(points)
        growing = made.certifier.measure(100 * iteration).growing[0]
        made.certifier.take_snapshot(100 * iteration)
    made.model.set_points(start)
    return float(growing)


def highest(made: Problem) -> int:
    return int(made.model.points()[:, 1].argmax())


DISPLACEMENTS = {
    "grown twice": ([[STEP, 0.0, 0.0], [2.0 * STEP, 0.0, 0.0], [3.0 * STEP, STEP, 0.0]], 10.0**0.5 * STEP),
    "grown once": ([[2.0 * STEP, 0.0, 0.0], [STEP, 0.0, 0.0], [2.0 * STEP, 0.0, 0.0]], float(GREW_ONCE) * 2.0 * STEP),
    "grown from another direction": (
        [[0.0, STEP, 0.0], [2.0 * STEP, 0.0, 0.0], [3.0 * STEP, 0.0, 0.0]],
        float(GREW_ONCE) * 3.0 * STEP,
    ),
    "shorter": ([[STEP, 0.0, 0.0], [3.0 * STEP, 0.0, 0.0], [2.0 * STEP, 0.0, 0.0]], 0.0),
    "longer, another direction": ([[STEP, 0.0, 0.0], [2.0 * STEP, 0.0, 0.0], [0.0, 3.0 * STEP, 0.0]], 0.0),
    "longer, back": ([[STEP, 0.0, 0.0], [2.0 * STEP, 0.0, 0.0], [-3.0 * STEP, 0.0, 0.0]], 0.0),
    "out of rest": ([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [STEP, 0.0, 0.0]], 0.0),
}


@pytest.mark.parametrize("name", list(DISPLACEMENTS))
def test_growing_is_a_displacement_longer_than_those_before_in_their_direction(hung: Problem, name: str) -> None:
    displacements, expected = DISPLACEMENTS[name]
    assert seen(hung, highest(hung), displacements) == pytest.approx(expected, abs=ROUNDING)


def test_what_hangs_low_may_fold(hung: Problem) -> None:
    lowest = int(hung.model.points()[:, 1].argmin())
    assert seen(hung, lowest, DISPLACEMENTS["grown twice"][0]) == 0.0


def test_balanced_cloth_that_moves_faster_and_faster_is_not_at_rest() -> None:
    tolerance = Tolerance()
    still = Check(1000, Residual(*[0.0] * 5), 0.0, True)
    assert still.within(tolerance)
    assert replace(still, growing=tolerance.growing).within(tolerance)
    assert not replace(still, growing=1.01 * tolerance.growing).within(tolerance)


def test_it_is_required_of_all_methods_but_the_papers_rule() -> None:
    """That one chatters: how far it moves tells nothing about folds."""
    for method, required in (("accelerated", True), ("multilevel", True), ("direct", False)):
        scene = load_scene({"garment": {"shape": {"kind": "square"}}, "solver": {"method": method}})
        assert math.isfinite(tolerance_of(scene).growing) == required

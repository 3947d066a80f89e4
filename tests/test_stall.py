"""An attempt ends where it comes no nearer to rest."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from warp_cloth.fitting.problem import build_problem
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.model.attempt import CutShort, Patience
from warp_cloth.model.result import Status
from warp_cloth.scene import load_scene
from warp_cloth.solver.certificate.certifier import Measurement, Tolerance
from warp_cloth.solver.goal import Goal
from warp_cloth.solver.loop import relax_items
from warp_cloth.solver.stall import STALL, StallWatch


def measured(iteration: int, residual: float, error: float) -> Measurement:
    one = np.ones(1)
    return Measurement(iteration, one, residual * one, error * one, one, one, np.zeros((1, 2, 3)), one > 0)


def stalls(
    patience: Patience, residual: Callable[[int], float], count: int, error: Callable[[int], float] = lambda n: 1.0
) -> list[bool]:
    """Whether an item has stalled at each of some checks; its rest error stays the same by default."""
    watch = StallWatch([patience], [Tolerance()])
    return [bool(watch.stalled(measured(100 * n, residual(n), error(n)))[0]) for n in range(1, count)]


@pytest.mark.parametrize("patience", [Patience.SHORT, Patience.LONG])
def test_what_comes_no_nearer_to_rest_stalls(patience: Patience) -> None:
    checks = STALL[patience][0] // 100 + 2
    assert stalls(patience, lambda n: 0.1, checks + 1) == [False] * (checks - 1) + [True]


def test_one_figure_that_falls_is_progress() -> None:
    assert not any(stalls(Patience.SHORT, lambda n: 0.1 * 0.99**n, 400))


@pytest.mark.parametrize("patience", [Patience.SHORT, Patience.LONG])
def test_what_is_jammed_stalls_though_it_moves_less_and_less(patience: Patience) -> None:
    first = STALL[Patience.SHORT][0] // 100 + 2
    found = stalls(patience, lambda n: 0.02, first + 1, lambda n: 1e-3 * 0.99**n)
    assert found == [False] * (first - 1) + [True]
    assert not any(stalls(patience, lambda n: 0.009, 400, lambda n: 1e-3 * 0.99**n))  # forces balance


def test_a_fit_with_a_stated_limit_never_stalls() -> None:
    assert not any(stalls(Patience.NONE, lambda n: 0.1, 1000))


def test_a_relaxation_without_progress_is_cut_short() -> None:
    """A tolerance below rounding cannot be reached."""
    scene = load_scene("hanging", ["garment.shape.vertices_per_side=5"])
    problem = build_problem([scene], [load_outfit(scene)], "cpu")
    goal = Goal(Tolerance(relative_rms=1e-30, rest_error=1e-30), 100_000, Patience.SHORT)
    (outcome,) = relax_items(problem.certifier, [goal])
    assert (outcome.status, outcome.cut_short) == (Status.ITERATION_LIMIT, CutShort.STALLED)
    assert STALL[Patience.SHORT][0] < outcome.iterations < 100_000

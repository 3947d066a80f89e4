"""The estimate of the distance from rest on motions whose rest is known."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest

from warp_cloth.solver.certificate.rest_error import Snapshot, Snapshots, rest_error

STEP = 100  # iterations between two measurements
AWAY = np.array([[0.3, -0.2, 0.1], [0.1, 0.4, 0.2], [-0.1, 0.0, 0.5]])  # [m], from rest at the start
DISTANCE = math.sqrt(np.mean(np.sum(AWAY**2, axis=1)))
FINEST = 1e-4  # [m]; shapes are kept in float32, which near 1 m tells 1e-7 m apart
LOOSEST = 8.0  # times the true distance, median
LOOSEST_FAST = 16.0  # where a span covers most of what is left: a span may be quiet by chance, and is not believed


def measured(left: Callable[[int], float], until: int) -> list[tuple[float, float]]:
    """Estimate and true distance [m] at every measurement of a motion that has the fraction ``left`` before it."""
    snapshots = Snapshots()
    measurements = []
    for now in range(0, until + 1, STEP):
        shape = (1.0 + AWAY * left(now)).astype(np.float32)
        found = snapshots.at_spans(now)
        shapes = [shape, *(each.shape for each in found)]
        distances = [float(np.sqrt(np.mean(np.sum((a - b) ** 2, axis=1)))) for a, b in itertools.pairwise(shapes)]
        estimate = float(rest_error(now, found, np.array([distances]))[0])
        measurements.append((estimate, DISTANCE * abs(left(now))))
        if snapshots.due(now):
            snapshots.store(Snapshot(now, shape))
        snapshots.drop(now)
    return measurements


MOTIONS: dict[str, Callable[[int], float]] = {
    "fast": lambda now: math.exp(-now / 300),
    "slow": lambda now: math.exp(-now / 2000),
    "like 1 / n2, as momentum leaves a cubic energy": lambda now: (1 + now / 100) ** -2.0,
    "fast, then slow": lambda now: 0.9 * math.exp(-now / 200) + 0.1 * math.exp(-now / 1500),
}
HONEST = 0.95  # fraction of the measurements, as the certificate promises
HONEST_SWINGING = 0.9  # a swing is slow where it turns, and cloth swings in many modes that do not all turn at once


def ratios_of(motion: Callable[[int], float]) -> list[float]:
    """Estimate over true distance where both are known."""
    measurements = measured(motion, 6000)
    return [estimate / true for estimate, true in measurements if true > FINEST and math.isfinite(estimate)]


def test_no_less_than_the_true_distance() -> None:
    ratios = [ratio for motion in MOTIONS.values() for ratio in ratios_of(motion)]
    assert len(ratios) > 100
    assert np.mean(np.array(ratios) >= 1.0) >= HONEST


@pytest.mark.parametrize("name", list(MOTIONS))
def test_not_much_more_than_the_true_distance(name: str) -> None:
    assert np.median(ratios_of(MOTIONS[name])) < (LOOSEST_FAST if name == "fast" else LOOSEST)


def test_a_swing_is_not_taken_for_rest_where_it_turns() -> None:
    ratios = ratios_of(lambda now: math.exp(-now / 1000) * math.cos(now / 150))
    assert np.mean(np.array(ratios) >= 1.0) >= HONEST_SWINGING


def test_steady_creep_is_not_rest() -> None:
    estimate, _ = measured(lambda now: 1.0 - now / 1e6, 6000)[-1]
    assert estimate > DISTANCE * 6000 / 1e6  # at least as far again


def test_nothing_is_known_at_the_start() -> None:
    assert [math.isinf(estimate) for estimate, _ in measured(lambda now: 0.0, 500)] == [True] * 6


def test_standing_still_is_rest() -> None:
    assert measured(lambda now: 0.0, 1000)[-1][0] == 0.0


@pytest.mark.parametrize("step", [100, 300, 700])
def test_no_more_shapes_are_kept_than_memory_is_planned_for(step: int) -> None:
    stored = Snapshots()
    most = 0
    for iteration in range(0, 60_000, step):
        if stored.due(iteration):
            stored.store(Snapshot(iteration, None))
            most = max(most, len(stored.shapes))
        stored.drop(iteration)
    assert most <= Snapshots.most()

"""The relax loop: going on while a check is read changes nothing of how a fit ends."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
import pytest

from warp_cloth.fitting import problem as set_up_module
from warp_cloth.fitting.problem import build_problem, collider_updates, tolerance_of
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.model.model import build_model
from warp_cloth.scene import load_scene
from warp_cloth.solver.goal import Goal, Outcome
from warp_cloth.solver.loop import bursts, relax_items
from warp_cloth.study.launches import launches_of

FALLING = [
    "collision.cloth=false",
    "garment.shape.vertices_per_side=9",
    "collision.pixel_mm=10",
    "collision.offset_mm=5",
]


def ended(changes: Sequence[Sequence[str]], *, ahead: bool) -> tuple[list[Outcome], np.ndarray]:
    """How scenes of cloth that falls on a ball end together, and each vertex's normal force [N] and stiffness [N/m].

    The last shape is what the model holds.
    """
    scenes = [load_scene("sphere", [*FALLING, *change]) for change in changes]
    made = build_problem(scenes, [load_outfit(scene) for scene in scenes], "cpu")
    goals = [Goal(tolerance_of(scene), scene.solver.iterations) for scene in scenes]
    outcomes = relax_items(made.certifier, goals, follow=collider_updates(made), ahead=ahead)
    for item, outcome in enumerate(outcomes):
        np.testing.assert_array_equal(made.model.points(item), outcome.points)
    return outcomes, np.stack([np.asarray(made.certifier.normal_forces()), made.model.state.stiffness.numpy()])


@pytest.mark.parametrize(
    "changes",
    [
        [["avatar.friction=0", "solver.iterations=3000", "solver.residual=0.3", "solver.residual_p99=1"]],
        [["solver.iterations=50"], ["solver.iterations=300"], ["solver.iterations=3000", "solver.tolerance_mm=20"]],
    ],
)
@pytest.mark.parametrize("gathers", [False, True])
def test_what_runs_ahead_ends_where_its_check_saw_it(
    changes: Sequence[Sequence[str]], gathers: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(set_up_module, "build_model", partial(build_model, gathers=gathers))
    (all_late, late_force), (all_early, early_force) = (ended(changes, ahead=ahead) for ahead in (True, False))
    np.testing.assert_array_equal(late_force, early_force)
    for late, early in zip(all_late, all_early, strict=True):
        assert (late.status, late.iterations, late.check) == (early.status, early.iterations, early.check)
        np.testing.assert_array_equal(late.points, early.points)


def test_cloth_that_hangs_goes_from_check_to_check_in_fewer_graphs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(set_up_module, "build_model", partial(build_model, gathers=True))
    scene = load_scene("hanging", ["garment.shape.vertices_per_side=9", "solver.iterations=230"])
    shapes, graphs = [], list[list[int]]()
    for told in (None, lambda iteration, relaxation: None):
        made = build_problem([scene], [load_outfit(scene)], "cpu")
        run, counts = made.relaxation.run, list[int]()
        monkeypatch.setattr(
            made.relaxation, "run", lambda count, run=run, counts=counts: (counts.append(count), run(count))
        )
        (outcome,) = relax_items(made.certifier, [Goal(tolerance_of(scene), scene.solver.iterations)], on_burst=told)
        shapes.append(outcome.points)
        graphs.append(counts)
    assert graphs == [[100, 100, 30], [20] * 11 + [10]]
    np.testing.assert_array_equal(*shapes)


def test_hanging_cloth_is_packed_once_between_two_checks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(set_up_module, "build_model", partial(build_model, gathers=True))
    scene = load_scene("hanging", ["garment.shape.vertices_per_side=9"])
    made = build_problem([scene], [load_outfit(scene)], "cpu")
    (count,) = bursts(made.relaxation)
    launches = launches_of(lambda: made.relaxation.iterate(count))
    assert len(launches) == count + 2


@pytest.mark.parametrize("ahead", [False, True])
def test_worn_cloth_that_stays_packed_between_checks_ends_with_the_same_bits(
    monkeypatch: pytest.MonkeyPatch, ahead: bool
) -> None:
    changes = ["collision.pixel_mm=10", "garment.shape.vertices_per_side=13", "solver.residual=0.05"]
    changes += ["solver.residual_p99=0.5", "collision.cloth=false"]
    scenes = [load_scene("sphere", [*changes, f"solver.iterations={count}"]) for count in (5000, 530)]
    found = []
    for gathers in (False, True):
        monkeypatch.setattr(set_up_module, "build_model", partial(build_model, gathers=gathers))
        made = build_problem(scenes, [load_outfit(scene) for scene in scenes], "cpu")
        goals = [Goal(tolerance_of(scene), scene.solver.iterations) for scene in scenes]
        outcomes = relax_items(made.certifier, goals, follow=collider_updates(made), ahead=ahead and gathers)
        assert made.relaxation.stays_packed is gathers
        found.append(outcomes)
    for scattered, gathered in zip(*found, strict=True):
        assert (gathered.status, gathered.iterations) == (scattered.status, scattered.iterations)
        np.testing.assert_array_equal(gathered.points, scattered.points)
    assert found[0][0].iterations != found[0][1].iterations

"""Runs a scene once, and records its state after several iteration counts, as if it had been stopped there."""

from __future__ import annotations

import time
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from warp_cloth.avatar.exact import penetrations
from warp_cloth.base.cache import Cache
from warp_cloth.base.clock import StageClock
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.fitting.predrape import prepare_start
from warp_cloth.fitting.problem import Problem, collider_updates, load_problem
from warp_cloth.model.result import Penetration, Status
from warp_cloth.report.rest import limits_missed
from warp_cloth.scene import Scene, load_scene
from warp_cloth.solver.certificate.strains import edge_strains, strain_summary
from warp_cloth.solver.goal import Goal, Outcome
from warp_cloth.solver.loop import relax_items
from warp_cloth.solver.relax import Relaxation


@dataclass(frozen=True, eq=False)
class RunState:
    """The state of a run after some iterations."""

    status: Status
    iterations: int
    loading: float  # [s] until the first iteration, without compiling
    relaxing: float  # [s]
    meshes: tuple[Mesh, ...]
    worn: tuple[Points, ...]  # of each garment [m], shape [V, 3]
    depth: Penetration | None  # under the exact avatar
    strain: float  # 99th percentile of the magnitude of edges' strain
    message: str  # of the whole run


@dataclass(frozen=True)
class StoppedRun:
    """A scene to run in any process; without states where its settings are refused or its process dies."""

    settings: dict[str, Any]
    overrides: tuple[str, ...]
    stops: tuple[int, ...]

    def run(self, device: str) -> list[RunState]:
        """The states of ``run_with_stops``."""
        try:
            return run_with_stops(load_scene(self.settings, self.overrides), device, self.stops)
        except InputError:
            return []

    def lost(self, verdict: str, message: str) -> list[RunState]:
        return []


def run_with_stops(scene: Scene, device: str, stops: Collection[int]) -> list[RunState]:
    """Runs a scene to its end; returns its states after those iterations (ends of bursts) and at the end."""
    clock, cache = StageClock(), Cache()
    problem = load_problem(scene, device, cache=cache, clock=clock)
    loading = sum(spent for stage, spent in clock.seconds.items() if stage != "compile")  # compiled once for all scenes
    recorder = _Recorder(stops)
    prepare_start(problem, cache, clock)
    (goal,) = problem.goals()
    (outcome,) = relax_items(
        problem.certifier,
        [goal],
        follow=collider_updates(problem),
        schedule=problem.schedule,
        on_burst=recorder.record,
    )
    relaxing = recorder.elapsed()
    ends = [
        (Status.ITERATION_LIMIT if np.isfinite(points).all() else Status.DIVERGED, count, seconds, points)
        for count, (seconds, points) in recorder.shapes.items()
        if count < outcome.iterations
    ]
    ends.append((outcome.status, outcome.iterations, relaxing, outcome.points))
    message = _ended(outcome, goal)
    return _states(problem, ends, loading, message)


def _states(
    problem: Problem, ends: list[tuple[Status, int, float, Points]], loading: float, message: str
) -> list[RunState]:
    """States from status, iterations, seconds and points of each."""
    model, outfit = problem.model, problem.outfit
    depths = penetrations([end[3] for end in ends], [outfit.avatar] * len(ends), model.device)
    starts = np.cumsum([mesh.vertex_count for mesh in outfit.meshes])[:-1]
    states = []
    for (status, count, seconds, points), depth in zip(ends, depths, strict=True):
        model.set_points(points)
        strain = strain_summary(edge_strains(model)).p99
        worn = tuple(np.split(points, starts))
        states.append(RunState(status, count, loading, seconds, outfit.meshes, worn, depth, strain, message))
    return states


def _ended(outcome: Outcome, goal: Goal) -> str:
    """How a run ended, in a sentence."""
    after = f"after {outcome.iterations:,} iterations"
    if outcome.status is Status.ITERATION_LIMIT:
        return f"Not at rest {after}: {', '.join(limits_missed(outcome.check, goal.tolerance))}."
    return f"{'Diverged' if outcome.status is Status.DIVERGED else 'At rest'} {after}."


class _Recorder:
    """Records shapes and seconds during a run; the time of recording does not count."""

    def __init__(self, stops: Collection[int]) -> None:
        self._stops = frozenset(stops)
        self._recording = 0.0  # [s]
        self._began = time.perf_counter()
        self.shapes: dict[int, tuple[float, Points]] = {}

    def elapsed(self) -> float:
        return time.perf_counter() - self._began - self._recording

    def record(self, iteration: int, relaxation: Relaxation) -> None:
        """Records the shape after this iteration if it is one of the stops."""
        if iteration in self._stops:
            relaxation.update_model()
            wp.synchronize_device(relaxation.model.device)
            seconds, entered = self.elapsed(), time.perf_counter()
            self.shapes[iteration] = seconds, relaxation.model.points()
            self._recording += time.perf_counter() - entered

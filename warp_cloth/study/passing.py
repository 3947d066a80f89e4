"""A scene run once, and what it would have come to had it been stopped on the way: the loop passes through that."""

from __future__ import annotations

import time
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from warp_cloth.avatar.exact import penetrations
from warp_cloth.base.cache import Cache
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.fitting.clock import StageClock
from warp_cloth.fitting.predrape import prepare_start
from warp_cloth.fitting.problem import Problem, collider_updates, load_problem, tolerance_of
from warp_cloth.model.result import Penetration, Status
from warp_cloth.report.status import more_iterations, sentence_of
from warp_cloth.scene import Scene, load_scene
from warp_cloth.solver.certificate.strains import edge_strains, strain_summary
from warp_cloth.solver.loop import Goal, relax_items
from warp_cloth.solver.relax import Relaxation


@dataclass(frozen=True, eq=False)
class Passed:
    """A run after some iterations, as if it had been stopped there."""

    status: Status
    iterations: int
    loading: float  # [s] until the first iteration, without compiling
    relaxing: float  # [s]
    meshes: tuple[Mesh, ...]
    worn: tuple[Points, ...]  # of each garment [m], shape [V, 3]
    depth: Penetration | None  # under the exact avatar
    strain: float  # of edges, the 99th percentile of its size
    message: str  # how the whole run ended


@dataclass(frozen=True)
class Passage:
    """Settings of a scene to run through, in any process; empty where they are refused or take the process along."""

    settings: dict[str, Any]
    overrides: tuple[str, ...]
    stops: tuple[int, ...]

    def run(self, device: str) -> list[Passed]:
        """What ``run_through`` tells."""
        try:
            return run_through(load_scene(self.settings, self.overrides), device, self.stops)
        except InputError:
            return []

    def lost(self, verdict: str, message: str) -> list[Passed]:
        return []


def run_through(scene: Scene, device: str, stops: Collection[int]) -> list[Passed]:
    """Runs a scene to its end; tells of those iterations on the way, which end chunks of the loop, and of the end."""
    clock, cache = StageClock(), Cache()
    made = load_problem(scene, device, cache=cache, clock=clock)
    loading = sum(spent for stage, spent in clock.seconds.items() if stage != "compile")  # compiled once for all scenes
    watch = _Watch(stops)
    prepare_start(made, cache)
    goal = Goal(tolerance_of(scene), scene.solver.iterations)
    (outcome,) = relax_items(
        made.relaxation,
        made.certifier,
        [goal],
        follow=collider_updates(made),
        schedule=made.schedule,
        on_chunk=watch.offer,
    )
    spent = watch.elapsed()
    way = [(count, *seen) for count, seen in watch.seen.items() if count < outcome.iterations]
    found = [
        (Status.ITERATION_LIMIT if np.isfinite(points).all() else Status.DIVERGED, count, seconds, points)
        for count, seconds, points in way
    ]
    message = sentence_of(outcome, goal.tolerance, more_iterations(scene, outcome))
    ends = [*found, (outcome.status, outcome.iterations, spent, outcome.points)]
    return _measured(made, ends, loading, message)


def _measured(
    made: Problem, ends: list[tuple[Status, int, float, Points]], loading: float, message: str
) -> list[Passed]:
    model, outfit = made.model, made.outfit
    depths = penetrations([end[3] for end in ends], [outfit.avatar] * len(ends), model.device)
    starts = np.cumsum([mesh.vertex_count for mesh in outfit.garments])[:-1]
    passed = []
    for (status, count, seconds, points), depth in zip(ends, depths, strict=True):
        model.set_points(points)
        strain = strain_summary(edge_strains(model)).p99
        worn = tuple(np.split(points, starts))
        passed.append(Passed(status, count, loading, seconds, outfit.garments, worn, depth, strain, message))
    return passed


class _Watch:
    """Keeps shapes and seconds on the way; the time that this takes does not count."""

    def __init__(self, stops: Collection[int]) -> None:
        self._stops = frozenset(stops)
        self._idle = 0.0
        self._began = time.perf_counter()
        self.seen: dict[int, tuple[float, Points]] = {}

    def elapsed(self) -> float:
        return time.perf_counter() - self._began - self._idle

    def offer(self, iteration: int, relaxation: Relaxation) -> None:
        """Keeps the shape after this iteration if it is asked for."""
        if iteration in self._stops:
            relaxation.show()
            wp.synchronize_device(relaxation.model.device)
            seconds, entered = self.elapsed(), time.perf_counter()
            self.seen[iteration] = seconds, relaxation.model.points()
            self._idle += time.perf_counter() - entered

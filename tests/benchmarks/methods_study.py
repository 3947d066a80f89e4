"""The methods on the same cloth: how fast each comes to rest, at every stiffness and resolution, and is it true?

Hanging squares, cantilever strips, cloth over a ball, draped discs, sewn T-shirts. Each run continues far beyond
its certificate; its end is the rest shape that earlier shapes are measured against.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Any

import numpy as np
from methods_scenes import Case, all_cases, case_tree

from warp_cloth.base.mesh import Points
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.batch.lifeline import sigint_blocked
from warp_cloth.fitting.problem import Problem, collider_updates, load_problem, start_coarse, tolerance_of
from warp_cloth.scene import load_scene
from warp_cloth.solver.certificate import certifier
from warp_cloth.solver.certificate.certifier import Tolerance
from warp_cloth.solver.goal import Goal
from warp_cloth.solver.loop import BURST, relax_items
from warp_cloth.solver.step_options import StepOptions

LIMITS = MappingProxyType({"direct": 20_000, "momentum": 20_000, "accelerated": 40_000, "multilevel": 20_000})

# Rest for the study: a hundredth of a certificate's tolerances.
BEYOND = Tolerance(relative_rms=1e-4, relative_p99=5e-4, rest_error=1e-5)
LEVELS = (0.1, 0.01, 0.001)  # relative residuals whose iterations and seconds are reported
GROWTH = 1.05  # shapes are stored when the iterations have grown by this factor
FURTHER = 3.0  # times the iterations to the certificate that a run lasts at least
CERTAIN = 5.0  # a distance is known where it is so many times what the end may still be from rest


@dataclass(frozen=True)
class Measurement:
    """What was seen of a run at one check."""

    iteration: int  # of the finest garment
    seconds: float  # since the start, simplified garments included
    weights: float  # residual rms in vertex weights
    relative: float
    relative_p99: float
    rest_error_mm: float  # nan while it is not known
    true_mm: float = math.nan  # rms distance from where the run ended; nan where that is not known


@dataclass(frozen=True)
class Run:
    """One method on one scene."""

    case: Case
    method: str
    device: str
    vertices: int
    coarse: float  # iterations of simplified garments, each weighted by its vertices over the garment's
    coarse_seconds: float
    rest: int  # iteration of the certificate; 0 where it was not reached
    end_mm: float  # what the end may still be from rest
    looks: tuple[Measurement, ...] = field(repr=False)

    @property
    def work(self) -> float:
        """Iterations to the certificate, all levels weighted by their vertices; inf where it was not reached."""
        return self.coarse + self.rest if self.rest else math.inf

    def first(self, relative: float) -> Measurement | None:
        """The first look from which on the relative residual stays below this."""
        found = None
        for look in reversed(self.looks):
            if not look.relative <= relative:
                break
            found = look
        return found

    def certified(self) -> Measurement | None:
        """The look at which the certificate was given."""
        return next((look for look in self.looks if look.iteration == self.rest), None)

    def estimates(self) -> list[Measurement]:
        """Looks at balanced forces whose distance from rest is known."""
        return [
            look
            for look in self.looks
            if look.relative <= 0.01
            and look.relative_p99 <= 0.05
            and look.rest_error_mm == look.rest_error_mm
            and look.true_mm > CERTAIN * self.end_mm
        ]


def step_options(method: str) -> StepOptions:
    """How the method moves cloth; momentum alone is each vertex's own step and plain momentum, nothing else."""
    if method == "momentum":
        return StepOptions(
            momentum=0.99, damping=1.0, viscosity=0.0, memory=0.0, memory_falling=0.0, anisotropy_limit=0.0
        )
    if method == "direct":
        return StepOptions(method="direct")
    return StepOptions(method="multilevel" if method == "multilevel" else "accelerated")


def prepared(case: Case, method: str, device: str, limit: int, more: Mapping[str, float] | None = None) -> Problem:
    """The case on the device, ready to relax."""
    with TemporaryDirectory() as folder:
        own = "accelerated" if method == "momentum" else method
        tree = {
            **case_tree(case, Path(folder), more),
            "collision": {"cloth": False},
            "solver": {"method": own, "iterations": limit},
        }
        return load_problem(load_scene(tree), device, options=step_options(method))


def run_case(
    case: Case, method: str, device: str, limit: int | None = None, more: Mapping[str, float] | None = None
) -> Run:
    """Relaxes a case by a method, on beyond its certificate; ``more`` as in ``case_tree``."""
    limit = LIMITS[method] if limit is None else limit
    problem = prepared(case, method, device, limit, more)
    began = time.perf_counter()
    levels = start_coarse(problem)
    before = time.perf_counter() - began
    model, looks, shapes = problem.model, [], []
    wanted, idle, stored, rest = tolerance_of(problem.scenes[0]), 0.0, 0, 0

    def seen(measurement: certifier.Measurement, seconds: float) -> None:
        nonlocal idle, stored, rest
        check = problem.certifier.check(measurement, 0)
        entered = time.perf_counter()
        shape: Points | None = None
        certified = not rest and check.within(wanted)
        if certified:
            rest = check.iteration
        if certified or check.iteration >= GROWTH * stored:
            stored, shape = check.iteration, model.points()
        shapes.append(shape)
        looks.append((check, before + seconds - idle))
        idle += time.perf_counter() - entered

    (outcome,) = relax_items(
        problem.certifier,
        [Goal(BEYOND, limit)],
        follow=collider_updates(problem),
        on_check=seen,
        ahead=False,
    )
    end = outcome.points
    further = int(FURTHER * rest) - outcome.iterations
    for _ in range(max(further, 0) // BURST):
        problem.relaxation.run(BURST)
    if further > 0:
        end = model.points()
    coarse = sum(level.iterations * level.vertices for level in levels) / model.vertex_count
    end_mm = 1e3 * outcome.check.rest_error
    measured = []
    for (check, seconds), shape in zip(looks, shapes, strict=True):
        true = math.nan if shape is None else 1e3 * float(np.sqrt(np.mean(np.sum((shape - end) ** 2, axis=1))))
        left = check.residual
        error = 1e3 * check.rest_error if math.isfinite(check.rest_error) else math.nan
        measured.append(
            Measurement(check.iteration, seconds, left.rms, left.relative_rms, left.relative_p99, error, true)
        )
    return Run(case, method, device, model.vertex_count, coarse, before, rest, end_mm, tuple(measured))


class MethodStudy:
    """Runs cases; results are stored in a file at once, and not computed again."""

    def __init__(self, stored: Path, device: str, log: Callable[[str], None], processes: int = 1) -> None:
        self._stored, self._device, self._log, self._processes = stored, device, log, processes
        self.runs: dict[tuple[str, str], Run] = {}
        if stored.exists():
            for line in stored.read_text(encoding="utf-8").splitlines():
                run = run_from(json.loads(line))
                self.runs[run.case.name, run.method] = run

    def run(self, groups: Sequence[str], limits: Mapping[str, int] = LIMITS) -> list[Run]:
        """All cases of these groups by their methods; those whose seconds count one after another, and first."""
        jobs = [(group, case, method) for group, case, methods in all_cases() for method in methods if group in groups]
        new = [job for job in jobs if (job[1].name, job[2]) not in self.runs]
        parallel = [job for job in new if job[0] != "methods"] if self._processes > 1 else []
        for _, case, method in new[: len(new) - len(parallel)]:
            if (case.name, method) not in self.runs:  # two groups may share one
                self._store(run_case(case, method, self._device, limits[method]))
        left = {(case.name, method): (case, method, self._device, limits[method]) for _, case, method in parallel}
        remaining = [job for key, job in left.items() if key not in self.runs]
        if remaining:
            with sigint_blocked():
                pool = get_context("spawn").Pool(self._processes, start_warp, (False,))
            with pool:
                for found in pool.imap_unordered(_run_job, remaining):
                    self._store(found)
        return list(self.runs.values())

    def _store(self, found: Run) -> None:
        self.runs[found.case.name, found.method] = found
        with self._stored.open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(found)) + "\n")
        words = f"rest after {found.work:,.0f} iterations" if found.rest else "not at rest"
        self._log(f"  {found.case.name}, {found.method}: {words}, {found.looks[-1].seconds:.2f} s in all")


def _run_job(job: tuple[Case, str, str, int]) -> Run:
    return run_case(*job)


def run_from(values: Mapping[str, Any]) -> Run:
    """A run from its ``asdict``."""
    looks = tuple(Measurement(**look) for look in values["looks"])
    return Run(**{**values, "case": Case(**values["case"]), "looks": looks})

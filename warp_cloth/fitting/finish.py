"""From relaxed scenes to fits: measure the draped shapes, find what is wrong with them, write the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.clock import StageClock
from warp_cloth.base.mesh import Points
from warp_cloth.base.threads import map_in_threads
from warp_cloth.fitting.attempts import Course, Run
from warp_cloth.fitting.problem import Problem, tolerance_of
from warp_cloth.garment.outfit import Outfit
from warp_cloth.model.result import FitResult, Strain, WornGarment
from warp_cloth.report.build import build_report
from warp_cloth.report.measurements import Measurements
from warp_cloth.report.problems import find_problems
from warp_cloth.report.verdict import is_worn, verdict
from warp_cloth.scene import Scene
from warp_cloth.solver.certificate.strains import measured_strains, strain_summary, yarn_summaries
from warp_cloth.solver.loop import Outcome


def finish_fits(
    problem: Problem,
    courses: Sequence[Course],
    *,
    clock: StageClock,
    frames: int = 0,
) -> list[FitResult]:
    """Measures relaxed scenes, finds their problems, and writes their reports.

    Args:
        problem: the scenes, as they were relaxed.
        courses: of each scene; the best run of each is the problem's.
        clock: of the stages, for all scenes together.
        frames: number of intermediate shapes that each garment keeps.
    """
    runs = [course.best for course in courses]
    outcomes = [run.outcome for run in runs]
    measured = _measure(problem, runs)
    clock.lap("measure")
    results = []
    for course, run, found in zip(courses, runs, measured, strict=True):
        scene, outfit, outcome = run.attempt.scene, problem.outfits[run.item], run.outcome
        garments = tuple(
            replace(worn, fields=found.crossings.marked(index, worn.mesh))
            for index, worn in enumerate(_worn_garments(scene, outfit, outcome, frames))
        )
        problems = find_problems(scene, outfit, outcome, found, tolerance_of(scene))
        worn, message = is_worn(outcome.status, problems), verdict(outcome, problems)
        report = build_report(
            scene,
            outfit,
            outcome,
            found,
            message=message,
            worn=worn,
            problems=problems,
            attempts=course.summary(),
            stated=run.attempt.stated,
            seconds=clock.seconds if len(outcomes) == 1 else {**clock.seconds, "relax": course.seconds},
            device=problem.model.device,
        )
        ended = outcome.status, worn, problems, message
        results.append(FitResult(run.attempt.stated, *ended, garments, outfit.avatar, report, problem.model.device))
    clock.lap("measure")
    return results


def _measure(problem: Problem, runs: Sequence[Run]) -> list[Measurements]:
    """What the report says of every scene as it was relaxed."""
    model, outcomes = problem.model, [run.outcome for run in runs]
    strains = measured_strains(model)
    edge_strains = [strains.edge[model.of_item(item, model.edge_start)] for item in range(len(outcomes))]

    def strains_of(item: int) -> tuple[Strain, dict[str, Strain]]:
        yarns = strains.of_yarns(model.of_item(item, model.weave_start))
        return strain_summary(edge_strains[item]), yarn_summaries(yarns)

    summaries = map_in_threads(strains_of, range(len(outcomes)))
    return [
        Measurements(
            *summaries[item],
            edge_strains=edge_strains[item],
            overlap=runs[item].overlap,
            crossings=runs[item].crossings,
            contact=problem.contact_report(item),
            misplaced=runs[item].placement.misplaced,
            levels=runs[item].levels,
            choices=problem.choices(item),
        )
        for item in range(len(outcomes))
    ]


def _worn_garments(scene: Scene, outfit: Outfit, outcome: Outcome, frames: int) -> tuple[WornGarment, ...]:
    worn = []
    first = 0
    for spec, mesh, garment in zip(scene.garments, outfit.meshes, outfit.garments, strict=True):
        vertices = slice(first, first + mesh.vertex_count)
        first = vertices.stop
        points: Points = outcome.points[vertices]
        shapes = _chosen_frames(outcome, vertices, mesh.points, points, frames) if frames else None
        fabric = spec.fabric
        worn.append(WornGarment(spec.name, mesh, points, fabric.thickness, shapes, fabric=fabric, rest=garment.rest))
    return tuple(worn)


def _chosen_frames(outcome: Outcome, vertices: slice, first: Points, last: Points, count: int) -> NDArray[np.float32]:
    """``count`` shapes: the loaded one first, then evenly chosen ones, the worn one last; shape [count, V, 3].

    Where fewer shapes are known than frames are requested, each serves for several frames.
    """
    shapes = [shape[vertices] for iteration, shape in outcome.frames if iteration < outcome.iterations]
    known = [first.astype(np.float32), *(shape for shape in shapes if np.isfinite(shape).all())]
    picks = np.linspace(0, len(known) - 1, count - 1).round().astype(int)
    return np.stack([*(known[pick] for pick in picks), last.astype(np.float32)])

"""From relaxed scenes to fits: measure the draped shapes, find what is wrong with them, write the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from warp_cloth.base.clock import StageClock
from warp_cloth.base.mesh import Points
from warp_cloth.base.threads import map_in_threads
from warp_cloth.fitting.attempts import Course, Run
from warp_cloth.fitting.film import Dressing, Film, film_of
from warp_cloth.fitting.problem import Problem, tolerance_of
from warp_cloth.garment.outfit import Outfit
from warp_cloth.model.result import FitResult, Strain, WornGarment
from warp_cloth.report.build import build_report
from warp_cloth.report.measurements import Measurements
from warp_cloth.report.problems import find_problems
from warp_cloth.scene import Scene
from warp_cloth.solver.certificate.strains import measured_strains, strain_summary, yarn_summaries
from warp_cloth.solver.goal import Outcome


def finish_fits(
    problem: Problem,
    courses: Sequence[Course],
    *,
    clock: StageClock,
    frames: int = 0,
    dressings: Sequence[Dressing] = (),
) -> list[FitResult]:
    """Measures relaxed scenes, finds their problems, and writes their reports.

    Args:
        problem: the scenes, as they were relaxed.
        courses: of each scene; the best run of each is the problem's.
        clock: of the stages, for all scenes together.
        frames: number of intermediate shapes that each garment keeps.
        dressings: of each garment of a lone scene, where it was dressed on a body that moved.
    """
    runs = [course.best for course in courses]
    outcomes = [run.outcome for run in runs]
    measured = _measure(problem, runs)
    clock.lap("measure")
    results = []
    for course, run, found in zip(courses, runs, measured, strict=True):
        scene, outfit, outcome = run.attempt.scene, problem.outfits[run.item], run.outcome
        film = film_of(course, outfit, frames, dressings) if frames else None
        garments = tuple(
            replace(worn, fields=found.crossings.marked(index, worn.mesh))
            for index, worn in enumerate(_worn_garments(scene, outfit, outcome, film))
        )
        problems = find_problems(scene, outfit, outcome, found, tolerance_of(scene))
        report = build_report(
            run.attempt,
            outfit,
            outcome,
            found,
            problems=problems,
            attempts=course.summary(),
            seconds=clock.seconds if len(outcomes) == 1 else {**clock.seconds, "relax": course.seconds},
            device=problem.model.device,
        )
        ended = outcome.status, report["worn"], problems, report["message"]
        made = garments, outfit.avatar, report, problem.model.device
        moves = None if film is None else film.avatar
        results.append(FitResult(run.attempt.stated, *ended, *made, avatar_frames=moves))
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
            off_shoulders=runs[item].placement.off_shoulders,
            levels=runs[item].levels,
            choices=problem.choices(item),
        )
        for item in range(len(outcomes))
    ]


def _worn_garments(scene: Scene, outfit: Outfit, outcome: Outcome, film: Film | None) -> tuple[WornGarment, ...]:
    worn = []
    first = 0
    for number, (spec, mesh, garment) in enumerate(zip(scene.garments, outfit.meshes, outfit.garments, strict=True)):
        vertices = slice(first, first + mesh.vertex_count)
        first = vertices.stop
        points: Points = outcome.points[vertices]
        shapes, fabric = None if film is None else film.garments[number], spec.fabric
        worn.append(WornGarment(spec.name, mesh, points, fabric.thickness, shapes, fabric=fabric, rest=garment.rest))
    return tuple(worn)
